// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A ROS 2 node around pose_mapper. Images, their camera and the poses of an odometry come in; points and adjusted keyframes go
/// out. Mapping runs in a thread of its own, so that no callback waits for it.

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <geometry_msgs/msg/pose_stamped.hpp>
#include <memory>
#include <mutex>
#include <nav_msgs/msg/path.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/camera_info.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/point_cloud2.hpp>
#include <sensor_msgs/point_cloud2_iterator.hpp>
#include <string>
#include <thread>
#include <turbomap/camera/full_image_keypoint.hpp>
#include <turbomap/interop/opencv.hpp>
#include <utility>
#include <vector>

#include "pose_mapper.hpp"

namespace {

using example::pose_mapper;
using isometry = turbomap::isometry<double>;

/// What mapping needs of one image.
struct frame {
  std::vector<turbomap::keypoint> keypoints;
  std::vector<std::uint8_t> descriptors;
  pose_mapper::pose T_cw;
  rclcpp::Time stamp;
};

/// Camera to world, as odometry publishes it.
pose_mapper::pose camera_to_world(const geometry_msgs::msg::Pose& p) {
  return {p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w, p.position.x, p.position.y, p.position.z};
}
pose_mapper::pose world_to_camera(const pose_mapper::pose& T_wc) {
  return turbomap::to_rigid_transform(turbomap::inverse(turbomap::to_isometry<double>(T_wc)));
}

class mapping_node : public rclcpp::Node {
 public:
  mapping_node() : Node("turbomap_mapping") {
    options_.least_motion = declare_parameter("least_motion", options_.least_motion);
    options_.least_turn = declare_parameter("least_turn", options_.least_turn);
    frame_id_ = declare_parameter("frame_id", std::string("map"));
    tolerance_s_ = declare_parameter("pose_tolerance", tolerance_s_);
    orb_ = cv::ORB::create(static_cast<int>(declare_parameter("features", 1000)));
    const auto sensor = rclcpp::SensorDataQoS();
    info_ = create_subscription<sensor_msgs::msg::CameraInfo>(
        "camera_info", sensor, [this](sensor_msgs::msg::CameraInfo::ConstSharedPtr m) { take(*m); });
    poses_ = create_subscription<geometry_msgs::msg::PoseStamped>(
        "pose", 100, [this](geometry_msgs::msg::PoseStamped::ConstSharedPtr m) {
          recent_.push_back(*m);
          if (recent_.size() > 200) recent_.pop_front();
          take_waiting();
        });
    images_ = create_subscription<sensor_msgs::msg::Image>(
        "image", sensor, [this](sensor_msgs::msg::Image::ConstSharedPtr m) { keep(std::move(m)); });
    points_ = create_publisher<sensor_msgs::msg::PointCloud2>("points", rclcpp::QoS(1).transient_local());
    path_ = create_publisher<nav_msgs::msg::Path>("keyframes", rclcpp::QoS(1).transient_local());
  }
  ~mapping_node() override {
    {
      const std::lock_guard<std::mutex> held(mutex_);
      stop_ = true;
    }
    woken_.notify_one();
    if (mapping_.joinable()) mapping_.join();
  }

 private:
  void take(const sensor_msgs::msg::CameraInfo& m) {
    if (mapper_) return;
    if (!(m.k[0] > 0)) {
      RCLCPP_ERROR_ONCE(get_logger(), "camera_info: K is empty: the camera is not calibrated");
      return;
    }
    cv::Mat(3, 3, CV_64F, const_cast<double*>(m.k.data())).copyTo(K_);
    cv::Mat(m.d, true).copyTo(distortion_);
    if (m.distortion_model != "plumb_bob" && m.distortion_model != "rational_polynomial" && !m.d.empty()) {
      RCLCPP_ERROR_ONCE(get_logger(), "camera_info: distortion model '%s' is not one of cv::undistortPoints",
                        m.distortion_model.c_str());
      return;
    }
    mapper_ = std::make_unique<pose_mapper>(
        turbomap::pinhole_from_opencv<float>(K_),
        turbomap::image_bounds{0, 0, static_cast<float>(m.width), static_cast<float>(m.height)}, options_);
    mapping_ = std::thread([this] { run(); });
  }

