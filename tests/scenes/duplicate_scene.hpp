// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Random map points and keyframes that see them, made to be hard on a duplicate search: crowded windows, equal
/// distances, keypoints at the border, points on the very threshold of a test. And the same keyframes in the memory of
/// any policy.

#include <turbomap/array.hpp>
#include <turbomap/context.hpp>
#include <turbomap/fusion/duplicate_options.hpp>
#include <turbomap/store/keyframe_packing.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "matching_frames.hpp"
#include "matching_rigs.hpp"

namespace turbomap_test {

struct duplicate_recipe {
  unsigned seed = 1;
  int targets = 3, points = 150;
  int clutter = 150;  ///< keypoints of a target that belong to no point
  int levels = 8;
  float scale_factor = 1.2F;
  int columns = 64, rows = 48;  ///< of the cell index; 0: none
  double stereo = 0.5;          ///< share of u_right where the rig has bf
  double skip = 0.1;            ///< share of points that are skipped in a camera; < 0: an empty list
  double taken = 0;             ///< share of keypoints that hold a point; 0: an empty list
  double uncertain = 0;         ///< share of points with a covariance; 0: none has one
  double on_edge = 0;           ///< share of points that stand on a threshold as exactly as they can
  double not_finite = 0;        ///< share of points with a number that is none
  double off_unit = 0;          ///< of the squared norm of the quaternions from 1, at most
  double origin = 0;            ///< m; how far away from the origin of the world everything is
  int prototypes = 4;           ///< descriptors are one of these with a few bits changed
  int noise = 45;               ///< at most so many bits (elements)
};

/// Points and targets in host memory. Target t has the rig t % rigs.
template <class Descriptor, class Camera>
class duplicate_scene {
 public:
  using target = turbomap::duplicate_target<Descriptor, Camera>;
  using element = typename Descriptor::element;

  duplicate_scene(const std::vector<test_rig<Camera>>& rigs, const duplicate_recipe& recipe)
      : recipe_(recipe), random_(recipe.seed) {
    shift_ = {recipe.origin, -recipe.origin, 0.5 * recipe.origin};
    prototypes_.resize(static_cast<std::size_t>(recipe.prototypes * Descriptor::elements));
    for (element& e : prototypes_) e = random_element();
    for (int t = 0; t < recipe.targets; ++t) pose_frame(rigs[static_cast<std::size_t>(t) % rigs.size()]);
    for (int p = 0; p < recipe.points; ++p) add_point(p);
    for (auto& f : frames) {
      for (int k = 0; k < recipe.clutter; ++k) add_keypoint(f, below(cameras(f)), anywhere(f), below(recipe.levels));
      shuffle(f);
      repack(f);
    }
    for (auto& f : frames) {
      skip.emplace_back();
      if (recipe.skip < 0) continue;
      skip.back().resize(f.cameras.size() * position.size());
      for (auto& s : skip.back()) s = chance(recipe.skip) ? static_cast<std::uint8_t>(1 + below(255)) : 0;
    }
    taken.resize(frames.size());
    for (std::size_t t = 0; t < frames.size() && recipe.taken > 0; ++t)
      for (std::size_t k = 0; k < frames[t].keypoints.size(); ++k)
        taken[t].push_back(chance(recipe.taken) ? static_cast<std::uint8_t>(1 + below(255)) : std::uint8_t{0});
  }

  turbomap::map_point_view<Descriptor> points() const {
    return {static_cast<int>(position.size()),
            position.data(),
            normal.data(),
            min_distance.data(),
            max_distance.data(),
            descriptors.data(),
            covariance.empty() ? nullptr : covariance.data()};
  }
  /// Target t with its packed form at `base`.
  target at(std::size_t t, std::byte* base) const {
    return {turbomap::view_at<Descriptor, Camera>(frames[t].layout, base), frames[t].T_cw, skip[t], taken[t]};
  }
  std::vector<target> targets() {
    std::vector<target> all;
    for (std::size_t t = 0; t < frames.size(); ++t) all.push_back(at(t, frames[t].block.data()));
    return all;
  }
  turbomap::pyramid scales() const { return {recipe_.scale_factor, recipe_.levels}; }

