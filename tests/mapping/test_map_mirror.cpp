// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A mirror is what the map is: after every edit through it, after every edit of others that is reported, and, of what nobody
/// reports, in time. Commits on it leave a sound map whatever it holds.

#include <doctest/doctest.h>

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/look_again.hpp>
#include <turbomap/mapping/map_mirror.hpp>
#include <turbomap/mapping/point_culling.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <mutex>
#include <new>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/map_world.hpp"
#include "scenes/pointer_map.hpp"

namespace turbomap_test {

struct pointer_holder {
  pointer_map objects;
};
/// A map of pointers, edited through its mirror.
struct mirrored_pointer_map : pointer_holder, turbomap::map_mirror<pointer_map> {
  mirrored_pointer_map() : map_mirror(objects) {}
};

inline turbomap::map_keyframe_id insert_keyframe(mirrored_pointer_map& map,
                                                 const std::vector<turbomap::keypoint>& keypoints, double time_s,
                                                 turbomap::map_keyframe_id) {
  return map.number(insert_keyframe(map.objects, keypoints, time_s, nullptr));
}

/// The name of a point that may be asked for its object only while the point is alive, as a handle with a generation.
struct point_handle {
  pointer_point* object = nullptr;

  point_handle() = default;
  point_handle(pointer_point* p) : object(p) {}
  operator pointer_point*() const { return object; }
  pointer_point* get() const {
    if (object == nullptr || object->bad) throw std::out_of_range("point_handle");
    return object;
  }
};
struct handle_map : pointer_map {};

/// A map whose slots may find no memory.
struct slotless_map : pointer_map {
  bool fails = false;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::handle_map> : turbomap::map_traits<turbomap_test::pointer_map> {
  using point = turbomap_test::point_handle;
};

template <>
struct turbomap::map_traits<turbomap_test::slotless_map> : turbomap::map_traits<turbomap_test::pointer_map> {
  static void set_point(turbomap_test::slotless_map& m, keyframe k, std::size_t i, point p) {
    if (m.fails) throw std::bad_alloc();
    turbomap::map_traits<turbomap_test::pointer_map>::set_point(m, k, i, p);
  }
};

template <>
struct turbomap::map_traits<turbomap_test::mirrored_pointer_map>
    : turbomap::map_traits<turbomap::map_mirror<turbomap_test::pointer_map>> {};

namespace {

using namespace turbomap_test;
using traits = turbomap::map_traits<mirrored_pointer_map>;
using user_traits = turbomap::map_traits<pointer_map>;

/// Half of the edits are made by others, on the map itself, and reported: sometimes by the point, sometimes by the keyframe.
struct reported_edits : library_edits {
  static bool observe(mirrored_pointer_map& m, turbomap::map_point_id p, turbomap::map_keyframe_id k, std::size_t i) {
    if (i % 2 == 0) return turbomap::observe(m, p, k, i);
    const bool made = turbomap::observe(m.objects, m.name(p), m.name(k), i);
    if (i % 3 == 0)
      m.changed(m.name(k));
    else
      m.changed(m.name(p));
    m.hear();
    return made;
  }
  static turbomap::map_point_id forget(mirrored_pointer_map& m, turbomap::map_keyframe_id k, std::size_t i) {
    if (i % 2 == 0) return turbomap::forget(m, k, i);
    const auto p = traits::point_at(m, k, i);
    turbomap::forget(m.objects, m.name(k), i);
    if (i % 3 == 0 || p == turbomap::map_point_id{})
      m.changed(m.name(k));
    else
      m.changed(m.name(p));
    m.changed(m.name(p));  // its reference may be another
    m.hear();
    return p;
  }
  template <class S>
  static bool merge(mirrored_pointer_map& m, turbomap::map_point_id from, turbomap::map_point_id into,
                    const turbomap::fusion_commit_options& o, S& scratch) {
    if (from.index % 2 == 0) return turbomap::merge_points(m, from, into, o.merges, scratch, o.tolerance);
    std::vector<std::pair<pointer_keyframe*, std::size_t>> views;
    const bool made = turbomap::merge_points(m.objects, m.name(from), m.name(into), o.merges, views, o.tolerance);
    m.changed(m.name(from)), m.changed(m.name(into));
    if (from.index % 3 == 0) m.refresh();
    m.hear();
    return made;
  }
};

/// After each edit, the measurements that the mirror keeps of a point are those of the map.
struct counted_edits : reported_edits {
  static void check(const mirrored_pointer_map& m, turbomap::map_point_id p) {
    if (!traits::alive(m, p)) return;
    const int kept = turbomap::measurement_count(m, p), truth = turbomap::measurement_count(m.objects, m.name(p));
    if (kept != truth) FAIL("the mirror keeps " << kept << " measurements of " << truth);
    if (turbomap::has_more_measurements(m, p, truth)) FAIL("more measurements than there are");
  }
  static bool observe(mirrored_pointer_map& m, turbomap::map_point_id p, turbomap::map_keyframe_id k, std::size_t i) {
    const bool made = reported_edits::observe(m, p, k, i);
    check(m, p);
    return made;
  }
  static turbomap::map_point_id forget(mirrored_pointer_map& m, turbomap::map_keyframe_id k, std::size_t i) {
    const auto p = reported_edits::forget(m, k, i);
    check(m, p);
    return p;
  }
  template <class S>
  static bool merge(mirrored_pointer_map& m, turbomap::map_point_id from, turbomap::map_point_id into,
                    const turbomap::fusion_commit_options& o, S& scratch) {
    const bool made = reported_edits::merge(m, from, into, o, scratch);
    check(m, from), check(m, into);
    return made;
  }
};

template <class Edits>
void check_edits(std::size_t worlds) {
  for (std::size_t n = 0; n < worlds; ++n) {
    world_options o;
    o.cameras = std::array{1, 2, 4}[n % 3], o.levels = std::array{8, 8, 1, 3}[n % 4];
    o.keypoints_per_camera = std::array{24, 14, 9}[n % 3];
    const auto failure =
        run_edits<mirrored_pointer_map, Edits>(random_edits(static_cast<std::uint32_t>(n + 1), 5000), o, 1000);
    CAPTURE(n);
    INFO((failure ? std::to_string(failure->edit) + ": " + failure->what : std::string()));
    REQUIRE(!failure);
  }
}

TEST_CASE("after every edit through the mirror it is what the map is") { check_edits<library_edits>(40); }
TEST_CASE("after every edit the mirror keeps the measurements of a point") { check_edits<counted_edits>(20); }
TEST_CASE("after every edit of others that is reported the mirror is what the map is") {
  check_edits<reported_edits>(40);
}

std::vector<turbomap::map_violation> faults_of(const pointer_map& map) {
  std::vector<turbomap::map_violation> faults;
  const auto report = [&](const turbomap::map_violation& v) { faults.push_back(v); };
  for (const pointer_keyframe& k : map.keyframes)
    for (std::size_t i = 0; !k.bad && i < k.keypoints.size(); ++i)
      turbomap::detail::check_slot(map, const_cast<pointer_keyframe*>(&k), i, report);
  for (const pointer_point& p : map.points)
    if (!p.bad) turbomap::detail::check_point(map, const_cast<pointer_point*>(&p), report);
  return faults;
}

/// How many points and slots differ.
std::size_t differences(const mirrored_pointer_map& m) {
  std::size_t count = 0;
  for (const pointer_point& object : m.objects.points) {
    auto* const p = const_cast<pointer_point*>(&object);
    if (object.bad) continue;
    const auto mine = m.number(p);
    std::vector<std::pair<const pointer_keyframe*, std::size_t>> here, there;
    traits::for_each_observation(m, mine, [&](turbomap::map_keyframe_id k, std::size_t i) {
      here.push_back({m.name(k), i});
    });
    user_traits::for_each_observation(m.objects, p, [&](pointer_keyframe* k, std::size_t i) {
      there.push_back({k, i});
    });
    std::sort(here.begin(), here.end()), std::sort(there.begin(), there.end());
    count += here != there || traits::position(m, mine).x != object.position.x ? 1 : 0;
    if (!object.reference->bad) count += m.name(traits::reference(m, mine)) != object.reference ? 1 : 0;
  }
  for (const pointer_keyframe& object : m.objects.keyframes) {
    auto* const k = const_cast<pointer_keyframe*>(&object);
    for (std::size_t i = 0; !object.bad && i < object.keypoints.size(); ++i)
      count += m.name(traits::point_at(m, m.number(k), i)) != object.points[i] ? 1 : 0;
  }
  return count;
}

/// Keyframes, points, and observations of them, made through the mirror.
struct furnished {
  mirrored_pointer_map m;
  std::mt19937 random;
  bool edits_before_commit = true;  ///< and reports nothing

