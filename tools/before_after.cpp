// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// turbomap-before-after: one system, its local mapping written by hand, and by the library. See docs/programs.md.

#include <algorithm>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <thrust/system/cpp/execution_policy.h>
#include <CLI/CLI.hpp>

#include <turbomap/io/recording.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/validate.hpp>

#include "before_after/map_difference.hpp"
#include "before_after/sequential_mapping.hpp"
#include "objects_map/objects_map.hpp"
#include "progress.hpp"
#include "replay/replayed_map.hpp"
#include "replay/stage_times.hpp"
#include "run_program.hpp"

namespace {

using turbomap::mapping_stage;
using turbomap::per_stage;
using turbomap_before_after::compare;
using turbomap_before_after::sequential_mapping;
using turbomap_program::keyframe_ptr;
using turbomap_program::point_ptr;
using turbomap_replay::now_ms;
using camera = turbomap::pinhole<float>;
using map_type = turbomap_program::objects_map<camera>;
using world_type = turbomap_replay::replayed_map<map_type>;

/// Keyframe i comes from tracking. \param insert  what the system does with its features, timed
template <class Insert, class Process>
per_stage<double> step(world_type& world, std::int32_t i, const std::vector<turbomap::keypoint>& keypoints,
                       const Insert& insert, const Process& process) {
  const auto k = world.add(i, keypoints);
  const double begin = now_ms();
  insert(k);
  const double inserted = now_ms() - begin;
  world.associate(i);
  const auto& created = world.create(i);
  world.count_tracking(i);
  per_stage<double> ms = process(k, created);
  ms[mapping_stage::process] += inserted;
  return ms;
}

/// The system with the library in it.
class after {
 public:
  after(const turbomap::recording& recording, const turbomap::local_mapper_options& options)
      : world(recording, false),
        rig_(turbomap_replay::recorded_rig<camera>(recording.meta)),
        store_(turbomap_replay::recorded_store_options(recording.meta)),
        mapper_(context_, world.map(), store_, options, hooks()) {}

  per_stage<double> process(const turbomap::recording& recording, std::int32_t i) {
    const auto data = turbomap_replay::recorded_keyframe(recording, static_cast<std::size_t>(i), rig_, keypoints_);
    return step(
        world, i, keypoints_, [&](const keyframe_ptr& k) { mapper_.insert(k, data); },
        [&](const keyframe_ptr& k, const std::vector<point_ptr>& created) {
          mapper_.watch(created);
          return mapper_.process(k).ms;
        });
  }
  world_type world;

 private:
  turbomap::local_mapper_hooks<map_type> hooks() {
    turbomap::local_mapper_hooks<map_type> hooks;
    hooks.erasing = [this](const keyframe_ptr& k) { world.remember(k); };
    return hooks;
  }
  std::vector<turbomap::rig_camera<camera>> rig_;
  turbomap::context<> context_;
  turbomap::keyframe_store<turbomap_replay::orb, camera> store_;
  turbomap::local_mapper<map_type, turbomap::context<>::policy_type, turbomap::no_adjustment> mapper_;
  std::vector<turbomap::keypoint> keypoints_;
};

/// The system as it was.
class before {
 public:
  before(const turbomap::recording& recording, const turbomap::local_mapper_options& options)
      : world(recording, false),
        mapping_(world.map(), turbomap_replay::recorded_rig<camera>(recording.meta)[0].camera, recording.meta.bf,
                 recording.meta.bounds, recording.meta.grid_columns, recording.meta.grid_rows, options) {}

  per_stage<double> process(const turbomap::recording& recording, std::int32_t i) {
    const auto at = static_cast<std::size_t>(i);
    return step(
        world, i, recording.gather_keypoints(at),
        [&](const keyframe_ptr& k) { mapping_.insert(k, recording.descriptors(at).data()->data()); },
        [&](const keyframe_ptr& k, const std::vector<point_ptr>& created) {
          mapping_.watch(created);
          return mapping_.process(k, [this](const keyframe_ptr& erased) { world.remember(erased); });
        });
  }
  double covisible_ms() const { return mapping_.covisible_ms(); }
  world_type world;

 private:
  sequential_mapping mapping_;
};

turbomap::local_mapper_options defaults(const turbomap::recording_meta& meta) {
  auto o = turbomap::local_mapper_options::stereo(meta.baseline, meta.close_depth, meta.pyramid());
  o.enabled[mapping_stage::adjustment] = false;
  return o;
}
/// The rules of the system as it was.
turbomap::local_mapper_options parity(const turbomap::recording_meta& meta) {
  auto o = defaults(meta);
  o.search.candidate_set = turbomap::candidates::grouped;
  o.search.ties = turbomap::tie_rule::highest_index;
  o.creation.rule = turbomap::creation_rule::pairs;
  o.fusion.mode = turbomap::fusion_mode::serial_exact;
  o.fusion.commit.merges = turbomap::merge_rule::drop;
  o.most_views = 0;
  return o;
}

/// What one of the three took, over the keyframes that count.
struct mapping_times {
  per_stage<turbomap::duration_statistics> stages;
  turbomap::duration_statistics total;