  /// Packs a frame with its cell index.
  void repack(scene_frame<Descriptor, Camera>& f) {
    turbomap::keyframe_data<Descriptor, Camera> data;
    data.keypoint_count = static_cast<int>(f.keypoints.size());
    data.keypoints = f.keypoints.data(), data.descriptors = f.descriptors.data();
    data.cameras = f.cameras.data(), data.camera_count = cameras(f);
    data.bounds = f.bounds;
    turbomap::keyframe_packing_options options;
    options.grid_columns = recipe_.columns, options.grid_rows = recipe_.rows;
    options.pyramid = scales();
    f.layout = turbomap::plan_packing(data, options, scratch_);
    f.block.resize_discard(f.layout.bytes + 1);
    turbomap::pack_keyframe(data, f.layout, scratch_, f.block.data());
  }

  std::vector<scene_frame<Descriptor, Camera>> frames;
  std::vector<std::vector<std::uint8_t>> skip, taken;
  std::vector<turbomap::vec3<double>> position;
  std::vector<turbomap::vec3<float>> normal;
  std::vector<float> min_distance, max_distance;
  std::vector<element> descriptors;
  std::vector<turbomap::point_covariance> covariance;

 private:
  using frame = scene_frame<Descriptor, Camera>;

  double uniform(double low, double high) { return low + (high - low) * (random_() >> 5) / 134217728.0; }
  bool chance(double p) { return uniform(0, 1) < p; }
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
  double gauss() { return uniform(-1, 1) + uniform(-1, 1) + uniform(-1, 1); }
  Eigen::Vector3d direction() { return Eigen::Vector3d(gauss(), gauss(), gauss() + 1e-3).normalized(); }
  static int cameras(const frame& f) { return static_cast<int>(f.cameras.size()); }
  Eigen::Vector2d anywhere(const frame& f) {
    const auto& b = f.bounds;
    // Now and then at the border, half of it beyond the last cell.
    const double grow = chance(0.1) ? 3 : 0;
    return {uniform(b.min_x - grow, b.max_x + grow), uniform(b.min_y - grow, b.max_y + grow)};
  }

  void pose_frame(const test_rig<Camera>& rig) {
    frame f;
    f.cameras = rig.cameras, f.bounds = rig.bounds;
    const Eigen::Quaterniond q(Eigen::AngleAxisd(uniform(0, 0.6), direction()));
    const Eigen::Vector3d centre = shift_ + 0.7 * Eigen::Vector3d(gauss(), gauss(), gauss());
    f.T_cw = to_rigid(q, -(q * centre));
    const double stretch = std::sqrt(1 + uniform(-recipe_.off_unit, recipe_.off_unit));
    f.T_cw.qx *= stretch, f.T_cw.qy *= stretch, f.T_cw.qz *= stretch, f.T_cw.qw *= stretch;
    frames.push_back(std::move(f));
  }