  explicit furnished(unsigned seed) : random(seed) {
    for (std::uint32_t k = 0; k < 10; ++k)
      turbomap_test::insert_keyframe(m, random_keypoints(seed + k, 2, 8, 20), k, {});
    for (int n = 0; n < 60; ++n) {
      const auto p = traits::add_point(m, {1.0 * n, 2, 3}, m.number(keyframe()));
      for (int v = 0; v < 8; ++v) turbomap::observe(m, p, m.number(keyframe()), draw(40));
    }
  }
  std::size_t draw(std::size_t n) { return random() % n; }
  pointer_keyframe* keyframe() {
    for (;;) {
      auto& k = m.objects.keyframes[draw(m.objects.keyframes.size())];
      if (!k.bad) return &k;
    }
  }
  pointer_point* point() {
    for (;;) {
      auto& p = m.objects.points[draw(m.objects.points.size())];
      if (!p.bad) return &p;
    }
  }
  /// Somebody else edits the map.
  void edit() {
    pointer_map& map = m.objects;
    switch (draw(16)) {
      case 0:
        if (std::count_if(map.keyframes.begin(), map.keyframes.end(), [](const auto& k) { return !k.bad; }) > 4)
          turbomap::erase_keyframe(map, keyframe());
        return;
      case 1:
        if (std::count_if(map.points.begin(), map.points.end(), [](const auto& p) { return !p.bad; }) > 20)
          turbomap::erase_point(map, point());
        return;
      case 2: {
        std::vector<std::pair<pointer_keyframe*, std::size_t>> views;
        turbomap::merge_points(map, point(), point(), turbomap::merge_rule::drop, views);
        return;
      }
      case 3: {
        auto* const p = point();
        if (!p->observations.empty()) user_traits::set_reference(map, p, p->observations.rbegin()->first);
        return;
      }
      case 4:
        user_traits::set_position(map, point(), {1.0 * static_cast<double>(draw(100)), 0, 1});
        return;
      case 5: {
        auto* const p = user_traits::add_point(map, {1, 2, 3}, keyframe());
        turbomap::observe(map, p, keyframe(), draw(40));
        return;
      }
      case 6:
      case 7:
      case 8:
        turbomap::forget(map, keyframe(), draw(40));
        return;
      default:
        turbomap::observe(map, point(), keyframe(), draw(40));
    }
  }
  /// A commit on the mirror: of duplicates, of culled points or of culled keyframes, chosen by the names that a stage had copied.
  void commit() {
    if (draw(4) == 0) {
      std::vector<turbomap::recent_point<turbomap::map_point_id>> recent;
      for (int n = 0; n < 6; ++n) recent.push_back({m.number(point()), 0});
      turbomap::map_point_culling_options o;
      o.fewest_measurements = 3;
      turbomap::cull_recent_points(static_cast<turbomap::map_mirror<pointer_map>&>(m), recent, 2, o);
      return;
    }
    std::vector<turbomap::map_keyframe_id> targets;
    std::vector<turbomap::map_point_id> points;
    for (int n = 0; n < 3; ++n) targets.push_back(m.number(keyframe()));
    for (int n = 0; n < 6; ++n) points.push_back(m.number(point()));
    if (draw(4) == 0) {
      std::vector<turbomap::culling_record<turbomap::map_keyframe_id>> records;
      turbomap::keyframe_culling_options o;
      o.redundant_share = 0.4F, o.observers = 1, o.max_depth = 0;
      if (draw(8) == 0) turbomap::cull_keyframes(m, targets[0], turbomap::span(&targets[1], 1), o, records);
      return;
    }
    if (edits_before_commit) edit();  // between search and commit
    std::vector<turbomap::duplicate<std::int32_t>> plan;
    for (int n = 0; n < 6; ++n)
      plan.push_back({static_cast<std::int32_t>(draw(3)), 0, static_cast<std::int32_t>(draw(6)),
                      static_cast<std::int32_t>(draw(40)), 1});
    turbomap::fusion_commit<mirrored_pointer_map> fusion;
    fusion(m, turbomap::span<const turbomap::duplicate<std::int32_t>>(plan),
           turbomap::span<const turbomap::map_keyframe_id>(targets),
           turbomap::span<const turbomap::map_point_id>(points));
  }
};

TEST_CASE("what nobody reports: commits leave a sound map, and the sample check finds all of it in time") {
  std::size_t healed = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    CAPTURE(seed);
    furnished f(seed);
    REQUIRE(differences(f.m) == 0);
    bool stale = false;
    for (int round = 0; round < 100; ++round) {
      CAPTURE(round);
      for (std::size_t n = f.draw(4); n > 0; --n) f.edit();
      stale = stale || differences(f.m) != 0;
      f.commit();
      const auto faults = faults_of(f.m.objects);
      INFO((faults.empty() ? std::string() : turbomap::to_string(faults[0])));
      REQUIRE(faults.empty());
    }
    CHECK(stale);
    for (int n = 0; n < 12; ++n) healed += f.m.check_sample(0.1);  // ten times a tenth; ten keyframes, one at each
    CHECK(differences(f.m) == 0);
    CHECK(f.m.check_sample(1) == 0);
  }
  CHECK(healed > 20);  // commits leave some of it, if not for every seed
}

/// A point that the first `observers` of so many new keyframes see.
turbomap::map_point_id add_seen_point(mirrored_pointer_map& m, std::uint32_t keyframes, std::size_t observers) {
  for (std::uint32_t k = 0; k < keyframes; ++k) turbomap_test::insert_keyframe(m, random_keypoints(k, 1, 8, 20), k, {});
  const auto keyframe = [&](std::size_t k) { return m.number(&m.objects.keyframes[k]); };
  const auto p = traits::add_point(m, {1, 2, 3}, keyframe(0));
  for (std::size_t k = 0; k < observers; ++k) turbomap::observe(m, p, keyframe(k), 2);
  return p;
}

TEST_CASE("an unreported change of a reference is seen before its keyframe goes") {
  mirrored_pointer_map m;
  const auto p = add_seen_point(m, 4, 4);
  const auto keyframe = [&](std::size_t k) { return m.number(&m.objects.keyframes[k]); };
  auto& object = m.objects.points[0];
  SUBCASE("in a commit") {
    user_traits::set_reference(m.objects, &object, &m.objects.keyframes[3]);
    turbomap::look_at_all(static_cast<const turbomap::map_mirror<pointer_map>&>(m), keyframe(3), 2);
    turbomap::erase_keyframe(m, keyframe(3));
    CHECK(object.reference == &m.objects.keyframes[0]);
  }
  SUBCASE("in a commit, of a keyframe that is the reference no longer; an observer was erased meanwhile") {
    traits::set_reference(m, p, keyframe(3));
    user_traits::set_reference(m.objects, &object, &m.objects.keyframes[2]);
    turbomap::erase_keyframe(m.objects, &m.objects.keyframes[0]);
    turbomap::look_at_all(static_cast<const turbomap::map_mirror<pointer_map>&>(m), keyframe(3), 2);
    turbomap::erase_keyframe(m, keyframe(3));
    REQUIRE_FALSE(object.bad);
    CHECK_FALSE(object.reference->bad);
    CHECK(object.reference == &m.objects.keyframes[2]);
  }
  SUBCASE("in a commit, of the reference; the observer that would follow it was erased meanwhile") {
    traits::set_reference(m, p, keyframe(3));
    turbomap::erase_keyframe(m.objects, &m.objects.keyframes[0]);
    turbomap::look_at_all(static_cast<const turbomap::map_mirror<pointer_map>&>(m), keyframe(3), 1);
    turbomap::erase_keyframe(m, keyframe(3), 1);
    REQUIRE_FALSE(object.bad);
    CHECK(object.reference == &m.objects.keyframes[1]);
  }
  SUBCASE("by the sample check") {
    user_traits::set_reference(m.objects, &object, &m.objects.keyframes[3]);
    CHECK(m.check_sample(1) == 1);
    CHECK(traits::reference(m, p) == keyframe(3));
  }
}

TEST_CASE("an edit that was reported by its point alone is not healed: it was known") {
  mirrored_pointer_map m;
  add_seen_point(m, 6, 3);
  for (auto& k : m.objects.keyframes) traits::alive(m, m.number(&k));  // all are read
  auto* const object = &m.objects.points[0];
  for (std::size_t k = 3; k < 6; ++k) turbomap::observe(m.objects, object, &m.objects.keyframes[k], 2);
  SUBCASE("reported") {
    m.changed(object);
    m.begin();
    for (int n = 0; n < 8; ++n) CHECK(m.check_sample(1) == 0);
  }
  SUBCASE("not reported") {
    std::size_t healed = 0;
    for (int n = 0; n < 8; ++n) healed += m.check_sample(1);
    CHECK(healed > 0);
  }
  CHECK(differences(m) == 0);
}

TEST_CASE("what a keyframe sees that still waits for its turn is read anew, and needs no report") {
  mirrored_pointer_map m;
  add_seen_point(m, 6, 3);
  const auto p = m.number(&m.objects.points[0]);
  for (std::size_t k = 0; k < 3; ++k) traits::alive(m, m.number(&m.objects.keyframes[k]));
  REQUIRE(traits::alive(m, p));  // read, as keyframes 0 to 2
  SUBCASE("tracking has handed over 3, 4 and 5, and the mapper is at 2") {
    for (std::size_t k = 3; k < 6; ++k)
      REQUIRE(turbomap::observe(m.objects, &m.objects.points[0], &m.objects.keyframes[k], 2));
    for (int n = 0; n < 8; ++n) CHECK(m.check_sample(1) == 0);
  }
  SUBCASE("the same, and an observation is gone that nobody has reported") {
    for (std::size_t k = 3; k < 6; ++k)
      REQUIRE(turbomap::observe(m.objects, &m.objects.points[0], &m.objects.keyframes[k], 2));
    REQUIRE(turbomap::forget(m.objects, &m.objects.keyframes[1], 2) == &m.objects.points[0]);
    CHECK(m.check_sample(1) > 0);
  }
  CHECK(differences(m) == 0);
}

TEST_CASE("places of keyframes that others erased are taken again after a mirror was emptied") {
  turbomap::mirror_keyframes<flat_map> places;
  const std::size_t none = places.size();
  for (int round = 0; round < 3; ++round) {
    std::vector<std::int32_t> taken;
    for (std::int32_t i = 0; i < 5; ++i)
      taken.push_back(places.take(turbomap::map_keyframe_id{i + 1, 1}, static_cast<std::uint64_t>(i)));
    CHECK(places.size() == none + 5);
    for (const std::size_t lost : {1U, 3U}) places.retire(static_cast<std::size_t>(taken[lost]));
    const auto erased = taken[2];  // by the mapper itself
    places.retire(static_cast<std::size_t>(erased)), places.give_back(erased);
    places.clear();
  }
}

TEST_CASE("what is not a number is as it was, once it was read") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using position = turbomap::vec3<double>;
  CHECK(turbomap::detail::is_as_before(position{1, nan, -0.0}, position{1, nan, 0.0}));
  CHECK_FALSE(turbomap::detail::is_as_before(position{1, nan, 0}, position{1, 2, 0}));
  CHECK_FALSE(turbomap::detail::is_as_before(position{1, 2, 0}, position{nan, 2, 0}));
  turbomap::rigid_transform<double> now, before;
  now.tz = before.tz = nan;
  CHECK(turbomap::detail::is_as_before(now, before));
  before.qy = 0.5;
  CHECK_FALSE(turbomap::detail::is_as_before(now, before));
}

TEST_CASE("names of nothing, and those that the mirror never gave, may be prefetched") {
  const furnished f(5);
  const auto everything = (turbomap::point_data::entry + turbomap::point_data::views) |
                          static_cast<unsigned>(turbomap::point_data::appearance);
  for (const turbomap::map_point_id p : {turbomap::map_point_id{}, turbomap::map_point_id{1000000, 1}}) {
    traits::prefetch(f.m, p, everything);
    CHECK_FALSE(traits::alive(f.m, p));
  }
}

TEST_CASE("a name that throws where its point is gone is not asked for the object before the map was asked") {
  using handles = turbomap::map_traits<handle_map>;
  handle_map map;
  turbomap::map_mirror<handle_map> mirror(map);
  auto* const k = insert_keyframe(map, {make_keypoint(0)}, 0, nullptr);
  std::vector<turbomap::recent_point<turbomap::map_point_id>> recent;
  for (int n = 0; n < 20; ++n) {
    const point_handle p = handles::add_point(map, {}, k);
    recent.push_back({mirror.number(p), 0});
    if (n % 2 == 0) handles::retire(map, p, {});  // by others, who do not report it
  }
  CHECK(turbomap::cull_recent_points(mirror, recent, 2).dropped == 10);
  CHECK(recent.empty());
}

TEST_CASE(
    "of a point that is to be erased every slot is looked at again, also in a keyframe that was found alive for "
    "another") {
  mirrored_pointer_map m;
  turbomap_test::insert_keyframe(m, random_keypoints(1, 1, 8, 20), 0, {});
  auto& keyframe = m.objects.keyframes[0];
  std::vector<turbomap::recent_point<turbomap::map_point_id>> recent;
  for (std::size_t n = 0; n < 3; ++n) {
    const auto p = traits::add_point(m, {1, 2, 3}, m.number(&keyframe));
    REQUIRE(turbomap::observe(m, p, m.number(&keyframe), n));
    if (n < 2) recent.push_back({p, 0});
  }
  auto* const other = keyframe.points[2];
  keyframe.points[1] = other;  // by others, who do not report it and leave the list of the second point as it was
  turbomap::fault_list faults;
  const auto summary = turbomap::cull_recent_points(static_cast<turbomap::map_mirror<pointer_map>&>(m), recent, 2, {},
                                                    turbomap::fault_sink(faults));
  REQUIRE(faults.size() == 1);
  CHECK(faults[0].keypoint == 1);
  CHECK(summary.dropped == 1);
  CHECK(keyframe.points[0] == nullptr);
  CHECK(keyframe.points[1] == other);
}

/// A small point, a large one and another; a plan of duplicates, and a slot that others gave to the other without telling its list,
/// or anybody.
struct contradicted_merge {
  mirrored_pointer_map m;
  turbomap::map_point_id small, large, other;
  std::vector<turbomap::map_keyframe_id> targets;
  std::vector<turbomap::duplicate<std::int32_t>> plan;
  turbomap::fusion_commit<mirrored_pointer_map> fusion;

