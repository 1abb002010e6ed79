// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// A simulated world for tests of the loop: landmarks along a corridor that know who they are, keyframes that see them with
/// a stereo pair, a fisheye rig or one camera, and a tracker that recognises most of them, loses some, and makes points of
/// its own. So of every point of a map the truth is known. And whole runs of local mapping over it.

#include <turbomap/descriptor/binary.hpp>
#include <turbomap/local_mapper.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>
#include <turbomap/map/validate.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "matching_frames.hpp"
#include "matching_rigs.hpp"
#include "reference/larger_or_nan.hpp"
#include "reference/two_views.hpp"

namespace turbomap_test {

struct mapping_recipe {
  unsigned seed = 1;
  double step = 0.3;        ///< m between keyframes, along x
  double sway = 1;          ///< of the camera on its way, and turns of it; 0: it goes evenly
  int turn_back = 1 << 20;  ///< keyframe after which the camera goes back the way it came
  int per_metre = 25;       ///< landmarks
  int clutter = 20;         ///< keypoints of an image that belong to no landmark
  double pixel_noise = 0;   ///< px at octave 0, standard deviation; grows with the octave
  int noisy_bits = 0;       ///< of a descriptor, at most
  double twins = 0;         ///< share of landmarks that look like the one before them, beside it
  double lost = 0.3;        ///< share of known landmarks that tracking does not recognise in a keyframe
  double fresh = 0.4;       ///< share of those, and of unknown ones, that it makes a stereo point of
  turbomap::pyramid scales;
  bool rounded = false;  ///< numbers that maps and keyframes are given are rounded: the same ones from every compiler
};

using landmark_id = std::int64_t;

/// What a keyframe sees; `landmark` < 0: clutter, each one its own.
struct mapping_view {
  std::vector<turbomap::keypoint> keypoints;
  std::vector<std::uint8_t> descriptors;
  std::vector<landmark_id> landmark;
  turbomap::rigid_transform<double> T_cw;
};

/// Landmarks of a corridor without end, made metre by metre, always the same ones.
template <class Camera>
class mapping_scene {
 public:
  static constexpr int bytes = 32;

  mapping_scene(test_rig<Camera> rig, const mapping_recipe& recipe) : rig_(std::move(rig)), recipe_(recipe) {}

  const test_rig<Camera>& rig() const { return rig_; }
  const mapping_recipe& recipe() const { return recipe_; }
  Eigen::Vector3d position(landmark_id l) const { return landmark(l).position; }

  turbomap::rigid_transform<double> pose(int n) const {
    const int along = n <= recipe_.turn_back ? n : 2 * recipe_.turn_back - n;
    const double a = recipe_.sway;
    const Eigen::Vector3d centre(recipe_.step * along, a * 0.1 * std::sin(0.9 * n), a * 0.15 * std::cos(0.7 * n));
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(a * 0.12 * std::sin(0.5 * n), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(a * 0.05 * std::sin(1.1 * n), Eigen::Vector3d::UnitX()));
    const Eigen::Quaterniond q = turn.conjugate();
    auto T = to_rigid(q, -(q * centre));
    if (recipe_.rounded)
      for (double* x : {&T.qx, &T.qy, &T.qz, &T.qw, &T.tx, &T.ty, &T.tz}) *x = rounded_to(0x1p-34, *x);
    return T;
  }
  /// To the nearest multiple of a step that is a power of two, far above what compilers differ by.
  static double rounded_to(double step, double x) { return step * std::nearbyint(x / step); }

