// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Maps whose traits tell lies, any number of them: validate() names the faults that a plain reading of its rules finds, no
// more and no fewer, and commits that meet one refuse and write nothing.

#include <algorithm>
#include <set>
#include <tuple>
#include <vector>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>
#include <turbomap/mapping/point_culling.hpp>

#include "hostile.hpp"
#include "scenes/lying_map.hpp"

using namespace turbomap_fuzz;

namespace {

using turbomap::map_fault;
using turbomap_test::lying_map;
using traits = turbomap::map_traits<lying_map>;
using keyframe = turbomap::map_keyframe_id;
using point = turbomap::map_point_id;
using found = std::tuple<map_fault, std::uint64_t, std::uint64_t, std::size_t>;

class world {
 public:
  explicit world(choices& c) : cameras_(1 + static_cast<int>(c.below(2))) {
    for (int n = 0; n < 4; ++n) {
      const auto keypoints = turbomap_test::random_keypoints(static_cast<std::uint32_t>(n) + 1, cameras_, 8, 4);
      keyframes_.push_back(map_.add_keyframe(keypoints, {}, 0.1 * n, n == 0 ? keyframe{} : keyframes_.back()));
    }
    for (int n = 0; n < 5; ++n) points_.push_back(map_.add_point({1, 2, 3}, any_keyframe(c)));
    for (int n = 0; n < 24; ++n) turbomap::observe(map_, any_point(c), any_keyframe(c), slot(c));
    if (c.flag()) turbomap::erase_point(map_, points_[0]);
    if (c.flag()) turbomap::erase_keyframe(map_, keyframes_[0]);
  }

  void run(choices& c) {
    expect(turbomap::validate(map_).empty(), "a map that edits made is sound");
    for (unsigned n = c.byte() % 6; n > 0; --n) lie(c);
    compare();
    for (unsigned n = c.byte() % 4; n > 0; --n) commit(c);
  }

 private:
  keyframe any_keyframe(choices& c) const { return keyframes_[c.below(keyframes_.size())]; }
  point any_point(choices& c) const { return points_[c.below(points_.size())]; }
  std::size_t slot(choices& c) const { return c.below(static_cast<std::size_t>(4 * cameras_)); }

  void lie(choices& c) {
    const auto k = any_keyframe(c);
    const auto p = any_point(c);
    const std::size_t i = slot(c);
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    ++lies_;
    switch (c.byte() % 8) {
      case 0:
        map_.slots[{k.index, i}] = p;
        break;
      case 1:
        map_.slots[{k.index, i}] = c.flag() ? point{} : point{77, 0};
        break;
      case 2:
        map_.invented.insert({p.index, {k, c.flag() ? i : i + 100}});
        break;
      case 3:
        map_.invented.insert({p.index, {c.flag() ? keyframe{} : keyframe{9, 0}, i}});
        break;
      case 4:
        map_.hidden[{p.index, {k.index, i}}] = true;
        break;
      case 5:
        map_.counts[p.index].assign(c.below(10), c.byte() % 3);
        break;
      case 6:
        if (traits::alive(map_, p)) traits::set_position(map_, p, {1, nan, 2});
        break;
      default:
        if (traits::alive(map_, k)) map_.set_pose(k, {0, 0, 0, 2, 0, 0, 0});
    }
  }

