// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Tracks: which keypoints of a keyframe and its neighbours show one point of the scene. A search gives matches of pairs of
/// keyframes; matches that share a keypoint belong together, so a landmark that five keyframes see becomes one track of five
/// views. Two keypoints of one camera image cannot show the same point: a match that would say so is left out.

#include <cstddef>
#include <cstdint>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../named_range.hpp"
#include "../plain_vector.hpp"
#include "../precompiled.hpp"
#include "correspondences.hpp"
#include "track_joiner.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Index = result of the search: the cameras that its two keypoints are of.
template <class Descriptor, class Camera>
struct look_up_cameras {
  search_view<Descriptor, Camera> search;  ///< the matches
  match_cameras* cameras;                  ///< one per result of the search

  /// Looks up one result, if it is a match.
  TURBOMAP_HD void operator()(int i) const {
    if (search.match[i] == no_match) return;
    const int query = search.queries[i % search.slot_count];
    cameras[i] = {static_cast<std::uint8_t>(search.query().camera_of(query)),
                  static_cast<std::uint8_t>(search.neighbour(i / search.slot_count).camera_of(search.match[i]))};
  }
};

/// Cameras of the keypoints of all matches.
template <class Derived, class Descriptor, class Camera>
void launch_look_up_cameras(const thrust::execution_policy<Derived>& policy,
                            const search_view<Descriptor, Camera>& search, match_cameras* cameras) {
  for_each_index(derived(policy), search.neighbour_count * search.slot_count,
                 look_up_cameras<Descriptor, Camera>{search, cameras});
}

/// The tracks of one search, on the host. Make one and use it for every call: its memory is reused. Move-only.
template <class Descriptor, class Camera, class Policy>
class match_tracks {
 public:
  using matches_type = correspondences<Descriptor, Camera, Policy>;              ///< the correspondences of a search
  using list_type = plain_vector<typename matches_type::plan_type::value_type>;  ///< matches on the host

  /// No tracks. \param ctx  its resource gives the memory, and must outlive this
  explicit match_tracks(const context<Policy>& ctx) : cameras_(ctx.resource()) {}

  /// See join_tracks().
  void join(context<Policy>& ctx, const matches_type& matches) {
    searched_ = matches.size();
    matches.plan(ctx, plan_);
    const auto& search = matches.view();
    match_cameras_.clear();
    if (!plan_.empty() && (search.query_cameras > 1 || search.neighbour_cameras > 1)) read_cameras(ctx, matches);
    join_(plan_, match_cameras_, search.own_neighbour, tracks_);
  }

  /// The tracks of the last join().
  const track_list& tracks() const { return tracks_; }
  /// The matches that were joined, in (neighbour, query keypoint) order: tracks().outcomes says what became of each.
  const list_type& plan() const { return plan_; }
  /// size() of the correspondences that were joined.
  int searched() const { return searched_; }

 private:
  void read_cameras(context<Policy>& ctx, const matches_type& matches) {
    const auto& search = matches.view();
    const auto count = static_cast<std::size_t>(matches.size());
    cameras_.resize_discard(count);
    launch_look_up_cameras(ctx.policy(), search, cameras_.data());
    const match_cameras* all = ctx.on_host(cameras_.data(), count, host_cameras_);
    ctx.synchronize();
    // The plan is in the order of the results, so each match is found from the one before.
    const auto& queries = matches.queries();
    std::size_t slot = 0;
    std::int32_t neighbour = -1;
    for (const auto& m : plan_) {
      if (m.neighbour != neighbour) neighbour = m.neighbour, slot = 0;
      while (queries[slot] != m.query) ++slot;
      match_cameras_.push_back(all[static_cast<std::size_t>(neighbour * search.slot_count) + slot]);
    }
  }

  array<match_cameras, memory_of_t<Policy>> cameras_;  ///< [neighbour][slot]; written where there is a match
  plain_vector<match_cameras> host_cameras_, match_cameras_;
  list_type plan_;
  int searched_ = 0;
  track_joiner join_;
  track_list tracks_;
};

/// Joins the matches of a search into tracks. Nodes are keypoints, edges are matches. Edges are taken in the order of
/// (distance, query keypoint, neighbour, candidate); each joins the tracks of its two keypoints, unless a camera of a
/// keyframe would then have two keypoints in one track: such a match is left out with the outcome `contradicts`. The result
/// consists of integers that the host decides on: the same under every policy. Waits for the search.
/// \param result  overwritten
/// O(matches x cameras of all keyframes / 64 + keypoints).
template <class Descriptor, class Camera, class Policy>
void join_tracks(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches,
                 match_tracks<Descriptor, Camera, Policy>& result) {
  const named_range range("join_tracks");
  result.join(ctx, matches);
}

#define TURBOMAP_INSTANTIATE(Descriptor, Camera, Policy)                                                   \
  TURBOMAP_INSTANCE void join_tracks(context<Policy>&, const correspondences<Descriptor, Camera, Policy>&, \
                                     match_tracks<Descriptor, Camera, Policy>&);
TURBOMAP_PRECOMPILED_SEARCHES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE
