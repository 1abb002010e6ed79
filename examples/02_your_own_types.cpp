// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// A SLAM system's own classes, pointers behind mutexes, as they are: one traits struct lets the library read them, and the
/// accepted points are committed to the system's map under its own lock. The data are synthetic.

#include <thrust/execution_policy.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <mutex>
#include <random>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/context.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/store/keyframe_store.hpp>
#include <vector>

// ---- The system, as it was before it met this library. ----------------------------------------------------------------
namespace my {

struct MapPoint {
  double position[3];
  int observations = 0;
};
struct Feature {
  float u, v;
  std::array<std::uint8_t, 32> descriptor;
};
struct KeyFrame {
  std::uint64_t id = 0;
  double centre[3] = {0, 0, 0};  // looks along +z
  std::vector<std::unique_ptr<Feature>> features;
  std::vector<MapPoint*> points;  // one a feature, null: none; guarded by mutex
  bool bad = false;               // erased from the map; guarded by mutex
  mutable std::mutex mutex;
};
struct Map {
  std::vector<std::unique_ptr<MapPoint>> points;
  std::mutex mutex;
};
constexpr float focal = 400, centre_u = 320, centre_v = 240;

}  // namespace my

// ---- What it takes: how to read a keyframe. See docs/traits.md. ---------------------------------------------------------
template <>
struct turbomap::keyframe_traits<my::KeyFrame> {
  using descriptor = turbomap::binary_descriptor<256>;
  using rig = turbomap::mono_rig<turbomap::pinhole<float>>;
  static std::uint64_t id(const my::KeyFrame& k) { return k.id; }
  static turbomap::rigid_transform<double> pose(const my::KeyFrame& k) {
    return {0, 0, 0, 1, -k.centre[0], -k.centre[1], -k.centre[2]};
  }
  static rig cameras(const my::KeyFrame&) {
    return turbomap::make_mono_rig(turbomap::pinhole<float>{my::focal, my::focal, my::centre_u, my::centre_v});
  }
  static std::size_t keypoint_count(const my::KeyFrame& k) { return k.features.size(); }
  static turbomap::keypoint keypoint(const my::KeyFrame& k, std::size_t i) {
    turbomap::keypoint out;
    out.x = k.features[i]->u, out.y = k.features[i]->v;
    return out;
  }
  static const std::uint8_t* descriptor_data(const my::KeyFrame& k, std::size_t i) {
    return k.features[i]->descriptor.data();
  }
  static turbomap::image_bounds bounds(const my::KeyFrame&) { return {0, 0, 640, 480}; }
  static std::unique_lock<std::mutex> guard(const my::KeyFrame& k) { return std::unique_lock<std::mutex>(k.mutex); }
};

