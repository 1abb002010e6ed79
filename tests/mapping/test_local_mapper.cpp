// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The loop of local mapping: stages, hooks, deadlines, the guard of the map; bad keyframes, maps that contradict
/// themselves, other threads, no memory.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <new>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "local_mapper_cases.hpp"
#include "scenes/described_map.hpp"
#include "scenes/lying_map.hpp"
#include "scenes/mirrored_map.hpp"
#include "scenes/watched_map.hpp"
#include "support/counted_new.hpp"
#include "support/environment.hpp"
#include "support/policies.hpp"
#include "support/thread_counts.hpp"

namespace {

using namespace turbomap_test;
using turbomap::mapping_stage;
using turbomap::stage_outcome;
using flat_traits = turbomap::map_traits<flat_map>;

constexpr std::array<mapping_stage, 7> all_stages{
    mapping_stage::process, mapping_stage::point_culling, mapping_stage::search,          mapping_stage::creation,
    mapping_stage::fusion,  mapping_stage::adjustment,    mapping_stage::keyframe_culling};

TEST_CASE("with noise, and landmarks that look alike, it is nearly right") {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    CAPTURE(seed);
    auto recipe = noisy(seed);
    check_good(quality_of(sequential{}, stereo_case(recipe), 14));
    check_good(quality_of(sequential{}, rig_case(recipe), 9));
    recipe.twins = 0.2;
    check_good(quality_of(sequential{}, stereo_case(recipe), 14));
  }
}

// Fisheye keypoints have no depth of their own, so a lookalike half a metre along the epipolar line fits as well as the landmark
// itself where no third view contradicts. Nearly all wrong merges are of points that were made of such matches.
// TURBOMAP_TEST_SEEDS: scenes (3; the table of docs/matching.md is of 400).
TEST_CASE("a fisheye rig among landmarks that look alike side by side") {
  const auto seeds = static_cast<int>(environment("TURBOMAP_TEST_SEEDS", 3));
  const auto run = [&](const char* name, turbomap::creation_rule rule, int fewest_keyframes, double lookalike_ratio) {
    map_quality all;
    for (int seed = 1; seed <= seeds; ++seed) {
      auto recipe = noisy(static_cast<unsigned>(seed));
      recipe.twins = 0.2;
      auto c = rig_case(recipe);
      c.options.creation.rule = rule;
      c.options.creation.fewest_keyframes = fewest_keyframes;
      c.options.creation.lookalike_ratio = lookalike_ratio;
      const auto q = quality_of(sequential{}, c, 12);
      all.merged += q.merged, all.merged_wrongly += q.merged_wrongly, all.points += q.points, all.mixed += q.mixed;
    }
    MESSAGE(std::string(name) << ": " << all.merged << " merged, " << all.merged_wrongly << " of them wrongly; "
                              << all.points << " points left, " << all.mixed << " of them wrong");
    return all;
  };
  using turbomap::creation_rule;
  const double ratio = turbomap::creation_options{}.lookalike_ratio;
  const map_quality pairs = run("pairs", creation_rule::pairs, 1, ratio),
                    any = run("tracks, nobody asks for lookalikes", creation_rule::tracks, 1, 0),
                    one = run("tracks", creation_rule::tracks, 1, ratio),
                    two = run("tracks of two keyframes", creation_rule::tracks, 2, ratio);
  const auto least = static_cast<std::size_t>(300 * seeds);
  CHECK(one.merged > least);
  CHECK(one.merged_wrongly < pairs.merged_wrongly);
  CHECK(one.merged_wrongly * 4 < 3 * any.merged_wrongly);
  CHECK(one.mixed * 3 < 2 * any.mixed);
  CHECK(one.merged_wrongly * 100 < 4 * one.merged);
  CHECK(two.merged > least);
  CHECK(two.merged_wrongly < pairs.merged_wrongly);
  CHECK(two.merged_wrongly * 100 < 3 * two.merged);
  CHECK(two.mixed * 2 < any.mixed);
}

/// A run on pinhole keyframes.
template <class Map = flat_map>
struct stereo_run {
  mapping_case<pinhole_camera> c = stereo_case();
  mapping_scene<pinhole_camera> scene;
  mapping_run<Map, sequential> run;

  explicit stereo_run(const turbomap::local_mapper_options& options = stereo_case().options,
                      turbomap::local_mapper_hooks<Map> hooks = {}, const mapping_recipe& recipe = {})
      : c(stereo_case(recipe)), scene(c.rig, recipe), run(scene, options, std::move(hooks)) {}
  bool sound() const { return turbomap::validate(run.map).empty(); }
};

TEST_CASE("each stage can be switched off: nothing of it happens") {
  for (int off = -1; off < static_cast<int>(all_stages.size()); ++off) {
    CAPTURE(off);
    auto options = stereo_case().options;
    if (off >= 0) options.enabled[all_stages[static_cast<std::size_t>(off)]] = false;
    int adjusted = 0;
    turbomap::local_mapper_hooks<flat_map> hooks;
    hooks.adjust = [&](flat_map&, turbomap::map_keyframe_id, double) { ++adjusted; };
    stereo_run<> r(options, hooks);
    std::size_t neighbours = 0, matches = 0, created = 0, culled = 0, targets = 0, fused = 0, keyframes = 0,
                described = 0;
    for (int n = 0; n < 12; ++n) {
      const auto& report = r.run.step();
      for (const auto s : all_stages) {
        const bool is_off = off >= 0 && s == all_stages[static_cast<std::size_t>(off)];
        CHECK(report.outcome[s] == (is_off ? stage_outcome::off : stage_outcome::done));
        if (is_off) CHECK(report.ms[s] == 0);
      }
      if (n == 0)
        flat_traits::for_each_point(r.run.map, [&](turbomap::map_point_id p) {
          described += flat_traits::max_distance(r.run.map, p) > 0 ? 1 : 0;
        });
      neighbours += report.neighbours, matches += report.matches, created += report.points_created;
      culled += report.points_culled, targets += report.fusion_targets, fused += report.fused.entries;
      keyframes += report.keyframes_culled.size();
      CHECK_FALSE(report.cut);
    }
    const auto is_off = [&](mapping_stage s) { return off >= 0 && s == all_stages[static_cast<std::size_t>(off)]; };
    CHECK((described == 0) == is_off(mapping_stage::process));
    CHECK((culled == 0) == is_off(mapping_stage::point_culling));
    CHECK((neighbours == 0) == is_off(mapping_stage::search));
    CHECK((matches == 0) == (is_off(mapping_stage::search) || is_off(mapping_stage::creation)));
    CHECK((created == 0) == (is_off(mapping_stage::search) || is_off(mapping_stage::creation)));
    CHECK((targets == 0) == is_off(mapping_stage::fusion));
    CHECK((fused == 0) == is_off(mapping_stage::fusion));
    CHECK(adjusted == (is_off(mapping_stage::adjustment) ? 0 : 12));
    if (!is_off(mapping_stage::fusion))  // without it nobody sees a point often enough
      CHECK((keyframes == 0) == is_off(mapping_stage::keyframe_culling));
    CHECK(r.run.map.keyframe_count() == 12 - keyframes);
    CHECK(r.run.store.size() == 12 - keyframes);  // culled ones leave the store too
    CHECK(r.run.mapper.stored().size() == 12 - keyframes);
    CHECK(r.run.mapper.iterations() == 12);
    CHECK(r.sound());
  }
}

