// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Random keyframes that see common landmarks, made to be hard on a search: many candidates below the threshold, many equal
/// distances, keypoints at the epipole, degenerate motions. And the same keyframes in the memory of any policy.

#include <turbomap/array.hpp>
#include <turbomap/context.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "matching_frames.hpp"
#include "matching_rigs.hpp"

namespace turbomap_test {

/// A query and its neighbours in host memory.
template <class Descriptor, class Camera>
class scene {
 public:
  using frame = scene_frame<Descriptor, Camera>;
  using posed = turbomap::posed_keyframe<Descriptor, Camera>;

  scene(const test_rig<Camera>& rig, const scene_recipe& recipe) : recipe_(recipe), random_(recipe.seed) {
    pose_frames(rig);
    seed_descriptors();
    fill_query();
    for (std::size_t n = 1; n < frames.size(); ++n) fill_neighbour(frames[n]);
    for (frame& f : frames) finish(f);
  }

  posed query() { return frames[0].posed(); }
  std::vector<posed> neighbours() {
    std::vector<posed> all;
    for (std::size_t n = 1; n < frames.size(); ++n) all.push_back(frames[n].posed());
    return all;
  }
  turbomap::pyramid scales() const { return {recipe_.scale_factor, recipe_.levels}; }
  /// Packs a frame again after a test has changed its keypoints.
  void repack(frame& f) { f.pack(scratch_, scales()); }

  std::vector<frame> frames;  ///< 0 is the query

 private:
  struct landmark {
    Eigen::Vector3d position;
    int prototype, octave;
    std::uint32_t group;
  };