  void lacks(const char* what) { RCLCPP_INFO_THROTTLE(get_logger(), *get_clock(), 5000, "an image without %s", what); }

  void keep(sensor_msgs::msg::Image::ConstSharedPtr m) {
    if (!mapper_) return lacks("camera_info");
    waiting_.push_back(std::move(m));
    take_waiting();
    if (waiting_.size() > most_waiting) take_first();
  }

  /// Takes the images that no later pose can be nearer to: one at or after their stamp is there.
  void take_waiting() {
    const auto is_decided = [this](const sensor_msgs::msg::Image& m) {
      return !recent_.empty() && !(rclcpp::Time(recent_.back().header.stamp) < rclcpp::Time(m.header.stamp));
    };
    while (!waiting_.empty() && is_decided(*waiting_.front())) take_first();
  }

  /// The first image that waits, with the pose that is nearest now.
  void take_first() {
    const auto m = std::move(waiting_.front());
    waiting_.pop_front();
    if (const auto* pose = nearest(m->header.stamp))
      take(*m, pose->pose);
    else
      lacks("pose");
  }

  void take(const sensor_msgs::msg::Image& m, const geometry_msgs::msg::Pose& pose) {
    const auto T_wc = camera_to_world(pose);
    if (!turbomap::is_pose(T_wc))
      return lacks("pose that is finite and of a unit quaternion");  // nor may a choice rest on it
    frame f;
    f.T_cw = world_to_camera(T_wc), f.stamp = m.header.stamp;
    {
      const std::lock_guard<std::mutex> held(mutex_);
      if (!last_.wants(f.T_cw, options_)) return;
    }
    const bool is_gray = m.encoding == "mono8";
    if (!is_gray && m.encoding != "bgr8" && m.encoding != "rgb8") {
      RCLCPP_ERROR_ONCE(get_logger(), "image: encoding '%s' is none of mono8, bgr8, rgb8", m.encoding.c_str());
      return;
    }
    cv::Mat image(static_cast<int>(m.height), static_cast<int>(m.width), is_gray ? CV_8UC1 : CV_8UC3,
                  const_cast<std::uint8_t*>(m.data.data()), m.step);
    if (!is_gray) cv::cvtColor(image, image, m.encoding == "bgr8" ? cv::COLOR_BGR2GRAY : cv::COLOR_RGB2GRAY);
    std::vector<cv::KeyPoint> found;
    cv::Mat descriptors;
    orb_->detectAndCompute(image, {}, found, descriptors);
    if (found.empty()) return;
    f.keypoints = turbomap::keypoints_from_opencv(found);
    std::vector<cv::Point2f> pixels;
    for (auto& k : f.keypoints) {  // ORB's pixels of coarser levels are off
      k = turbomap::in_full_image(k, image.cols, image.rows, static_cast<float>(orb_->getScaleFactor()));
      pixels.emplace_back(k.x, k.y);
    }
    cv::undistortPoints(pixels, pixels, K_, distortion_, {}, K_);
    for (std::size_t i = 0; i < pixels.size(); ++i) f.keypoints[i].x = pixels[i].x, f.keypoints[i].y = pixels[i].y;
    const auto bytes = turbomap::descriptors_from_opencv<pose_mapper::orb>(descriptors);
    f.descriptors.assign(bytes.begin(), bytes.end());
    {
      const std::lock_guard<std::mutex> held(mutex_);
      last_.T_cw = f.T_cw, last_.any = true;
      queue_.push_back(std::move(f));
    }
    woken_.notify_one();
  }