TEST_CASE("probation ends while the stage that judges points is off, too") {
  auto options = stereo_case().options;
  options.enabled[mapping_stage::point_culling] = false;
  stereo_run<> r(options);
  std::vector<std::vector<turbomap::map_point_id>> alive;  // after each keyframe
  for (int n = 0; n < 7; ++n) {
    r.run.step();
    alive.emplace_back();
    flat_traits::for_each_point(r.run.map, [&](turbomap::map_point_id p) { alive.back().push_back(p); });
  }
  for (const auto p : alive.back()) r.run.map.seen_in_tracking(p, 100, 1);  // none of them would be kept
  for (const auto s : all_stages) r.run.mapper.options().enabled[s] = s == mapping_stage::point_culling;
  CHECK(r.run.step().points_culled > 10);  // new ones are judged
  const auto& old = alive[alive.size() - 1 - static_cast<std::size_t>(options.point_culling.probation)];
  std::size_t kept = 0;
  for (const auto p : old) {
    if (std::count(alive.back().begin(), alive.back().end(), p) == 0) continue;  // it was merged before
    CHECK(r.run.map.alive(p));
    ++kept;
  }
  CHECK(kept > 100);
}

TEST_CASE("keyframes that wait: fusion, adjustment and keyframe culling are skipped, and said to be") {
  bool wait = false;
  int adjusted = 0;
  turbomap::local_mapper_hooks<flat_map> hooks;
  hooks.keyframes_wait = [&] { return wait; };
  hooks.adjust = [&](flat_map&, turbomap::map_keyframe_id, double) { ++adjusted; };
  stereo_run<> r(stereo_case().options, hooks);
  r.run.steps(3);
  CHECK(adjusted == 3);
  wait = true;
  for (int n = 0; n < 9; ++n) {
    const auto& report = r.run.step();
    for (const auto s : all_stages)
      CHECK(report.outcome[s] == (s >= mapping_stage::fusion ? stage_outcome::skipped : stage_outcome::done));
    CHECK(report.fused.entries == 0);
    CHECK(report.keyframes_culled.empty());
    CHECK_FALSE(report.cut);
  }
  CHECK(adjusted == 3);
  CHECK(r.run.map.keyframe_count() == 12);
  wait = false;
  const auto& report = r.run.step();
  CHECK(report.fused.merged > 0);
  CHECK(report.outcome[mapping_stage::keyframe_culling] == stage_outcome::done);
  CHECK(adjusted == 4);
}

TEST_CASE("keyframes that are in the map and not yet inserted do not use up the neighbours") {
  for (const int waiting : {0, 3, 10}) {
    CAPTURE(waiting);
    auto options = stereo_case().options;
    options.enabled[mapping_stage::keyframe_culling] = false;
    options.neighbours.neighbourhood.neighbours = 3;
    mapping_recipe recipe;
    recipe.lost = 0;
    stereo_run<> r(options, {}, recipe);
    r.run.steps(8);
    const auto k = r.run.track();
    for (int n = 0; n < waiting; ++n) {  // tracking is ahead: these share more with the keyframe than the older ones do
      const auto ahead = r.run.add();
      r.run.associate(ahead, r.run.view(r.run.keyframes().size() - 1));
    }
    const auto& report = r.run.mapper.process(k);
    CHECK(report.neighbours == 3);
    CHECK(report.fusion_targets >= 3);
    for (const auto id : r.run.mapper.last_search().selection().ids()) CHECK(id < 9);
  }
}

TEST_CASE("no point is ever in the map without its appearance, and no appearance is out of date") {
  // Of all live points when a stage ends, beside what an update from nothing gives.
  for (const bool rig : {false, true}) {
    CAPTURE(rig);
    const auto check = [&](auto c) {
      using map_type = mapped_by<std::decay_t<decltype(c.rig.cameras[0].camera)>>;
      using traits = turbomap::map_traits<map_type>;
      const mapping_scene<typename traits::camera> scene(c.rig, c.recipe);
      mapping_run<map_type, sequential>* running = nullptr;
      std::size_t looked_at = 0, without = 0;
      turbomap::local_mapper_hooks<map_type> hooks;
      hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report&) {
        if (s < mapping_stage::creation) return;
        traits::for_each_point(running->map, [&](turbomap::map_point_id p) {
          ++looked_at;
          without += traits::max_distance(running->map, p) > 0 ? 0 : 1;
        });
      };
      mapping_run<map_type, sequential> run(scene, c.options, hooks);
      running = &run;
      std::size_t culled = 0;
      for (int n = 0; n < 12; ++n) culled += run.step().keyframes_culled.size();
      CHECK(looked_at > 1000);
      CHECK(without == 0);
      CHECK(culled > 0);
      const std::string now = content(run.map);
      std::vector<turbomap::map_point_id> all;
      traits::for_each_point(run.map, [&](turbomap::map_point_id p) { all.push_back(p); });
      run.mapper.update_appearance(turbomap::span<const turbomap::map_point_id>(all));
      CHECK(content(run.map) == now);
    };
    if (rig)
      check(rig_case());
    else
      check(stereo_case());
  }
}

TEST_CASE("what is no keyframe of the map is refused by insert and process") {
  stereo_run<> r;
  r.run.steps(2);
  const auto data = r.scene.data<turbomap::binary_descriptor<256>>(r.run.view(0));
  const std::string before = content(r.run.map);
  CHECK_THROWS_AS(r.run.mapper.insert({}, data), std::invalid_argument);
  CHECK_THROWS_AS(r.run.mapper.process({}), std::invalid_argument);
  const auto k = r.run.add();
  turbomap::erase_keyframe(r.run.map, k);
  CHECK_THROWS_AS(r.run.mapper.insert(k, data), std::invalid_argument);
  CHECK_THROWS_AS(r.run.mapper.process(k), std::invalid_argument);
  CHECK(content(r.run.map) == before);
  CHECK(r.run.store.size() == 2);
}

/// Runs the mapper's own adjustment under a policy and says what it left.
template <class Policy>
std::string adjusted_map(const Policy& policy, const mapping_case<pinhole_camera>& c, int keyframes,
                         std::size_t* adjusted = nullptr) {
  using map_type = mapped_by<pinhole_camera>;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  mapping_run<map_type, Policy, turbomap::local_adjustment<map_type, Policy>> run(scene, c.options, {}, policy);
  for (int n = 0; n < keyframes; ++n) {
    const auto& report = run.step();
    CHECK(report.outcome[mapping_stage::adjustment] == stage_outcome::done);
    if (adjusted != nullptr) *adjusted += report.adjustment.solve.accepted > 0 ? 1 : 0;
    REQUIRE(turbomap::validate(run.map).empty());
  }
  return content(run.map);
}

TEST_CASE("the mapper adjusts by itself, with the same bits under every host policy and for any number of threads") {
  const auto c = stereo_case(noisy(11));
  std::size_t adjusted = 0;
  const std::string expected = adjusted_map(sequential{}, c, 8, &adjusted);
  CHECK(adjusted >= 5);
  for_each_thread_count([&](int threads) {
    CAPTURE(threads);
    for_each_parallel_policy([&](auto policy) { CHECK(adjusted_map(policy, c, 8) == expected); });
  });
}