  contradicted_merge() {
    for (std::uint32_t k = 0; k < 9; ++k) turbomap_test::insert_keyframe(m, random_keypoints(k, 1, 8, 20), k, {});
    small = point_seen_by({0, 1}), large = point_seen_by({2, 3, 4}), other = point_seen_by({8});
  }
  turbomap::map_keyframe_id keyframe(std::size_t k) { return m.number(&m.objects.keyframes[k]); }
  turbomap::map_point_id point_seen_by(std::initializer_list<std::size_t> keyframes) {
    const auto p = traits::add_point(m, {1, 2, 3}, keyframe(*keyframes.begin()));
    for (const std::size_t k : keyframes) REQUIRE(turbomap::observe(m, p, keyframe(k), 2));
    return p;
  }
  pointer_point*& slot(std::size_t k) { return m.objects.keyframes[k].points[2]; }
  /// The small point, or the large one, is found in a keyframe.
  void found(bool is_small, std::size_t k) {
    plan.push_back({static_cast<std::int32_t>(targets.size()), 0, is_small ? 1 : 0, 2, 1});
    targets.push_back(keyframe(k));
  }
  turbomap::fusion_summary fuse(const turbomap::fault_sink& sink) {
    const std::vector<turbomap::map_point_id> points{large, small};
    return fusion(m, turbomap::span<const turbomap::duplicate<std::int32_t>>(plan),
                  turbomap::span<const turbomap::map_keyframe_id>(targets),
                  turbomap::span<const turbomap::map_point_id>(points), {}, sink);
  }
  /// It gains views first, so that the large one goes.
  void find_small_one_often() {
    for (const std::size_t k : {5U, 6U, 2U, 4U}) found(true, k);
  }
};

TEST_CASE("a merge looks again at the slots of the point that goes, whichever entry made it that one") {
  contradicted_merge s;
  std::size_t contradicted = 1, refused = 1;
  SUBCASE("the one with fewer views goes") { s.found(false, 0); }
  SUBCASE("it gains views first, so that the other one goes") {
    contradicted = 3, refused = 2;
    s.find_small_one_often();
  }
  SUBCASE("slots of the one that stays are not written to") {
    contradicted = 3, refused = 0;
    s.found(false, 0);
  }
  s.slot(contradicted) = s.m.name(s.other);
  turbomap::fault_list faults;
  const auto summary = s.fuse(turbomap::fault_sink(faults));
  const auto is_refused = [](turbomap::fusion_action a) { return a == turbomap::fusion_action::refused; };
  CHECK(std::count_if(s.fusion.actions().begin(), s.fusion.actions().end(), is_refused) ==
        static_cast<std::ptrdiff_t>(refused));
  CHECK(faults.size() == (refused > 0 ? 1 : 0));
  CHECK(summary.entries + refused == s.plan.size());
  CHECK(summary.merged == (refused > 0 ? 0 : 1));
  CHECK(s.slot(contradicted) == s.m.name(s.other));
}

TEST_CASE(
    "where contradictions are thrown, all slots of the points of a plan are looked at before anything is written") {
  contradicted_merge s;
  s.find_small_one_often();
  s.slot(3) = s.m.name(s.other);
  CHECK_THROWS_AS(s.fuse({}), turbomap::inconsistent_map);
  CHECK(traits::point_at(s.m, s.keyframe(5), 2) == turbomap::map_point_id{});
  CHECK(traits::alive(s.m, s.small));
  CHECK(s.slot(3) == s.m.name(s.other));
}

TEST_CASE("an edit that ends between the list of a point and its slot: octaves are counted again") {
  using traits = turbomap::map_traits<turbomap::map_mirror<slotless_map>>;
  slotless_map map;
  turbomap::map_mirror<slotless_map> mirror(map);
  const auto a = mirror.number(insert_keyframe(map, {make_keypoint(0)}, 0, nullptr));
  const auto b = mirror.number(insert_keyframe(map, {make_keypoint(0)}, 1, nullptr));
  const auto p = traits::add_point(mirror, {1, 2, 3}, a);
  REQUIRE(turbomap::observe(mirror, p, a, 0));
  map.fails = true;
  unsigned counted = 0;
  SUBCASE("gained") {
    CHECK_THROWS_AS(turbomap::observe(mirror, p, b, 0), std::bad_alloc);
    counted = 2;
  }
  SUBCASE("lost") { CHECK_THROWS_AS(turbomap::forget(mirror, a, 0), std::bad_alloc); }
  map.fails = false;
  turbomap::look_at_list(mirror, p);
  CHECK(traits::octave_counts(mirror, p)[0] == counted);
}

TEST_CASE("a new point has no descriptor until it is described, in a place that another point had, too") {
  furnished f(5);
  const std::vector<std::uint8_t> bytes(32, 0xAA);
  const auto k = f.m.number(f.keyframe());
  for (int n = 0; n < 2; ++n) {
    CAPTURE(n);
    const auto p = traits::add_point(f.m, {1, 2, 3}, k);
    CHECK(traits::descriptor_data(f.m, p) == nullptr);
    traits::set_appearance(f.m, p, {0, 0, 1}, 1, 2, bytes.data());
    REQUIRE(traits::descriptor_data(f.m, p) != nullptr);
    CHECK(traits::descriptor_data(f.m, p)[31] == 0xAA);
    turbomap::erase_point(f.m, p);
  }
}

TEST_CASE("a merge of others is followed through points that the mirror has never seen") {
  furnished f(5);
  auto& map = f.m.objects;
  auto* const first = f.point();
  const auto p = f.m.number(first);
  REQUIRE(traits::alive(f.m, p));
  auto* const middle = user_traits::add_point(map, {1, 2, 3}, f.keyframe());
  auto* const last = user_traits::add_point(map, {1, 2, 3}, f.keyframe());
  std::vector<std::pair<pointer_keyframe*, std::size_t>> views;
  REQUIRE(turbomap::merge_points(map, first, middle, turbomap::merge_rule::drop, views));
  REQUIRE(turbomap::merge_points(map, middle, last, turbomap::merge_rule::drop, views));
  f.m.refresh();
  f.m.hear();
  CHECK(f.m.name(turbomap::resolve(f.m, p)) == last);
}

TEST_CASE("what tracking associates is counted at a point that was read before, as in a count of all") {
  pointer_map map;
  turbomap::map_mirror<pointer_map> mirror(map);
  auto* const first = insert_keyframe(map, {make_keypoint(3), make_keypoint(4, 0, 5)}, 0, nullptr);
  auto* const p = user_traits::add_point(map, {1, 2, 3}, first);
  auto* const q = user_traits::add_point(map, {2, 2, 3}, first);
  REQUIRE(turbomap::observe(map, p, first, 0));
  REQUIRE(turbomap::observe(map, q, first, 1));
  const auto of_p = mirror.number(p), of_q = mirror.number(q);
  REQUIRE(turbomap::measurement_count(mirror, of_p) == 1);  // read, and counted
  REQUIRE(turbomap::measurement_count(mirror, of_q) == 2);
  // Both cameras of the next keyframe see p, the second one more finely.
  auto* const k = insert_keyframe(map, {make_keypoint(2), make_keypoint(5, 0, 7), make_keypoint(1, 1)}, 1, nullptr);
  REQUIRE(turbomap::observe(map, p, k, 0));
  REQUIRE(turbomap::observe(map, q, k, 1));
  REQUIRE(turbomap::observe(map, p, k, 2));
  std::size_t slot = 0;
  while (mirror.take_associations(mirror.number(k), slot, 1)) {
  }
  for (const auto& [number, name] : {std::pair(of_p, p), std::pair(of_q, q)}) {
    CHECK(turbomap::measurement_count(mirror, number) == turbomap::measurement_count(map, name));
    turbomap::map_mirror<pointer_map> anew(map);
    const auto kept = traits::octave_counts(mirror, number), counted = traits::octave_counts(anew, anew.number(name));
    REQUIRE(kept.size() == counted.size());
    for (std::size_t o = 0; o < kept.size(); ++o) CHECK(kept[o] == counted[o]);
  }
  CHECK(traits::octave_counts(mirror, of_p)[1] == 1);
  CHECK(traits::octave_counts(mirror, of_q)[5] == 1);
}

TEST_CASE("associations are read in parts; what was read before somebody said that all has changed is read anew") {
  for (const bool said : {false, true}) {
    CAPTURE(said);
    furnished f(9);
    auto& map = f.m.objects;
    auto* const p = user_traits::add_point(map, {1, 2, 3}, f.keyframe());
    auto* const k = turbomap_test::insert_keyframe(map, random_keypoints(1, 2, 8, 20), 10, nullptr);
    REQUIRE(turbomap::observe(map, p, k, 0));
    auto* const last = f.point();
    REQUIRE(turbomap::observe(map, last, k, 39));
    const auto number = f.m.number(k);
    std::size_t slot = 0;
    REQUIRE(f.m.take_associations(number, slot, 30));
    CHECK(slot > 0);
    CHECK(slot < 39);
    turbomap::forget(map, k, 0);  // others hold the guard between two parts
    if (said) f.m.refresh();
    turbomap::hear_refresh(static_cast<const turbomap::map_mirror<pointer_map>&>(f.m));
    while (f.m.take_associations(number, slot, 1)) {
    }
    CHECK(slot == 40);
    CHECK((traits::point_at(f.m, number, 0) == turbomap::map_point_id{}) == said);
    CHECK(f.m.name(traits::point_at(f.m, number, 39)) == last);
  }
}

TEST_CASE(
    "points forget a keyframe that is taken out before its slots were read, and the mirror lets go of what others "
    "erase") {
  furnished f(9);
  auto& map = f.m.objects;
  auto* const p = user_traits::add_point(map, {1, 2, 3}, f.keyframe());
  auto* const k = turbomap_test::insert_keyframe(map, random_keypoints(1, 2, 8, 20), 10, nullptr);
  REQUIRE(turbomap::observe(map, p, k, 3));
  const auto mine = f.m.number(p);
  REQUIRE(traits::alive(f.m, mine));  // the point is read, its keyframe is not
  const auto number = f.m.number(k);
  turbomap::erase_keyframe(map, k, -1);
  f.m.removed(k->id);
  int views = 0;
  traits::for_each_observation(f.m, mine, [&](turbomap::map_keyframe_id, std::size_t) { ++views; });
  CHECK(views == 0);
  CHECK(traits::keypoint_count(f.m, number) == 0);
  CHECK(differences(f.m) == 0);

  auto* const erased = f.point();
  const auto gone = f.m.number(erased);
  f.m.changed(erased);
  turbomap::erase_point(map, erased);
  f.m.begin();
  f.m.check_sample(1);  // nobody asks for it
  f.m.begin();
  CHECK(f.m.name(gone) == nullptr);
  CHECK(f.m.name(number) == nullptr);
  CHECK(differences(f.m) == 0);
}

TEST_CASE("a point that is reported when another has its place in the user's map already is read anew") {
  using traits = turbomap::map_traits<turbomap::map_mirror<flat_map>>;
  flat_map map;
  turbomap::map_mirror<flat_map> mirror(map);
  const auto k = insert_keyframe(map, {make_keypoint(0), make_keypoint(0)}, 0, {});
  const auto erased = map.add_point({1, 2, 3}, k);
  REQUIRE(turbomap::observe(map, erased, k, 0));
  const auto mine = mirror.number(erased);
  REQUIRE(traits::alive(mirror, mine));
  turbomap::erase_point(map, erased);
  const auto other = map.add_point({1, 2, 3}, k);
  REQUIRE(other.index == erased.index);  // so nobody can ask for the id of the first one
  mirror.changed(erased);
  mirror.hear();
  CHECK_FALSE(traits::alive(mirror, mine));
  CHECK(traits::alive(mirror, mirror.number(other)));
}

TEST_CASE("many points are reported whose places others have already: all of them are read anew") {
  using traits = turbomap::map_traits<turbomap::map_mirror<flat_map>>;
  flat_map map;
  turbomap::map_mirror<flat_map> mirror(map);
  std::vector<turbomap::keypoint> keypoints(20, make_keypoint(0));
  const auto k = insert_keyframe(map, keypoints, 0, {});
  std::vector<turbomap::map_point_id> erased;
  std::vector<decltype(mirror.number(erased[0]))> mine;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    erased.push_back(map.add_point({1, 2, 3}, k));
    REQUIRE(turbomap::observe(map, erased[i], k, i));
    mine.push_back(mirror.number(erased[i]));
    REQUIRE(traits::alive(mirror, mine[i]));
  }
  for (const auto p : erased) turbomap::erase_point(map, p);
  for (std::size_t i = 0; i < erased.size(); ++i) map.add_point({1, 2, 3}, k);
  for (const auto p : erased) mirror.changed(p);
  mirror.hear();
  for (const auto p : mine) CHECK_FALSE(traits::alive(mirror, p));
}

