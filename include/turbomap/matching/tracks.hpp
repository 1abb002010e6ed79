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
#include "../found_list.hpp"
#include "../named_range.hpp"
#include "../plain_vector.hpp"
#include "../precompiled.hpp"
#include "correspondences.hpp"
#include "track_joiner.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {

/// A match, and the cameras that its two keypoints are of.
template <class Distance>
struct placed_match {
  correspondence<Distance> match;
  match_cameras cameras;
};

/// Index = result of a search.
template <class Descriptor, class Camera>
struct placed_match_found {
  using entry = placed_match<typename Descriptor::distance_type>;

  search_view<Descriptor, Camera> search;

  TURBOMAP_HD bool operator()(int i, entry& e) const {
    if (!match_found<Descriptor, Camera>{search}(i, e.match)) return false;
    e.cameras = {static_cast<std::uint8_t>(search.query().camera_of(e.match.query)),
                 static_cast<std::uint8_t>(search.neighbour(e.match.neighbour).camera_of(e.match.candidate))};
    return true;
  }
};

}  // namespace detail

/// The tracks of one search, on the host. Make one and use it for every call: its memory is reused. Move-only.
template <class Descriptor, class Camera, class Policy>
class match_tracks {
 public:
  using matches_type = correspondences<Descriptor, Camera, Policy>;              ///< the correspondences of a search
  using list_type = plain_vector<typename matches_type::plan_type::value_type>;  ///< matches on the host

  /// No tracks. \param ctx  its resources give the memory, and must outlive this
  explicit match_tracks(const context<Policy>& ctx) : list_(ctx) {}

  /// See join_tracks().
  void join(context<Policy>& ctx, const matches_type& matches) {
    const auto& search = matches.view();
    neighbours_ = slots_ = -1;  // where memory runs out, the tracks are of no search
    match_cameras_.clear();
    if (search.query_cameras > 1 || search.neighbour_cameras > 1)
      read_with_cameras(ctx, matches);
    else
      matches.plan(ctx, plan_);
    join_(plan_, match_cameras_, search.own_neighbour, tracks_);
    neighbours_ = search.neighbour_count, slots_ = search.slot_count;
  }

  /// The tracks of the last join().
  const track_list& tracks() const { return tracks_; }
  /// The matches that were joined, in (neighbour, query keypoint) order: tracks().outcomes says what became of each.
  const list_type& plan() const { return plan_; }
  /// Whether the correspondences that were joined were of as many neighbours and query keypoints as these.
  bool are_of(const matches_type& matches) const {
    return neighbours_ == matches.view().neighbour_count && slots_ == matches.view().slot_count;
  }

 private:
  void read_with_cameras(context<Policy>& ctx, const matches_type& matches) {
    list_.read(ctx, matches.size(), detail::placed_match_found<Descriptor, Camera>{matches.view()}, placed_);
    plan_.clear();
    for (const auto& m : placed_) plan_.push_back(m.match), match_cameras_.push_back(m.cameras);
  }

  using placed_match = detail::placed_match<typename Descriptor::distance_type>;
  found_list<placed_match, Policy> list_;
  plain_vector<placed_match> placed_;
  plain_vector<match_cameras> match_cameras_;
  list_type plan_;
  int neighbours_ = 0, slots_ = 0;  ///< of the search
  track_joiner join_;
  track_list tracks_;
};

/// Joins the matches of a search into tracks. Nodes are keypoints, edges are matches. Edges are taken in the order of
/// (distance, query keypoint, neighbour, candidate); each joins the tracks of its two keypoints, unless a camera of a
/// keyframe would then have two keypoints in one track: such a match is left out with the outcome `contradicts`. The result
/// consists of integers that the host decides on: the same under every policy. Waits for the search.
/// \param result  overwritten
/// \throws std::bad_alloc  there is no memory left; create_track_points() then refuses `result`
/// \throws device_error    a launch, copy or wait failed; the same
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