TEST_CASE("what adjustment moves, and what outliers leave, is described anew") {
  using map_type = mapped_by<pinhole_camera>;
  auto c = stereo_case(noisy(11));
  c.options.adjustment.mono_chi2 = c.options.adjustment.stereo_chi2 = 1;  // many outliers
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  mapping_run<map_type, sequential, turbomap::local_adjustment<map_type, sequential>> run(scene, c.options);
  std::size_t outliers = 0;
  for (int n = 0; n < 8; ++n) outliers += run.step().adjustment.outliers;
  CHECK(outliers > 10);
  SUBCASE("around the last keyframe") {}
  SUBCASE("everywhere") {
    turbomap::global_adjustment_options options;
    options.scales = c.recipe.scales, options.stereo_chi2 = options.mono_chi2 = 0.5;
    const std::size_t updated = run.mapper.report().points_updated;
    const auto last = run.keyframes().back();
    const auto summary = run.mapper.adjust_globally(last, options);
    CHECK(summary.free_keyframes + 1 == run.map.keyframe_count());
    CHECK(summary.solve.accepted > 0);
    CHECK(summary.outliers > 10);
    CHECK(run.mapper.report().points_updated > updated + run.map.point_count() / 2);
    CHECK(run.mapper.adjust_globally({}, options).stale);
    CHECK_THROWS_AS(run.mapper.fuse_around({}), std::invalid_argument);
    const auto before = content(run.map);
    const auto report = run.mapper.report().fused;
    const auto fused = run.mapper.fuse_around(last);
    CHECK(fused.observations_added > 5);  // of those that were outliers by the narrow gate
    CHECK(content(run.map) != before);
    CHECK(run.mapper.report().fused.observations_added == report.observations_added + fused.observations_added);
    CHECK(turbomap::validate(run.map).empty());
  }
  std::vector<turbomap::map_point_id> all;
  turbomap::map_traits<map_type>::for_each_point(run.map, [&](turbomap::map_point_id p) { all.push_back(p); });
  const std::string now = content(run.map);
  run.mapper.update_appearance(turbomap::span<const turbomap::map_point_id>(all));
  CHECK(content(run.map) == now);
}

TEST_CASE("an appearance is computed once between two stages that read it") {
  auto c = stereo_case(noisy(11));
  c.options.adjustment.mono_chi2 = c.options.adjustment.stereo_chi2 = 1;  // many outliers
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  described_map* map = nullptr;
  std::size_t before_fusion = 0;
  turbomap::local_mapper_hooks<described_map> hooks;
  hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report&) {
    if (s == mapping_stage::creation) before_fusion = map->described.size();
  };
  mapping_run<described_map, sequential, turbomap::local_adjustment<described_map, sequential>> run(scene, c.options,
                                                                                                    hooks);
  map = &run.map;
  std::size_t merged = 0, adjusted = 0, outliers = 0, culled = 0;
  for (int n = 0; n < 12; ++n) {
    run.map.described.clear();
    const auto& report = run.step();
    // Tracking reads, process() reads (fusion), tracking reads: so once before fusion, and once after it.
    CHECK(report.points_updated == run.map.described.size());
    const auto first = run.map.described.begin(), fusion = first + static_cast<std::ptrdiff_t>(before_fusion);
    for (const auto& [begin, end] : {std::pair(first, fusion), std::pair(fusion, run.map.described.end())}) {
      std::vector<std::uint64_t> ids(begin, end);
      std::sort(ids.begin(), ids.end());
      CHECK(std::adjacent_find(ids.begin(), ids.end()) == ids.end());
    }
    merged += report.fused.merged, adjusted += report.adjustment.points, outliers += report.adjustment.outliers;
    culled += report.keyframes_culled.size();
  }
  CHECK(merged > 0);
  CHECK(adjusted > 0);
  CHECK(outliers > 0);
  CHECK(culled > 0);
}

TEST_CASE("a hook adjusts in place of the mapper's own stage") {
  using map_type = mapped_by<pinhole_camera>;
  const auto c = stereo_case();
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  int called = 0;
  turbomap::local_mapper_hooks<map_type> hooks;
  hooks.adjust = [&](map_type&, turbomap::map_keyframe_id, double) { ++called; };
  mapping_run<map_type, sequential, turbomap::local_adjustment<map_type, sequential>> run(scene, c.options, hooks);
  run.steps(3);
  CHECK(called == 3);
  CHECK(run.mapper.report().adjustment.observations == 0);
}

TEST_CASE("a hook that moves keyframes of a mirrored map, and throws: poses are read anew") {
  using map_type = mirrored_map<flat_map>;
  using traits = turbomap::map_traits<map_type>;
  const auto normals = [](bool throws) {
    turbomap::local_mapper_hooks<map_type> hooks;
    bool armed = false;
    hooks.adjust = [&](map_type& map, turbomap::map_keyframe_id, double) {
      if (!armed) return;
      traits::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) {
        auto T = turbomap::pose_of(map, k);
        T.tx += 1 + static_cast<double>(traits::id(map, k));
        traits::set_pose(map, k, T);
      });
      if (throws) throw std::runtime_error("the hook's");
    };
    auto options = stereo_case().options;
    options.checked_share = 0;  // nothing but what is said is read anew
    options.enabled[mapping_stage::keyframe_culling] = false;
    stereo_run<map_type> r(options, hooks);
    r.run.steps(3);
    armed = true;
    if (throws)
      CHECK_THROWS_AS(r.run.step(), std::runtime_error);
    else
      r.run.step();
    std::vector<turbomap::map_point_id> points;
    traits::for_each_point(r.run.map, [&](turbomap::map_point_id p) { points.push_back(p); });
    r.run.mapper.update_geometry(points);
    std::vector<float> result;
    for (const auto p : points) result.push_back(traits::normal(r.run.map, p).x);
    return result;
  };
  const auto expected = normals(false);
  CHECK(expected.size() > 50);
  CHECK(normals(true) == expected);
}

TEST_CASE("fusion and adjustment are repeated while fusion finds something") {
  int most_lost = 0, adjusted = 0, before_waiting = 1000;
  std::vector<mapping_stage> done;
  turbomap::local_mapper_hooks<flat_map> hooks;
  hooks.keyframes_wait = [&] { return adjusted >= before_waiting; };
  // Loses a link of the keyframe that others know, as a pose does that hides it.
  hooks.adjust = [&](flat_map& map, turbomap::map_keyframe_id k, double) {
    if (adjusted++ >= most_lost) return;
    for (std::size_t i = 0; i < flat_traits::keypoint_count(map, k); ++i) {
      const auto p = flat_traits::point_at(map, k, i);
      if (p == turbomap::map_point_id{} || map.observations(p).size() < 5) continue;
      turbomap::forget(map, k, i);
      return;
    }
  };
  hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report&) {
    if (s == mapping_stage::fusion) done.clear();
    done.push_back(s);
  };
  auto options = stereo_case().options;
  options.extra_rounds = 2;
  stereo_run<> r(options, hooks);
  const auto adjustments = [&](int lost) {
    most_lost = lost, adjusted = 0;
    const auto& report = r.run.step();
    CHECK(r.sound());
    for (const auto s : {mapping_stage::fusion, mapping_stage::adjustment})
      CHECK(report.outcome[s] == stage_outcome::done);
    return adjusted;
  };
  for (int n = 0; n < 5; ++n) adjustments(0);
  CHECK(adjustments(0) == 1);  // the second fusion finds nothing
  CHECK(done == std::vector<mapping_stage>{mapping_stage::fusion, mapping_stage::keyframe_culling});
  CHECK(adjustments(1) == 2);
  CHECK(adjustments(9) == 3);  // as often as the options say
  before_waiting = 1;
  CHECK(adjustments(9) == 1);  // the next keyframe has come: what was done is told as done
}

