// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A small map with its truth to adjust, in any type of map, and what one adjustment leaves of it.

#include <turbomap/map/map_edit.hpp>
#include <turbomap/mapping/global_adjustment.hpp>
#include <turbomap/mapping/local_adjustment.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "scenes/map_scene.hpp"
#include "scenes/matching_rigs.hpp"

namespace turbomap_test {

struct local_recipe {
  int keyframes = 10, points = 120;
  unsigned seed = 1;
  double pixel_noise = 0.5;                  ///< px, at the finest level
  double error_m = 0.02, error_rad = 0.004;  ///< of poses; points are off by 2.5 error_m
  double outliers = 0;                       ///< share of keypoints that are 40 px off
  int cameras = 2;                           ///< that a keyframe has
  bool alternate = false;  ///< every second keyframe has cameras of its own, after the others in the rig
};

/// Keyframes along a wall, 1.2 m apart, looking at it: each sees a part of the points, by a rectified stereo pair and by a
/// third camera beside it.
template <class Map>
struct local_scene {
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;

  local_recipe recipe;
  std::vector<turbomap::rig_camera<pinhole_camera>> rig;  ///< of all keyframes
  Map map;
  std::vector<keyframe> keyframes;
  std::vector<point> points;
  std::vector<turbomap::rigid_transform<double>> true_poses;
  std::vector<turbomap::vec3<double>> true_points;
  std::set<std::pair<std::size_t, std::size_t>> wrong;  ///< keyframe, keypoint: the outliers

  explicit local_scene(const local_recipe& r = {}) : recipe(r) {
    std::mt19937 random(r.seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::normal_distribution<double> normal;
    for (int c = 0; c < (r.alternate ? 2 : 1) * r.cameras; ++c) {
      const float f = 400 - 30 * static_cast<float>(c);
      const bool left = c % r.cameras == 0;
      rig.push_back({pinhole_camera{f, f + 1, 320, 240},
                     left ? turbomap::rigid_transform<double>{} : beside(10),
                     left ? 40.0 : 0.0,
                     {}});
    }
    const double width = 1.2 * r.keyframes;
    for (int l = 0; l < r.points; ++l) {
      true_points.push_back(
          {width / 2 + (width / 2 + 3) * uniform(random), 2 * uniform(random), 6 + 2 * uniform(random)});
      auto x = true_points.back();
      x.x += 2.5 * r.error_m * normal(random), x.y += 2.5 * r.error_m * normal(random);
      x.z += 2.5 * r.error_m * normal(random);
      points.push_back(traits::add_point(map, x, keyframe{}));
    }
    for (int f = 0; f < r.keyframes; ++f) {
      const double truth[6] = {0.05 * uniform(random), 0.05 * uniform(random), 0.05 * uniform(random), -1.2 * f,
                               0.2 * uniform(random),  0.2 * uniform(random)};
      double error[6];
      for (int i = 0; i < 6; ++i) error[i] = (i < 3 ? r.error_rad : r.error_m) * normal(random);
      true_poses.push_back(turbomap::left_exp(truth, turbomap::rigid_transform<double>{}));
      std::vector<turbomap::keypoint> keypoints;
      std::vector<std::size_t> seen;
      const int first = r.alternate ? f % 2 * r.cameras : 0;
      for (int c = 0; c < r.cameras; ++c)
        for (std::size_t l = 0; l < true_points.size(); ++l) {
          turbomap::keypoint k;
          if (!look(rig[static_cast<std::size_t>(first + c)], true_poses.back(), true_points[l], k)) continue;
          k.camera = static_cast<std::uint8_t>(c), k.octave = static_cast<std::uint8_t>(random() % 4);
          const double sigma = r.pixel_noise * std::pow(1.2, k.octave), u = uniform(random);
          const bool off = std::abs(uniform(random)) < r.outliers;
          if (off) wrong.insert({keyframes.size(), keypoints.size()});
          k.x += static_cast<float>(sigma * normal(random) + (off ? std::copysign(40, u) : 0));
          k.y += static_cast<float>(sigma * normal(random));
          if (k.u_right >= 0) k.u_right += static_cast<float>(sigma * normal(random));
          if (random() % 3 == 0) k.u_right = -1;
          keypoints.push_back(k), seen.push_back(l);
        }
      const auto k = insert_keyframe(map, keypoints, f, keyframe{});
      keyframes.push_back(k);
      traits::set_pose(map, k, turbomap::left_exp(error, true_poses.back()));
      for (std::size_t i = 0; i < seen.size(); ++i) turbomap::observe(map, points[seen[i]], k, i);
    }
    for (const auto& p : points) {
      keyframe first{};
      traits::for_each_observation(map, p, [&](keyframe k, std::size_t) { first = first == keyframe{} ? k : first; });
      traits::set_reference(map, p, first);
    }
  }
  /// The cameras of keyframe f.
  turbomap::rig_view<pinhole_camera> rig_of(std::size_t f) const {
    return {rig.data() + (recipe.alternate ? f % 2 * static_cast<std::size_t>(recipe.cameras) : 0), recipe.cameras};
  }

  /// Everything that an adjustment may change, to the last bit: poses, slots, positions, who is alive.
  std::string state() const {
    std::string bytes;
    const auto put = [&bytes](const auto& value) {
      char raw[sizeof value];
      std::memcpy(raw, &value, sizeof value);
      bytes.append(raw, sizeof value);
    };
    for (const auto& k : keyframes) {
      put(traits::alive(map, k));
      if (!traits::alive(map, k)) continue;
      put(turbomap::rigid_transform<double>(traits::pose(map, k)));
      for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) {
        const point p = traits::point_at(map, k, i);
        put(p == point{} ? ~std::uint64_t{0} : traits::id(map, p));
      }
    }
    for (const auto& p : points) {
      put(traits::alive(map, p));
      if (traits::alive(map, p)) put(turbomap::vec3<double>(traits::position(map, p)));
    }
    return bytes;
  }

