// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Stand-ins for the messages of ROS 2 that examples/ros2 uses: fields of the same names and types, and no more.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace builtin_interfaces::msg {
struct Time {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
};
}  // namespace builtin_interfaces::msg

namespace std_msgs::msg {
struct Header {
  builtin_interfaces::msg::Time stamp;
  std::string frame_id;
};
}  // namespace std_msgs::msg

namespace geometry_msgs::msg {
struct Point {
  double x = 0, y = 0, z = 0;
};
struct Quaternion {
  double x = 0, y = 0, z = 0, w = 1;
};
struct Pose {
  Point position;
  Quaternion orientation;
};
struct PoseStamped {
  using ConstSharedPtr = std::shared_ptr<const PoseStamped>;
  std_msgs::msg::Header header;
  Pose pose;
};
}  // namespace geometry_msgs::msg

namespace nav_msgs::msg {
struct Path {
  std_msgs::msg::Header header;
  std::vector<geometry_msgs::msg::PoseStamped> poses;
};
}  // namespace nav_msgs::msg

namespace sensor_msgs {
namespace msg {
struct CameraInfo {
  using ConstSharedPtr = std::shared_ptr<const CameraInfo>;
  std_msgs::msg::Header header;
  std::uint32_t height = 0, width = 0;
  std::string distortion_model;
  std::vector<double> d;
  std::array<double, 9> k{};
};
struct Image {
  using ConstSharedPtr = std::shared_ptr<const Image>;
  std_msgs::msg::Header header;
  std::uint32_t height = 0, width = 0;
  std::string encoding;
  std::uint32_t step = 0;
  std::vector<std::uint8_t> data;
};
struct PointCloud2 {
  std_msgs::msg::Header header;
  std::uint32_t width = 0, point_step = 0;
  std::vector<std::uint8_t> data;
};
}  // namespace msg

/// Knows clouds of x, y, z, which are padded to 16 bytes as those of ROS are.
class PointCloud2Modifier {
 public:
  explicit PointCloud2Modifier(msg::PointCloud2& cloud) : cloud_(cloud) {}
  void setPointCloud2FieldsByString(int, const char* /*xyz*/) { cloud_.point_step = 16; }
  void resize(std::size_t points) {
    cloud_.width = static_cast<std::uint32_t>(points);
    cloud_.data.resize(points * cloud_.point_step);
  }

 private:
  msg::PointCloud2& cloud_;
};
template <class T>
class PointCloud2Iterator {
 public:
  PointCloud2Iterator(msg::PointCloud2& cloud, const std::string& field)
      : at_(reinterpret_cast<T*>(cloud.data.data()) + (field[0] - 'x')), step_(cloud.point_step / sizeof(T)) {}
  T& operator*() const { return *at_; }
  PointCloud2Iterator& operator++() { return at_ += step_, *this; }

 private:
  T* at_;
  std::size_t step_;
};
}  // namespace sensor_msgs