TEST_CASE("a further round for which no time is left cuts nothing") {
  constexpr double deadline_ms = 500;
  bool slow_adjustment = false, slow_fusion = false;
  int adjusted = 0, fused = 0;
  turbomap::local_mapper_hooks<flat_map> hooks;
  hooks.adjust = [&](flat_map& map, turbomap::map_keyframe_id k, double left) {
    ++adjusted;
    if (slow_adjustment) std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(left + 1));
    for (std::size_t i = 0; i < flat_traits::keypoint_count(map, k); ++i) {  // the next fusion finds something
      const auto p = flat_traits::point_at(map, k, i);
      if (p == turbomap::map_point_id{} || map.observations(p).size() < 5) continue;
      turbomap::forget(map, k, i);
      return;
    }
  };
  hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report&) {
    if (s == mapping_stage::fusion && ++fused == 2 && slow_fusion)
      std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(deadline_ms));
  };
  auto options = stereo_case().options;
  options.extra_rounds = 2;
  options.enabled[mapping_stage::keyframe_culling] = false;  // nothing else is late
  stereo_run<> r(options, hooks);
  r.run.steps(6);
  r.run.mapper.options().deadline_ms = deadline_ms;
  int rounds = 0;
  SUBCASE("when the first one has ended") { slow_adjustment = true, rounds = 1; }
  SUBCASE("when it has fused") { slow_fusion = true, rounds = 2; }
  adjusted = fused = 0;
  const auto& report = r.run.step();
  CHECK(fused == rounds);
  CHECK(adjusted == 1);
  for (const auto s : {mapping_stage::fusion, mapping_stage::adjustment})
    CHECK(report.outcome[s] == stage_outcome::done);
  CHECK(report.fusion_targets > 0);
  CHECK_FALSE(report.cut);
  CHECK(r.sound());
}

TEST_CASE("the report tells the outliers of all rounds") {
  auto c = stereo_case(noisy(11, 1.0));
  c.options.adjustment.mono_chi2 = c.options.adjustment.stereo_chi2 = 1;  // many outliers, and fusion finds them again
  c.options.extra_rounds = 2;
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  std::size_t so_far = 0, told = 0, rounds = 0;
  turbomap::local_mapper_hooks<flat_map> hooks;
  hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report& report) {
    if (s != mapping_stage::fusion && s != mapping_stage::adjustment) return;
    const std::size_t outliers = report.adjustment.outliers;
    if (s == mapping_stage::fusion) ++rounds;
    CHECK(outliers >= so_far);
    so_far = outliers;
  };
  mapping_run<flat_map, sequential, turbomap::local_adjustment<flat_map, sequential>> run(scene, c.options, hooks);
  for (int n = 0; n < 8; ++n) so_far = 0, told += run.step().adjustment.outliers;
  CHECK(rounds > 8);  // there was a second one
  CHECK(told > 0);
}

TEST_CASE("stop ends the iteration before the stage that asks, whatever it says later") {
  for (std::size_t at = 0; at < all_stages.size(); ++at) {
    CAPTURE(at);
    long asked = -1;  // not armed
    std::vector<mapping_stage> done;
    turbomap::local_mapper_hooks<flat_map> hooks;
    hooks.stop = [&] { return asked >= 0 && asked++ == static_cast<long>(at); };
    hooks.adjust = [](flat_map&, turbomap::map_keyframe_id, double) {};
    hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report& report) {
      CHECK(report.outcome[s] == stage_outcome::done);
      if (asked >= 0) done.push_back(s);
    };
    stereo_run<> r(stereo_case().options, hooks);
    r.run.steps(3);
    asked = 0;
    const auto& report = r.run.step();
    for (std::size_t s = 0; s < all_stages.size(); ++s)
      CHECK(report.outcome[all_stages[s]] == (s < at ? stage_outcome::done : stage_outcome::skipped));
    CHECK(done == std::vector<mapping_stage>(all_stages.begin(), all_stages.begin() + static_cast<std::ptrdiff_t>(at)));
    CHECK(r.sound());
    asked = -1;
    CHECK(r.run.step().outcome[mapping_stage::keyframe_culling] == stage_outcome::done);  // the next one is whole
  }
}

TEST_CASE("a search that its flag stops is cut, one that finishes is done") {
  for (const auto set : {turbomap::candidates::epipolar_ordered, turbomap::candidates::grouped}) {
    std::atomic<bool> stop{false};
    auto options = stereo_case().options;
    options.search.candidate_set = set, options.search.stop = &stop;
    stereo_run<> r(options);
    r.run.steps(3);
    stop = true;
    const auto& report = r.run.step();
    REQUIRE(report.neighbours > 0);
    CHECK(report.outcome[mapping_stage::search] ==
          (set == turbomap::candidates::grouped ? stage_outcome::done : stage_outcome::cut));
    CHECK(r.sound());
  }
}

TEST_CASE("adjustment is told the time that is left") {
  for (const double deadline : {0.0, 1e7}) {
    std::vector<double> left;
    turbomap::map_keyframe_id of{};
    turbomap::local_mapper_hooks<flat_map> hooks;
    hooks.adjust = [&](flat_map&, turbomap::map_keyframe_id k, double ms) { left.push_back(ms), of = k; };
    auto options = stereo_case().options;
    options.deadline_ms = deadline;
    stereo_run<> r(options, hooks);
    r.run.steps(2);
    REQUIRE(left.size() == 2);
    CHECK(of == r.run.keyframes().back());
    if (deadline > 0) {
      CHECK(left[1] > 0);
      CHECK(left[1] < deadline);
    } else {
      CHECK(left[1] == std::numeric_limits<double>::infinity());
    }
  }
}

TEST_CASE("a deadline that nothing can hold cuts what can be cut, says so, and leaves a sound map") {
  int adjusted = 0;
  turbomap::local_mapper_hooks<flat_map> hooks;
  hooks.adjust = [&](flat_map&, turbomap::map_keyframe_id, double) { ++adjusted; };
  stereo_run<> r(stereo_case().options, hooks);
  r.run.steps(4);
  const std::size_t keyframes = r.run.map.keyframe_count();
  CHECK(adjusted == 4);
  r.run.mapper.options().deadline_ms = 1e-6;
  for (int n = 0; n < 8; ++n) {
    const auto& report = r.run.step();
    CHECK(report.cut);
    for (const auto s : all_stages)
      CHECK(report.outcome[s] == (s < mapping_stage::search ? stage_outcome::done : stage_outcome::cut));
    CHECK(report.neighbours == 0);
    CHECK(report.points_created == 0);
    CHECK(report.fusion_targets == 0);
    CHECK(report.fused.entries == 0);
    CHECK(report.keyframes_culled.empty());
    CHECK(r.sound());
  }
  CHECK(adjusted == 4);
  CHECK(r.run.map.keyframe_count() == keyframes + 8);
  r.run.mapper.options().deadline_ms = 0;
  const auto& report = r.run.step();
  CHECK_FALSE(report.cut);
  CHECK(report.fused.merged > 0);
  CHECK(adjusted == 5);
}

TEST_CASE("a deadline that everything fits in changes nothing") {
  auto options = stereo_case().options;
  stereo_run<> free(options);
  options.deadline_ms = 1e8;
  stereo_run<> timed(options);
  for (int n = 0; n < 8; ++n) {
    free.run.step();
    CHECK_FALSE(timed.run.step().cut);
  }
  CHECK(content(free.run.map) == content(timed.run.map));
}

using watched = watched_map<probing_descriptor>;

TEST_CASE("insert reads the map under its guard") {
  stereo_run<watched> r;
  r.run.map.watch.armed = true;
  const auto k = r.run.add();
  r.run.map.watch.unguarded = 0;
  r.run.mapper.insert(k, r.scene.data<probing_descriptor>(r.run.view(0)));
  CHECK(r.run.map.watch.unguarded == 0);
  CHECK(r.run.map.watch.taken == 1);
}

