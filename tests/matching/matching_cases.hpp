// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of the correspondence search and of point creation, for every execution policy, host or device.

#include <turbomap/descriptor/binary.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>

#include <thrust/detail/seq.h>

#include <cstring>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "reference/creation_oracle.hpp"
#include "reference/same_plans.hpp"
#include "reference/search_oracle.hpp"
#include "scenes/matching_scene.hpp"

namespace turbomap_test {

using sequential = std::decay_t<decltype(thrust::seq)>;
using orb = turbomap::binary_descriptor<256>;

constexpr turbomap::candidates every_candidate_set[] = {
    turbomap::candidates::exhaustive, turbomap::candidates::epipolar_ordered, turbomap::candidates::grouped};
constexpr turbomap::tie_rule every_tie_rule[] = {turbomap::tie_rule::lowest_index, turbomap::tie_rule::highest_index};
constexpr motion every_motion[] = {motion::sideways,       motion::forward,   motion::backward, motion::along_axis,
                                   motion::turn_at_origin, motion::identical, motion::anything};

/// Matches of all sorts, good and absurd: wide gates in the search.
inline turbomap::search_options wide_gates() {
  turbomap::search_options o;
  o.max_distance = 256, o.line_chi2 = 60, o.epipole_radius = 2, o.reprojection_chi2 = 30, o.max_parallax_cosine = 1;
  return o;
}

/// What a comparison with an oracle has seen, over many scenes.
struct tally {
  long results = 0, doubtful = 0, matches = 0, differences = 0;
};
/// Everything equal, few results left out, and enough of them to mean something.
inline void check_tally(const tally& t, long least_matches) {
  CAPTURE(t.results);
  CAPTURE(t.doubtful);
  CHECK(t.differences == 0);
  CHECK(t.doubtful * 500 <= t.results);  // rare; a few more or less with the rounding of each compiler's scenes
  CHECK(t.matches >= least_matches);
}

/// Two lists in (neighbour, query) order are equal where nothing was doubtful.
template <class T, class Same>
long count_differences(const std::vector<T>& expected, const std::vector<T>& got,
                       const std::vector<doubtful_result>& doubtful, Same equal) {
  const auto without = [&doubtful](const std::vector<T>& all) {
    std::vector<T> rest;
    for (const T& a : all)
      if (std::none_of(doubtful.begin(), doubtful.end(),
                       [&a](const auto& d) { return d.neighbour == a.neighbour && d.query == a.query; }))
        rest.push_back(a);
    return rest;
  };
  const auto e = without(expected), g = without(got);
  long differences = static_cast<long>(e.size() > g.size() ? e.size() - g.size() : g.size() - e.size());
  for (std::size_t i = 0; i < e.size() && i < g.size(); ++i) differences += equal(e[i], g[i]) ? 0 : 1;
  return differences;
}

template <class Descriptor, class Camera>
using plan_of = std::vector<turbomap::correspondence<typename Descriptor::distance_type>>;

/// The library's plan under a policy.
template <class Policy, class Descriptor, class Camera>
plan_of<Descriptor, Camera> search_under(const Policy& policy, const scene<Descriptor, Camera>& s,
                                         const turbomap::search_options& options) {
  turbomap::context<Policy> ctx(policy);
  const resident_scene<Descriptor, Camera, Policy> keyframes(ctx, s);
  return turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options).plan(ctx);
}

/// Search under `policy` == search under thrust::seq, to the last bit, and == the oracle.
template <class Policy, class Descriptor, class Camera>
void check_search(const Policy& policy, scene<Descriptor, Camera>& s, const turbomap::search_options& options,
                  tally& t) {
  const auto got = search_under(policy, s, options);
  if constexpr (!std::is_same_v<Policy, sequential>) CHECK(same(got, search_under(sequential{}, s, options)));
  const auto neighbours = s.neighbours();
  std::vector<doubtful_result> doubtful;
  const auto expected = search_oracle<Descriptor, Camera>(s.query(), neighbours, options, &doubtful);
  t.results += static_cast<long>(neighbours.size()) * s.query().view.keypoint_count;
  t.doubtful += static_cast<long>(doubtful.size());
  t.matches += static_cast<long>(expected.size());
  t.differences += count_differences(expected, got, doubtful, [](auto& a, auto& b) { return same(a, b); });
}

