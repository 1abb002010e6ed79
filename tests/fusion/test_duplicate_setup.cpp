// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Bad input of the duplicate search, the memory it asks for, and several contexts at once.

#include <thrust/execution_policy.h>

#include <atomic>
#include <functional>
#include <initializer_list>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>

#include "duplicate_cases.hpp"
#include "scenes/keyframe_samples.hpp"
#include "support/counted_new.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::duplicate_options;
using scene = duplicate_scene<orb, pinhole_camera>;
using target = scene::target;
using targets = turbomap::span<const target>;
template <class Policy>
using duplicates = turbomap::duplicates<orb, pinhole_camera, Policy>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

scene make_scene(unsigned seed = 1) { return {{pinhole_rig(50)}, seeded(seed)}; }

/// A search and the result it left; refused calls must leave it like that.
struct bad_input {
  scene s = make_scene();
  turbomap::context<sequential> ctx{};
  duplicates<sequential> result{ctx};
  turbomap::map_point_view<orb> points = s.points();
  std::vector<target> all = s.targets();
  duplicate_options options = keep_trials();

  static duplicate_options keep_trials() {
    duplicate_options options;
    options.keep_trials = true;
    return options;
  }
  bad_input() { turbomap::find_duplicates(ctx, points, targets(all), options, result); }

  /// `spoil` changes a copy; the message must hold `text`.
  void refused(const char* text, const std::function<void(bad_input&)>& spoil) {
    CAPTURE(text);
    const auto before = result.plan(ctx);
    const auto trials = result.trials(ctx);
    REQUIRE(!before.empty());
    const auto good_targets = all;
    spoil(*this);
    std::string message;
    try {
      turbomap::find_duplicates(ctx, points, targets(all), options, result);
    } catch (const std::invalid_argument& e) {
      message = e.what();
    }
    CAPTURE(message);
    CHECK(message.find(text) != std::string::npos);
    CHECK(same(result.plan(ctx), before));
    CHECK(same(result.trials(ctx), trials));
    points = s.points(), all = good_targets, options = keep_trials();
    turbomap::find_duplicates(ctx, points, targets(all), options, result);
    CHECK(same(result.plan(ctx), before));
  }
};

TEST_CASE("bad targets are refused by name, and the last result stays") {
  bad_input in;
  in.refused("targets[0].T_cw = nan", [](auto& b) { b.all[0].T_cw.tx = nan; });
  in.refused("targets[2].T_cw = inf", [](auto& b) { b.all[2].T_cw.qw = infinity; });
  in.refused("targets[1].T_cw squared quaternion norm = ", [](auto& b) { b.all[1].T_cw.qw += 0.5; });
  in.refused("targets[1].skip.size() = 149", [](auto& b) { b.all[1].skip = b.all[1].skip.subspan(0, 149); });
  in.refused("targets[1].skip.size() = 151", [](auto& b) { b.all[1].skip = {b.all[1].skip.data(), 151}; });
  in.refused("targets[0].view = null", [](auto& b) { b.all[0].view.pixel = nullptr; });
  in.refused("targets[0].view = null", [](auto& b) { b.all[0].view.octave = nullptr; });
  in.refused("targets[2].view = null", [](auto& b) { b.all[2].view.descriptor = nullptr; });
  in.refused("targets[0].view.keypoint_count = -1", [](auto& b) { b.all[0].view.keypoint_count = -1; });
  in.refused("targets[0].view.camera_count = 0", [](auto& b) { b.all[0].view.camera_count = 0; });
  in.refused("targets[0].view.camera_count = 1", [](auto& b) { b.all[0].view.cameras = nullptr; });
  in.refused("targets[1].view.cells.bounds = 0", [](auto& b) { b.all[1].view.cells = {}; });
  in.refused("targets[1].view.cells.bounds = inf",
             [](auto& b) { b.all[1].view.cells.bounds.max_x = std::numeric_limits<float>::infinity(); });
  in.refused("targets[1].view.cells.bounds = ",
             [](auto& b) { b.all[1].view.cells.bounds.min_y = std::numeric_limits<float>::quiet_NaN(); });
  in.refused("targets[1].view.cells.columns = -3", [](auto& b) { b.all[1].view.cells.columns = -3; });
  in.refused("targets[1].view.cells.columns = 64", [](auto& b) { b.all[1].view.cells.rows = 0; });
  in.refused("targets[1].view.cells = null", [](auto& b) { b.all[1].view.cells.offsets.data = nullptr; });
  in.refused("targets[1].view.cells = null", [](auto& b) { b.all[1].view.cells.keypoints.data = nullptr; });
  in.refused("targets[1].view.cells.inverse_width = 0", [](auto& b) { b.all[1].view.cells.inverse_width = 0; });
  in.refused("targets[1].view.cells.inverse_width = ",
             [](auto& b) { b.all[1].view.cells.inverse_height = std::numeric_limits<float>::infinity(); });
}