TEST_CASE("fuse_around knows no deadline, and keeps the report of the stage") {
  auto options = stereo_case(noisy(11)).options;
  stereo_run<watched> r(options, {}, noisy(11)), free(options, {}, noisy(11));
  r.run.steps(3), free.run.steps(3);
  for (auto* run : {&r.run, &free.run}) {
    run->mapper.options().enabled[mapping_stage::fusion] = false;
    run->steps(4);  // makes duplicates
  }
  r.run.mapper.options().deadline_ms = 1e-6;
  CHECK(r.run.step().cut);  // from the search on
  for (const auto s : all_stages) free.run.mapper.options().enabled[s] = s < mapping_stage::search;
  free.run.step();
  const auto fused = r.run.mapper.fuse_around(r.run.keyframes().back());
  CHECK(fused.merged > 0);
  CHECK(r.run.mapper.report().fusion_targets == 0);  // of the last process()
  CHECK(r.run.mapper.report().fused.merged == fused.merged);
  CHECK(free.run.mapper.fuse_around(free.run.keyframes().back()).merged == fused.merged);
  CHECK(content(r.run.map) == content(free.run.map));
  int guards = 0;
  r.run.map.watch.before = [&] {
    if (++guards == 4) throw std::runtime_error("no guard");
  };
  const auto before = r.run.mapper.report();
  CHECK_THROWS_AS(r.run.mapper.fuse_around(r.run.keyframes().front()), std::runtime_error);
  CHECK(r.run.mapper.report().fused.entries == before.fused.entries);
  CHECK(r.run.mapper.report().fused.merged == before.fused.merged);
  CHECK(r.run.mapper.report().fusion_targets == 0);
  r.run.map.watch.before = nullptr;
  CHECK(r.sound());
}

TEST_CASE("a fusion that ends between two parts: what it did is reported, and appearances are due") {
  for (const bool on_request : {true, false}) {
    CAPTURE(on_request);
    auto options = stereo_case(noisy(11)).options;
    options.fusion.commit.entries_per_guard = 1;
    options.enabled[mapping_stage::fusion] = false;
    stereo_run<watched> r(options, {}, noisy(11));
    r.run.steps(6);  // makes duplicates
    auto& mapper = r.run.mapper;
    for (const auto s : all_stages) mapper.options().enabled[s] = s == mapping_stage::fusion;
    const auto merged = mapper.report().fused.merged, points = r.run.map.point_count();
    r.run.map.watch.before = [&] {
      if (r.run.map.point_count() + 2 == points) throw std::runtime_error("no guard");
    };
    const auto last = r.run.keyframes().back();
    if (on_request)
      CHECK_THROWS_AS(mapper.fuse_around(last), std::runtime_error);
    else
      CHECK_THROWS_AS(mapper.process(last), std::runtime_error);
    r.run.map.watch.before = nullptr;
    CHECK(r.run.map.point_count() + 2 == points);
    CHECK(mapper.report().fused.merged == merged + 2);
    const auto updated = mapper.report().points_updated;
    mapper.update_appearance({});  // whatever is due
    CHECK(mapper.report().points_updated >= updated + 2);
    CHECK(r.sound());
  }
}

TEST_CASE("an adjustment that ends between two parts: what it did is reported, and appearances are due") {
  using traits = turbomap::map_traits<watched>;
  for (const bool on_request : {true, false}) {
    CAPTURE(on_request);
    const auto c = stereo_case(noisy(11));
    const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
    mapping_run<watched, sequential, turbomap::local_adjustment<watched, sequential>> run(scene, c.options);
    auto& mapper = run.mapper;
    mapper.options().enabled[mapping_stage::adjustment] = false;
    run.steps(6);
    for (const auto s : all_stages) mapper.options().enabled[s] = s == mapping_stage::adjustment;
    turbomap::global_adjustment_options global;
    global.scales = c.recipe.scales;
    for (turbomap::local_adjustment_options* o :
         {&mapper.options().adjustment, static_cast<turbomap::local_adjustment_options*>(&global)})
      o->points_per_guard = 40, o->mono_chi2 = o->stereo_chi2 = 1;  // many outliers
    const auto last = run.keyframes().back();
    const auto pose = turbomap::pose_of(run.map, last);
    const std::size_t observations = run.map.observation_count();
    run.map.watch.before = [&] {  // positions are written after poses, then outliers are taken out
      if (run.map.observation_count() != observations) throw std::runtime_error("no guard");
    };
    if (on_request)
      CHECK_THROWS_AS(mapper.adjust_globally(last, global), std::runtime_error);
    else
      CHECK_THROWS_AS(mapper.process(last), std::runtime_error);
    run.map.watch.before = nullptr;
    CHECK_FALSE(turbomap::is_same_pose(pose, turbomap::pose_of(run.map, last)));
    CHECK(run.map.observation_count() < observations);
    if (!on_request) CHECK(mapper.report().adjustment.outliers > 0);
    const auto updated = mapper.report().points_updated;
    mapper.update_appearance({});  // whatever is due
    CHECK(mapper.report().points_updated >= updated + 100);
    CHECK(turbomap::validate(run.map).empty());
    std::vector<turbomap::map_point_id> points;
    std::vector<turbomap::vec3<float>> normals;
    traits::for_each_point(
        run.map, [&](turbomap::map_point_id p) { points.push_back(p), normals.push_back(traits::normal(run.map, p)); });
    mapper.update_geometry(points);  // once more: nothing was left
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto now = traits::normal(run.map, points[i]);
      REQUIRE((now.x == normals[i].x && now.y == normals[i].y && now.z == normals[i].z));
    }
  }
}

TEST_CASE("what a map says while it is fused or adjusted on request waits until that ends") {
  const auto c = stereo_case(noisy(11));
  const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
  mapping_run<watched, sequential, turbomap::local_adjustment<watched, sequential>> run(scene, c.options);
  run.steps(4);
  using traits = turbomap::map_traits<watched>;
  const auto last = run.keyframes().back();
  turbomap::map_point_id p{};
  for (std::size_t i = 0; !traits::alive(run.map, p); ++i) p = traits::point_at(run.map, last, i);
  const auto normal = traits::normal(run.map, p);
  traits::set_appearance(run.map, p, {}, 0, 0, traits::descriptor_data(run.map, p));
  // A plain mutex: to compute at once would wait for ever.
  run.map.watch.before = [&] {
    if (run.map.watch.held) throw std::logic_error("the guard is taken twice");
  };
  run.map.watch.after = [&] {
    run.mapper.update_appearance(turbomap::span<const turbomap::map_point_id>(&p, 1));
    CHECK_THROWS_AS(run.mapper.reset(), std::invalid_argument);
    CHECK_THROWS_AS(run.mapper.process(last), std::invalid_argument);
    CHECK_THROWS_AS(run.mapper.fuse_around(last), std::invalid_argument);
  };
  turbomap::global_adjustment_options options;
  options.scales = c.recipe.scales;
  SUBCASE("fused") { run.mapper.fuse_around(last); }
  SUBCASE("adjusted") { CHECK(run.mapper.adjust_globally(last, options).solve.accepted > 0); }
  SUBCASE("stopped before it was adjusted") {
    const std::atomic<bool> stop{true};
    options.solve.stop = &stop;
    CHECK(run.mapper.adjust_globally(last, options).solve.accepted == 0);
  }
  const auto now = traits::normal(run.map, p);
  CHECK(now.x * normal.x + now.y * normal.y + now.z * normal.z > 0.9F);
  run.map.watch.before = run.map.watch.after = nullptr;
  run.mapper.reset();
}

TEST_CASE("a keyframe of a store that was cleared can be removed") {
  stereo_run<> r;
  r.run.steps(2);
  const std::uint64_t id = flat_traits::id(r.run.map, r.run.keyframes().back());
  r.run.store.clear();
  r.run.mapper.remove(id);
  CHECK(r.run.mapper.stored().size() == 1);
  CHECK_THROWS_AS(r.run.mapper.remove(id), std::invalid_argument);
}