  mapping_view view(int n) const {
    mapping_view v;
    v.T_cw = pose(n);
    std::mt19937 random(recipe_.seed * 7919 + static_cast<unsigned>(n));
    const oracle_pose T = to_oracle_pose(v.T_cw);
    const Eigen::Vector3d centre = T.inverse().t;
    const int metre = static_cast<int>(std::floor(centre.x()));
    for (std::size_t c = 0; c < rig_.cameras.size(); ++c) {
      const oracle_pose T_camera = to_oracle_pose(rig_.cameras[c].T_camera_body) * T;
      for (int m = metre - 9; m <= metre + 9; ++m)
        for (int i = 0; i < recipe_.per_metre; ++i) see(v, random, static_cast<int>(c), T_camera, id(m, i));
      for (int i = 0; i < recipe_.clutter; ++i) {
        const auto& b = rig_.bounds;
        turbomap::keypoint k;
        k.x = static_cast<float>(uniform(random, b.min_x, b.max_x - 1));
        k.y = static_cast<float>(uniform(random, b.min_y, b.max_y - 1));
        k.octave = static_cast<std::uint8_t>(random() % static_cast<unsigned>(recipe_.scales.levels));
        k.camera = static_cast<std::uint8_t>(c);
        v.landmark.push_back(-1 -
                             (static_cast<landmark_id>(n) * 1000000 + static_cast<landmark_id>(v.keypoints.size())));
        v.keypoints.push_back(k);
        for (int b8 = 0; b8 < bytes; ++b8) v.descriptors.push_back(static_cast<std::uint8_t>(random()));
      }
    }
    if (recipe_.rounded)
      for (auto& k : v.keypoints) {
        for (float* x : {&k.x, &k.y, &k.u_right}) *x = static_cast<float>(rounded_to(0x1p-6, static_cast<double>(*x)));
        k.depth = static_cast<float>(rounded_to(0x1p-10, static_cast<double>(k.depth)));
      }
    return v;
  }

  template <class Descriptor>
  turbomap::keyframe_data<Descriptor, Camera> data(const mapping_view& v) const {
    turbomap::keyframe_data<Descriptor, Camera> d;
    d.keypoint_count = static_cast<int>(v.keypoints.size());
    d.keypoints = v.keypoints.data(), d.descriptors = v.descriptors.data();
    d.cameras = rig_.cameras.data(), d.camera_count = static_cast<int>(rig_.cameras.size());
    d.bounds = rig_.bounds;
    return d;
  }

  static double uniform(std::mt19937& random, double low, double high) {
    return low + (high - low) * (random() >> 5) / 134217728.0;
  }
  static double gauss(std::mt19937& random) {  // near enough, variance 1
    return uniform(random, -1, 1) + uniform(random, -1, 1) + uniform(random, -1, 1);
  }

 private:
  struct truth {
    Eigen::Vector3d position;
    double size;  ///< m: the distance from which it is seen at octave 0
    std::vector<std::uint8_t> descriptor;
  };

  static constexpr int origin = 1000;  // metres before the first keyframe that have ids
  landmark_id id(int metre, int i) const { return static_cast<landmark_id>(metre + origin) * recipe_.per_metre + i; }
  const truth& landmark(landmark_id l) const {
    const auto known = landmarks_.find(l);
    if (known != landmarks_.end()) return known->second;
    std::mt19937 random(recipe_.seed * 104729 + static_cast<unsigned>(l));
    truth t;
    const double metre = static_cast<double>(l / recipe_.per_metre - origin);
    t.position = {metre + uniform(random, 0, 1), uniform(random, -2.5, 2.5), uniform(random, 3, 8)};
    t.size = std::pow(10, uniform(random, 0.5, 1.4));
    const bool twin = uniform(random, 0, 1) < recipe_.twins && l % recipe_.per_metre != 0;
    for (int b = 0; b < bytes; ++b) t.descriptor.push_back(static_cast<std::uint8_t>(random()));
    if (twin) {  // as the posts of a railing are
      const truth& other = landmark(l - 1);
      t.descriptor = other.descriptor, t.size = other.size;
      t.position = other.position + Eigen::Vector3d(uniform(random, 0.5, 1), 0, 0);
    }
    return landmarks_.emplace(l, std::move(t)).first->second;
  }