  /// The rules of map_fault, each by itself, read through the same traits.
  std::set<found> plain_reading() const {
    std::set<found> all;
    const auto id = [&](auto name) { return traits::id(map_, name); };
    traits::for_each_keyframe(map_, [&](keyframe k) {
      if (!turbomap::is_pose(traits::pose(map_, k))) all.insert({map_fault::bad_pose, id(k), 0, 0});
      for (std::size_t i = 0; i < traits::keypoint_count(map_, k); ++i) {
        const point p = traits::point_at(map_, k, i);
        if (p == point{}) continue;
        if (!traits::alive(map_, p))
          all.insert({map_fault::slot_of_dead_point, id(k), 0, i});
        else if (const auto views = views_of(p); std::count(views.begin(), views.end(), view{k, i}) == 0)
          all.insert({map_fault::slot_without_observation, id(k), id(p), i});
      }
    });
    traits::for_each_point(map_, [&](point p) {
      const auto x = traits::position(map_, p);
      if (!finite({x.x, x.y, x.z})) all.insert({map_fault::position_not_finite, 0, id(p), 0});
      const auto views = views_of(p);
      const auto counts = traits::octave_counts(map_, p);
      bool readable = true;
      for (const auto& [k, i] : views) {
        const bool alive = k != keyframe{} && traits::alive(map_, k);
        if (!alive) all.insert({map_fault::observer_not_alive, 0, id(p), i});
        const bool there = alive && i < traits::keypoint_count(map_, k);
        if (alive && !there) all.insert({map_fault::keypoint_out_of_range, id(k), id(p), i});
        const bool counted = there && traits::keypoint(map_, k, i).octave < counts.size();
        if (there && traits::point_at(map_, k, i) != p)
          all.insert({map_fault::observation_without_slot, id(k), id(p), i});
        if (there && !counted) all.insert({map_fault::octave_out_of_range, id(k), id(p), i});
        readable = readable && counted;
      }
      if (!readable) return;  // what follows asks for all of it
      std::vector<std::uint32_t> truth(counts.size(), 0);
      bool listed_twice = false;
      std::set<std::int32_t> counted;
      for (std::size_t a = 0; a < views.size(); ++a) {
        const auto& [k, i] = views[a];
        bool twice = false, finest = true;
        for (std::size_t b = 0; b < views.size(); ++b) {
          if (b == a || views[b].first != k) continue;
          const auto mine = traits::keypoint(map_, k, i), other = traits::keypoint(map_, k, views[b].second);
          twice = twice || (b > a && other.camera == mine.camera);
          listed_twice = listed_twice || views[b].second == i;
          finest = finest && mine.octave <= other.octave;
        }
        if (twice) all.insert({map_fault::seen_twice_by_camera, id(k), id(p), i});
        if (finest && counted.insert(k.index).second) ++truth[traits::keypoint(map_, k, i).octave];
      }
      // Of a view that is listed twice no rule says how often it counts.
      if (listed_twice) uncounted_.insert(id(p));
      if (!std::equal(truth.begin(), truth.end(), counts.begin())) wrong_counts_.insert(id(p));
    });
    return all;
  }

  void compare() const {
    std::set<found> told;
    std::set<std::uint64_t> counts;
    for (const auto& v : turbomap::validate(map_))
      if (v.fault == map_fault::wrong_octave_counts)
        counts.insert(v.point);
      else
        told.insert({v.fault, v.keyframe, v.point, v.keypoint});
    wrong_counts_.clear(), uncounted_.clear();
    expect(told == plain_reading(), "validate() finds what is wrong, and nothing else");
    for (const auto id : uncounted_) counts.erase(id), wrong_counts_.erase(id);
    expect(counts == wrong_counts_, "validate() finds counts that are wrong");
  }

  /// A commit, of points or of one keyframe: with all its faults noted it ends, and one that throws has written nothing.
  void commit(choices& c) {
    const auto k = any_keyframe(c), other = any_keyframe(c);
    std::vector<turbomap::recent_point<point>> recent{{any_point(c), 0}, {any_point(c), 0}};
    std::vector<turbomap::culling_record<keyframe>> records;
    turbomap::keyframe_culling_options o;
    o.redundant_share = 0.3F, o.observers = 1, o.max_depth = 0, o.keep_keyframes = 0;
    const bool of_points = c.flag(), strict = c.flag();
    if (!traits::alive(map_, k)) return;
    turbomap::fault_list noted;
    const auto faults = strict ? turbomap::fault_sink() : turbomap::fault_sink(noted);
    map_.writes = 0;
    const bool done = allowed([&] {
      if (of_points)
        turbomap::cull_recent_points(map_, recent, 2, {}, faults);
      else
        turbomap::cull_keyframes(map_, k, turbomap::span<const keyframe>(&other, 1), o, records, nullptr,
                                 turbomap::ignore_keyframe(), faults);
    });
    expect(done || strict, "where faults are noted nothing is thrown");
    expect(done || map_.writes == 0, "what refuses has written nothing");
    if (lies_ == 0) {
      expect(done && noted.size() == 0, "a sound map has no faults");
      expect(turbomap::validate(map_).empty(), "a sound map stays sound");
    }
  }
  using view = std::pair<keyframe, std::size_t>;
  std::vector<view> views_of(point p) const {
    std::vector<view> all;
    traits::for_each_observation(map_, p, [&](keyframe k, std::size_t i) { all.push_back({k, i}); });
    return all;
  }

  int cameras_;
  lying_map map_;
  std::vector<keyframe> keyframes_;
  std::vector<point> points_;
  int lies_ = 0;
  mutable std::set<std::uint64_t> wrong_counts_, uncounted_;  ///< by plain_reading()
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  world w(c);
  w.run(c);
  return 0;
}