namespace {

using traits = turbomap::keyframe_traits<my::KeyFrame>;
using posed = turbomap::posed_keyframe<traits::descriptor, turbomap::pinhole<float>>;

/// Which keypoints hold a map point now: a snapshot under the keyframe's lock.
std::vector<std::uint8_t> mask_of(const my::KeyFrame& k) {
  const std::lock_guard<std::mutex> lock(k.mutex);
  std::vector<std::uint8_t> mask(k.points.size());
  std::transform(k.points.begin(), k.points.end(), mask.begin(), [](const my::MapPoint* p) { return p != nullptr; });
  return mask;
}

/// The search saw a snapshot; the map went on meanwhile. So each point is looked at again under the locks: still no point on
/// either keypoint, both keyframes still in the map? Short: no geometry, no descriptors. Returns the points inserted.
int commit(my::Map& map, my::KeyFrame& query, const std::vector<my::KeyFrame*>& neighbours,
           const std::vector<turbomap::created_point>& points) {
  const std::lock_guard<std::mutex> map_lock(map.mutex);
  int inserted = 0;
  for (const turbomap::created_point& p : points) {
    my::KeyFrame& neighbour = *neighbours[static_cast<std::size_t>(p.neighbour)];
    const std::scoped_lock locks(query.mutex, neighbour.mutex);
    my::MapPoint *&a = query.points[static_cast<std::size_t>(p.query)],
                 *&b = neighbour.points[static_cast<std::size_t>(p.candidate)];
    if (query.bad || neighbour.bad || a != nullptr || b != nullptr) continue;
    map.points.push_back(std::make_unique<my::MapPoint>(my::MapPoint{{p.position.x, p.position.y, p.position.z}, 2}));
    a = b = map.points.back().get();
    ++inserted;
  }
  return inserted;
}

/// Feature i of every keyframe sees scene point i: uniform in a box, noise 0.3 px, 20 of 256 descriptor bits flipped.
std::vector<std::unique_ptr<my::KeyFrame>> synthetic_keyframes(const std::vector<std::array<double, 3>>& scene) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.3F);
  std::vector<std::unique_ptr<my::KeyFrame>> keyframes;
  for (int k = 0; k < 3; ++k) {
    my::KeyFrame& keyframe = *keyframes.emplace_back(std::make_unique<my::KeyFrame>());
    keyframe.id = static_cast<std::uint64_t>(k);
    keyframe.centre[0] = 0.4 * k, keyframe.centre[1] = 0.1 * k;
    for (std::size_t i = 0; i < scene.size(); ++i) {
      const double x = scene[i][0] - keyframe.centre[0], y = scene[i][1] - keyframe.centre[1], z = scene[i][2];
      auto f = std::make_unique<my::Feature>();
      f->u = static_cast<float>(my::focal * x / z + my::centre_u) + noise(random);
      f->v = static_cast<float>(my::focal * y / z + my::centre_v) + noise(random);
      std::mt19937 of_point(static_cast<unsigned>(i));
      for (auto& byte : f->descriptor) byte = static_cast<std::uint8_t>(of_point());
      for (int flip = 0; flip < 20; ++flip)
        f->descriptor[random() % 32] ^= static_cast<std::uint8_t>(1U << random() % 8);
      keyframe.features.push_back(std::move(f));
    }
    keyframe.points.assign(scene.size(), nullptr);
  }
  return keyframes;
}

}  // namespace

int main() {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> side(-2, 2), depth(4, 8);
  std::vector<std::array<double, 3>> scene(500);
  for (auto& x : scene) x = {side(random), side(random), depth(random)};
  const auto keyframes = synthetic_keyframes(scene);
  my::Map map;
  my::KeyFrame& query = *keyframes[2];
  const std::vector<my::KeyFrame*> neighbours{keyframes[1].get(), keyframes[0].get()};

  // Once a keyframe, whenever the system makes one.
  turbomap::keyframe_store<traits::descriptor, turbomap::pinhole<float>> store;
  std::vector<turbomap::keyframe_handle> handles{store.insert(query)};
  for (const my::KeyFrame* n : neighbours) handles.push_back(store.insert(*n));

  // Once a call: poses and masks.
  turbomap::context ctx{thrust::host};
  const auto pinned = store.pin(ctx, handles);
  const auto query_mask = mask_of(query);
  std::vector<std::vector<std::uint8_t>> masks;
  std::vector<posed> others;
  for (const my::KeyFrame* n : neighbours) masks.push_back(mask_of(*n));
  for (std::size_t n = 0; n < neighbours.size(); ++n)
    others.push_back({pinned[n + 1], traits::pose(*neighbours[n]), masks[n]});
  const auto matches = turbomap::search_correspondences(ctx, posed{pinned[0], traits::pose(query), query_mask},
                                                        turbomap::span<const posed>(others));
  turbomap::point_creation creation(ctx);
  turbomap::create_points(ctx, matches, {}, creation);
  const auto plan = turbomap::first_claims(creation.plan(ctx, matches), 500, {500, 500});

  // Meanwhile tracking gives the keypoint of the plan's first point to a point of its own: the commit must see that.
  my::MapPoint tracked{{0, 0, 0}, 1};
  query.points[static_cast<std::size_t>(plan.at(0).query)] = &tracked;
  const int inserted = commit(map, query, neighbours, plan);

  int far = 0;
  for (std::size_t i = 0; i < scene.size(); ++i)
    if (const my::MapPoint* p = query.points[i]; p != nullptr && p != &tracked)
      far += std::hypot(p->position[0] - scene[i][0], p->position[1] - scene[i][1], p->position[2] - scene[i][2]) > 0.5;
  std::printf("%zu points planned, %d inserted, %d of them farther than 0.5 m from the truth\n", plan.size(), inserted,
              far);
  const bool kept = query.points[static_cast<std::size_t>(plan[0].query)] == &tracked;
  return kept && inserted == static_cast<int>(plan.size()) - 1 && inserted > 400 && far <= inserted / 50 ? 0 : 1;
}