  double uniform(double low, double high) { return low + (high - low) * (random_() >> 5) / 134217728.0; }
  bool chance(double p) { return uniform(0, 1) < p; }
  int below(int n) { return n <= 0 ? 0 : static_cast<int>(random_() % static_cast<unsigned>(n)); }
  double gauss() { return uniform(-1, 1) + uniform(-1, 1) + uniform(-1, 1); }
  Eigen::Vector3d direction() { return Eigen::Vector3d(gauss(), gauss(), gauss() + 1e-3).normalized(); }
  Eigen::Quaterniond turn(double radians) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(radians, direction())).normalized();
  }

  void pose_frames(const test_rig<Camera>& rig) {
    frames.resize(static_cast<std::size_t>(recipe_.neighbours) + 1);
    for (frame& f : frames) f.cameras = rig.cameras, f.bounds = rig.bounds;
    const bool origin = recipe_.how == motion::turn_at_origin;
    const Eigen::Vector3d start = origin ? Eigen::Vector3d::Zero() : Eigen::Vector3d(3 * direction());
    frames[0].T_cw = to_rigid(turn(uniform(0, 3)), start);
    const Eigen::Isometry3d T_qw = to_eigen(frames[0].T_cw);
    for (std::size_t n = 1; n < frames.size(); ++n) {
      Eigen::Quaterniond R = turn(uniform(0, 0.2));
      Eigen::Vector3d t = Eigen::Vector3d::Zero();  // the query's centre in the neighbour
      const double length = uniform(0.05, 0.6);
      switch (recipe_.how) {
        case motion::sideways:
          t = Eigen::Vector3d(length, uniform(-0.02, 0.02), uniform(-0.02, 0.02));
          break;
        case motion::forward:
          t = Eigen::Vector3d(uniform(-0.1, 0.1) * length, uniform(-0.1, 0.1) * length, length);
          break;
        case motion::backward:
          t = Eigen::Vector3d(uniform(-0.1, 0.1) * length, 0, -length);
          break;
        case motion::along_axis:
          t = Eigen::Vector3d(0, 0, length), R.setIdentity();
          break;
        case motion::anything:
          t = std::pow(10, uniform(-3, 1)) * direction(), R = turn(uniform(0, 3.1));
          break;
        default:
          break;
      }
      if (recipe_.how == motion::identical) {
        frames[n].T_cw = frames[0].T_cw;
      } else if (origin) {
        frames[n].T_cw = to_rigid(R, t);
      } else {
        const Eigen::Isometry3d T = Eigen::Translation3d(t) * R * T_qw;
        frames[n].T_cw = to_rigid(Eigen::Quaterniond(T.rotation()).normalized(), T.translation());
      }
    }
  }

  void seed_descriptors() {
    prototypes_.resize(static_cast<std::size_t>(recipe_.prototypes * Descriptor::elements));
    for (auto& e : prototypes_) e = random_element();
  }
  typename Descriptor::element random_element() {
    using element = typename Descriptor::element;
    if constexpr (std::is_floating_point_v<element>)
      return static_cast<element>(below(9) - 4) / 4;  // on a grid, so that distances tie
    else
      return static_cast<element>(random_());
  }
  void append_descriptor(frame& f, int prototype) {
    const auto* p = prototypes_.data() + prototype * Descriptor::elements;
    f.descriptors.insert(f.descriptors.end(), p, p + Descriptor::elements);
    auto* mine = f.descriptors.data() + f.descriptors.size() - Descriptor::elements;
    for (int changes = below(recipe_.noise + 1); changes > 0; --changes) {
      auto& e = mine[below(Descriptor::elements)];
      if constexpr (std::is_floating_point_v<typename Descriptor::element>)
        e += 0.25F;
      else
        e = static_cast<typename Descriptor::element>(e ^ (1 << below(8)));
    }
  }

  turbomap::keypoint keypoint_at(const frame& f, int camera, double x, double y, int octave) {
    turbomap::keypoint k;
    const auto& b = f.bounds;
    k.x = std::min(std::max(static_cast<float>(x), b.min_x), b.max_x);
    k.y = std::min(std::max(static_cast<float>(y), b.min_y), b.max_y);
    k.angle = static_cast<float>(uniform(0, 360));
    k.octave = static_cast<std::uint8_t>(std::min(std::max(octave, 0), recipe_.levels - 1));
    k.camera = static_cast<std::uint8_t>(camera);
    return k;
  }
  /// u_right and depth; now and then a depth that cannot be.
  void add_stereo(const frame& f, turbomap::keypoint& k, double depth) {
    const double bf = f.cameras[k.camera].bf;
    if (!(bf > 0) || !chance(recipe_.stereo)) return;
    k.u_right = static_cast<float>(std::max(k.x - bf / depth + 0.3 * gauss(), 0.0));
    k.depth = chance(0.05) ? -1.0F : static_cast<float>(depth);
  }
  turbomap::keypoint anywhere(const frame& f) {
    const auto& b = f.bounds;
    const int camera = below(static_cast<int>(f.cameras.size()));
    turbomap::keypoint k =
        keypoint_at(f, camera, uniform(b.min_x, b.max_x), uniform(b.min_y, b.max_y), below(recipe_.levels));
    add_stereo(f, k, uniform(0.5, 20));
    if (recipe_.groups > 0 && !chance(0.15)) k.group = 7 * static_cast<std::uint32_t>(below(recipe_.groups));
    return k;
  }

  void fill_query() {
    frame& f = frames[0];
    for (int i = 0; i < recipe_.query_keypoints; ++i) {
      turbomap::keypoint k = anywhere(f);
      const int prototype = below(recipe_.prototypes);
      turbomap::vec3<double> ray{};
      const auto& c = f.cameras[k.camera];
      if (chance(recipe_.landmarks) && c.camera.unproject(turbomap::vec2<double>{k.x, k.y}, ray)) {
        const double range = std::pow(10, uniform(-0.2, 1.5));
        const Eigen::Vector3d in_camera(range * ray.x, range * ray.y, range * ray.z);
        if (k.u_right >= 0 && k.depth >= 0) {
          k.depth = static_cast<float>(in_camera.z());
          k.u_right = static_cast<float>(std::max(k.x - c.bf / in_camera.z(), 0.0));
        }
        const Eigen::Isometry3d T = to_eigen(c.T_camera_body) * to_eigen(f.T_cw);
        landmarks_.push_back({T.inverse() * in_camera, prototype, k.octave, k.group});
      }
      f.keypoints.push_back(k);
      append_descriptor(f, prototype);
    }
  }

  bool see(const frame& f, const landmark& l, turbomap::keypoint& k) {
    const int camera = below(static_cast<int>(f.cameras.size()));
    const auto& c = f.cameras[static_cast<std::size_t>(camera)];
    const Eigen::Vector3d x = to_eigen(c.T_camera_body) * (to_eigen(f.T_cw) * l.position);
    turbomap::vec2<double> p{};
    if (!c.camera.project(turbomap::vec3<double>{x.x(), x.y(), x.z()}, p)) return false;
    if (p.x < f.bounds.min_x || p.x >= f.bounds.max_x || p.y < f.bounds.min_y || p.y >= f.bounds.max_y) return false;
    const int octave = l.octave + below(3) - 1;
    const double sigma = std::pow(recipe_.scale_factor, octave);
    k = keypoint_at(f, camera, p.x + sigma * gauss(), p.y + sigma * gauss(), octave);
    add_stereo(f, k, x.z());
    k.group = chance(0.8) ? l.group : turbomap::keypoint::no_group;
    return true;
  }

  bool near_epipole(const frame& f, turbomap::keypoint& k) {
    const int camera = below(static_cast<int>(f.cameras.size())),
              other = below(static_cast<int>(frames[0].cameras.size()));
    const auto& c = f.cameras[static_cast<std::size_t>(camera)];
    const Eigen::Isometry3d T_qw =
        to_eigen(frames[0].cameras[static_cast<std::size_t>(other)].T_camera_body) * to_eigen(frames[0].T_cw);
    const Eigen::Vector3d t =
        to_eigen(c.T_camera_body) * (to_eigen(f.T_cw) * Eigen::Vector3d(T_qw.inverse().translation()));
    turbomap::vec2<double> p{};
    const double side = chance(0.5) ? 1 : -1;  // the other end of the baseline may be in the image too
    if (!c.camera.project(turbomap::vec3<double>{side * t.x(), side * t.y(), side * t.z()}, p)) return false;
    const double radius = std::pow(10, uniform(-2, 1.5));
    k = keypoint_at(f, camera, p.x + radius * gauss(), p.y + radius * gauss(), below(recipe_.levels));
    k.group = 7 * static_cast<std::uint32_t>(below(recipe_.groups));
    return true;
  }

  void fill_neighbour(frame& f) {
    std::vector<std::pair<turbomap::keypoint, int>> made;
    for (const landmark& l : landmarks_) {
      turbomap::keypoint k;
      if (static_cast<int>(made.size()) < recipe_.neighbour_keypoints && see(f, l, k)) made.push_back({k, l.prototype});
    }
    while (static_cast<int>(made.size()) < recipe_.neighbour_keypoints) {
      turbomap::keypoint k = anywhere(f);
      if (chance(2 * recipe_.at_epipole)) near_epipole(f, k);
      made.push_back({k, below(recipe_.prototypes)});
    }
    for (std::size_t i = made.size(); i > 1; --i)
      std::swap(made[i - 1], made[static_cast<std::size_t>(below(static_cast<int>(i)))]);
    for (const auto& [k, prototype] : made) {
      f.keypoints.push_back(k);
      append_descriptor(f, prototype);
    }
  }

  void finish(frame& f) {
    f.pack(scratch_, scales());
    if (recipe_.mapped < 0) return;
    f.has_point.resize(f.keypoints.size());
    for (auto& m : f.has_point) m = chance(recipe_.mapped) ? static_cast<std::uint8_t>(1 + below(255)) : 0;
  }

  scene_recipe recipe_;
  std::mt19937 random_;
  std::vector<typename Descriptor::element> prototypes_;
  std::vector<landmark> landmarks_;
  turbomap::keyframe_packing_scratch scratch_;
};

/// The keyframes of a scene in the memory of a policy.
template <class Descriptor, class Camera, class Policy>
class resident_scene {
 public:
  using posed = turbomap::posed_keyframe<Descriptor, Camera>;

  resident_scene(turbomap::context<Policy>& ctx, const scene<Descriptor, Camera>& host) {
    for (const auto& f : host.frames) {
      blocks_.emplace_back();
      blocks_.back().resize_discard(f.layout.bytes + 1);
      turbomap::copy_in(ctx.policy(), blocks_.back().data(), f.block.data(), f.layout.bytes);
      keyframes_.push_back(f.posed(blocks_.back().data()));
    }
    ctx.synchronize();
  }

  const posed& query() const { return keyframes_[0]; }
  turbomap::span<const posed> neighbours() const { return {keyframes_.data() + 1, keyframes_.size() - 1}; }

 private:
  std::vector<turbomap::array<std::byte, turbomap::memory_of_t<Policy>>> blocks_;
  std::vector<posed> keyframes_;
};

}  // namespace turbomap_test