  element random_element() {
    if constexpr (std::is_floating_point_v<element>)
      return static_cast<element>(below(9) - 4) / 4;  // on a grid, so that distances tie
    else
      return static_cast<element>(random_());
  }
  void append_descriptor(std::vector<element>& out, int prototype) {
    const auto* p = prototypes_.data() + prototype * Descriptor::elements;
    out.insert(out.end(), p, p + Descriptor::elements);
    auto* mine = out.data() + out.size() - Descriptor::elements;
    for (int changes = below(recipe_.noise + 1); changes > 0; --changes) {
      auto& e = mine[below(Descriptor::elements)];
      if constexpr (std::is_floating_point_v<element>)
        e += 0.25F;
      else
        e = static_cast<element>(e ^ (1 << below(8)));
    }
  }
  void add_keypoint(frame& f, int camera, const Eigen::Vector2d& at, int octave, double depth = 0, int prototype = -1) {
    turbomap::keypoint k;
    k.x = std::min(std::max(static_cast<float>(at.x()), f.bounds.min_x), f.bounds.max_x);
    k.y = std::min(std::max(static_cast<float>(at.y()), f.bounds.min_y), f.bounds.max_y);
    k.octave = static_cast<std::uint8_t>(std::min(std::max(octave, 0), recipe_.levels - 1));
    k.camera = static_cast<std::uint8_t>(camera);
    const double bf = f.cameras[k.camera].bf;
    // Models that are not rectilinear have no use for it, but may come with it.
    if (chance(recipe_.stereo))
      k.u_right = static_cast<float>(std::max(k.x - (depth > 0 ? bf / depth : 20) + 0.7 * gauss(), 0.0));
    f.keypoints.push_back(k);
    append_descriptor(f.descriptors, prototype < 0 ? below(recipe_.prototypes) : prototype);
  }
  /// Keypoints of a frame in another order.
  void shuffle(frame& f) {
    for (std::size_t i = f.keypoints.size(); i > 1; --i) {
      const std::size_t j = static_cast<std::size_t>(below(static_cast<int>(i)));
      std::swap(f.keypoints[i - 1], f.keypoints[j]);
      std::swap_ranges(f.descriptors.begin() + static_cast<std::ptrdiff_t>((i - 1) * Descriptor::elements),
                       f.descriptors.begin() + static_cast<std::ptrdiff_t>(i * Descriptor::elements),
                       f.descriptors.begin() + static_cast<std::ptrdiff_t>(j * Descriptor::elements));
    }
  }

  /// Somewhere before (sometimes behind) a camera, with keypoints near its images.
  void add_point(int p) {
    const frame& f = frames[static_cast<std::size_t>(below(recipe_.targets))];
    const auto& c = f.cameras[static_cast<std::size_t>(below(cameras(f)))];
    const camera_pose view(f, c);
    turbomap::vec3<double> ray{0, 0, 1};
    const Eigen::Vector2d uv = anywhere(f);
    c.camera.unproject(turbomap::vec2<double>{uv.x(), uv.y()}, ray);
    const double distance = std::pow(10, uniform(-0.3, 1.2)) * (chance(0.05) ? -1 : 1);
    const Eigen::Vector3d X = view.R.transpose() * (distance * Eigen::Vector3d(ray.x, ray.y, ray.z) - view.t);
    const double d = std::abs(distance);
    const int octave = below(recipe_.levels);
    const double s = recipe_.scale_factor;
    const double most = d * std::pow(s, octave - uniform(0, 1)) * (chance(0.1) ? 0.5 : 1);
    const Eigen::Vector3d along = (X - view.centre).normalized();
    Eigen::Vector3d n = (along + uniform(0, 1.2) * direction()).normalized() * uniform(0.7, 1);
    position.push_back({X.x(), X.y(), X.z()});
    max_distance.push_back(static_cast<float>(most));
    min_distance.push_back(static_cast<float>(most / std::pow(s, recipe_.levels - 1)));
    if (chance(recipe_.on_edge)) {
      const int edge = below(4);
      if (edge == 0) min_distance.back() = static_cast<float>(d / 0.8);
      if (edge == 1) max_distance.back() = static_cast<float>(d / 1.2);
      if (edge == 2) max_distance.back() = static_cast<float>(d * std::pow(s, octave));
      if (edge == 3) n = 0.5 * along;
    }
    normal.push_back({static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z())});
    const int prototype = below(recipe_.prototypes);
    append_descriptor(descriptors, prototype);
    for (frame& other : frames) see(other, X, octave, prototype);
    if (recipe_.uncertain > 0) add_covariance(d, along);
    if (chance(recipe_.not_finite)) spoil(static_cast<std::size_t>(p));
  }

