// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// How somebody else ends long work early.

#include <atomic>
#include <type_traits>

namespace turbomap {

/// Refers to what is asked whether to stop: a flag, or anything that is called without arguments and gives a bool. Both are given
/// by address and must outlive the work:
///
///     std::atomic<bool> wanted{false};                                  options.stop = &wanted;
///     const auto asked = [&] { return loop_closing.wants_the_map(); };  options.stop = &asked;
///
/// A callable is asked from whatever threads the policy uses, and must not throw. Plain data: options that hold one can be
/// copied to a device, where nobody asks.
class stop_request {
 public:
  /// Nobody stops it.
  stop_request() = default;
  /// Nobody stops it.
  stop_request(decltype(nullptr)) {}
  /// A flag; null: nobody.
  stop_request(const std::atomic<bool>* flag) : ask_(flag == nullptr ? nullptr : &ask_flag), what_(flag) {}
  /// Anything that is called without arguments; null: nobody.
  template <class Callable,
            class = std::enable_if_t<std::is_object_v<Callable> && std::is_invocable_r_v<bool, const Callable&>>>
  stop_request(const Callable* callable)
      : ask_(callable == nullptr ? nullptr : &ask_callable<Callable>), what_(callable) {}

  /// Whether anybody may stop it.
  explicit operator bool() const { return ask_ != nullptr; }
  /// Whether to stop now.
  bool operator()() const { return ask_ != nullptr && ask_(what_); }

 private:
  static bool ask_flag(const void* flag) {
    return static_cast<const std::atomic<bool>*>(flag)->load(std::memory_order_relaxed);
  }
  template <class Callable>
  static bool ask_callable(const void* callable) {
    return static_cast<bool>((*static_cast<const Callable*>(callable))());
  }

  bool (*ask_)(const void*) = nullptr;
  const void* what_ = nullptr;
};

}  // namespace turbomap
