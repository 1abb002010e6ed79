// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A model check of the commits of local mapping. Two threads can only meet where one of them takes the guard of the map: what
/// happens under it happens at once. So all ways in which mapping (A) and another part of the system (B) can interleave are
/// all ways to place the edits of B before the guards that A takes. In a tiny world each of them is run from its beginning:
/// every single edit at every guard, and every pair of kinds of edits at every pair of guards.

#include <thrust/detail/seq.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "local_mapper_cases.hpp"
#include "scenes/watched_map.hpp"

namespace {

using namespace turbomap_test;
using turbomap::mapping_stage;
using watched = watched_map<turbomap::binary_descriptor<256>>;
using keyframe = turbomap::map_keyframe_id;
using point = turbomap::map_point_id;

constexpr double shift = 100;  // m: no keyframe and no point of the scene is so far away

enum class edit_kind : std::uint8_t { erase_point, merge_points, observe, forget, erase_keyframe, move_all };

/// What B does at once: `which` of the points or keyframes that there are, modulo their number.
struct one_edit {
  edit_kind kind;
  std::size_t which;
};
struct placed_edit {
  one_edit edit;
  int guard;  ///< before which A takes, counted from 0; later than the last one: after process()
};

/// Whether B says what it changed, for a mapper that works on a copy.
enum class telling : std::uint8_t { all, nothing };

mapping_case<pinhole_camera> tiny_case() {
  // Of 150 seeds this one's fourth keyframe has most to do: two points are made, two merged, two keyframes culled.
  mapping_recipe recipe = noisy(137, 0.6, 8);
  recipe.per_metre = 1, recipe.clutter = 1, recipe.step = 0.15, recipe.lost = 0.7, recipe.fresh = 0.3;
  recipe.scales.levels = 4;
  auto c = stereo_case(recipe);
  auto& o = c.options;
  o.neighbours.neighbourhood.min_shared_points = 1;
  o.adjustment.min_shared_points = 1;
  o.adjustment.solve.max_iterations = 2;
  o.adjustment.points_per_guard = 1, o.fusion.commit.entries_per_guard = 1;  // the most guards
  o.points_read_per_guard = 4;  // new points come one at a time; reading in smaller parts would take minutes
  o.keyframe_culling.redundant_share = 0.4F, o.keyframe_culling.observers = 1, o.keyframe_culling.max_depth = 20;
  o.point_culling.patience = 1;
  o.checked_share = 0;  // what is not told is found by commits only
  return c;
}

/// What the runs did in all: that the world is not too tiny to mean something.
struct totals {
  std::size_t runs = 0;
  std::size_t created = 0, merged = 0, adjusted = 0, stale = 0, culled = 0, dropped = 0;
  int most_guards = 0;
};

template <class Map>
class interleaved_run {
 public:
  using traits = turbomap::map_traits<Map>;
  static constexpr int before = 3;  ///< keyframes that are mapped undisturbed

  interleaved_run(const mapping_scene<pinhole_camera>& scene, const turbomap::local_mapper_options& options,
                  telling tells)
      : run_(scene, options), tells_(tells) {
    run_.notes_creation = false;
    run_.steps(before);
    current_ = run_.track();
    list();
  }
  std::size_t points() const { return points_.size(); }
  std::size_t keyframes() const { return keyframes_.size(); }

  /// One keyframe with the edits of B in between, and one more undisturbed. \return whether A took so many guards that all edits
  /// were made while it worked
  bool check(const std::vector<placed_edit>& edits, totals& sums) {
    auto& watch = run_.map.watch;
    std::size_t next = 0;
    int guard = 0;
    watch.before = [&] {
      for (; next < edits.size() && edits[next].guard == guard; ++next) apply(edits[next].edit);
      ++guard;
    };
    watch.armed = true;
    try {
      run_.mapper.process(current_);
      add(run_.mapper.report(), sums);
    } catch (const std::invalid_argument& e) {  // erased before the first guard: nothing was done
      watch.armed = false;
      CAPTURE(std::string(e.what()));
      REQUIRE(!traits::alive(run_.map, current_));
      REQUIRE(guard == 1);
    }
    watch.armed = false, watch.before = {};
    const bool inside = next == edits.size();
    for (; next < edits.size(); ++next) apply(edits[next].edit);
    CHECK(watch.unguarded == 0);
    check_map();
    if (moves_ > 0) move(-moves_);
    run_.note();
    REQUIRE_NOTHROW(run_.step());
    check_map();
    ++sums.runs, sums.most_guards = std::max(sums.most_guards, guard);
    return inside;
  }

