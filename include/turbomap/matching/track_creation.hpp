// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Map points from tracks: one point with all its views for each landmark that a search has found, instead of one per match.

#include <cstddef>
#include <cstdint>

#include "../array.hpp"
#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../named_range.hpp"
#include "../precompiled.hpp"
#include "../result_copies.hpp"
#include "create_track.hpp"
#include "creation_check.hpp"
#include "tracks.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Candidate map points of the tracks of one search. Make one and use it for every call. Move-only.
template <class Policy>
class track_creation {
 public:
  /// Where the results are.
  using memory_type = memory_of_t<Policy>;

  /// Takes its memory from the context.
  explicit track_creation(const context<Policy>& ctx)
      : inputs_(ctx.resource()),
        cameras_(ctx.resource()),
        views_(ctx.resource()),
        kept_(ctx.resource()),
        points_(ctx.resource()),
        copies_(ctx) {}

  /// All tracks with their outcome, in their order, equal to the last bit on every policy. Waits. O(views).
  /// \param kept  of each view of track_list::views: 1 where the point of its track is seen there, 0 where the view was
  ///              left out because it does not fit; meaningful for accepted tracks
  template <class Points, class Kept>
  void plan(context<Policy>& ctx, Points& points, Kept& kept) const {
    points.resize(points_.size());
    kept.resize(kept_.size());
    copies_.fetch(ctx, {{points.data(), points_.data(), points.size() * sizeof(created_track)},
                        {kept.data(), kept_.data(), kept.size()}});
  }

  /// No points: what is left where a call failed.
  void clear() { points_.resize_discard(0), kept_.resize_discard(0); }
  /// See create_track_points().
  template <class Descriptor, class Camera>
  void create(context<Policy>& ctx, const search_view<Descriptor, Camera>& search, const track_list& tracks,
              const creation_options& options, const known_points& known) {
    track_creation_view<Descriptor, Camera> v{};
    v.search = search;
    v.options = options;
    v.track_count = static_cast<int>(tracks.size());
    v.cameras = search.query_cameras > search.neighbour_cameras ? search.query_cameras : search.neighbour_cameras;
    const auto placed = static_cast<std::size_t>(1 + search.neighbour_count) * static_cast<std::size_t>(v.cameras);
    cameras_.resize_discard(placed);
    views_.resize_discard(tracks.views.size());
    packed_inputs inputs;
    const auto offsets = inputs.place<std::int32_t>(tracks.offsets.size());
    const auto views = inputs.place<track_view>(tracks.views.size());
    const auto numbers = inputs.place<std::int32_t>(known.numbers.size());
    const auto starts = inputs.place<std::int32_t>(known.offsets.size());
    const upload_block block = ctx.begin_upload(inputs_, inputs.bytes());
    offsets.copy(block, tracks.offsets.data());
    views.copy(block, tracks.views.data());
    numbers.copy(block, known.numbers.data());
    starts.copy(block, known.offsets.data());
    ctx.send(block, inputs.bytes());
    points_.resize_discard(tracks.size());
    kept_.resize_discard(tracks.views.size());
    v.offsets = offsets.resident(block);
    v.views = views.resident(block);
    v.map_points = known.offsets.empty() ? nullptr : numbers.resident(block);
    v.map_point_offset = starts.resident(block);
    v.placed_cameras = cameras_.data();
    v.placed_views = views_.data();
    v.kept = kept_.data();
    v.points = points_.data();
    if (v.track_count == 0) return;
    launch_place_cameras(ctx.policy(), v);
    launch_create_tracks(ctx.policy(), v);
  }

 private:
  array<std::byte, memory_type> inputs_;
  array<detail::placed_camera, memory_type> cameras_;
  array<detail::placed_view, memory_type> views_;
  array<std::uint8_t, memory_type> kept_;
  array<created_track, memory_type> points_;
  mutable result_copies copies_;
};

/// Creates and tests one point for each track. The point nearest to the rays of all views is moved by at most
/// options.refinement_steps Gauss-Newton steps on the reprojection errors, u_right included, by octave. Where the largest
/// angle between rays is less than that of a stereo pair, the estimate begins with the depth of the stereo keypoint. Each
/// view must then lie in front of its camera, reproject within its gate, and agree in scale with the first view that is
/// left (the query's where it is); while one does not, the view with the largest error over its gate leaves and the
/// estimate is repeated. Two views are decided as create_points() decides a match, then refined. What is left must be of
/// options.fewest_keyframes keyframes, and two views of one keyframe must pass options.lookalike_ratio.
/// \param matches  the search that was joined; its keyframes must still be there
/// \param tracks   of these matches
/// \param known    where map points are seen in these keyframes: a landmark that has one is left out (outcome `known`)
/// \param result   overwritten. Under CUDA the work may still be running on return
/// \throws std::invalid_argument  an option is not finite or out of range, the scale factor is not that of the search, or
///         tracks are not of the matches, or `known` has no number for a keypoint; nothing is changed
/// \throws std::bad_alloc  there is no memory left; `result` then holds no points
/// \throws device_error    a copy or launch failed; the same
/// Decisions and positions are equal to the last bit on every policy. O(views^2) per track where many views leave;
/// O(keypoints of the keyframe) more where two cameras of one keyframe are left.
template <class Descriptor, class Camera, class Policy>
void create_track_points(context<Policy>& ctx, const correspondences<Descriptor, Camera, Policy>& matches,
                         const match_tracks<Descriptor, Camera, Policy>& tracks, const creation_options& options,
                         track_creation<Policy>& result, const known_points& known = {}) {
  const named_range range("create_track_points");
  check_creation_options(options, matches.view().options.scales.scale_factor);
  require(tracks.are_of(matches), "tracks", tracks.tracks().size(),
          "are not of the matches: of other neighbours or keypoints (their number is given)");
  const auto keyframes =
      static_cast<std::size_t>(1 + matches.view().neighbour_count - (matches.view().own_neighbour >= 0 ? 1 : 0));
  require(known.offsets.empty() || known.offsets.size() == keyframes, "known.offsets.size()", known.offsets.size(),
          "must be the number of keyframes, or 0");
  const auto& counts = matches.keypoint_counts();  // none before the first search
  for (std::size_t k = 0; k < known.offsets.size(); ++k) {
    const std::int64_t begin = known.offsets[k], keypoints = k < counts.size() ? counts[k] : 0;
    require(begin >= 0 && begin + keypoints <= static_cast<std::int64_t>(known.numbers.size()), "known.offsets[]",
            begin, "leaves no number for each keypoint of its keyframe");
  }
  try {
    result.create(ctx, matches.view(), tracks.tracks(), options, known);
  } catch (...) {  // else there would be points that nobody has written
    result.clear();
    throw;
  }
}

#define TURBOMAP_INSTANTIATE(Descriptor, Camera, Policy)                                                               \
  TURBOMAP_INSTANCE void create_track_points(context<Policy>&, const correspondences<Descriptor, Camera, Policy>&,     \
                                             const match_tracks<Descriptor, Camera, Policy>&, const creation_options&, \
                                             track_creation<Policy>&, const known_points&);
TURBOMAP_PRECOMPILED_SEARCHES(TURBOMAP_INSTANTIATE)
#undef TURBOMAP_INSTANTIATE

TURBOMAP_END_NAMESPACE
