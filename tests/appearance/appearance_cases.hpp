// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The checks of the update of map points, for every execution policy, host or device.

#include <turbomap/appearance/update_appearance.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/descriptor/real.hpp>

#include <thrust/detail/seq.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "reference/appearance_oracle.hpp"
#include "scenes/keyframe_samples.hpp"
#include "scenes/matching_scene.hpp"

namespace turbomap_test {

using one_by_one = std::decay_t<decltype(thrust::seq)>;
using orb_bits = turbomap::binary_descriptor<256>;

/// Observations of random points.
struct observed_points {
  std::vector<turbomap::vec3<double>> position;
  std::vector<std::int32_t> offset{0}, reference;
  std::vector<turbomap::point_observation> observations;

  turbomap::appearance_view view() const {
    return {static_cast<int>(position.size()), position.data(), offset.data(), observations.data(), reference.data()};
  }
  void add(const turbomap::vec3<double>& x, std::int32_t reference_keyframe,
           const std::vector<turbomap::point_observation>& seen) {
    position.push_back(x);
    reference.push_back(reference_keyframe);
    observations.insert(observations.end(), seen.begin(), seen.end());
    offset.push_back(static_cast<std::int32_t>(observations.size()));
  }
};

/// Points with so many random observations each.
template <class Descriptor, class Camera>
observed_points observe_counts(const std::vector<turbomap::posed_keyframe<Descriptor, Camera>>& keyframes,
                               const std::vector<int>& counts, std::mt19937& random) {
  const auto below = [&random](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  observed_points points;
  for (const int count : counts) {
    std::vector<turbomap::point_observation> seen;
    for (int k = 0; k < count; ++k) {
      const int keyframe = below(static_cast<int>(keyframes.size()));
      seen.push_back({keyframe, below(keyframes[static_cast<std::size_t>(keyframe)].view.keypoint_count)});
    }
    const auto at = [&] { return below(2001) / 100.0 - 10; };
    points.add({at(), at(), at()}, count == 0 ? -1 : seen[static_cast<std::size_t>(below(count))].keyframe, seen);
  }
  return points;
}

/// Points with few and many observations, on both sides of the table of the medoid, of keyframes in any order.
template <class Descriptor, class Camera>
observed_points observe_anything(const std::vector<turbomap::posed_keyframe<Descriptor, Camera>>& keyframes,
                                 unsigned seed) {
  std::mt19937 random(seed);
  std::vector<int> counts{0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 62, 63, 64, 65, 66, 127, 128, 129, 0};
  for (int i = 0; i < 60; ++i) counts.push_back(static_cast<int>(random() % 20));
  return observe_counts(keyframes, counts, random);
}

/// What a call gives.
template <class Descriptor>
struct update_plan {
  std::vector<turbomap::point_appearance> points;
  std::vector<typename Descriptor::element> descriptors;

  bool operator==(const update_plan& b) const {
    const auto same = [](const auto& x, const auto& y) {
      return x.size() == y.size() && (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
    };
    return same(points, b.points) && same(descriptors, b.descriptors);
  }
};
static_assert(sizeof(turbomap::point_appearance) == 48, "no padding: compared by bytes");

template <class Policy, class Descriptor, class Camera>
update_plan<Descriptor> update_under(const Policy& policy, const scene<Descriptor, Camera>& s,
                                     const observed_points& points, const turbomap::appearance_options& options) {
  turbomap::context<Policy> ctx(policy);
  const resident_scene<Descriptor, Camera, Policy> keyframes(ctx, s);
  turbomap::appearances<Descriptor, Camera, Policy> updates(ctx);
  turbomap::update_appearance(ctx, points.view(), keyframes.neighbours(), options, updates);
  update_plan<Descriptor> plan;
  updates.plan(ctx, plan.points, plan.descriptors);
  return plan;
}

/// a == b within 1e-6 of a, or of `scale` if that is more.
inline bool is_close(float a, float b, double scale = 0) {
  return std::abs(static_cast<double>(a) - b) <= 1e-6 * std::max(scale, static_cast<double>(std::abs(a)));
}

/// Under `policy` == under thrust::seq to the last bit, for points with so many views.
template <class Policy, class Descriptor, class Camera>
void check_many_views(const Policy& policy, const test_rig<Camera>& rig, const std::vector<int>& counts) {
  scene_recipe recipe;
  recipe.neighbours = 9, recipe.query_keypoints = 20, recipe.neighbour_keypoints = 40, recipe.noise = 40;
  scene<Descriptor, Camera> s(rig, recipe);
  std::mt19937 random(5);
  const observed_points points = observe_counts(s.neighbours(), counts, random);
  turbomap::appearance_options options;
  options.scales = s.scales(), options.covariance = true;
  for (const int most : {0, 33, 300}) {
    CAPTURE(most);
    options.most_views = most;
    const auto got = update_under(policy, s, points, options),
               expected = update_under(one_by_one{}, s, points, options);
    REQUIRE(got.points.size() == counts.size());
    CHECK(got == expected);
    for (std::size_t i = 0; i < counts.size(); ++i) CHECK(got.points[i].medoid == expected.points[i].medoid);
  }
}

/// Under `policy` == under thrust::seq to the last bit == the oracle.
template <class Policy, class Descriptor, class Camera>
void check_update(const Policy& policy, const test_rig<Camera>& rig, unsigned seed, motion how = motion::sideways,
                  int levels = 8, float scale_factor = 1.2F) {
  scene_recipe recipe;
  recipe.seed = seed, recipe.how = how, recipe.neighbours = 9, recipe.query_keypoints = 20;
  recipe.neighbour_keypoints = 40, recipe.noise = 40, recipe.levels = levels, recipe.scale_factor = scale_factor;
  scene<Descriptor, Camera> s(rig, recipe);
  const auto keyframes = s.neighbours();
  const observed_points points = observe_anything(keyframes, seed);
  const int bounds[]{0, 64, 5, 16};
  int bound = 0;
  for (const auto [descriptors, geometry] : {std::array<bool, 2>{true, true}, std::array<bool, 2>{true, false},
                                             std::array<bool, 2>{false, true}, std::array<bool, 2>{true, true}}) {
    turbomap::appearance_options options;
    options.most_views = bounds[bound++];
    options.scales = s.scales(), options.descriptors = descriptors, options.geometry = geometry;
    options.covariance = geometry, options.stereo_correlation = descriptors ? 0.5 : 0;
    const auto got = update_under(policy, s, points, options);
    if constexpr (!std::is_same_v<Policy, one_by_one>) CHECK(got == update_under(one_by_one{}, s, points, options));
    const auto expected = appearance_oracle(points.view(), keyframes, options);
    int compared = 0;
    REQUIRE(got.points.size() == expected.size());
    REQUIRE(got.descriptors.size() == (descriptors ? expected.size() * Descriptor::elements : 0));
    for (std::size_t i = 0; i < expected.size(); ++i) {
      CAPTURE(i);
      const auto &g = got.points[i], &e = expected[i];
      CHECK(g.medoid == e.medoid);
      CHECK(is_close(e.normal.x, g.normal.x, 1));
      CHECK(is_close(e.normal.y, g.normal.y, 1));
      CHECK(is_close(e.normal.z, g.normal.z, 1));
      CHECK(is_close(e.min_distance, g.min_distance));
      CHECK(is_close(e.max_distance, g.max_distance));
      if (!std::isnan(e.covariance.xx)) {
        ++compared;
        CHECK((to_eigen(g.covariance) - to_eigen(e.covariance)).norm() <= 1e-4 * to_eigen(e.covariance).norm());
      }
      if (!descriptors) continue;
      std::vector<typename Descriptor::element> element(Descriptor::elements);
      if (e.medoid >= 0) {
        const auto& o = points.observations[static_cast<std::size_t>(points.offset[i] + e.medoid)];
        const auto* d = keyframes[static_cast<std::size_t>(o.keyframe)].view.descriptor_of(o.keypoint);
        element.assign(d, d + Descriptor::elements);
      }
      CHECK(std::memcmp(element.data(), got.descriptors.data() + i * Descriptor::elements, Descriptor::bytes) == 0);
    }
    CHECK(compared > 5);
  }
}

/// What is known without an oracle: two cameras a metre apart on the body, three keyframes.
template <class Policy>
struct known_scene {
  using posed = turbomap::posed_keyframe<orb_bits, pinhole_camera>;

  known_scene() {
    scene_recipe recipe;
    recipe.neighbours = 3, recipe.query_keypoints = 0, recipe.neighbour_keypoints = 4;
    auto rig = pinhole_rig();
    rig.cameras.push_back(rig.cameras[0]);
    rig.cameras[1].T_camera_body.tx = -1;  // its centre is at x = 1
    host.emplace(rig, recipe);
    for (std::size_t k = 1; k < host->frames.size(); ++k) {
      auto& f = host->frames[k];
      f.T_cw = {};
      f.T_cw.tx = -3 * static_cast<double>(k - 1);  // body centres at x = 0, 3, 6
      for (int i = 0; i < 4; ++i) {
        f.keypoints[static_cast<std::size_t>(i)].camera = i < 2 ? 0 : 1;
        f.keypoints[static_cast<std::size_t>(i)].octave = static_cast<std::uint8_t>(i);
      }
      std::fill(f.descriptors.begin(), f.descriptors.end(), std::uint8_t{0});
      for (std::size_t i = 0; i < 4; ++i) f.descriptors[i * 32] = static_cast<std::uint8_t>((1 << i) - 1);  // i bits
      host->repack(f);
    }
  }
  update_plan<orb_bits> update(const observed_points& points, turbomap::appearance_options options = {}) {
    return update_under(Policy{}, *host, points, options);
  }
  std::optional<scene<orb_bits, pinhole_camera>> host;
};

template <class Policy>
void check_known_points() {
  known_scene<Policy> s;
  observed_points points;
  points.add({0, 0, 4}, 0, {{0, 1}});                  // straight ahead, octave 1
  points.add({3, 0, 4}, 1, {{0, 0}, {2, 0}, {1, 3}});  // 3-4-5 triangles; the reference sees it in camera 1 only
  points.add({0, 0, 2}, 0, {{0, 3}, {0, 2}, {0, 1}, {0, 0}});  // camera 0's keypoint although camera 1's comes first
  points.add({0, 0, 0}, 0, {{0, 1}, {1, 0}});                  // in the centre of a camera
  points.add({1, 2, 3}, -7, {});                               // seen by nobody
  points.add({3, 0, 1}, 1, {{1, 3}, {1, 2}});                  // camera 1 only: the first says the octave
  const auto plan = s.update(points);
  const auto& p = plan.points;
  const auto check = [](const turbomap::point_appearance& u, double nx, double nz, double most, int medoid) {
    CHECK(u.normal.x == doctest::Approx(nx).epsilon(1e-6));
    CHECK(u.normal.y == 0);
    CHECK(u.normal.z == doctest::Approx(nz).epsilon(1e-6));
    CHECK(u.max_distance == doctest::Approx(most).epsilon(1e-6));
    CHECK(u.min_distance == doctest::Approx(most / std::pow(1.2, 7)).epsilon(1e-6));
    CHECK(u.medoid == medoid);
  };
  REQUIRE(p.size() == 6);
  check(p[0], 0, 1, 4 * 1.2, 0);
  check(p[1], -1 / (3 * std::sqrt(17.0)), (0.8 + 0.8 + 4 / std::sqrt(17.0)) / 3, 4 * 1.728, 0);
  // distances 0 1 2 3 / 1 0 1 2 / 2 1 0 1 / 3 2 1 0 of the descriptors of 3, 2, 1, 0 bits: medians 1 1 1 1
  check(p[2], -1 / std::sqrt(5.0) / 2, (1 + 2 / std::sqrt(5.0)) / 2, 2 * 1.2, 0);
  check(p[3], -0.5, 0, 0, 0);
  check(p[4], 0, 0, 0, -1);
  check(p[5], -1 / std::sqrt(2.0), 1 / std::sqrt(2.0), 1.728, 0);
  CHECK(plan.descriptors[0] == 1);
  CHECK(plan.descriptors[2 * 32] == 7);
  CHECK(plan.descriptors[4 * 32] == 0);
  // Descriptors of 0, 3, 2 bits: rows 0 3 2 / 3 0 1 / 2 1 0, medians 2 1 1: the second, and in another order the first.
  observed_points order;
  order.add({0, 0, 2}, 0, {{0, 0}, {0, 3}, {0, 2}});
  order.add({0, 0, 2}, 0, {{0, 2}, {0, 3}, {0, 0}});
  order.add({0, 0, 2}, 0, {{0, 0}, {0, 3}, {0, 1}, {1, 0}, {2, 1}});  // 0 3 1 0 1: the medians are 1 2 1 1 1
  const auto ordered = s.update(order);
  CHECK(ordered.points[0].medoid == 1);
  CHECK(ordered.points[1].medoid == 0);
  CHECK(ordered.points[2].medoid == 0);
}

/// Nothing, and points that nobody sees.
template <class Policy>
void check_empty_updates() {
  known_scene<Policy> s;
  observed_points points;
  auto plan = s.update(points);
  CHECK(plan.points.empty());
  CHECK(plan.descriptors.empty());
  turbomap::context<Policy> ctx{Policy{}};
  turbomap::appearances<orb_bits, pinhole_camera, Policy> updates(ctx);
  turbomap::update_appearance(ctx, {}, turbomap::span<const typename known_scene<Policy>::posed>(), {}, updates);
  updates.plan(ctx, plan.points, plan.descriptors);
  CHECK(plan.points.empty());
  for (int i = 0; i < 3; ++i) points.add({0, 0, 1}, 0, {});
  turbomap::update_appearance(ctx, points.view(), turbomap::span<const typename known_scene<Policy>::posed>(), {},
                              updates);
  updates.plan(ctx, plan.points, plan.descriptors);
  REQUIRE(plan.points.size() == 3);
  for (const auto& p : plan.points) CHECK((p.medoid == -1 && p.max_distance == 0 && p.normal.z == 0));
  CHECK(plan.descriptors == std::vector<std::uint8_t>(3 * 32));
}

/// Descriptors that are no numbers are the farthest of all, and are taken only where there is nothing else.
template <class Policy>
void check_descriptors_of_nan() {
  using real = turbomap::real_descriptor<float, 8>;
  scene_recipe recipe;
  recipe.neighbours = 1, recipe.query_keypoints = 0, recipe.neighbour_keypoints = 12;
  scene<real, pinhole_camera> s(pinhole_rig(), recipe);
  auto& f = s.frames[1];
  const auto fill = [&f](int keypoint, float value) { std::fill_n(f.descriptors.begin() + keypoint * 8, 8, value); };
  for (int i = 0; i < 4; ++i) fill(i, std::numeric_limits<float>::quiet_NaN());
  fill(4, std::numeric_limits<float>::infinity());
  for (int i = 5; i < 12; ++i) fill(i, static_cast<float>(i));
  s.repack(f);
  observed_points points;
  points.add({0, 0, 1}, 0, {{0, 0}, {0, 1}, {0, 5}, {0, 6}, {0, 7}, {0, 8}});  // the numbers agree: 6 and 7 are first
  points.add({0, 0, 1}, 0, {{0, 0}, {0, 1}, {0, 2}, {0, 3}});                  // nothing else
  points.add({0, 0, 1}, 0, {{0, 4}, {0, 5}, {0, 0}});                          // all medians are infinite
  points.add({0, 0, 1}, 0, {{0, 4}, {0, 5}, {0, 6}});
  const auto plan = update_under(Policy{}, s, points, {});
  const auto expected = appearance_oracle(points.view(), s.neighbours(), {});
  for (std::size_t i = 0; i < 4; ++i) CHECK(plan.points[i].medoid == expected[i].medoid);
  CHECK(plan.points[0].medoid == 3);
  CHECK(plan.points[1].medoid == 0);
  CHECK(plan.points[2].medoid == 0);
  CHECK(plan.points[3].medoid == 1);
}

/// Bad input names itself, and the previous result stays.
template <class Policy>
void check_update_arguments() {
  using posed = typename known_scene<Policy>::posed;
  known_scene<Policy> s;
  turbomap::context<Policy> ctx{Policy{}};
  const resident_scene<orb_bits, pinhole_camera, Policy> resident(ctx, *s.host);
  const std::vector<posed> good(resident.neighbours().begin(), resident.neighbours().end());
  observed_points points;
  points.add({0, 0, 4}, 0, {{0, 1}});
  points.add({3, 0, 4}, 1, {{0, 0}, {2, 0}, {1, 3}});
  turbomap::appearances<orb_bits, pinhole_camera, Policy> updates(ctx);
  turbomap::update_appearance(ctx, points.view(), turbomap::span<const posed>(good), {}, updates);
  update_plan<orb_bits> before, after;
  updates.plan(ctx, before.points, before.descriptors);

  const auto message = [&](const turbomap::appearance_view& view, const std::vector<posed>& keyframes,
                           const turbomap::appearance_options& options) {
    try {
      turbomap::update_appearance(ctx, view, turbomap::span<const posed>(keyframes), options, updates);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  const auto refused_points = [&](const std::string& name, auto change) {
    observed_points p = points;
    change(p);
    CAPTURE(name);
    CHECK(message(p.view(), good, {}).find(name) != std::string::npos);
  };
  const auto refused_view = [&](const std::string& name, auto change) {
    auto v = points.view();
    change(v);
    CAPTURE(name);
    CHECK(message(v, good, {}).find(name) != std::string::npos);
  };
  const auto refused_keyframe = [&](const std::string& name, auto change) {
    auto keyframes = good;
    change(keyframes[2]);
    CAPTURE(name);
    CHECK(message(points.view(), keyframes, {}).find("keyframes[2]" + name) != std::string::npos);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused_points("view.reference[1] = 5", [](auto& p) { p.reference[1] = 5; });
  refused_points("view.reference[0] = 1", [](auto& p) { p.reference[0] = 1; });
  refused_points("view.reference[0] = -1", [](auto& p) { p.reference[0] = -1; });
  refused_points("view.observations[2].keyframe = 3", [](auto& p) { p.observations[2].keyframe = 3; });
  refused_points("view.observations[0].keyframe = -1", [](auto& p) { p.observations[0].keyframe = -1; });
  refused_points("view.observations[1].keypoint = 4", [](auto& p) { p.observations[1].keypoint = 4; });
  refused_points("view.observations[1].keypoint = -1", [](auto& p) { p.observations[1].keypoint = -1; });
  refused_points("view.observation_offset[0] = 1", [](auto& p) { p.offset[0] = 1; });
  refused_points("view.observation_offset[2] = 0", [](auto& p) { p.offset[2] = 0; });
  refused_points("view.position[1] = ", [nan](auto& p) { p.position[1].y = nan; });
  refused_view("view.count = -1", [](auto& v) { v.count = -1; });
  refused_view("view.position = null", [](auto& v) { v.position = nullptr; });
  refused_view("view.reference = null", [](auto& v) { v.reference = nullptr; });
  refused_view("view.observations = null", [](auto& v) { v.observations = nullptr; });
  refused_view("view.observation_offset = null", [](auto& v) { v.observation_offset = nullptr; });
  refused_keyframe(".T_cw", [nan](auto& k) { k.T_cw.tx = nan; });
  refused_keyframe(".T_cw squared quaternion norm", [](auto& k) { k.T_cw.qw = 2; });
  refused_keyframe(".view.camera_count = 0", [](auto& k) { k.view.camera_count = 0; });
  refused_keyframe(".view.camera_count = 2", [](auto& k) { k.view.cameras = nullptr; });
  refused_keyframe(".view.octave", [](auto& k) { k.view.octave = nullptr; });
  refused_keyframe(".view.descriptor", [](auto& k) { k.view.descriptor = nullptr; });
  refused_keyframe(".view.keypoint_count = -1", [](auto& k) { k.view.keypoint_count = -1; });
  if constexpr (turbomap::is_host_accessible_v<turbomap::memory_of_t<Policy>>) {
    const std::vector<std::uint8_t> cameras{2, 0, 0, 0};
    refused_keyframe(".view.camera = 2", [&cameras](auto& k) { k.view.camera = cameras.data(); });
  }
  const auto refused_scales = [&](const std::string& name, const turbomap::pyramid& scales) {
    turbomap::appearance_options options;
    options.scales = scales;
    CHECK(message(points.view(), good, options).find(name) != std::string::npos);
  };
  const auto refused_option = [&](const std::string& name, auto change) {
    turbomap::appearance_options options;
    change(options);
    CHECK(message(points.view(), good, options).find(name) != std::string::npos);
  };
  refused_option("options.covariance", [](auto& o) { o.covariance = true, o.geometry = false; });
  refused_option("options.most_views = -1", [](auto& o) { o.most_views = -1; });
  refused_option("options.stereo_correlation = 1", [](auto& o) { o.stereo_correlation = 1; });
  refused_scales("options.scales.levels = 0", {1.2F, 0});
  refused_scales("options.scales.levels = 257", {1.2F, 257});
  refused_scales("options.scales.scale_factor = 0.5", {0.5F, 8});
  refused_scales("options.scales.scale_factor", {std::numeric_limits<float>::quiet_NaN(), 8});
  refused_scales("options.scales.scale_factor", {std::numeric_limits<float>::infinity(), 8});
  updates.plan(ctx, after.points, after.descriptors);
  CHECK(after == before);

  // What is not asked for need not be there.
  auto bare = points.view();
  bare.position = nullptr, bare.reference = nullptr;
  turbomap::appearance_options only;
  only.geometry = false;
  auto keyframes = good;
  keyframes[2].view.cameras = nullptr, keyframes[2].view.octave = nullptr;
  CHECK(message(bare, keyframes, only) == "accepted");
  only.geometry = true, only.descriptors = false;
  keyframes = good;
  keyframes[2].view.descriptor = nullptr;
  CHECK(message(points.view(), keyframes, only) == "accepted");
}

/// After the first calls nothing is allocated; where memory runs out the result is empty. `upstream`: the policy's
/// memory.
template <class Policy>
void check_update_allocations(std::pmr::memory_resource* upstream) {
  counting_resource resource(upstream);
  {
    turbomap::context<Policy> ctx(Policy{}, &resource);
    scene<orb_bits, fisheye_camera> s(fisheye_rig(), {});
    const resident_scene<orb_bits, fisheye_camera, Policy> keyframes(ctx, s);
    const observed_points points = observe_anything(s.neighbours(), 3);
    turbomap::appearances<orb_bits, fisheye_camera, Policy> updates(ctx);
    const auto round = [&] { turbomap::update_appearance(ctx, points.view(), keyframes.neighbours(), {}, updates); };
    update_plan<orb_bits> first, later;
    for (int i = 0; i < 2; ++i) round();
    updates.plan(ctx, first.points, first.descriptors);
    const long before = resource.allocations;
    CHECK(before > 0);
    for (int i = 0; i < 5; ++i) round();
    CHECK(resource.allocations == before);
    updates.plan(ctx, later.points, later.descriptors);
    CHECK(first == later);
    CHECK(first.points.size() == points.position.size());

    for (int refused = 0;; ++refused) {
      turbomap::appearances<orb_bits, fisheye_camera, Policy> fresh(ctx);
      resource.refuse_from = resource.allocations + refused, resource.refusals = 1;
      bool failed = false;
      try {
        turbomap::update_appearance(ctx, points.view(), keyframes.neighbours(), {}, fresh);
      } catch (const std::bad_alloc&) {
        failed = true;
      }
      resource.refuse_from = -1;
      fresh.plan(ctx, later.points, later.descriptors);
      if (!failed) {
        CHECK(refused >= 3);  // points, descriptors, inputs
        CHECK(first == later);
        break;
      }
      CHECK(later.points.empty());
      CHECK(later.descriptors.empty());
    }
  }
  CHECK(resource.bytes_out == 0);
}

}  // namespace turbomap_test