 private:
  static bool look(const turbomap::rig_camera<pinhole_camera>& c, const turbomap::rigid_transform<double>& T_cw,
                   const turbomap::vec3<double>& X, turbomap::keypoint& k) {
    using turbomap::operator*;
    const auto p = turbomap::to_isometry<double>(c.T_camera_body) * (turbomap::to_isometry<double>(T_cw) * X);
    turbomap::vec2<double> pixel{};
    if (p.z < 1 || !c.camera.project(p, pixel)) return false;
    if (pixel.x < 0 || pixel.x >= 640 || pixel.y < 0 || pixel.y >= 480) return false;
    k.x = static_cast<float>(pixel.x), k.y = static_cast<float>(pixel.y);
    if (c.bf > 0 && pixel.x - c.bf / p.z >= 0) k.u_right = static_cast<float>(pixel.x - c.bf / p.z);
    return true;
  }
};

/// A context, a store with all live keyframes of a scene, and the stage.
template <class Map, class Policy>
struct adjustment_run {
  using traits = turbomap::map_traits<Map>;

  local_scene<Map>& scene;
  turbomap::context<Policy> ctx;
  turbomap::store_of<Map, Policy> store;
  turbomap::handle_table stored;
  turbomap::guard_times held;
  turbomap::local_adjustment<Map, Policy, turbomap::every_adjustment_method> adjust{ctx};

  adjustment_run(const Policy& policy, local_scene<Map>& scene) : scene(scene), ctx(policy) {
    for (std::size_t f = 0; f < scene.keyframes.size(); ++f)
      if (!(scene.keyframes[f] == typename traits::keyframe{}) && traits::alive(scene.map, scene.keyframes[f]))
        insert(f);
  }
  void insert(std::size_t f) {
    const auto k = scene.keyframes[f];
    std::vector<turbomap::keypoint> keypoints;
    for (std::size_t i = 0; i < turbomap::keypoint_count_of(scene.map, k); ++i)
      keypoints.push_back(turbomap::keypoint_of(scene.map, k, i));
    const std::vector<typename traits::descriptor::element> descriptors(
        keypoints.size() * static_cast<std::size_t>(traits::descriptor::elements));
    turbomap::keyframe_data<typename traits::descriptor, pinhole_camera> data;
    data.keypoint_count = static_cast<int>(keypoints.size());
    data.keypoints = keypoints.data(), data.descriptors = descriptors.data();
    const auto rig = scene.rig_of(f);
    data.cameras = rig.cameras, data.camera_count = rig.count;
    data.bounds = {-100, -100, 740, 580};  // outliers may lie outside the image
    stored.add(traits::id(scene.map, k), store.insert(data));
  }
  turbomap::mapping_scope<Map, Policy> scope() { return {ctx, scene.map, store, stored, held}; }
  /// All of the map: global_adjustment with memory of its own, as after a loop was closed.
  turbomap::local_adjustment_summary adjust_globally(std::size_t anyone,
                                                     const turbomap::global_adjustment_options& options = {}) {
    turbomap::global_adjustment<Map, Policy, turbomap::every_adjustment_method> global(ctx);
    return global(scope(), scene.keyframes[anyone], options);
  }
  turbomap::local_adjustment_summary operator()(std::size_t current,
                                                const turbomap::local_adjustment_options& options = {}) {
    return adjust(scope(), scene.keyframes[current], options);
  }
};

/// One adjustment around a keyframe with memory of its own.
template <class Policy, class Map>
turbomap::local_adjustment_summary adjust_around(const Policy& policy, local_scene<Map>& scene, std::size_t current,
                                                 const turbomap::local_adjustment_options& options = {}) {
  return adjustment_run<Map, Policy>(policy, scene)(current, options);
}

/// One adjustment of all that is connected with a keyframe, with memory of its own.
template <class Policy, class Map>
turbomap::local_adjustment_summary adjust_globally(const Policy& policy, local_scene<Map>& scene, std::size_t anyone,
                                                   const turbomap::global_adjustment_options& options = {}) {
  return adjustment_run<Map, Policy>(policy, scene).adjust_globally(anyone, options);
}

}  // namespace turbomap_test