TEST_CASE("one slow keyframe does not switch a stage off for ever") {
  constexpr double deadline_ms = 500;
  bool slow = false, searched = false;
  turbomap::local_mapper_hooks<watched> hooks;
  hooks.stage_done = [&](mapping_stage s, const turbomap::mapping_report&) { searched = s == mapping_stage::search; };
  auto options = stereo_case().options;
  options.deadline_ms = deadline_ms;
  stereo_run<watched> r(options, hooks);
  r.run.map.watch.before = [&] {
    if (!slow || !searched) return;
    slow = false;
    std::this_thread::sleep_for(std::chrono::milliseconds(600));
  };
  r.run.steps(3);
  slow = true;
  CHECK(r.run.step().outcome[mapping_stage::creation] == stage_outcome::done);  // a piece that was begun is finished
  CHECK_FALSE(slow);
  int cut = 0;
  while (r.run.step().outcome[mapping_stage::creation] != stage_outcome::done && cut < 12) ++cut;
  CHECK(cut >= 1);  // expected to take 600 ms of 500
  CHECK(cut < 12);
}

TEST_CASE("the guard is held whenever the map is read or written, and never during a search") {
  for (const auto mode : {turbomap::fusion_mode::snapshot, turbomap::fusion_mode::serial_exact}) {
    auto options = stereo_case().options;
    options.fusion.mode = mode;
    turbomap::local_mapper_hooks<watched> hooks;
    watched* map = nullptr;
    int erased = 0;
    hooks.adjust = [&](watched&, turbomap::map_keyframe_id, double) { CHECK_FALSE(map->watch.held); };
    hooks.stage_done = [&](mapping_stage, const turbomap::mapping_report&) { CHECK_FALSE(map->watch.held); };
    const auto ask = [&] {
      CHECK_FALSE(map->watch.held);
      return false;
    };
    hooks.keyframes_wait = ask, hooks.stop = ask;
    hooks.erasing = [&](turbomap::map_keyframe_id) {
      ++erased;
      CHECK(map->watch.held);
    };
    stereo_run<watched> r(options, hooks);
    map = &r.run.map;
    r.run.notes_creation = false;
    std::size_t fused = 0, created = 0;
    for (int n = 0; n < 10; ++n) {
      const auto k = r.run.track();
      const long calls = distance_calls, taken = map->watch.taken;
      map->watch.armed = true;
      const auto& report = r.run.mapper.process(k);
      map->watch.armed = false;
      CHECK_FALSE(map->watch.held);
      r.run.note();
      fused += report.fused.merged, created += report.points_created;
      if (n >= 2) CHECK(distance_calls > calls);
      std::size_t counted = 0;
      for (const auto s : all_stages) {
        counted += report.held[s].count;
        CHECK(report.held[s].longest_ms <= report.held[s].total_ms);
        CHECK(report.held[s].total_ms <= report.total_ms);
        CHECK(report.held[s].commit_ms <= report.held[s].total_ms);
      }
      if (report.points_created > 0) CHECK(report.held[mapping_stage::creation].commit_ms > 0);
      if (report.fused.merged > 0) CHECK(report.held[mapping_stage::fusion].commit_ms > 0);
      CHECK(static_cast<long>(counted) == map->watch.taken - taken);  // the report knows of each time
    }
    CHECK(created > 0);
    CHECK(fused > 0);
    CHECK(erased > 0);
    CHECK(map->watch.unguarded == 0);
    CHECK(distance_calls_under_guard == 0);
  }
}

TEST_CASE("an exception gives the guard back") {
  stereo_run<watched> r;
  r.run.steps(4);
  for (int at = 0;; ++at) {
    CAPTURE(at);
    int times = 0;
    const auto k = r.run.track();
    r.run.map.watch.after = [&] {
      if (times++ == at) throw std::runtime_error("a trait that reads the network");
    };
    bool threw = false;
    try {
      r.run.mapper.process(k);
    } catch (const std::runtime_error&) {
      threw = true;
    }
    r.run.map.watch.after = {};
    CHECK_FALSE(r.run.map.watch.held);
    CHECK(r.run.map.watch.mutex.try_lock());
    r.run.map.watch.mutex.unlock();
    REQUIRE(r.sound());
    r.run.note();
    CHECK(r.run.mapper.process(k).outcome[mapping_stage::fusion] == stage_outcome::done);
    if (!threw) {
      CHECK(at > 8);
      break;
    }
  }
}

TEST_CASE("keyframes that are about to be erased still hold their points") {
  std::vector<std::uint64_t> erasing;
  flat_map* map = nullptr;
  turbomap::local_mapper_hooks<flat_map> hooks;
  hooks.erasing = [&](turbomap::map_keyframe_id k) {
    erasing.push_back(flat_traits::id(*map, k));
    std::size_t points = 0;
    for (std::size_t i = 0; i < map->keypoints(k).size(); ++i)
      points += map->point_at(k, i) != turbomap::map_point_id{} ? 1 : 0;
    CHECK(map->alive(k));
    CHECK(points > 0);
  };
  stereo_run<> r(stereo_case().options, hooks);
  map = &r.run.map;
  std::vector<std::uint64_t> culled;
  for (int n = 0; n < 12; ++n) {
    const auto& report = r.run.step();
    culled.insert(culled.end(), report.keyframes_culled.begin(), report.keyframes_culled.end());
  }
  CHECK_FALSE(culled.empty());
  CHECK(erasing == culled);
  for (const auto id : culled) {
    CHECK_FALSE(map->alive(r.run.keyframes()[static_cast<std::size_t>(id)]));
    CHECK_FALSE(r.run.mapper.stored().contains(id));
  }
}

TEST_CASE("a keyframe that others erase while it is processed, whenever the guard is free") {
  const auto c = stereo_case(noisy(11));
  int erased = 0;
  for (int at = 2;; ++at) {  // the first hold sees that it is there
    CAPTURE(at);
    const mapping_scene<pinhole_camera> scene(c.rig, c.recipe);
    mapping_run<watched, sequential, turbomap::local_adjustment<watched, sequential>> run(scene, c.options);
    run.steps(4);
    const auto k = run.track();
    const auto id = turbomap::map_traits<watched>::id(run.map, k);
    int guards = 0;
    run.map.watch.after = [&] {
      if (++guards == at) turbomap::erase_keyframe(run.map, k);
    };
    CHECK_NOTHROW(run.mapper.process(k));
    run.map.watch.after = nullptr;
    CHECK(turbomap::validate(run.map).empty());
    if (run.map.alive(k)) break;
    ++erased;
    run.mapper.remove(id);
  }
  CHECK(erased > 10);
}

TEST_CASE("a keyframe that is not inserted, or dead, is refused, and nothing is done") {
  stereo_run<> r;
  r.run.steps(3);
  const auto k = r.run.add();
  r.run.associate(k, r.run.view(3));
  auto before = content(r.run.map);
  try {
    r.run.mapper.process(k);
    FAIL_CHECK("not refused");
  } catch (const std::invalid_argument& e) {
    CHECK(std::string(e.what()) == "turbomap: keyframe id = 3: is not in the store: insert the keyframe first");
  }
  CHECK(content(r.run.map) == before);
  CHECK_THROWS_AS(r.run.mapper.process(turbomap::map_keyframe_id{}), std::invalid_argument);
  CHECK(r.run.mapper.iterations() == 3);
  r.run.mapper.insert(k, r.scene.data<map_descriptor>(r.run.view(3)));
  CHECK(r.run.mapper.process(k).outcome[mapping_stage::fusion] == stage_outcome::done);
  CHECK_THROWS_AS(r.run.mapper.insert(k, r.scene.data<map_descriptor>(r.run.view(3))), std::invalid_argument);
  CHECK(r.run.store.size() == r.run.mapper.stored().size());
  r.run.note();
  r.run.steps(2);
  const auto last = r.run.keyframes().back();
  turbomap::erase_keyframe(r.run.map, last);
  before = content(r.run.map);
  CHECK_THROWS_AS(r.run.mapper.process(last), std::invalid_argument);
  CHECK(content(r.run.map) == before);
  r.run.mapper.remove(5);
  CHECK_THROWS_AS(r.run.mapper.remove(5), std::invalid_argument);
  r.run.steps(2);
  CHECK(r.sound());
}