 private:
  static void add(const turbomap::mapping_report& r, totals& sums) {
    CHECK(r.refused.empty());
    sums.created += r.points_created, sums.merged += r.fused.merged, sums.culled += r.keyframes_culled.size();
    sums.adjusted += r.adjustment.solve.accepted > 0 && !r.adjustment.stale ? 1 : 0;
    sums.stale += r.adjustment.stale ? 1 : 0, sums.dropped += r.points_culled + r.adjustment.points_erased;
  }
  void list() {
    points_.clear(), keyframes_.clear();
    traits::for_each_point(run_.map, [this](point p) { points_.push_back(p); });
    traits::for_each_keyframe(run_.map, [this](keyframe k) { keyframes_.push_back(k); });
  }
  template <class Name>
  void tell(const Name& name) {
    if (tells_ == telling::all) run_.mapper.changed(name);
  }
  void tell_slots(keyframe k) {
    tell(k);
    for (std::size_t i = 0; i < traits::keypoint_count(run_.map, k); ++i)
      if (const point p = traits::point_at(run_.map, k, i); p != point{}) tell(p);
  }
  void move(int times) {
    move_all(run_.map, times * shift);
    moves_ += times;
    if (tells_ == telling::all) run_.mapper.refresh();
  }

  void apply(const one_edit& e) {
    auto& map = run_.map;
    map.watch.held = true;
    list();
    const std::size_t n = points_.size(), m = keyframes_.size();
    const point p = n == 0 ? point{} : points_[e.which % n];
    const bool of_both = e.kind == edit_kind::observe && n > 0;  // all points may be gone by now
    const keyframe k = m == 0 ? keyframe{} : keyframes_[of_both ? e.which / n % m : e.which % m];
    switch (e.kind) {
      case edit_kind::erase_point:
        if (p == point{}) break;
        gone_points_.insert(traits::id(map, p));
        tell(p);
        turbomap::erase_point(map, p);
        break;
      case edit_kind::merge_points: {
        const point q = n == 0 ? point{} : points_[e.which / n % n];
        if (p == q) break;
        const std::uint64_t id = traits::id(map, p);
        tell(p), tell(q);
        std::vector<std::pair<keyframe, std::size_t>> scratch;
        if (turbomap::merge_points(map, p, q, turbomap::merge_rule::drop, scratch)) gone_points_.insert(id);
        break;
      }
      case edit_kind::observe:
        for (std::size_t i = 0; i < traits::keypoint_count(map, k) && p != point{}; ++i)
          if (traits::point_at(map, k, i) == point{} && turbomap::observe(map, p, k, i)) break;
        tell(p), tell(k);
        break;
      case edit_kind::forget: {
        tell_slots(k);
        std::size_t place = e.which / m;
        for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i)
          if (traits::point_at(map, k, i) != point{} && place-- == 0) {
            turbomap::forget(map, k, i);
            break;
          }
        break;
      }
      case edit_kind::erase_keyframe:
        if (m == 0) break;
        gone_keyframes_.insert(traits::id(map, k));
        tell_slots(k);
        turbomap::erase_keyframe(map, k);
        break;
      case edit_kind::move_all:
        move(1);
        break;
    }
    map.watch.held = false;
  }