  const geometry_msgs::msg::PoseStamped* nearest(const rclcpp::Time& stamp) const {
    const geometry_msgs::msg::PoseStamped* best = nullptr;
    double least = tolerance_s_;
    for (const auto& p : recent_) {
      const double apart = std::abs((rclcpp::Time(p.header.stamp) - stamp).seconds());
      if (apart <= least) least = apart, best = &p;
    }
    return best;
  }

  /// The mapping thread.
  void run() {
    while (true) {
      frame f;
      {
        std::unique_lock<std::mutex> held(mutex_);
        woken_.wait(held, [this] { return stop_ || !queue_.empty(); });
        if (stop_) return;
        f = std::move(queue_.front());
        queue_.pop_front();
      }
      try {
        const auto& report = mapper_->add(f.keypoints, f.descriptors, f.T_cw, f.stamp.seconds());
        RCLCPP_INFO(get_logger(), "%zu points created, %zu merged, %.1f ms", report.points_created, report.fused.merged,
                    report.total_ms);
        publish(f.stamp);
      } catch (const std::exception& error) {
        RCLCPP_ERROR(get_logger(), "%s", error.what());
      }
    }
  }

  void publish(const rclcpp::Time& stamp) {
    const auto points = mapper_->points();
    sensor_msgs::msg::PointCloud2 cloud;
    cloud.header.frame_id = frame_id_, cloud.header.stamp = stamp;
    sensor_msgs::PointCloud2Modifier modifier(cloud);
    modifier.setPointCloud2FieldsByString(1, "xyz");
    modifier.resize(points.size());
    sensor_msgs::PointCloud2Iterator<float> x(cloud, "x"), y(cloud, "y"), z(cloud, "z");
    for (const auto& p : points) *x = p.x, *y = p.y, *z = p.z, ++x, ++y, ++z;
    points_->publish(cloud);

    nav_msgs::msg::Path path;
    path.header = cloud.header;
    for (const auto& T_cw : mapper_->trajectory()) {
      const auto T = turbomap::to_rigid_transform(turbomap::inverse(turbomap::to_isometry<double>(T_cw)));
      auto& p = path.poses.emplace_back();
      p.header = cloud.header;
      p.pose.position.x = T.tx, p.pose.position.y = T.ty, p.pose.position.z = T.tz;
      p.pose.orientation.x = T.qx, p.pose.orientation.y = T.qy, p.pose.orientation.z = T.qz,
      p.pose.orientation.w = T.qw;
    }
    path_->publish(path);
  }

  example::pose_mapper_options options_;
  std::string frame_id_;
  double tolerance_s_ = 0.01;  // half of the time between two images at 50 Hz
  cv::Ptr<cv::ORB> orb_;
  cv::Mat K_, distortion_;
  std::deque<geometry_msgs::msg::PoseStamped> recent_;  // callbacks run on one thread
  // An odometry that computes a pose from an image publishes it after that image. 10 images are 0.5 s at 20 Hz, more than
  // one takes that keeps up, and some megabytes.
  static constexpr std::size_t most_waiting = 10;
  std::deque<sensor_msgs::msg::Image::ConstSharedPtr> waiting_;
  std::unique_ptr<pose_mapper> mapper_;  // made once, before the thread; then the thread's
  std::thread mapping_;

  std::mutex mutex_;  // of what follows
  std::condition_variable woken_;
  std::deque<frame> queue_;
  example::keyframe_choice last_;
  bool stop_ = false;

  rclcpp::Subscription<sensor_msgs::msg::CameraInfo>::SharedPtr info_;
  rclcpp::Subscription<geometry_msgs::msg::PoseStamped>::SharedPtr poses_;
  rclcpp::Subscription<sensor_msgs::msg::Image>::SharedPtr images_;
  rclcpp::Publisher<sensor_msgs::msg::PointCloud2>::SharedPtr points_;
  rclcpp::Publisher<nav_msgs::msg::Path>::SharedPtr path_;
};

}  // namespace

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<mapping_node>());
  rclcpp::shutdown();
  return 0;
}