  void add(const per_stage<double>& ms) {
    double sum = 0;
    for (std::size_t s = 0; s < turbomap::mapping_stages; ++s) stages.values[s].add(ms.values[s]), sum += ms.values[s];
    total.add(sum);
  }
};
void print(const mapping_times& hand, const mapping_times& same, const mapping_times& own, double covisible_ms) {
  std::printf("%-18s %12s %12s %8s %12s %8s\n", "mean ms", "by hand", "same rules", "ratio", "defaults", "ratio");
  const auto line = [](const char* name, double a, double b, double c) {
    std::printf("%-18s %12.3f %12.3f %7.1fx %12.3f %7.1fx\n", name, a, b, a / b, c, a / c);
  };
  for (std::size_t s = 0; s < turbomap::mapping_stages; ++s)
    if (const auto stage = static_cast<mapping_stage>(s); stage != mapping_stage::adjustment)
      line(turbomap::to_string(stage), hand.stages[stage].mean(), same.stages[stage].mean(), own.stages[stage].mean());
  std::printf("%-18s %12.3f   in the stages of the library, and kept in a graph by most systems\n", "shared points",
              covisible_ms);
  line("total without it", hand.total.mean(), same.total.mean(), own.total.mean());
}

}  // namespace

int main(int argc, char** argv) {
  std::string path;
  bool each = false;
  CLI::App app(
      "A system with objects behind shared_ptr maps a recording three times: by local mapping written by hand, by the "
      "library with the same rules, and by the library as it is. Prints the times of every stage, and whether the "
      "first two maps are the same.",
      "turbomap-before-after");
  app.footer("Example:\n  turbomap-before-after recordings/euroc_v102_stereo");
  app.add_option(
         "RECORDING", path,
         "folder of a recording with one rectified stereo camera and visual words (not one of turbomap-extract)")
      ->required();
  app.add_flag("--each", each, "compare after each keyframe, and stop at the first that differs");
  return turbomap_program::run_program(app, argc, argv, [&] {
    const turbomap::recording recording = turbomap::read_recording(path);
    const auto& meta = recording.meta;
    if (meta.is_fisheye() || !(meta.bf > 0))
      throw std::invalid_argument(path + ": is not of one rectified stereo camera");
    if (std::all_of(recording.kp_node.begin(), recording.kp_node.end(),
                    [](auto word) { return word == turbomap::keypoint::no_group; }))
      throw std::invalid_argument(path + ": has no visual words: by hand only keypoints of one word are compared");
    before hand(recording, parity(meta));
    after same(recording, parity(meta)), own(recording, defaults(meta));
    mapping_times times[3];
    turbomap::duration_statistics counting;
    std::optional<turbomap_program::progress> bar;
    bar.emplace("before and after", recording.keyframe_count());
    for (std::size_t n = 0; n < recording.keyframe_count(); ++n, bar->advance()) {
      const auto i = static_cast<std::int32_t>(n);
      const per_stage<double> ms[]{hand.process(recording, i), same.process(recording, i), own.process(recording, i)};
      if (n >= turbomap_replay::warm_up) counting.add(hand.covisible_ms());
      for (int m = 0; m < 3 && n >= turbomap_replay::warm_up; ++m) times[m].add(ms[m]);
      if (each && !compare(hand.world.map(), same.world.map()).equal()) {
        bar.reset();
        std::printf("the maps differ after keyframe %zu\n", n);
        break;
      }
    }
    bar.reset();
    print(times[0], times[1], times[2], counting.mean());
    const auto d = compare(hand.world.map(), same.world.map());
    std::printf(
        "keyframes %zu and %zu, points %zu and %zu\n"
        "by hand and with the same rules: %s (keyframes %s; %zu points differ in existence, %zu in their observations, "
        "%zu in their descriptors; positions by %.1e m at most, normals and ranges by %.1e)\n",
        hand.world.map().keyframe_count(), same.world.map().keyframe_count(), hand.world.map().point_count(),
        same.world.map().point_count(), d.equal() ? "the same map" : "NOT the same map",
        d.keyframes == 0 ? "equal" : "differ", d.points, d.observations, d.descriptors, d.position_m, d.appearance);
    std::size_t faults = 0;
    for (const map_type* map : {&hand.world.map(), &same.world.map(), &own.world.map()})
      faults += turbomap::validate(*map).size();
    std::printf("faults in the three maps: %zu\n", faults);
    return d.equal() && faults == 0 ? 0 : 1;
  });
}