TEST_CASE("after being behind, so many keyframes are culled at once, and the others by the next ones") {
  const auto culled_after = [](int most_candidates, int most_erased) {
    auto options = stereo_case().options;
    options.keyframe_culling.most_candidates = most_candidates, options.keyframe_culling.most_erased = most_erased;
    options.enabled[mapping_stage::keyframe_culling] = false;
    stereo_run<> r(options);
    r.run.steps(14);
    r.run.mapper.options().enabled[mapping_stage::keyframe_culling] = true;
    std::vector<std::size_t> culled;
    for (int n = 0; n < 6; ++n) culled.push_back(r.run.step().keyframes_culled.size());
    CHECK(r.sound());
    return culled;
  };
  const auto all = culled_after(0, 0), defaults = culled_after(128, 8), one = culled_after(0, 1),
             few = culled_after(2, 0);
  CHECK(all == defaults);
  CHECK(all[0] > 2);
  for (const std::size_t n : one) CHECK(n <= 1);
  CHECK(one[0] + one[1] + one[2] == 3);
  for (const std::size_t n : few) CHECK(n <= 2);
}

TEST_CASE("bad options are refused when the mapper is made, and when they are changed") {
  stereo_run<> r;
  r.run.steps(2);
  const auto newest = r.run.track();
  const auto good = r.run.mapper.options();
  const auto refuses = [&](auto change) {
    auto options = stereo_case().options;
    change(options);
    CHECK_THROWS_AS(stereo_run<>{options}, std::invalid_argument);
    change(r.run.mapper.options());
    const auto before = everything(r.run.map);
    CHECK_THROWS_AS(r.run.mapper.process(newest), std::invalid_argument);
    CHECK_THROWS_AS(r.run.mapper.fuse_around(newest), std::invalid_argument);
    CHECK(everything(r.run.map) == before);
    r.run.mapper.options() = good;
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  refuses([](auto& o) { o.deadline_ms = -1; });
  refuses([](auto& o) { o.deadline_ms = nan; });
  refuses([](auto& o) { o.neighbours.stereo_baseline = -0.1; });
  refuses([](auto& o) { o.neighbours.stereo_baseline = nan; });
  refuses([](auto& o) { o.keyframe_culling.redundant_share = 2; });
  refuses([](auto& o) { o.keyframe_culling.most_candidates = -1; });
  refuses([](auto& o) { o.keyframe_culling.most_erased = -1; });
  refuses([](auto& o) { o.most_views = -1; });
  refuses([](auto& o) { o.checked_share = -0.01; });
  refuses([](auto& o) { o.checked_share = nan; });
  refuses([](auto& o) { o.extra_rounds = -1; });
  // Those of each stage, before an earlier one has changed the map.
  refuses([](auto& o) { o.point_culling.min_found_ratio = std::numeric_limits<float>::quiet_NaN(); });
  refuses([](auto& o) { o.neighbours.neighbourhood.neighbours = -1; });
  refuses([](auto& o) { o.search.line_chi2 = std::numeric_limits<float>::quiet_NaN(); });
  refuses([](auto& o) { o.creation.mono_chi2 = nan; });
  refuses([](auto& o) { o.fusion.search.radius = nan; });
  refuses([](auto& o) { o.fusion.commit.entries_per_guard = -1; });
  refuses([](auto& o) { o.fusion.commit.tolerance.chi2 = nan; });
  refuses([](auto& o) { o.creation.scales.levels = 4; });
  refuses([](auto& o) { o.fusion.search.scales.scale_factor = 1.5F; });
  refuses([](auto& o) { o.adjustment.scales.scale_factor = 1.5F; });
  refuses([](auto& o) { o.set_scales({1.5F, 4}); });  // the store has another pyramid
  const auto refuses_to_adjust = [&](auto change) {
    auto options = good;
    using adjusting = turbomap::local_mapper<flat_map, sequential>;
    CHECK_NOTHROW(adjusting(r.run.ctx, r.run.map, r.run.store, options));
    change(options);
    CHECK_THROWS_AS(adjusting(r.run.ctx, r.run.map, r.run.store, options), std::invalid_argument);
  };
  refuses_to_adjust([](auto& o) { o.adjustment.outlier_factor = nan; });
  refuses_to_adjust([](auto& o) { o.adjustment.solve.initial_lambda = nan; });
  refuses_to_adjust([](auto& o) { o.adjustment.solve.numbers = turbomap::precision::float64; });  // not compiled
  auto named = good;
  named.fusion.search.mono_chi2 = nan;
  CHECK_THROWS_WITH_AS(stereo_run<>{named},
                       "turbomap: options.fusion.search.mono_chi2 = nan: must be finite and positive",
                       std::invalid_argument);
  named.enabled[mapping_stage::fusion] = false;  // nobody reads it
  stereo_run<>{named}.run.steps(1);
  CHECK(r.run.mapper.process(newest).outcome[mapping_stage::creation] == stage_outcome::done);
  CHECK(r.run.mapper.iterations() == 3);
  CHECK(r.sound());
}

TEST_CASE("keyframes of the map that are not in the store are left out") {
  auto options = stereo_case().options;
  options.enabled[mapping_stage::keyframe_culling] = false;
  stereo_run<> r(options);
  r.run.steps(2);
  const auto outsider = r.run.add();
  r.run.associate(outsider, r.run.view(2));
  const auto free_slots = [&] {
    std::vector<std::size_t> all;
    for (std::size_t i = 0; i < r.run.map.keypoints(outsider).size(); ++i)
      if (r.run.map.point_at(outsider, i) == turbomap::map_point_id{}) all.push_back(i);
    return all;
  };
  const auto free_before = free_slots();
  REQUIRE(free_before.size() + 30 < r.run.map.keypoints(outsider).size());  // covisible
  for (int n = 0; n < 3; ++n) {
    const auto& report = r.run.step();
    CHECK(report.neighbours == static_cast<std::size_t>(n + 2));
    CHECK(report.fused.merged > 0);
    for (const auto id : r.run.mapper.last_search().selection().ids()) CHECK(id != 2);
  }
  for (const std::size_t i : free_before) CHECK(r.run.map.point_at(outsider, i) == turbomap::map_point_id{});
  CHECK(r.sound());
}

TEST_CASE("a map without anything to do") {
  mapping_recipe empty;
  empty.per_metre = 0, empty.clutter = 0;
  stereo_run<> nothing(stereo_case().options, {}, empty);
  empty.clutter = 30;
  stereo_run<> clutter(stereo_case().options, {}, empty);
  for (int n = 0; n < 4; ++n) {
    for (auto* r : {&nothing, &clutter}) {
      const auto& report = r->run.step();
      CHECK(report.outcome[mapping_stage::keyframe_culling] == stage_outcome::done);
      CHECK(report.points_created == 0);
      CHECK(report.fused.entries == 0);
      CHECK(r->sound());
    }
  }
}

TEST_CASE("a map that contradicts itself is refused stage by stage, and stays as it was") {
  for (const auto s : {mapping_stage::process, mapping_stage::point_culling, mapping_stage::creation,
                       mapping_stage::fusion, mapping_stage::keyframe_culling}) {
    CAPTURE(turbomap::to_string(s));
    lying_map* liar = nullptr;
    std::string before;
    turbomap::local_mapper_hooks<lying_map> hooks;
    const auto lie = [&] {
      lying_map& map = *liar;
      std::vector<turbomap::map_keyframe_id> keyframes;
      flat_traits::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) { keyframes.push_back(k); });
      flat_traits::for_each_point(map, [&](turbomap::map_point_id p) {
        const auto seen = map.observations(p);
        if (s == mapping_stage::creation) {  // free keypoints hold points that do not know of them
          for (const auto k : keyframes)
            for (std::size_t i = 0; i < map.keypoints(k).size(); ++i)
              if (map.point_at(k, i) == turbomap::map_point_id{}) map.slots[{k.index, i}] = p;
        } else if (seen.size() > 0 && (s == mapping_stage::process || s == mapping_stage::point_culling)) {
          map.invented.insert({p.index, {keyframes[0], 1000000}});  // a keypoint that is not there
        } else if (seen.size() > 0) {
          map.hidden[{p.index, {seen[0].keyframe, static_cast<std::size_t>(seen[0].keypoint)}}];
        }
      });
      before = content(static_cast<flat_map&>(map));
      map.writes = 0;
    };
    bool armed = false;
    hooks.stage_done = [&](mapping_stage done, const turbomap::mapping_report&) {
      if (armed && done == mapping_stage::search && s == mapping_stage::creation) lie();
    };
    auto options = stereo_case().options;
    options.strict = true;
    stereo_run<lying_map> r(options, hooks);
    liar = &r.run.map;
    auto& enabled = r.run.mapper.options().enabled;
    enabled[mapping_stage::keyframe_culling] = false;
    r.run.steps(5);
    const auto k = r.run.track();
    for (const auto t : all_stages) enabled[t] = t == s || (s == mapping_stage::creation && t == mapping_stage::search);
    r.run.mapper.options().keyframe_culling.redundant_share = 0;
    armed = true;
    if (s != mapping_stage::creation) lie();
    CHECK_THROWS_AS(r.run.mapper.process(k), turbomap::inconsistent_map);
    armed = false;
    CHECK(liar->writes == 0);
    CHECK(content(static_cast<flat_map&>(*liar)) == before);
    liar->tell_the_truth();
    for (const auto t : all_stages) enabled[t] = t != mapping_stage::adjustment;
    CHECK_NOTHROW(r.run.mapper.process(k));
    CHECK(turbomap::validate(*liar).empty());
  }
}