  void see(mapping_view& v, std::mt19937& random, int c, const oracle_pose& T, landmark_id l) const {
    const truth& t = landmark(l);
    const auto& mounted = rig_.cameras[static_cast<std::size_t>(c)];
    const Eigen::Vector3d x = T * t.position;
    turbomap::vec2<double> uv{};
    if (x.z() < 0.5 || !mounted.camera.project(turbomap::vec3<double>{x.x(), x.y(), x.z()}, uv)) return;
    const double distance = x.norm(), s = static_cast<double>(recipe_.scales.scale_factor);
    if (distance > 1.3 * t.size) return;
    const int octave = std::min(std::max(static_cast<int>(std::ceil(std::log(t.size / distance) / std::log(s))), 0),
                                recipe_.scales.levels - 1);
    const double sigma = recipe_.pixel_noise * std::pow(s, octave);
    turbomap::keypoint k;
    k.x = static_cast<float>(uv.x + sigma * gauss(random));
    k.y = static_cast<float>(uv.y + sigma * gauss(random));
    const double right = mounted.bf > 0 ? uv.x - mounted.bf / x.z() + sigma * gauss(random) : -1;
    const auto& b = rig_.bounds;
    if (k.x < b.min_x || k.x >= b.max_x || k.y < b.min_y || k.y >= b.max_y) return;
    k.octave = static_cast<std::uint8_t>(octave), k.camera = static_cast<std::uint8_t>(c);
    if (right >= 0) k.u_right = static_cast<float>(right), k.depth = static_cast<float>(x.z());
    if (rig_.cameras.size() > 1) k.depth = static_cast<float>(x.z());
    v.keypoints.push_back(k);
    v.landmark.push_back(l);
    v.descriptors.insert(v.descriptors.end(), t.descriptor.begin(), t.descriptor.end());
    auto* mine = v.descriptors.data() + v.descriptors.size() - bytes;
    for (int n = recipe_.noisy_bits > 0 ? static_cast<int>(random() % static_cast<unsigned>(recipe_.noisy_bits + 1))
                                        : 0;
         n > 0; --n) {
      const unsigned bit = random() % (8U * bytes);
      mine[bit / 8] = static_cast<std::uint8_t>(mine[bit / 8] ^ (1U << bit % 8));
    }
  }

  test_rig<Camera> rig_;
  mapping_recipe recipe_;
  mutable std::unordered_map<landmark_id, truth> landmarks_;
};

/// All that the traits of a simple_map tell, to the last bit. \param computed  also what is computed of points in floating point
/// \param poses  also the poses of keyframes: inputs, where nothing is adjusted
template <class Map>
std::string content(const Map& map, bool computed = true, bool poses = true) {
  using traits = turbomap::map_traits<Map>;
  std::string bytes;
  const auto put = [&bytes](const auto& value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(raw, sizeof value);
  };
  traits::for_each_keyframe(map, [&](typename traits::keyframe k) {
    put(traits::id(map, k)), put(k.index);
    if (poses) put(traits::pose(map, k));
    for (std::size_t i = 0; i < traits::keypoint_count(map, k); ++i) put(traits::point_at(map, k, i));
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    put(traits::id(map, p)), put(p.index), put(traits::reference(map, p));
    if (computed) {
      put(traits::position(map, p)), put(traits::normal(map, p));
      put(traits::min_distance(map, p)), put(traits::max_distance(map, p));
    }
    for (int e = 0; e < traits::descriptor::elements; ++e) put(traits::descriptor_data(map, p)[e]);
    for (const auto n : traits::octave_counts(map, p)) put(n);
    traits::for_each_observation(map, p, [&](typename traits::keyframe k, std::size_t i) { put(k), put(i); });
  });
  return bytes;
}

/// Every pose and position of the map is moved by `shift` (m) along x, as after a loop was closed. The caller holds the guard.
template <class Map>
void move_all(Map& map, double shift) {
  using traits = turbomap::map_traits<Map>;
  traits::for_each_keyframe(map, [&](typename traits::keyframe k) {
    auto T = traits::pose(map, k);
    const Eigen::Quaterniond q(T.qw, T.qx, T.qy, T.qz);
    const Eigen::Vector3d t = q * Eigen::Vector3d(shift, 0, 0);
    T.tx -= t.x(), T.ty -= t.y(), T.tz -= t.z();
    traits::set_pose(map, k, T);
  });
  traits::for_each_point(map, [&](typename traits::point p) {
    auto x = traits::position(map, p);
    x.x += shift;
    traits::set_position(map, p, x);
  });
}

/// What became of the truth.
struct map_quality {
  std::size_t merged = 0, merged_wrongly = 0;  ///< points that became others, and of another landmark
  std::size_t points = 0, mixed = 0;           ///< alive, and seen at keypoints of several landmarks
  std::size_t duplicates = 0;                  ///< alive, of a landmark that has another live point
  double worst_error = 0;                      ///< m, of the live points that are not mixed
};

/// Local mapping over a scene. `Map` is a simple_map, or derived from one. Without adjustment where nothing else is said: the
/// poses of a scene are true.
template <class Map, class Policy, class Adjustment = turbomap::no_adjustment>
class mapping_run {
 public:
  using traits = turbomap::map_traits<Map>;
  using keyframe = typename traits::keyframe;
  using point = typename traits::point;
  using descriptor = typename traits::descriptor;
  using camera = typename traits::camera;
  using mapper_type = turbomap::local_mapper<Map, Policy, Adjustment>;
  using hooks_type = turbomap::local_mapper_hooks<Map>;