  /// Far less is known along the ray of a view than across it.
  void add_covariance(double d, const Eigen::Vector3d& along) {
    const Eigen::Vector3d ray = (along + uniform(0, 0.5) * direction()).normalized();
    const double depth = d * uniform(0, 0.2), across = d * uniform(0, 0.01), known = chance(recipe_.uncertain) ? 1 : 0;
    const Eigen::Matrix3d C =
        known * (depth * depth * ray * ray.transpose() + across * across * Eigen::Matrix3d::Identity());
    covariance.push_back({static_cast<float>(C(0, 0)), static_cast<float>(C(1, 0)), static_cast<float>(C(1, 1)),
                          static_cast<float>(C(2, 0)), static_cast<float>(C(2, 1)), static_cast<float>(C(2, 2))});
  }

  struct camera_pose {
    Eigen::Matrix3d R;
    Eigen::Vector3d t, centre;
    camera_pose(const frame& f, const turbomap::rig_camera<Camera>& c) {
      const Eigen::Isometry3d T = to_eigen(c.T_camera_body) * to_eigen(f.T_cw);
      R = T.linear(), t = T.translation(), centre = -(R.transpose() * t);
    }
  };

  void see(frame& f, const Eigen::Vector3d& X, int octave, int prototype) {
    for (int c = 0; c < cameras(f); ++c) {
      const auto& camera = f.cameras[static_cast<std::size_t>(c)];
      const camera_pose view(f, camera);
      const Eigen::Vector3d x = view.R * X + view.t;
      turbomap::vec2<double> uv{};
      if (!camera.camera.project(turbomap::vec3<double>{x.x(), x.y(), x.z()}, uv)) continue;
      if (uv.x < f.bounds.min_x || uv.x > f.bounds.max_x || uv.y < f.bounds.min_y || uv.y > f.bounds.max_y) continue;
      for (int copies = below(4); copies > 0; --copies) {
        const int o = octave - below(3) + (chance(0.2) ? 1 : 0);
        const double sigma = std::pow(recipe_.scale_factor, o);
        const bool on_edge = chance(recipe_.on_edge);  // of the window
        const double dx = on_edge ? 3 * std::pow(recipe_.scale_factor, octave) : 1.2 * sigma * gauss();
        add_keypoint(f, c, {uv.x + dx, uv.y + 1.2 * sigma * gauss()}, o, x.z(), prototype);
      }
    }
  }

  void spoil(std::size_t p) {
    const double bad = chance(0.5) ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
    const double value = chance(0.5) ? bad : -bad;
    double* const coordinate[] = {&position[p].x, &position[p].y, &position[p].z};
    float* const number[] = {&normal[p].x, &normal[p].y, &normal[p].z, &min_distance[p], &max_distance[p]};
    const int which = below(covariance.empty() ? 8 : 9);
    if (which == 8)
      covariance[p].zx = static_cast<float>(value);
    else if (which < 3)
      *coordinate[which] = value;
    else
      *number[which - 3] = static_cast<float>(value);
  }

  duplicate_recipe recipe_;
  std::mt19937 random_;
  Eigen::Vector3d shift_;
  std::vector<element> prototypes_;
  turbomap::keyframe_packing_scratch scratch_;
};

/// The keyframes of a scene in the memory of a policy.
template <class Descriptor, class Camera, class Policy>
class resident_targets {
 public:
  using target = turbomap::duplicate_target<Descriptor, Camera>;

  resident_targets(turbomap::context<Policy>& ctx, const duplicate_scene<Descriptor, Camera>& host) {
    for (std::size_t t = 0; t < host.frames.size(); ++t) {
      const auto& f = host.frames[t];
      blocks_.emplace_back();
      blocks_.back().resize_discard(f.layout.bytes + 1);
      turbomap::copy_in(ctx.policy(), blocks_.back().data(), f.block.data(), f.layout.bytes);
      targets_.push_back(host.at(t, blocks_.back().data()));
    }
    ctx.synchronize();
  }

  turbomap::span<const target> targets() const { return targets_; }

 private:
  std::vector<turbomap::array<std::byte, turbomap::memory_of_t<Policy>>> blocks_;
  std::vector<target> targets_;
};

}  // namespace turbomap_test