TEST_CASE("another thread edits the map under the guard") {
  using traits = turbomap::map_traits<watched>;
  auto options = stereo_case().options;
  stereo_run<watched> r(options, {}, noisy(3));
  r.run.notes_creation = false;
  auto& map = r.run.map;
  std::atomic<bool> done{false};
  std::atomic<long> edits{0};
  std::atomic<int> rounds{0};  // that are left: on a busy machine the other thread might undo all that mapping does
  std::thread other([&] {
    std::mt19937 random(11);
    std::vector<turbomap::map_keyframe_id> keyframes;
    std::vector<turbomap::map_point_id> points;
    std::vector<std::pair<turbomap::map_keyframe_id, std::size_t>> scratch;
    while (!done) {
      if (rounds > 0) {
        --rounds;
        const auto guard = turbomap::map_guard(map);
        keyframes.clear(), points.clear();
        traits::for_each_keyframe(map, [&](turbomap::map_keyframe_id k) { keyframes.push_back(k); });
        traits::for_each_point(map, [&](turbomap::map_point_id p) { points.push_back(p); });
        for (int n = 0; n < 4 && !keyframes.empty() && !points.empty(); ++n) {
          const auto k = keyframes[random() % keyframes.size()];
          const auto p = points[random() % points.size()], q = points[random() % points.size()];
          const std::size_t i = random() % map.keypoints(k).size();
          if (!map.alive(p) || !map.alive(q)) continue;
          switch (random() % 8) {
            case 0:
              turbomap::erase_point(map, p);
              break;
            case 1:
              turbomap::merge_points(map, p, q, turbomap::merge_rule::refuse, scratch);
              break;
            case 2:
            case 3:
              turbomap::fade(map, k, i);
              break;
            default:
              turbomap::observe(map, p, k, i);
          }
          ++edits;
        }
        if (keyframes.size() > 6 && random() % 64 == 0) {
          const auto k = keyframes[1 + random() % (keyframes.size() - 3)];
          turbomap::erase_keyframe(map, k);
        }
      }
      std::this_thread::yield();
    }
  });
  std::size_t created = 0, stale = 0;
  for (int n = 0; n < 25; ++n) {
    rounds = 40;
    turbomap::map_keyframe_id k;
    {
      const auto guard = turbomap::map_guard(map);
      k = r.run.add();
    }
    const auto& view = r.run.view(r.run.keyframes().size() - 1);
    try {
      r.run.mapper.insert(k, r.scene.data<probing_descriptor>(view));  // takes the guard itself
      {
        const auto guard = turbomap::map_guard(map);
        if (map.alive(k)) r.run.associate(k, view);
      }
      const auto& report = r.run.mapper.process(k);
      created += report.points_created, stale += report.fused.stale + report.fused.already_observed;
    } catch (const std::invalid_argument&) {
      const auto guard = turbomap::map_guard(map);
      CHECK_FALSE(map.alive(k));  // the other one was faster
    }
    const auto guard = turbomap::map_guard(map);
    REQUIRE(turbomap::validate(map).empty());
  }
  done = true;
  other.join();
  CHECK(edits > 10);
  CHECK(created > 0);
  CHECK(r.sound());
}

/// Whether process() ran out of memory at its n-th allocation.
template <class Run>
bool fails(Run& run, turbomap::map_keyframe_id k, long n) {
  const no_memory_after limit(n);
  try {
    run.mapper.process(k);
    return false;
  } catch (const std::bad_alloc&) {
    return true;
  }
}

TEST_CASE("no memory, at any time: the map is sound, and the next keyframe is mapped") {
  mapping_recipe small;
  small.per_metre = 10, small.clutter = 5;
  auto options = stereo_case().options;
  options.neighbours.neighbourhood.min_shared_points = 5;
  SUBCASE("a mapper that has its memory") {
    stereo_run<> r(options, {}, small);
    r.run.notes_creation = false;
    r.run.steps(3);
    int failures = 0;
    for (int keyframe = 0; keyframe < 5; ++keyframe) {
      const auto k = r.run.track();
      for (long n = 0; fails(r.run, k, n); ++n) {
        ++failures;
        REQUIRE(r.sound());
        REQUIRE(r.run.store.size() == r.run.mapper.stored().size());
      }
      r.run.note();
    }
    CHECK(failures > 20);
    flat_traits::for_each_point(r.run.map, [&](turbomap::map_point_id p) {  // nobody was forgotten
      CHECK(flat_traits::max_distance(r.run.map, p) > 0);
    });
    CHECK(r.run.quality().merged_wrongly == 0);
  }
  SUBCASE("a new one") {
    int failures = 0;
    bool more = true;
    for (long n = 0; more; n += 1 + n / 8) {
      stereo_run<> r(options, {}, small);
      r.run.notes_creation = false;
      r.run.steps(2);
      turbomap::local_mapper<flat_map, sequential, turbomap::no_adjustment> fresh(r.run.ctx, r.run.map, r.run.store,
                                                                                  options);
      for (std::size_t i = 0; i < 2; ++i)
        if (r.run.map.alive(r.run.keyframes()[i]))
          fresh.insert(r.run.keyframes()[i], r.scene.data<map_descriptor>(r.run.view(i)));
      const auto k = r.run.track();
      fresh.insert(k, r.scene.data<map_descriptor>(r.run.view(2)));
      more = false;
      {
        const no_memory_after limit(n);
        try {
          fresh.process(k);
        } catch (const std::bad_alloc&) {
          more = true;
        }
      }
      failures += more ? 1 : 0;
      REQUIRE(r.sound());
      const auto& report = fresh.process(k);
      CHECK(report.outcome[mapping_stage::keyframe_culling] == stage_outcome::done);
      REQUIRE(r.sound());
    }
    CHECK(failures > 20);
  }
}

}  // namespace