  mapping_run(const mapping_scene<camera>& scene, const turbomap::local_mapper_options& options, hooks_type more = {},
              Policy policy = Policy(), turbomap::keyframe_store_options store_options = {})
      : scene_(scene),
        ctx(std::move(policy)),
        store(of_pyramid(store_options, scene.recipe().scales)),
        hooks_(std::move(more)),
        mapper(ctx, map, store, options, hooks()) {}

  static turbomap::keyframe_store_options of_pyramid(turbomap::keyframe_store_options o,
                                                     const turbomap::pyramid& scales) {
    o.packing.pyramid = scales;
    return o;
  }
  /// Tracking: the next keyframe enters map and store, with its associations.
  keyframe track() {
    const keyframe k = add();
    mapper.insert(k, scene_.template data<descriptor>(views_.back()));
    associate(k, views_.back());
    return k;
  }
  /// The next keyframe enters the map only.
  keyframe add() {
    views_.push_back(scene_.view(static_cast<int>(views_.size())));
    const auto& v = views_.back();
    const keyframe before = keyframes_.empty() || !map.alive(keyframes_.back()) ? keyframe{} : keyframes_.back();
    const keyframe k = map.add_keyframe(turbomap::span<const turbomap::keypoint>(v.keypoints), v.T_cw,
                                        0.2 * static_cast<double>(views_.size()), before);
    keyframes_.push_back(k);
    return k;
  }
  /// Track, map, note the truth.
  const turbomap::mapping_report& step() {
    const auto& report = mapper.process(track());
    note();
    return report;
  }
  void steps(int n) {
    for (; n > 0; --n) step();
  }

  /// The truth of points that are new. \see associate
  void note() {
    traits::for_each_point(map, [&](point p) {
      if (truth_.count(traits::id(map, p)) != 0) return;
      const landmark_id l = landmark_of(p).first;
      truth_[traits::id(map, p)] = {p, l};
      known_[l] = p;
    });
  }
  map_quality quality() {
    map_quality q;
    std::map<landmark_id, std::size_t> live;
    for (const auto& [id, named] : truth_) {
      const auto& [p, l] = named;
      if (traits::alive(map, p)) {
        ++q.points;
        q.duplicates += live[l]++ == 0 ? 0 : 1;
        const auto [now, pure] = landmark_of(p);
        q.mixed += pure ? 0 : 1;
        const auto& x = traits::position(map, p);
        if (pure && now >= 0)
          q.worst_error = larger_or_nan(q.worst_error, (scene_.position(now) - Eigen::Vector3d(x.x, x.y, x.z)).norm());
        continue;
      }
      const point survivor = turbomap::resolve(map, p);
      if (survivor == point{}) continue;
      ++q.merged;
      q.merged_wrongly += truth_.at(traits::id(map, survivor)).second == l ? 0 : 1;
    }
    return q;
  }
  /// The system starts anew, from the first keyframe.
  void restart() {
    map = Map();
    mapper.reset();
    keyframes_.clear(), views_.clear(), truth_.clear(), known_.clear();
  }
  const std::vector<keyframe>& keyframes() const { return keyframes_; }
  /// What a stage of one's own works on.
  turbomap::mapping_scope<Map, Policy> scope(turbomap::guard_times& held) {
    return {ctx, map, store, mapper.stored(), held};
  }
  const mapping_view& view(std::size_t n) const { return views_[n]; }

