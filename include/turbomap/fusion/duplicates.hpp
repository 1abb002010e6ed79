// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a duplicate search: it stays where the policy runs; the plan, its host form, is asked for last.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "duplicate_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Points found again in keyframes. Make one and use it for every call: its memory is reused. Move-only; not shared
/// between threads.
template <class Descriptor, class Camera, class Policy>
class duplicates {
 public:
  using memory_type = memory_of_t<Policy>;
  using distance_type = typename Descriptor::distance_type;
  using plan_type = std::vector<duplicate<distance_type>>;
  using trials_type = std::vector<duplicate_trial<distance_type>>;

  explicit duplicates(const context<Policy>& ctx)
      : inputs_(ctx.resource()), cameras_(ctx.resource()), hits_(ctx.resource()), trials_(ctx.resource()) {}
  duplicates(duplicates&&) = default;
  duplicates& operator=(duplicates&&) = default;

  /// No matches: what is left where a call ran out of memory.
  void clear() {
    requests_.clear();
    point_count_ = 0;
  }

  /// The matches on the host in (target, camera, point) order, equal on every policy. Waits for the search.
  /// O(points x cameras of all targets).
  plan_type plan(context<Policy>& ctx) const {
    plan_type result;
    plan(ctx, result);
    return result;
  }
  /// The same into a vector that is reused.
  void plan(context<Policy>& ctx, plan_type& result) const {
    const duplicate_hit<distance_type>* hit = on_host(ctx, hits_.data(), host_hits_);
    ctx.synchronize();
    result.clear();
    for (const duplicate_request& r : requests_)
      for (int p = 0; p < point_count_; ++p, ++hit)
        if (hit->keypoint >= 0) result.push_back({r.target, r.camera, p, hit->keypoint, hit->distance});
  }

  /// The outcome of every point in every camera, [target][camera][point], equal on every policy. Waits.
  /// \throws std::invalid_argument  they were not asked for: options.keep_trials
  trials_type trials(context<Policy>& ctx) const {
    require(kept_, "options.keep_trials", kept_, "must be true in the search for its trials to be there");
    const duplicate_trial<distance_type>* trial = on_host(ctx, trials_.data(), host_trials_);
    ctx.synchronize();
    return trials_type(trial, trial + size());
  }

 private:
  template <class D, class C, class P>
  friend class duplicate_setup;

  std::size_t size() const { return requests_.size() * static_cast<std::size_t>(point_count_); }
  /// An array of the result for the host to read after ctx.synchronize().
  template <class T>
  const T* on_host(context<Policy>& ctx, const T* resident, std::vector<T>& buffer) const {
    if constexpr (std::is_same_v<memory_type, host_memory>) return resident;
    buffer.resize(size());
    copy_out(ctx.policy(), buffer.data(), resident, buffer.size() * sizeof(T));
    return buffer.data();
  }

  array<std::byte, memory_type> inputs_;
  array<duplicate_camera, memory_type> cameras_;
  array<duplicate_hit<distance_type>, memory_type> hits_;
  array<duplicate_trial<distance_type>, memory_type> trials_;
  std::vector<duplicate_request> requests_;  ///< cameras of all targets; `skip` is of the policy's memory
  int point_count_ = 0;
  bool kept_ = false;
  mutable std::vector<duplicate_hit<distance_type>> host_hits_;
  mutable std::vector<duplicate_trial<distance_type>> host_trials_;
};

TURBOMAP_END_NAMESPACE
