// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A redundant keyframe of many points is taken out in parts, between which others have the map. The map is the one that an erasure
/// at once makes; no part takes more observations than it may; whatever others do in between, and whatever throws, the map is
/// sound, and no point that lost a view is forgotten.

#include <turbomap/map/map_edit.hpp>
#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/keyframe_culling.hpp>
#include <turbomap/mapping/working_map.hpp>

#include <thrust/detail/seq.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "scenes/failing_map.hpp"
#include "scenes/map_scene.hpp"
#include "scenes/mapping_scene.hpp"
#include "scenes/watched_map.hpp"
#include "support/counted_new.hpp"
#include "support/fail_everywhere.hpp"

namespace turbomap_test {

/// Knows who keeps keyframes, counts observations that are taken away while the guard is held once, and fails when told.
struct parted_map : watched_map<turbomap::binary_descriptor<256>> {
  using watched_map<turbomap::binary_descriptor<256>>::watched_map;
  std::set<std::uint64_t> pinned;                              ///< ids of keyframes
  long taken = 0, most_taken = 0;                              ///< observations in this hold; in any
  mutable long calls_left = std::numeric_limits<long>::max();  ///< until they throw
  mutable long reads_left = std::numeric_limits<long>::max();  ///< the same of reads of observations

  void may_throw() const {
    if (calls_left-- <= 0) throw broken_write();
  }
};

/// The same map, of which the stage works on a copy.
using mirrored_parted_map = mirrored_map<parted_map>;

/// Observations of a parted_map cannot be taken away, from call `n` on.
struct broken_writes_after {
  explicit broken_writes_after(long n) { broken->calls_left = n; }
  broken_writes_after(const broken_writes_after&) = delete;
  broken_writes_after& operator=(const broken_writes_after&) = delete;
  ~broken_writes_after() { broken->calls_left = std::numeric_limits<long>::max(); }
  static inline const parted_map* broken = nullptr;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::parted_map>
    : turbomap::map_traits<turbomap_test::watched_map<turbomap::binary_descriptor<256>>> {
  using map = turbomap_test::parted_map;
  using base = turbomap::map_traits<turbomap_test::watched_map<turbomap::binary_descriptor<256>>>;
  static bool may_erase(const map& m, keyframe k) { return m.pinned.count(id(m, k)) == 0; }
  static keyframe previous(const map& m, keyframe k) {
    CHECK(m.alive(k));
    return base::previous(m, k);
  }
  template <class F>
  static void for_each_observation(const map& m, point p, F f) {
    if (m.reads_left-- <= 0) throw turbomap_test::broken_write();
    base::for_each_observation(m, p, f);
  }
  static void erase_observation(map& m, point p, keyframe k, std::size_t i) {
    m.may_throw();
    base::erase_observation(m, p, k, i);
    m.most_taken = std::max(m.most_taken, ++m.taken);
  }
};

namespace {

using namespace turbomap_test;
using keyframe = turbomap::map_keyframe_id;
using point = turbomap::map_point_id;
using traits = turbomap::map_traits<parted_map>;
using policy = std::decay_t<decltype(thrust::seq)>;

constexpr std::size_t keyframes = 9, points = 120, keypoints = 320;
constexpr std::size_t current = keyframes - 1, candidate = 4;  // the last sees what the candidate sees

struct id_less {
  bool operator()(const point& a, const point& b) const {
    return a.index != b.index ? a.index < b.index : a.generation < b.generation;
  }
};
using point_set = std::set<point, id_less>;

/// Keyframes of rigs of two cameras that see most of the same points, some of them by both cameras; a few points are seen by the
/// candidate and one other keyframe only, so they die with it.
template <class Map>
struct world {
  Map map;
  std::vector<keyframe> k;
  std::vector<point> p;

