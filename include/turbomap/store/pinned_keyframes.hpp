// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keyframes that a call is reading: they stay where they are until its work is done.

#include <utility>

#include "../config.hpp"
#include "../span.hpp"
#include "keyframe_view.hpp"
#include "memory_space.hpp"
#include "pin_records.hpp"

TURBOMAP_BEGIN_NAMESPACE

template <class Policy>
class context;
template <class Descriptor, class Camera, class Memory>
class keyframe_store;

namespace detail {

/// The policy of a context, or the policy itself.
template <class Policy>
const auto& policy_in(const context<Policy>& ctx) {
  return ctx.policy();
}
template <class Policy>
const Policy& policy_in(const Policy& policy) {
  return policy;
}

}  // namespace detail

/// Holds some keyframes of a store in place: none of them is paged out, moved or overwritten, even when it is erased
/// meanwhile. Under CUDA, giving them up means: after the work that is in the stream then. Must not outlive the store
/// or the stream. Move-only; one thread at a time.
template <class Descriptor, class Camera, class Memory>
class pinned_keyframes {
 public:
  /// None.
  pinned_keyframes() = default;
  /// The other one holds nothing afterwards.
  pinned_keyframes(pinned_keyframes&& other) noexcept
      : store_(std::exchange(other.store_, nullptr)), record_(other.record_), order_(other.order_) {}
  /// Swaps what both hold.
  pinned_keyframes& operator=(pinned_keyframes&& other) noexcept {
    std::swap(store_, other.store_);
    std::swap(record_, other.record_);
    std::swap(order_, other.order_);
    return *this;
  }
  /// Releases behind the work of the context that pinned, if release_after() has not been called.
  [[gnu::noinline]] ~pinned_keyframes() { release(); }

  /// One view per handle, in the order of the handles; an array on the host of pointers into the memory of the store.
  /// Empty after the release.
  span<const keyframe_view<Descriptor, Camera>> views() const {
    return store_ == nullptr ? span<const keyframe_view<Descriptor, Camera>>() : record_->views;
  }
  /// Number of pinned keyframes; 0 after the release.
  std::size_t size() const { return views().size(); }
  /// The view of handle i (not checked).
  const keyframe_view<Descriptor, Camera>& operator[](std::size_t i) const { return record_->views[i]; }

  /// Releases the keyframes once the work enqueued so far in `execution` (a context or a policy) is done; at once under
  /// a host policy. Does not wait.
  template <class Execution>
  void release_after(const Execution& execution) noexcept {
    order_ = order_of(detail::policy_in(execution));
    release();
  }

 private:
  friend class keyframe_store<Descriptor, Camera, Memory>;
  using store_type = keyframe_store<Descriptor, Camera, Memory>;
  using record_type = pin_record<Descriptor, Camera, Memory>;

  pinned_keyframes(store_type* store, record_type* record, work_order<Memory> order)
      : store_(store), record_(record), order_(order) {}
  void release() noexcept {
    if (store_ != nullptr) std::exchange(store_, nullptr)->release(record_, order_);
  }

  store_type* store_ = nullptr;
  record_type* record_ = nullptr;
  work_order<Memory> order_{};
};

TURBOMAP_END_NAMESPACE
