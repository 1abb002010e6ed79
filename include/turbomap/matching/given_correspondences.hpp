// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Correspondences that were found elsewhere (by a learned matcher, in a recording), brought to where filters and point creation
/// work on them.

#include <cstdint>

#include "../config.hpp"
#include "../context.hpp"
#include "../error.hpp"
#include "../plain_vector.hpp"
#include "correspondences.hpp"
#include "prepare_search.hpp"
#include "search_setup.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Fills `result` as search_correspondences() would have, with the given matches: at most one for a query keypoint and
/// neighbour, none of a keypoint that holds a map point.
/// \throws std::invalid_argument as search_correspondences() does, and naming the match for an index out of range, a
///         keypoint that holds a map point or is the query keypoint itself, a distance that is negative or NaN, or a second
///         match of a query keypoint with one neighbour; `result` is unchanged
template <class Descriptor, class Camera, class Policy>
void given_correspondences(context<Policy>& ctx, const posed_keyframe<Descriptor, Camera>& query,
                           span<const posed_keyframe<Descriptor, Camera>> given,
                           span<const correspondence<typename Descriptor::distance_type>> matches,
                           const search_options& options, correspondences<Descriptor, Camera, Policy>& result) {
  const auto mapped = [](const posed_keyframe<Descriptor, Camera>& k, std::int32_t keypoint) {
    return !k.has_point.empty() && k.has_point[static_cast<std::size_t>(keypoint)] != 0;
  };
  ctx.begin_call();
  check_search(ctx, query, given, options);
  const detail::searched_neighbours<Descriptor, Camera> neighbours(query, given, options);
  plain_vector<std::int32_t> slot(static_cast<std::size_t>(query.view.keypoint_count), no_match);
  std::int32_t slots = 0;
  for (std::int32_t i = 0; i < query.view.keypoint_count; ++i)
    if (!mapped(query, i)) slot[static_cast<std::size_t>(i)] = slots++;
  const std::size_t count = neighbours.size() * static_cast<std::size_t>(slots);
  plain_vector<std::int32_t> candidate(count, no_match);
  plain_vector<typename Descriptor::distance_type> distance(count);
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const auto& m = matches[k];
    require(m.neighbour >= 0 && static_cast<std::size_t>(m.neighbour) < neighbours.size(), "matches[].neighbour",
            m.neighbour, "is not the number of a neighbour");
    require(m.query >= 0 && m.query < query.view.keypoint_count, "matches[].query", m.query, "is not a query keypoint");
    const auto& neighbour = neighbours[static_cast<std::size_t>(m.neighbour)];
    require(m.candidate >= 0 && m.candidate < neighbour.view.keypoint_count, "matches[].candidate", m.candidate,
            "is not a keypoint of the neighbour");
    const bool own = neighbours.across_rig && static_cast<std::size_t>(m.neighbour) + 1 == neighbours.size();
    require(!own || m.candidate != m.query, "matches[].candidate", m.candidate, "is the query keypoint itself");
    require(!mapped(query, m.query), "matches[].query", m.query, "holds a map point");
    require(!mapped(neighbour, m.candidate), "matches[].candidate", m.candidate, "holds a map point");
    require(m.distance >= 0, "matches[].distance", m.distance, "must not be negative");
    const std::size_t at = static_cast<std::size_t>(m.neighbour) * static_cast<std::size_t>(slots) +
                           static_cast<std::size_t>(slot[static_cast<std::size_t>(m.query)]);
    require(candidate[at] == no_match, "matches[].query", m.query, "has two matches with one neighbour");
    candidate[at] = m.candidate;
    distance[at] = m.distance;
  }
  set_up_search(ctx, query, given, options, result.buffers());
  try {
    launch_prepare_search(ctx.policy(), result.view());
    const auto& search = result.view();
    copy_in(ctx.policy(), search.match, candidate.data(), count * sizeof(std::int32_t));
    copy_in(ctx.policy(), search.distance, distance.data(), count * sizeof(typename Descriptor::distance_type));
    ctx.synchronize();  // the vectors end here
  } catch (...) {
    result.clear();  // its matches may be half there
    throw;
  }
}

TURBOMAP_END_NAMESPACE