  explicit world(std::uint32_t seed = 1) {
    std::mt19937 random(seed);
    for (std::size_t i = 0; i < keyframes; ++i)
      k.push_back(map.add_keyframe(random_keypoints(static_cast<std::uint32_t>(random()), 2, 5, keypoints / 2), {},
                                   0.1 * static_cast<double>(i), i == 0 ? keyframe{} : k.back()));
    const std::uint8_t descriptor[32] = {};
    for (std::size_t j = 0; j < points; ++j) {
      const std::size_t first = j % 10 == 0 ? candidate : random() % keyframes;
      p.push_back(map.add_point({0, 0, static_cast<double>(j)}, k[first]));
      traits::set_appearance(map, p[j], {0, 0, 1}, 1, 2, descriptor);
      for (std::size_t i = 0; i < keyframes; ++i) {
        if (j % 10 == 0 ? i != candidate && i != current : i != first && random() % 5 == 0) continue;
        see(i, j, random() % (keypoints / 2));
        if (random() % 3 == 0) see(i, j, keypoints / 2 + random() % (keypoints / 2));  // by the right camera too
      }
    }
    map.watch.after = [this] { map.taken = 0; };
    REQUIRE(turbomap::validate(map).empty());
  }
  world(const world&) = delete;
  world& operator=(const world&) = delete;

  /// Keypoints of the candidate that see a point, in their order.
  std::vector<std::size_t> seen() const {
    std::vector<std::size_t> all;
    if (!map.alive(k[candidate])) return all;
    for (std::size_t i = 0; i < keypoints; ++i)
      if (traits::point_at(map, k[candidate], i) != point{}) all.push_back(i);
    return all;
  }
  point_set seen_points() const {
    point_set all;
    for (const std::size_t i : seen()) all.insert(traits::point_at(map, k[candidate], i));
    return all;
  }

 private:
  void see(std::size_t i, std::size_t j, std::size_t keypoint) {
    while (traits::point_at(map, k[i], keypoint) != point{})
      keypoint = keypoint < keypoints / 2 ? (keypoint + 1) % (keypoints / 2)
                                          : keypoints / 2 + (keypoint + 1 - keypoints / 2) % (keypoints / 2);
    turbomap::observe(map, p[j], k[i], keypoint);
  }
};

turbomap::keyframe_culling_options redundant() {
  turbomap::keyframe_culling_options o;
  o.redundant_share = 0, o.observers = 1;
  return o;
}

/// The stage on a world.
template <class Map>
class culling {
 public:
  using stage_map = typename turbomap::working_map<Map>::type;

  explicit culling(world<Map>& w, int points_read_per_guard)
      : world_(w), working_(w.map), scope_{ctx_, working_.get(), store_, stored_, held, {}, points_read_per_guard} {
    for (std::size_t i = 0; i < keyframes; ++i) stored_.add(i, {static_cast<std::uint32_t>(i), 1});
    scope_.faults = turbomap::fault_sink(faults);
  }
  turbomap::guard_times held;
  turbomap::fault_list faults;
  std::vector<std::string> called;
  std::function<void(const std::string&)> when_called = [](const std::string&) {};

  /// \return the first candidate
  keyframe list() {
    working_.begin();
    const auto& all = stage_.snapshot(scope_, working_.number(world_.k[current]), {});
    held = {};
    called.clear(), called.reserve(8), world_.map.most_taken = 0;
    return all.empty() ? keyframe{} : working_.name(all[0]);
  }
  void forget_all() { stage_.clear(); }
  void remove(std::uint64_t id) { stored_.erase(id); }
  void commit(const turbomap::keyframe_culling_options& options = redundant()) {
    const auto call = [this](const std::string& name) { called.push_back(name), when_called(name); };
    const auto candidate_of = [&](const auto& k) { CHECK(working_.name(k) == world_.k[candidate]); };
    stage_.commit(
        scope_, working_.number(world_.k[current]), working_.number(world_.k[candidate]), options,
        [&](const auto& k) {
          candidate_of(k);
          call("erasing");
        },
        [&](const auto& k) {
          candidate_of(k);
          call("leaving");
        },
        [&](std::uint64_t id) {
          CHECK(id == candidate);
          call("erased");
        });
  }
  void strict() { scope_.faults = {}; }
  /// Names of the user's map.
  point_set touched() const {
    point_set all;
    for (const auto& p : stage_.touched()) all.insert(working_.name(p));
    return all;
  }
  /// Whether the stage reads what the map has.
  void check_copy() const {
    if constexpr (turbomap::is_mirrored_v<Map>) {
      using copy = turbomap::map_traits<stage_map>;
      for (const point& p : world_.p) {
        if (!world_.map.alive(p)) continue;
        std::set<std::pair<std::uint64_t, std::size_t>> a, b;
        const auto& m = scope_.map;
        const auto q = working_.number(p);
        CHECK(copy::alive(m, q));
        copy::for_each_observation(m, q, [&](auto k, std::size_t i) { a.insert({copy::id(m, k), i}); });
        traits::for_each_observation(world_.map, p, [&](keyframe k, std::size_t i) {
          b.insert({traits::id(world_.map, k), i});
        });
        CHECK(a == b);
        CHECK(working_.name(copy::reference(m, q)) == traits::reference(world_.map, p));
      }
    }
  }

