// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The result of a search by projection: it stays where the policy runs; the plan, its host form, is asked for last.

#include <cstddef>
#include <memory_resource>
#include <vector>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../found_list.hpp"
#include "../plain_vector.hpp"
#include "projection_view.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The memory of one search by projection, and what the host knows about it: filled by the search.
template <class Descriptor, class Memory>
struct projection_buffers {
  using distance_type = typename Descriptor::distance_type;  ///< of descriptors

  /// Empty. \param resource  of the policy's memory; must outlive this
  explicit projection_buffers(std::pmr::memory_resource* resource)
      : inputs(resource), cameras(resource), hits(resource), trials(resource), claims(resource) {}
  /// No matches, of no point.
  void clear() {
    requests.clear();
    point_count = 0;
  }

  array<std::byte, Memory> inputs;                        ///< the arguments of the call, packed
  array<projection_camera, Memory> cameras;               ///< [request]
  array<projection_hit<distance_type>, Memory> hits;      ///< [request][point]
  array<projection_trial<distance_type>, Memory> trials;  ///< [request][point], with options.keep_trials
  array<std::uint64_t, Memory> claims;                    ///< on the keypoints of all targets, with options.one_to_one
  const projection_request* resident_requests = nullptr;  ///< where the policy reads them
  plain_vector<projection_request> requests;  ///< cameras of all targets; pointers are of the policy's memory
  int point_count = 0;                        ///< points of the last call
  bool has_trials = false;                    ///< whether the last call kept its trials
};

namespace detail {

/// Index = request * points + point: its hit.
template <class Distance>
struct hit_found {
  using entry = projection_match<Distance>;

  const projection_request* requests;
  const projection_hit<Distance>* hits;
  int points;

  TURBOMAP_HD bool operator()(int i, entry& e) const {
    const projection_hit<Distance> hit = hits[i];
    if (hit.keypoint < 0) return false;
    const int r = i / points;
    e = {requests[r].target, requests[r].camera, i - r * points, hit.keypoint, hit.distance};
    return true;
  }
};

}  // namespace detail

/// Points found again in keyframes. Make one and use it for every call: its memory is reused. Move-only; not shared
/// between threads.
template <class Descriptor, class Camera, class Policy>
class projections {
 public:
  using memory_type = memory_of_t<Policy>;                           ///< where the results stay
  using distance_type = typename Descriptor::distance_type;          ///< of descriptors
  using plan_type = std::vector<projection_match<distance_type>>;    ///< matches on the host
  using trials_type = std::vector<projection_trial<distance_type>>;  ///< trials on the host

  /// No matches. \param ctx  its resources give the memory, and must outlive this
  explicit projections(const context<Policy>& ctx) : buffers_(ctx.resource()), list_(ctx) {}
  /// Takes the memory of another.
  projections(projections&&) = default;
  /// Exchanges the memory with another.
  projections& operator=(projections&&) = default;

  /// No matches: what is left where a call ran out of memory.
  void clear() { buffers_.clear(); }

  /// The matches on the host in (target, camera, point) order, equal on every policy. Waits for the search.
  /// O(points x cameras of all targets).
  plan_type plan(context<Policy>& ctx) const {
    plan_type result;
    plan(ctx, result);
    return result;
  }
  /// The same into a vector that is reused.
  template <class List>
  void plan(context<Policy>& ctx, List& result) const {
    list_.read(ctx, static_cast<int>(size()),
               detail::hit_found<distance_type>{buffers_.resident_requests, buffers_.hits.data(), buffers_.point_count},
               result);
  }

  /// The outcome of every point in every camera, [target][camera][point], equal on every policy. Waits.
  /// \throws std::invalid_argument  they were not asked for: options.keep_trials
  trials_type trials(context<Policy>& ctx) const {
    require(buffers_.has_trials, "options.keep_trials", buffers_.has_trials,
            "must be true in the search for its trials to be there");
    const projection_trial<distance_type>* trial = ctx.on_host(buffers_.trials.data(), size(), host_trials_);
    ctx.synchronize();
    return trials_type(trial, trial + size());
  }

  /// For the search, which fills them.
  projection_buffers<Descriptor, memory_type>& buffers() { return buffers_; }

 private:
  std::size_t size() const { return buffers_.requests.size() * static_cast<std::size_t>(buffers_.point_count); }

  projection_buffers<Descriptor, memory_type> buffers_;
  mutable found_list<projection_match<distance_type>, Policy> list_;
  mutable plain_vector<projection_trial<distance_type>> host_trials_;
};

TURBOMAP_END_NAMESPACE
