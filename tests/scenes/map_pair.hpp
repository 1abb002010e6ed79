// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A map of any type and the oracle of it, with the names of both sides, and every way to see that they differ.

#include <turbomap/map/covisibility.hpp>
#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "map_scene.hpp"
#include "reference/map_oracle.hpp"

namespace turbomap_test {

/// Thrown where map and oracle differ.
struct map_differs : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <class Map>
class map_pair {
 public:
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;

  /// Everything: all slots, lists and counts, validate(), covisibility, what dead points have become. Throws
  /// map_differs.
  void check_all() {
    for (oracle_id p = 0; p < points_.size(); ++p) check_point(p);
    for (oracle_id k = 0; k < keyframes_.size(); ++k) check_keyframe(k);
    for (oracle_id p = 0; p < points_.size(); ++p) check_resolve(p);
    for (const auto& [k, unused] : oracle_.keyframes) check_covisibility(k);
    if constexpr (turbomap::detail::map_has_v<Map, turbomap::detail::map_all_member>) {
      const auto faults = turbomap::validate(map_);
      if (!faults.empty()) fail("validate: " + turbomap::to_string(faults[0]));
      std::size_t alive = 0;
      traits::for_each_point(map_, [&alive](point) { ++alive; });
      require(alive == oracle_.points.size(), "number of points", alive);
    }
  }

 protected:
  [[noreturn]] static void fail(const std::string& what) { throw map_differs(what); }
  static void require(bool holds, const char* what, oracle_id id) {
    if (!holds) fail(std::string(what) + ", " + std::to_string(id));
  }
  point handle(std::optional<oracle_id> p) const { return p ? points_[*p] : point{}; }

  void check_point(oracle_id p) {
    const point mine = points_[p];
    const auto found = oracle_.points.find(p);
    require(traits::alive(map_, mine) == (found != oracle_.points.end()), "alive() of point", p);
    if (found == oracle_.points.end()) return;
    require(traits::id(map_, mine) == p, "id of point", p);
    std::size_t views = 0;
    traits::for_each_observation(map_, mine, [&](keyframe k, std::size_t i) {
      ++views;
      require(found->second.views.count({traits::id(map_, k), i}) != 0, "an observation too many of point", p);
    });
    require(views == found->second.views.size(), "number of observations of point", p);
    require(turbomap::measurement_count(map_, mine) == oracle_.measurements(p), "measurements of point", p);
    const auto& reference = found->second.reference;
    if (reference && oracle_.keyframes.count(*reference) != 0)
      require(traits::reference(map_, mine) == keyframes_[*reference], "reference keyframe of point", p);
    const auto counts = oracle_.counts(p);
    const auto count_is = [&](std::size_t octave, unsigned kept) {
      const auto at = counts.find(static_cast<int>(octave));
      return kept == (at == counts.end() ? 0 : at->second);
    };
    turbomap::recount(map_, mine, recounted_, turbomap::pyramid{}.levels);
    for (std::size_t o = 0; o < recounted_.size(); ++o) require(count_is(o, recounted_[o]), "recount() of point", p);
    if constexpr (turbomap::counts_octaves_v<Map>) {
      const auto kept = traits::octave_counts(map_, mine);
      for (std::size_t o = 0; o < kept.size(); ++o) require(count_is(o, kept[o]), "octave counts of point", p);
    }
  }
  void check_keyframe(oracle_id k) {
    const auto found = oracle_.keyframes.find(k);
    require(traits::alive(map_, keyframes_[k]) == (found != oracle_.keyframes.end()), "alive() of keyframe", k);
    if (found == oracle_.keyframes.end()) return;
    require(traits::id(map_, keyframes_[k]) == k, "id of keyframe", k);
    for (std::size_t i = 0; i < found->second.keypoints.size(); ++i)
      require(traits::point_at(map_, keyframes_[k], i) == handle(oracle_.point_at({k, i})), "a slot of keyframe", k);
  }
  void check_resolve(oracle_id p) {
    require(turbomap::resolve(map_, points_[p]) == handle(oracle_.resolve(p)), "resolve() of point", p);
  }
  void check_covisibility(oracle_id k) {
    const auto shared = oracle_.shared(k);
    std::vector<std::pair<int, oracle_id>> expected;
    for (const int least : {1, 4}) {
      expected.clear();
      for (const auto& [other, points] : shared)
        if (points >= least) expected.push_back({-points, other});
      if (expected.empty())
        for (const auto& [other, points] : shared) expected.push_back({-points, other});
      std::sort(expected.begin(), expected.end());
      const bool any = !expected.empty() && -expected[0].first >= least;
      if (!any && expected.size() > 1) expected.resize(1);
      const auto& found = covisibility_(map_, keyframes_[k], least);
      require(found.size() == expected.size(), "number of covisible keyframes", k);
      for (std::size_t i = 0; i < found.size(); ++i)
        require(found[i].keyframe == keyframes_[expected[i].second] && found[i].shared_points == -expected[i].first,
                "a covisible keyframe", k);
    }
  }

  std::multiset<oracle_id> ids(const std::vector<point>& all) const {
    std::multiset<oracle_id> sorted;
    for (const point p : all) {
      require(traits::alive(map_, p), "a touched point is dead", 0);
      sorted.insert(traits::id(map_, p));
    }
    return sorted;
  }
  std::vector<point> handles(const std::vector<oracle_id>& all) const {
    std::vector<point> names;
    for (const oracle_id p : all) names.push_back(points_[p]);
    return names;
  }
  static bool before(const point& a, const point& b) {
    if constexpr (std::is_pointer_v<point>)
      return std::less<point>()(a, b);
    else
      return std::pair(a.index, a.generation) < std::pair(b.index, b.generation);
  }

  Map map_;
  map_oracle oracle_;
  std::vector<keyframe> keyframes_;  ///< by id, dead ones as well
  std::vector<point> points_;

 private:
  turbomap::covisibility<Map> covisibility_;
  std::vector<std::uint32_t> recounted_;
};

}  // namespace turbomap_test