TEST_CASE(
    "points that a commit has found dead and that are reported afterwards are no reason to read everything anew") {
  furnished f(9);
  std::vector<pointer_point*> erased;
  std::vector<turbomap::map_point_id> kept;
  for (auto& p : f.m.objects.points) {
    const auto mine = f.m.number(&p);
    REQUIRE(traits::alive(f.m, mine));  // all are read
    if (erased.size() < 30)
      erased.push_back(&p);
    else
      kept.push_back(mine);
  }
  for (auto* const p : erased) {
    const auto mine = f.m.number(p);
    turbomap::erase_point(f.m.objects, p);
    traits::look_whether_alive(f.m, mine);
    REQUIRE(!traits::alive(f.m, mine));
  }
  for (const auto p : kept) REQUIRE(f.m.copy().points.entries[static_cast<std::size_t>(p.index)].read == 1);
  for (auto* const p : erased) f.m.changed(p);
  f.m.begin();
  std::size_t unread = 0;
  for (const auto p : kept) unread += f.m.copy().points.entries[static_cast<std::size_t>(p.index)].read == 0 ? 1 : 0;
  CHECK(unread == 0);
  CHECK(differences(f.m) == 0);
}

TEST_CASE(
    "an unreported change of a keyframe is found within as many calls as the map has keyframes, however many were "
    "erased") {
  mirrored_pointer_map m;
  add_seen_point(m, 40, 40);
  for (auto& k : m.objects.keyframes) REQUIRE(traits::alive(m, m.number(&k)));  // all are read
  for (auto& k : m.objects.keyframes) {
    if (k.id % 10 == 5) continue;  // four stay
    turbomap::erase_keyframe(m.objects, &k);
    m.removed(k.id);
  }
  m.changed(&m.objects.points[0]);
  m.begin();
  for (const std::size_t moved : {5U, 35U, 15U}) {
    CAPTURE(moved);
    m.objects.keyframes[moved].T_cw.tx += 1;
    std::size_t healed = 0;
    for (int n = 0; n < 4; ++n) healed += m.check_sample(1e-9);
    CHECK(healed == 1);
  }
  for (auto& k : m.objects.keyframes)
    if (!k.bad) turbomap::erase_keyframe(m.objects, &k), m.removed(k.id);
  CHECK(m.check_sample(1e-9) == 0);  // nobody is left to look at
}

