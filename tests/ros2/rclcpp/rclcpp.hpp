// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A stand-in for the part of rclcpp that examples/ros2 uses. Topics are callbacks in a table; spin() is what the test defines: it
/// publishes what a camera and an odometry would. Publishing runs the callbacks at once, in the caller's thread.

#include <cstdint>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "../messages.hpp"

namespace rclcpp {

/// Callbacks by topic.
template <class Message>
std::map<std::string, std::function<void(std::shared_ptr<const Message>)>>& listeners() {
  static std::map<std::string, std::function<void(std::shared_ptr<const Message>)>> all;
  return all;
}
template <class Message>
void deliver(const std::string& topic, const Message& message) {
  const auto at = listeners<Message>().find(topic);
  if (at != listeners<Message>().end()) at->second(std::make_shared<const Message>(message));
}

class Duration {
 public:
  explicit Duration(std::int64_t ns) : ns_(ns) {}
  double seconds() const { return 1e-9 * static_cast<double>(ns_); }

 private:
  std::int64_t ns_;
};
class Time {
 public:
  Time() = default;
  Time(const builtin_interfaces::msg::Time& t) : ns_(std::int64_t{1000000000} * t.sec + t.nanosec) {}
  operator builtin_interfaces::msg::Time() const {
    return {static_cast<std::int32_t>(ns_ / 1000000000), static_cast<std::uint32_t>(ns_ % 1000000000)};
  }
  double seconds() const { return 1e-9 * static_cast<double>(ns_); }
  friend bool operator<(const Time& a, const Time& b) { return a.ns_ < b.ns_; }
  friend Duration operator-(const Time& a, const Time& b) { return Duration(a.ns_ - b.ns_); }

 private:
  std::int64_t ns_ = 0;
};
class QoS {
 public:
  QoS(std::size_t) {}
  QoS& transient_local() { return *this; }
};
class SensorDataQoS : public QoS {
 public:
  SensorDataQoS() : QoS(5) {}
};
template <class Message>
struct Subscription {
  using SharedPtr = std::shared_ptr<Subscription>;
};
template <class Message>
class Publisher {
 public:
  using SharedPtr = std::shared_ptr<Publisher>;
  explicit Publisher(std::string topic) : topic_(std::move(topic)) {}
  void publish(const Message& message) { deliver(topic_, message); }

 private:
  std::string topic_;
};
struct Logger {};
struct Clock {};

class Node {
 public:
  explicit Node(const std::string&) {}
  virtual ~Node() = default;
  template <class T>
  T declare_parameter(const std::string&, const T& value) {
    return value;
  }
  template <class Message, class Callback>
  typename Subscription<Message>::SharedPtr create_subscription(const std::string& topic, const QoS&,
                                                                Callback callback) {
    listeners<Message>()[topic] = callback;
    return std::make_shared<Subscription<Message>>();
  }
  template <class Message>
  typename Publisher<Message>::SharedPtr create_publisher(const std::string& topic, const QoS&) {
    return std::make_shared<Publisher<Message>>(topic);
  }
  Logger get_logger() const { return {}; }
  std::shared_ptr<Clock> get_clock() const { return std::make_shared<Clock>(); }
};

inline void init(int, char**) {}
inline void shutdown() {}
/// Defined by the test, which ends the process where the node did not do its work.
void spin(const std::shared_ptr<Node>& node);

}  // namespace rclcpp

#define RCLCPP_INFO(logger, ...) (static_cast<void>(logger), std::printf(__VA_ARGS__), std::printf("\n"))
#define RCLCPP_ERROR(logger, ...) RCLCPP_INFO(logger, __VA_ARGS__)
#define RCLCPP_ERROR_ONCE(logger, ...) RCLCPP_INFO(logger, __VA_ARGS__)
#define RCLCPP_INFO_THROTTLE(logger, clock, ms, ...) (static_cast<void>(clock), RCLCPP_INFO(logger, __VA_ARGS__))