 private:
  world<Map>& world_;
  turbomap::context<policy> ctx_;
  turbomap::store_of<stage_map, policy> store_;
  turbomap::handle_table stored_;
  turbomap::working_map<Map> working_;
  turbomap::mapping_scope<stage_map, policy> scope_;
  turbomap::keyframe_culling<stage_map, policy> stage_;
};

/// Points that the candidate saw and that live on.
template <class Map>
point_set left_of(const world<Map>& before, const world<Map>& after) {
  point_set all;
  for (const std::size_t i : before.seen()) {
    const point p = traits::point_at(before.map, before.k[candidate], i);
    if (after.map.alive(p)) all.insert(p);
  }
  return all;
}
template <class Map>
point_set living(const world<Map>& w, const point_set& all) {
  point_set alive;
  for (const point& p : all)
    if (w.map.alive(p)) alive.insert(p);
  return alive;
}

TEST_CASE_TEMPLATE("the map of an erasure at once, whatever the size of a part", Map, parted_map, mirrored_parted_map) {
  for (std::uint32_t seed = 1; seed < 6; ++seed) {
    const world<Map> before(seed);
    const std::size_t seen = before.seen().size();
    REQUIRE(seen > 80);
    world<Map> expected(seed);
    turbomap::erase_keyframe(static_cast<parted_map&>(expected.map), expected.k[candidate]);
    CHECK(left_of(before, expected).size() < before.seen_points().size());
    for (const int part : {0, 1, 5, 80, 1000}) {
      CAPTURE(part);
      world<Map> w(seed);
      culling<Map> c(w, part);
      c.list();
      c.when_called = [&](const std::string& name) {
        CHECK(w.seen().size() == (name == "erasing" ? seen : 0));
        CHECK(w.map.alive(w.k[candidate]) == (name != "erased"));
      };
      c.commit();
      CHECK(c.called == std::vector<std::string>{"erasing", "leaving", "erased"});
      CHECK(content(static_cast<const parted_map&>(w.map)) == content(static_cast<const parted_map&>(expected.map)));
      CHECK(living(w, c.touched()) == left_of(before, w));
      CHECK(c.faults.empty());
      c.check_copy();
      // Of points that die, the other observations go too: here one or two.
      const std::size_t quarter = part == 0 ? seen : static_cast<std::size_t>(part + 3) / 4;
      CHECK(w.map.most_taken <= static_cast<long>(3 * quarter));
      const std::size_t holds = quarter >= seen ? 1 : 1 + (seen + quarter - 1) / quarter;
      CHECK(c.held.count >= (quarter >= seen ? 1 : holds - holds / 16 - 1));  // a point that dies may leave two slots
      CHECK(c.held.count <= holds + 1);  // behind the last point there are empty slots
    }
  }
}

TEST_CASE("no part takes more observations than it may") {
  // Points that live on lose one observation each, so every write is one of the part.
  for (const std::size_t part : {std::size_t{4}, std::size_t{24}, std::size_t{40}}) {
    world<parted_map> w;
    for (std::size_t j = 0; j < points; j += 10) turbomap::erase_point(w.map, w.p[j]);
    auto options = redundant();
    options.fewest_measurements = -1;  // none dies
    culling<parted_map> c(w, static_cast<int>(part));
    c.list();
    c.commit(options);
    CHECK(c.called.size() == 3);
    CHECK(w.map.most_taken == static_cast<long>(part / 4));
  }
}

/// What somebody does to the map before guard `at` of a commit, 0 being the one in which it is decided.
template <class Map>
struct intervention {
  std::function<void(world<Map>&)> what;
  std::function<void(world<Map>&, culling<Map>&)> check;  ///< afterwards
  turbomap::keyframe_culling_options options = redundant();
  bool sound = true;  ///< what it leaves
};

constexpr int part_of_interventions = 40;  // ten points

template <class Map>
void intervene(const intervention<Map>& i) {
  int guards = 2;
  for (int at = 1; at < guards; ++at) {
    CAPTURE(at);
    world<Map> w(2);
    const world<Map> before(2);
    culling<Map> c(w, part_of_interventions);
    c.list();
    int guard = 0;
    w.map.watch.before = [&] {
      CHECK(turbomap::validate(w.map).empty());
      if (guard++ == at) i.what(w);
    };
    c.commit(i.options);
    w.map.watch.before = {};
    if (i.sound) CHECK(turbomap::validate(w.map).empty());
    // All that lost a view to the commit, and is there yet, is named.
    CHECK(c.touched().size() >= (at > 1 ? std::size_t{5} : std::size_t{0}));
    if (at == 1) guards = std::max(guard, 12);
    if (guard <= at) break;
    i.check(w, c);
  }
}

TEST_CASE_TEMPLATE("somebody erases the keyframe between two parts", Map, parted_map, mirrored_parted_map) {
  intervene<Map>({[](auto& w) { turbomap::erase_keyframe(static_cast<parted_map&>(w.map), w.k[candidate]); },
                  [](auto& w, auto& c) {
                    CHECK_FALSE(w.map.alive(w.k[candidate]));
                    CHECK(c.called == std::vector<std::string>{"erasing"});
                  }});
}

TEST_CASE_TEMPLATE("somebody erases it, and puts another one in its place", Map, parted_map, mirrored_parted_map) {
  intervene<Map>({[](auto& w) {
                    auto& map = static_cast<parted_map&>(w.map);
                    turbomap::erase_keyframe(map, w.k[candidate]);
                    const auto added = map.add_keyframe(random_keypoints(9, 2, 5, keypoints / 2), {}, 2, w.k[current]);
                    turbomap::observe(map, w.p[current], added, 3);
                    w.k.push_back(added);
                  },
                  [](auto& w, auto& c) {
                    CHECK(w.k.back().index == w.k[candidate].index);
                    CHECK(traits::point_at(w.map, w.k.back(), 3) == w.p[current]);
                    CHECK(c.called == std::vector<std::string>{"erasing"});
                  }});
}

TEST_CASE_TEMPLATE("somebody adds observations to it", Map, parted_map, mirrored_parted_map) {
  std::size_t added = 0;
  intervene<Map>({[&](auto& w) {
                    auto& map = static_cast<parted_map&>(w.map);
                    const auto first = w.seen().empty() ? keypoints : w.seen().front();
                    // Into slots that were emptied, and one behind.
                    for (std::size_t i = 0, j = 1; i < keypoints && j < 40; ++i)
                      if ((i < first || i > 150) && traits::point_at(map, w.k[candidate], i) == point{} && j % 10 != 0)
                        added += turbomap::observe(map, w.p[j++], w.k[candidate], i) ? std::size_t{1} : std::size_t{0};
                  },
                  [](auto& w, auto& c) {
                    CHECK_FALSE(w.map.alive(w.k[candidate]));
                    CHECK(c.called == std::vector<std::string>{"erasing", "leaving", "erased"});
                    CHECK(c.faults.empty());
                  }});
  CHECK(added > 30);
}

TEST_CASE_TEMPLATE("somebody keeps it from being erased", Map, parted_map, mirrored_parted_map) {
  std::vector<std::size_t> left;
  intervene<Map>({[&](auto& w) { w.map.pinned.insert(candidate), left = w.seen(); },
                  [&](auto& w, auto& c) {
                    CHECK(w.map.alive(w.k[candidate]));
                    CHECK(w.seen() == left);  // nothing is taken since
                    CHECK(c.called == std::vector<std::string>{"erasing"});
                    // What it lost before is due.
                    const world<Map> before(2);
                    point_set lost;
                    for (const std::size_t i : before.seen())
                      if (std::count(left.begin(), left.end(), i) == 0)
                        lost.insert(traits::point_at(before.map, before.k[candidate], i));
                    CHECK(living(w, c.touched()) == living(w, lost));
                    c.commit();  // kept from the beginning
                    CHECK(w.seen() == left);
                    CHECK(c.called.size() == 1);
                    w.map.pinned.clear();
                    c.list();
                    c.commit();
                    CHECK_FALSE(w.map.alive(w.k[candidate]));
                    CHECK(turbomap::validate(w.map).empty());
                  }});
}

TEST_CASE_TEMPLATE("time keeps it once its neighbour is gone", Map, parted_map, mirrored_parted_map) {
  auto options = redundant();
  options.temporal_guards = true, options.keep_keyframes = 2, options.keep_last = 1;
  options.max_gap = options.max_old_gap = 0.25;
  const auto stays = [](auto& w, auto& c) {
    CHECK(w.map.alive(w.k[candidate]));
    CHECK(c.called == std::vector<std::string>{"erasing"});
  };
  intervene<Map>(
      {[](auto& w) { turbomap::erase_keyframe(static_cast<parted_map&>(w.map), w.k[candidate + 1]); }, stays, options});
  // Nobody can tell where a keyframe that is gone stands in time.
  intervene<Map>(
      {[](auto& w) { turbomap::erase_keyframe(static_cast<parted_map&>(w.map), w.k[current]); }, stays, options});
}

TEST_CASE_TEMPLATE("somebody edits its points", Map, parted_map, mirrored_parted_map) {
  const auto gone = [](auto& w, auto& c) {
    CHECK_FALSE(w.map.alive(w.k[candidate]));
    CHECK(c.called == std::vector<std::string>{"erasing", "leaving", "erased"});
    CHECK(c.faults.empty());
  };
  for (int kind = 0; kind < 4; ++kind) {
    CAPTURE(kind);
    intervene<Map>({[&](auto& w) {
                      auto& map = static_cast<parted_map&>(w.map);
                      const keyframe k = w.k[candidate];
                      std::vector<std::pair<keyframe, std::size_t>> scratch;
                      std::mt19937 random(3);
                      for (const std::size_t i : w.seen()) {
                        const point p = traits::point_at(map, k, i), q = w.p[random() % points];
                        if (p == point{} || random() % 2 == 0) continue;
                        if (kind == 0) turbomap::erase_point(map, p);
                        if (kind == 1 && map.alive(q))
                          turbomap::merge_points(map, p, q, turbomap::merge_rule::drop, scratch);
                        if (kind == 2) turbomap::forget(map, k, i);
                        if (kind == 3) turbomap::move_observation(map, k, i, random() % keypoints);
                      }
                    },
                    gone});
  }
}

TEST_CASE_TEMPLATE("it was made to contradict itself", Map, parted_map, mirrored_parted_map) {
  std::string left;
  intervention<Map> i{[&](auto& w) {
                        auto& map = static_cast<parted_map&>(w.map);
                        const auto seen = w.seen();
                        REQUIRE(!seen.empty());
                        // Past forget(): the last slot of a point that does not list it.
                        traits::base::erase_observation(map, traits::point_at(map, w.k[candidate], seen.back()),
                                                        w.k[candidate], seen.back());
                        left = std::to_string(seen.size());
                      },
                      [&](auto& w, auto& c) {
                        CHECK(w.map.alive(w.k[candidate]));
                        CHECK(w.seen().size() <= 10);  // the part in question, and all before were taken
                        CHECK(c.called == std::vector<std::string>{"erasing"});
                        REQUIRE(c.faults.size() >= 1);
                        CHECK(c.faults[0].fault == turbomap::map_fault::slot_without_observation);
                      },
                      redundant(), false};
  world<Map> w(2);
  culling<Map> c(w, part_of_interventions);
  c.list();
  int guard = 0;
  w.map.watch.before = [&] {
    if (guard++ == 2) i.what(w);
  };
  c.commit();
  i.check(w, c);

  world<Map> again(2);
  culling<Map> strict(again, part_of_interventions);
  strict.list(), strict.strict();
  guard = 0;
  again.map.watch.before = [&] {
    if (guard++ == 2) i.what(again);
  };
  CHECK_THROWS_AS(strict.commit(), turbomap::inconsistent_map);
  CHECK(strict.touched().size() > 20);
}

/// Every call that may fail does, in turn; a commit that follows ends the work, and no point that lost a view is lost.
template <class Failure, class Error, class Map>
int commit_with_failures() {
  const world<Map> before(3);
  for (int n = 0;; ++n) {
    CAPTURE(n);
    world<Map> w(3);
    broken_writes_after::broken = &w.map;
    culling<Map> c(w, part_of_interventions);
    c.list();
    bool failed = false;
    try {
      const Failure failure(n);
      c.commit();
    } catch (const Error&) {
      failed = true;
    }
    broken_writes_after::broken = nullptr;
    REQUIRE(turbomap::validate(w.map).empty());
    auto touched = c.touched();
    if (failed) {
      CHECK(w.map.alive(w.k[candidate]));
      const auto still = w.seen();
      for (const std::size_t i : before.seen())  // what it lost is named
        if (const point p = traits::point_at(before.map, before.k[candidate], i);
            w.map.alive(p) && std::count(still.begin(), still.end(), i) == 0)
          CHECK(touched.count(p) == 1);
      const bool begun = still.size() < before.seen().size();
      const keyframe first = c.list();
      if (begun) CHECK(first == w.k[candidate]);
      c.commit();
      for (const point& p : c.touched()) touched.insert(p);
    }
    CHECK_FALSE(w.map.alive(w.k[candidate]));
    CHECK(living(w, touched) == left_of(before, w));
    CHECK(turbomap::validate(w.map).empty());
    c.check_copy();
    if (!failed) return n;
  }
}

TEST_CASE_TEMPLATE("traits that throw in the middle", Map, parted_map, mirrored_parted_map) {
  CHECK(commit_with_failures<broken_writes_after, broken_write, Map>() > 80);
}

TEST_CASE("a part that cannot read the map ends with its exception, and the erasure goes on") {
  world<parted_map> w(3);
  auto& map = w.map;
  const keyframe k = w.k[candidate];
  turbomap::erasure_in_parts<parted_map> parts;
  std::vector<point> touched;
  const auto part = [&] { return parts(map, 10, 2, touched, turbomap::fault_sink{}); };
  parts.begin(k, traits::id(map, k));
  REQUIRE(part() == turbomap::erasure_part::some);
  const std::size_t seen = w.seen().size();
  map.reads_left = 0;
  CHECK_THROWS_AS(part(), broken_write);
  map.reads_left = std::numeric_limits<long>::max();
  CHECK(parts.is_of(k));
  CHECK(w.seen().size() == seen);
  while (part() == turbomap::erasure_part::some) {
  }
  CHECK(w.seen().empty());
  CHECK(turbomap::validate(map).empty());
}

TEST_CASE("no memory in the middle") {
  CHECK(commit_with_failures<no_memory_after, std::bad_alloc, parted_map>() > 0);
  CHECK(commit_with_failures<no_memory_after, std::bad_alloc, mirrored_parted_map>() > 10);
}

TEST_CASE_TEMPLATE("hooks that throw", Map, parted_map, mirrored_parted_map) {
  for (const std::string hook : {"erasing", "leaving"}) {
    world<Map> w(3);
    culling<Map> c(w, part_of_interventions);
    c.list();
    c.when_called = [&](const std::string& name) {
      if (name == hook) throw broken_write();
    };
    const std::size_t seen = w.seen().size();
    CHECK_THROWS_AS(c.commit(), broken_write);
    CHECK(w.map.alive(w.k[candidate]));
    CHECK(w.seen().size() == (hook == "erasing" ? seen : 0));
    CHECK(turbomap::validate(w.map).empty());
    c.when_called = [](const std::string&) {};
    if (hook == "leaving") CHECK(c.list() == w.k[candidate]);  // it shares no points with the current one any more
    c.called.clear();
    c.commit();
    CHECK(c.called == std::vector<std::string>{"erasing", "leaving", "erased"});
    CHECK_FALSE(w.map.alive(w.k[candidate]));
    CHECK(turbomap::validate(w.map).empty());
  }
}

TEST_CASE_TEMPLATE("what an exception left is gone on with, unless it is gone", Map, parted_map, mirrored_parted_map) {
  enum { stays, is_erased, leaves_store, is_pinned, map_starts_anew };
  for (const int what : {stays, is_erased, leaves_store, is_pinned, map_starts_anew}) {
    CAPTURE(what);
    world<Map> w(3);
    culling<Map> c(w, part_of_interventions);
    c.list();
    c.when_called = [](const std::string& name) {
      if (name == "leaving") throw broken_write();
    };
    CHECK_THROWS_AS(c.commit(), broken_write);
    c.when_called = [](const std::string&) {};
    if (what == is_erased) turbomap::erase_keyframe(static_cast<parted_map&>(w.map), w.k[candidate]);
    if (what == leaves_store) c.remove(candidate);
    if (what == is_pinned) w.map.pinned.insert(candidate);
    if (what == map_starts_anew) c.forget_all();
    CHECK((c.list() == w.k[candidate]) == (what == stays || what == is_pinned));
    if (what != is_pinned) continue;
    c.commit();
    CHECK(c.called.empty());
    CHECK_FALSE(c.list() == w.k[candidate]);  // it is a keyframe as others
    CHECK(w.map.alive(w.k[candidate]));
  }
}

}  // namespace