TEST_CASE("reports that nobody hears do not pile up: too many, or one that everything changed, stand for all") {
  using reports_type = turbomap::mirror_reports<pointer_map>;
  reports_type reports;
  pointer_point p;
  pointer_keyframe k;
  const auto check = [&](std::size_t points, std::size_t keyframes, bool all) {
    const auto taken = reports.take();
    CHECK(taken.points.size() == points);
    CHECK(taken.keyframes.size() == keyframes);
    CHECK(taken.all == all);
  };
  for (std::size_t n = 0; n + 1 < reports_type::most; ++n) reports.add(&p);
  reports.add(&k);
  check(reports_type::most - 1, 1, false);
  for (std::size_t n = 0; n < reports_type::most; ++n) reports.add(&p);
  reports.add(&k), reports.add(&p);
  check(0, 0, true);
  reports.add(&p), reports.add(&k);
  reports.add_all();
  reports.add(&p), reports.add(&k);
  check(0, 0, true);
  reports.add(&p);
  check(1, 0, false);
}

TEST_CASE("who reports may hold the lock of the object") {
  furnished f(3);
  pointer_keyframe& k = f.m.objects.keyframes[0];
  std::atomic<bool> done{false};
  std::atomic<int> reports{0}, heard{0};
  std::thread other([&] {
    while (!done) {
      if (reports - heard > 10) continue;
      const std::lock_guard<std::mutex> lock(k.mutex);
      f.m.changed(&k);
      ++reports;
    }
  });
  while (heard < 10000) {
    const int now = reports;
    f.m.hear();
    heard = now;
  }
  done = true;
  other.join();
}

TEST_CASE("another thread edits the map and reports it") {
  furnished f(7);
  f.edits_before_commit = false;
  std::mutex guard;
  std::atomic<bool> done{false};
  std::atomic<int> edits{0};
  std::thread other([&] {
    while (!done) {
      std::lock_guard<std::mutex> lock(guard);
      f.edit();
      ++edits;
      f.m.refresh();
      f.m.changed(f.point());
    }
  });
  for (int round = 0; round < 300 || edits == 0; ++round) {
    f.m.changed(&f.m.objects.keyframes[0]);
    std::lock_guard<std::mutex> lock(guard);
    f.m.hear();
    if (round % 10 == 0) CHECK(differences(f.m) == 0);
    f.commit();
    REQUIRE(faults_of(f.m.objects).empty());
  }
  done = true;
  other.join();
}

}  // namespace