TEST_CASE("bad points are refused by name, and the last result stays") {
  bad_input in;
  in.refused("points.count = -1", [](auto& b) { b.points.count = -1; });
  in.refused("points.position = null", [](auto& b) { b.points.position = nullptr; });
  in.refused("points.normal = null", [](auto& b) { b.points.normal = nullptr; });
  in.refused("points.min_distance = null", [](auto& b) { b.points.min_distance = nullptr; });
  in.refused("points.max_distance = null", [](auto& b) { b.points.max_distance = nullptr; });
  in.refused("points.descriptor = null", [](auto& b) { b.points.descriptor = nullptr; });
  in.refused("points x cameras of all targets", [](auto& b) {
    b.points.count = std::numeric_limits<int>::max() / 2;
    for (auto& t : b.all) t.skip = {};
  });
}

TEST_CASE("bad options are refused by name, and the last result stays") {
  bad_input in;
  const auto option = [&in](const char* name, auto member, std::initializer_list<double> values) {
    for (const double v : values)
      in.refused((std::string("options.") + name + " = ").c_str(), [&](auto& b) { member(b.options) = v; });
  };
  option("radius", [](auto& o) -> double& { return o.radius; }, {-1, 0, nan, infinity});
  option("min_view_cosine", [](auto& o) -> double& { return o.min_view_cosine; }, {-1.01, 1.01, nan});
  option("min_range_factor", [](auto& o) -> double& { return o.min_range_factor; }, {-0.1, nan, infinity});
  option("max_range_factor", [](auto& o) -> double& { return o.max_range_factor; }, {-0.1, nan, infinity});
  option("mono_chi2", [](auto& o) -> double& { return o.mono_chi2; }, {-1, 0, nan, infinity});
  option("stereo_chi2", [](auto& o) -> double& { return o.stereo_chi2; }, {-1, 0, nan, infinity});
  option("max_distance", [](auto& o) -> double& { return o.max_distance; }, {-1, nan, infinity, 1e10});
  for (const float v : {-1.0F, 0.5F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
    in.refused("options.scales.scale_factor = ", [&](auto& b) { b.options.scales.scale_factor = v; });
  for (const int v : {-1, 0, 257})
    in.refused("options.scales.levels = ", [&](auto& b) { b.options.scales.levels = v; });
  in.refused("options.finer_octaves = -1", [](auto& b) { b.options.finer_octaves = -1; });
  in.refused("options.coarser_octaves = -1", [](auto& b) { b.options.coarser_octaves = -1; });
  for (const int v : {-1, 8}) in.refused("options.window_octave = ", [&](auto& b) { b.options.window_octave = v; });
}

/// Allocations of one search and its plan, after some rounds of warming up.
template <class Policy>
void check_steady_state(bool count_everything) {
  auto s = make_scene();
  const auto all = s.targets();
  counting_resource resource(std::pmr::new_delete_resource());
  {
    turbomap::context<Policy> ctx(Policy{}, &resource, &resource);
    duplicates<Policy> found(ctx);
    typename duplicates<Policy>::plan_type plan;
    long before = 0, before_resource = 0;
    for (int round = 0; round < 8; ++round) {
      if (round == 4) before = allocations, before_resource = resource.allocations;
      for (const bool keep : {true, false}) {
        duplicate_options options;
        options.keep_trials = keep;
        turbomap::find_duplicates(ctx, s.points(), targets(all), options, found);
        found.plan(ctx, plan);
      }
    }
    CHECK(resource.allocations == before_resource);
    if (count_everything) CHECK(allocations == before);
    CHECK(resource.allocations > 0);  // the user's memory was used
    CHECK(!plan.empty());
  }
  CHECK(resource.bytes_out == 0);
  CHECK(resource.mismatched == 0);
}

TEST_CASE("in the steady state nothing is allocated") {
  check_steady_state<sequential>(true);
  turbomap_test::for_each_parallel_policy([](auto policy) { check_steady_state<decltype(policy)>(false); });
}

TEST_CASE("all memory comes from the user's resource") {
  auto s = make_scene();
  const auto all = s.targets();
  counting_resource resource(std::pmr::new_delete_resource());
  counting_resource other(std::pmr::new_delete_resource());
  auto* const previous = std::pmr::set_default_resource(&other);
  {
    turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
    CHECK(!turbomap::find_duplicates(ctx, s.points(), targets(all)).plan(ctx).empty());
  }
  std::pmr::set_default_resource(previous);
  CHECK(other.allocations == 0);
  CHECK(resource.allocations > 0);
}

TEST_CASE("wherever memory runs out, the next call works and nothing is lost") {
  auto s = make_scene();
  const auto all = s.targets();
  duplicate_options options;
  options.keep_trials = true;
  const auto expected = turbomap::find_duplicates(sequential{}, s.points(), targets(all), options);
  bool refused = true;
  long from = 0;
  for (; refused; ++from) {
    counting_resource resource(std::pmr::new_delete_resource());
    {
      turbomap::context<sequential> ctx(sequential{}, &resource, &resource);
      duplicates<sequential> found(ctx);
      // A small search first, so that the refused call has something to grow.
      turbomap::find_duplicates(ctx, s.points(), targets(all.data(), 1), options, found);
      resource.refuse_from = resource.allocations + from, resource.refusals = 1;
      refused = false;
      try {
        turbomap::find_duplicates(ctx, s.points(), targets(all), options, found);
      } catch (const std::bad_alloc&) {
        refused = true;
        CHECK(found.plan(ctx).empty());
      }
      turbomap::find_duplicates(ctx, s.points(), targets(all), options, found);
      CHECK(same(found.plan(ctx), expected));
    }
    CHECK(resource.bytes_out == 0);
    CHECK(resource.mismatched == 0);
    REQUIRE(from < 100);
  }
  CHECK(from > 3);
}

TEST_CASE("contexts on several threads share the keyframes and nothing else") {
  std::vector<scene> scenes;
  for (unsigned seed = 0; seed < 3; ++seed) scenes.push_back(make_scene(seed));
  std::vector<duplicates<sequential>::plan_type> expected;
  std::vector<std::vector<target>> all;
  for (auto& s : scenes) {
    all.push_back(s.targets());
    expected.push_back(turbomap::find_duplicates(sequential{}, s.points(), targets(all.back())));
  }
  std::atomic<int> wrong{0};
  const auto work = [&](unsigned t) {
    turbomap::context<sequential> ctx{};
    duplicates<sequential> found(ctx);
    for (unsigned round = 0; round < 12; ++round) {
      const std::size_t i = (round + t) % scenes.size();
      duplicate_options options;
      options.keep_trials = round % 2 == 0;
      turbomap::find_duplicates(ctx, scenes[i].points(), targets(all[i]), options, found);
      if (!same(found.plan(ctx), expected[i])) ++wrong;
    }
  };
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) threads.emplace_back(work, t);
  for (auto& t : threads) t.join();
  CHECK(wrong == 0);
}

}  // namespace