/// All candidate sets and tie rules.
template <class Policy, class Descriptor, class Camera>
void check_all_searches(const Policy& policy, scene<Descriptor, Camera>& s, turbomap::search_options options,
                        tally& t) {
  options.scales = s.scales();
  for (const auto set : every_candidate_set)
    for (const auto ties : every_tie_rule) {
      options.candidate_set = set, options.ties = ties;
      check_search(policy, s, options, t);
    }
}

/// Positions agree with the oracle's: accepted points within 1e-9; those that are refused may hang on rays that hardly meet,
/// where both lose digits: within 1e-6.
inline bool close_positions(const turbomap::created_point& a, const turbomap::created_point& b, double tolerance) {
  if (a.method == turbomap::creation_method::none || a.outcome == turbomap::creation_outcome::no_depth ||
      a.outcome == turbomap::creation_outcome::at_infinity)
    return true;
  const Eigen::Vector3d p(a.position.x, a.position.y, a.position.z), q(b.position.x, b.position.y, b.position.z);
  return (p - q).norm() <= tolerance * p.norm();
}

template <class Policy, class Descriptor, class Camera>
std::vector<turbomap::created_point> create_under(const Policy& policy, const scene<Descriptor, Camera>& s,
                                                  const turbomap::search_options& options,
                                                  const turbomap::creation_options& creation,
                                                  plan_of<Descriptor, Camera>* matches = nullptr) {
  turbomap::context<Policy> ctx(policy);
  const resident_scene<Descriptor, Camera, Policy> keyframes(ctx, s);
  const auto found = turbomap::search_correspondences(ctx, keyframes.query(), keyframes.neighbours(), options);
  turbomap::point_creation<Policy> points(ctx);
  turbomap::create_points(ctx, found, creation, points);
  if (matches != nullptr) *matches = found.plan(ctx);
  return points.plan(ctx, found);
}

/// Creation under `policy` == creation under thrust::seq, to the last bit, and == the oracle (positions within 1e-9).
template <class Policy, class Descriptor, class Camera>
void check_creation(const Policy& policy, scene<Descriptor, Camera>& s, turbomap::search_options options,
                    turbomap::creation_options creation, tally& t, std::vector<long>& outcomes) {
  options.scales = creation.scales = s.scales();
  plan_of<Descriptor, Camera> matches;
  const auto got = create_under(policy, s, options, creation, &matches);
  if constexpr (!std::is_same_v<Policy, sequential>) CHECK(same(got, create_under(sequential{}, s, options, creation)));
  const auto neighbours = s.neighbours();
  std::vector<doubtful_result> doubtful;
  const auto expected = creation_oracle<Descriptor, Camera>(s.query(), neighbours, matches, creation, &doubtful);
  t.results += static_cast<long>(expected.size());
  t.doubtful += static_cast<long>(doubtful.size());
  for (const auto& p : expected) {
    t.matches += p.outcome == turbomap::creation_outcome::accepted ? 1 : 0;
    ++outcomes[static_cast<std::size_t>(p.outcome)];
  }
  t.differences += count_differences(expected, got, doubtful, [](auto& a, auto& b) {
    return a.neighbour == b.neighbour && a.query == b.query && a.candidate == b.candidate && a.outcome == b.outcome &&
           a.method == b.method &&
           close_positions(a, b, a.outcome == turbomap::creation_outcome::accepted ? 1e-9 : 1e-6);
  });
}

}  // namespace turbomap_test