  void check_map() {
    const auto& map = run_.map;
    const auto faults = turbomap::validate(map);
    if (!faults.empty()) CAPTURE(turbomap::to_string(faults[0]));
    REQUIRE(faults.empty());
    list();
    // What was moved stays moved: nothing computed from the places of before is written.
    const bool follows = tells_ == telling::all || !turbomap::is_mirrored_v<Map>;
    const double middle = moves_ * shift;
    for (const keyframe k : keyframes_) {
      REQUIRE(gone_keyframes_.count(traits::id(map, k)) == 0);
      const double x = to_oracle_pose(traits::pose(map, k)).inverse().t.x();
      if (follows) REQUIRE(std::abs(x - middle) < shift / 2);
    }
    for (const point p : points_) {
      REQUIRE(gone_points_.count(traits::id(map, p)) == 0);
      if (follows) REQUIRE(std::abs(traits::position(map, p).x - middle) < shift / 2);
    }
    REQUIRE(run_.store.statistics().pinned_sets == 0);
  }

  mapping_run<Map, sequential_policy, turbomap::local_adjustment<Map, sequential_policy>> run_;
  telling tells_;
  keyframe current_;
  std::vector<point> points_;
  std::vector<keyframe> keyframes_;
  std::set<std::uint64_t> gone_points_, gone_keyframes_;  ///< ids of what B erased
  int moves_ = 0;                                         ///< of the whole map, so far
};

/// Runs the edits before every guard, in their order.
template <class Map>
class all_interleavings {
 public:
  explicit all_interleavings(telling tells) : tells_(tells) {}

  void single(edit_kind kind, std::size_t count) {
    for (std::size_t which = 0; which < count; ++which)
      for (int g = 0; check({{{kind, which}, g}}); ++g) {
      }
  }
  void pair(const one_edit& first, const one_edit& second) {
    for (int g = 0; check({{first, g}, {second, g}}); ++g)
      for (int h = g + 1; check({{first, g}, {second, h}}); ++h) {
      }
  }
  interleaved_run<Map> make() const { return {scene_, case_.options, tells_}; }
  const totals& sums() const { return sums_; }

 private:
  bool check(const std::vector<placed_edit>& edits) {
    for (const auto& e : edits) {
      CAPTURE(static_cast<int>(e.edit.kind));
      CAPTURE(e.edit.which);
      CAPTURE(e.guard);
    }
    return make().check(edits, sums_);
  }

  telling tells_;
  mapping_case<pinhole_camera> case_ = tiny_case();
  mapping_scene<pinhole_camera> scene_{case_.rig, case_.recipe};
  totals sums_;
};

template <class Map>
void check_all(telling tells) {
  all_interleavings<Map> all(tells);
  const auto tiny = all.make();
  const std::size_t n = tiny.points(), m = tiny.keyframes();
  CHECK(n == 6);
  CHECK(m == 4);
  all.single(edit_kind::erase_point, n);
  all.single(edit_kind::merge_points, n * n);
  all.single(edit_kind::observe, n * m);
  all.single(edit_kind::forget, 4 * m);
  all.single(edit_kind::erase_keyframe, m);
  all.single(edit_kind::move_all, 1);
  const one_edit kinds[] = {{edit_kind::erase_point, 0},
                            {edit_kind::merge_points, 1},
                            {edit_kind::observe, 9},
                            {edit_kind::erase_keyframe, 2},
                            {edit_kind::move_all, 0}};
  for (const one_edit& first : kinds)
    for (const one_edit& second : kinds) all.pair(first, second);
  const totals& s = all.sums();
  CHECK(s.most_guards > 25);
  for (const std::size_t done : {s.created, s.merged, s.adjusted, s.culled}) CHECK(done > s.runs / 2);
  CHECK(s.stale > 100);
}

TEST_CASE("other threads edit the map before any guard that mapping takes") { check_all<watched>(telling::all); }
TEST_CASE("the same of a mapper that works on a copy and is told") { check_all<mirrored_watched_map>(telling::all); }
TEST_CASE("the same of one that is not told") { check_all<mirrored_watched_map>(telling::nothing); }

}  // namespace
