// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Plays a camera and an odometry to the node of examples/ros2, which is compiled against stand-ins of the headers of ROS 2: the camera
/// moves sideways along a painted wall, 4 m away. The points that the node publishes must lie on the wall, whether a pose comes before its
/// image or after it, as that of an odometry that computes it from the image.

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdlib>
#include <limits>
#include <mutex>
#include <opencv2/imgproc.hpp>

#include "rclcpp/rclcpp.hpp"

void rclcpp::spin(const std::shared_ptr<Node>&) {
  std::mutex mutex;
  std::condition_variable published;
  std::size_t paths = 0, points = 0, off = 0, keyframes = 0;
  double last_x = 0;
  listeners<sensor_msgs::msg::PointCloud2>()["points"] = [&](std::shared_ptr<const sensor_msgs::msg::PointCloud2> m) {
    const std::lock_guard<std::mutex> held(mutex);
    points = m->width, off = 0;
    for (std::size_t i = 0; i < points; ++i) {
      float z;
      std::memcpy(&z, m->data.data() + i * m->point_step + 8, sizeof z);
      off += std::abs(z - 4) <= 0.2F ? 0 : 1;
    }
  };
  listeners<nav_msgs::msg::Path>()["keyframes"] = [&](std::shared_ptr<const nav_msgs::msg::Path> m) {
    {
      const std::lock_guard<std::mutex> held(mutex);
      ++paths, keyframes = m->poses.size(), last_x = m->poses.back().pose.position.x;
    }
    published.notify_one();
  };

  cv::Mat wall(480, 1200, CV_8U, cv::Scalar(128));  // 1 px is 1 cm
  cv::RNG random(7);
  for (int n = 0; n < 1500; ++n)
    cv::rectangle(
        wall,
        cv::Rect(random.uniform(-10, 1190), random.uniform(-10, 470), random.uniform(5, 40), random.uniform(5, 40)),
        cv::Scalar(random.uniform(0, 256)), cv::FILLED);
  // What a system sends that is not ready yet: the node says so, and waits for better.
  deliver("camera_info", sensor_msgs::msg::CameraInfo{});  // not calibrated
  sensor_msgs::msg::CameraInfo info;
  info.width = 640, info.height = 480, info.distortion_model = "plumb_bob", info.d.assign(5, 0);
  info.k = {400, 0, 320, 0, 400, 240, 0, 0, 1};
  deliver("camera_info", info);
  const auto send_pose = [](std::int32_t n) {
    geometry_msgs::msg::PoseStamped pose{{{n, 0}, "odometry"}, {}};
    pose.pose.position.x = 0.25 * n;
    deliver("pose", pose);
  };
  const auto send_image = [&](std::int32_t n, std::uint32_t nanoseconds = 0) {
    const cv::Mat seen = wall(cv::Rect(25 * n, 0, 640, 480)).clone();
    deliver("image", sensor_msgs::msg::Image{
                         {{n, nanoseconds}, "camera"}, 480, 640, "mono8", 640, {seen.data, seen.data + 640 * 480}});
  };
  const auto mapped = [&](std::size_t images) {
    std::unique_lock<std::mutex> held(mutex);
    return published.wait_for(held, std::chrono::seconds(60), [&] { return paths == images; });
  };
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), 0.0}) {
    geometry_msgs::msg::PoseStamped pose{{{-2, 0}, "odometry"}, {}};
    pose.pose.position.x = pose.pose.orientation.w = bad;
    deliver("pose", pose);
    deliver("image",
            sensor_msgs::msg::Image{{{-2, 0}, "camera"}, 480, 640, "mono8", 640, {wall.data, wall.data + 640 * 480}});
  }
  send_pose(-1);
  deliver("image", sensor_msgs::msg::Image{
                       {{-1, 0}, "camera"}, 480, 640, "bayer_rggb8", 640, {wall.data, wall.data + 640 * 480}});
  bool in_time = true;
  for (std::int32_t n = 0; n < 4; ++n) {
    send_pose(n), send_image(n);
    in_time = in_time && mapped(static_cast<std::size_t>(n) + 1);
  }
  send_image(4), send_pose(4);
  in_time = in_time && mapped(5);
  // A pose just before its image, which no other follows: taken when the images that may wait are too many.
  send_pose(5), send_image(5, 5000000);
  for (std::uint32_t i = 1; i <= 10; ++i) send_image(5, 20000000 * i);
  in_time = in_time && mapped(6);
  // Poses that come two images late, and images before that no pose is near to.
  send_image(6), send_image(7);
  for (std::int32_t n = 6; n < 8; ++n) {
    send_pose(n);
    in_time = in_time && mapped(static_cast<std::size_t>(n) + 1);
  }
  std::printf("%zu points, %zu of them off the wall; %zu keyframes, the last at %.3f m, it should be at 1.75\n", points,
              off, keyframes, last_x);
  if (!in_time || points < 300 || off > points / 20 || keyframes < 5 || std::abs(last_x - 1.75) > 0.02) std::exit(1);
}