  /// Most keypoints of known landmarks see them; some get new points, of landmarks that are known as well.
  void associate(keyframe k, const mapping_view& v) {
    const auto& recipe = scene_.recipe();
    std::mt19937 random(recipe.seed * 31 + static_cast<unsigned>(views_.size()));
    std::vector<point> created;
    std::map<landmark_id, std::size_t> first, second;  // views by the first two cameras
    for (std::size_t i = 0; i < v.keypoints.size(); ++i)
      (v.keypoints[i].camera == 0 ? first : second)[v.landmark[i]] = i;
    for (std::size_t i = 0; i < v.keypoints.size(); ++i) {
      const landmark_id l = v.landmark[i];
      const double lost = scene_.uniform(random, 0, 1), fresh = scene_.uniform(random, 0, 1);
      const double depth_error = scene_.gauss(random);
      const auto known = known_.find(l);
      const point p = known == known_.end() ? point{} : turbomap::resolve(map, known->second);
      if (p != point{} && lost >= recipe.lost && turbomap::observe(map, p, k, i)) continue;
      if (l < 0 || fresh >= recipe.fresh || v.keypoints[i].camera != 0) continue;
      const bool stereo = v.keypoints[i].u_right >= 0, rig = second.count(l) != 0;
      const bool monocular = scene_.rig().cameras.size() == 1 && !(scene_.rig().cameras[0].bf > 0);
      const auto before = monocular && views_.size() == 2 ? earlier_view(l) : -1;  // it starts from two keyframes
      if (!stereo && !rig && before < 0) continue;
      if (traits::point_at(map, k, i) != point{}) continue;
      const Eigen::Vector3d centre = to_oracle_pose(v.T_cw).inverse().t;
      const Eigen::Vector3d x = centre + (1 + 0.002 * recipe.pixel_noise * depth_error) * (scene_.position(l) - centre);
      const auto at = [&](double c) { return recipe.rounded ? scene_.rounded_to(0x1p-20, c) : c; };
      const point made = map.add_point({at(x.x()), at(x.y()), at(x.z())}, k);
      turbomap::observe(map, made, k, i);
      if (rig) turbomap::observe(map, made, k, second[l]);
      if (before >= 0) turbomap::observe(map, made, keyframes_.front(), static_cast<std::size_t>(before));
      created.push_back(made);
    }
    mapper.watch(created);
    note();
  }

 private:
  const mapping_scene<camera>& scene_;

 public:
  turbomap::context<Policy> ctx;
  Map map;
  turbomap::keyframe_store<descriptor, camera, turbomap::memory_of_t<Policy>> store;
  bool notes_creation = true;  ///< looks at the map between creation and fusion, without a guard

 private:
  hooks_type hooks() {
    hooks_type all = hooks_;
    all.stage_done = [this](turbomap::mapping_stage s, const turbomap::mapping_report& r) {
      if (s == turbomap::mapping_stage::creation && notes_creation) note();
      if (hooks_.stage_done) hooks_.stage_done(s, r);
    };
    return all;
  }
  std::ptrdiff_t earlier_view(landmark_id l) const {
    const auto& all = views_.front().landmark;
    const auto found = std::find(all.begin(), all.end(), l);
    return found == all.end() ? -1 : found - all.begin();
  }
  /// What most of its keypoints see (the least of equals), and whether all do.
  std::pair<landmark_id, bool> landmark_of(point p) const {
    std::map<landmark_id, int> seen;
    traits::for_each_observation(map, p, [&](keyframe k, std::size_t i) {
      ++seen[views_[static_cast<std::size_t>(traits::id(map, k))].landmark[i]];
    });
    std::pair<int, landmark_id> most{0, -1};
    for (const auto& [l, n] : seen)
      if (n > most.first) most = {n, l};
    return {most.second, seen.size() == 1};
  }

  hooks_type hooks_;
  std::vector<keyframe> keyframes_;  ///< by id
  std::vector<mapping_view> views_;
  std::map<std::uint64_t, std::pair<point, landmark_id>> truth_;  ///< by id of the point, as it was made
  std::unordered_map<landmark_id, point> known_;                  ///< the newest point of each landmark

 public:
  mapper_type mapper;
};

}  // namespace turbomap_test
