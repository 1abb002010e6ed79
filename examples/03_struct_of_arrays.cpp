// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Flat arrays that exist already are used as they are: no traits, no store, no copy. The arrays here are vectors; with a CUDA
/// policy they would be pointers into device memory (cv::cuda::GpuMat, torch, ...), and nothing else would change.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/context.hpp>
#include <turbomap/descriptor/real.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <vector>

namespace {

constexpr int points = 400, length = 64;
using descriptor = turbomap::real_descriptor<float, length>;  // e.g. of a learned detector
using camera = turbomap::pinhole<float>;
using view = turbomap::keyframe_view<descriptor, camera>;
using posed = turbomap::posed_keyframe<descriptor, camera>;

/// A keyframe as a front end with flat arrays keeps it.
struct arrays {
  std::vector<turbomap::vec2<float>> pixels;
  std::vector<turbomap::vec3<float>> rays;  // unit, in the camera
  std::vector<std::uint8_t> octaves;
  std::vector<float> descriptors;  // points x length
};

/// Keypoint i of either view sees scene point i, so that the right answer is known.
arrays synthetic_view(const std::vector<turbomap::vec3<float>>& scene, const turbomap::rigid_transform<double>& T_cw,
                      const camera& cam, std::mt19937& random) {
  std::normal_distribution<float> normal;
  arrays a;
  for (int i = 0; i < points; ++i) {
    const auto x = turbomap::to_isometry<float>(T_cw) * scene[static_cast<std::size_t>(i)];
    auto& pixel = a.pixels.emplace_back();
    cam.project(x, pixel);  // all points are in front of the camera
    pixel.x += 0.3F * normal(random), pixel.y += 0.3F * normal(random);
    cam.unproject(pixel, a.rays.emplace_back());
    a.octaves.push_back(0);
    std::mt19937 of_point(static_cast<unsigned>(i));
    std::normal_distribution<float> direction;
    for (int d = 0; d < length; ++d) a.descriptors.push_back(0.125F * direction(of_point) + 0.01F * normal(random));
  }
  return a;
}

/// The whole interface: where the arrays are.
view view_of(const arrays& a, const turbomap::rig_camera<camera>& rig) {
  view v;
  v.keypoint_count = static_cast<int>(a.pixels.size());
  v.pixel = a.pixels.data();
  v.bearing = a.rays.data();
  v.octave = a.octaves.data();
  v.descriptor = a.descriptors.data();
  v.cameras = &rig;
  v.camera_count = 1;
  return v;
}

}  // namespace

int main() {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> side(-2, 2), depth(4, 8);
  std::vector<turbomap::vec3<float>> scene(points);
  for (auto& x : scene) x = {side(random), side(random), depth(random)};
  const turbomap::rig_camera<camera> rig{{400, 400, 320, 240}, {}, 0, {}};
  const turbomap::rigid_transform<double> pose_a{}, pose_b{0, std::sin(0.05), 0, std::cos(0.05), -0.5, 0.1, 0};
  const arrays a = synthetic_view(scene, pose_a, rig.camera, random),
               b = synthetic_view(scene, pose_b, rig.camera, random);

  turbomap::context ctx{thrust::host};
  const posed query{view_of(a, rig), pose_a, {}}, neighbour{view_of(b, rig), pose_b, {}};
  turbomap::search_options options;
  options.max_distance = 0.5;  // squared Euclidean: of one point about 0.01 here, of two about 2
  const auto matches =
      turbomap::search_correspondences(ctx, query, turbomap::span<const posed>(&neighbour, 1), options);
  turbomap::point_creation creation(ctx);
  turbomap::create_points(ctx, matches, {}, creation);

  int wrong = 0, accepted = 0, far = 0;
  double worst = 0;
  for (const turbomap::created_point& p : creation.plan(ctx, matches)) {
    wrong += p.query != p.candidate;
    if (p.outcome != turbomap::creation_outcome::accepted) continue;
    ++accepted;
    const auto truth = turbomap::cast<double>(scene[static_cast<std::size_t>(p.query)]);
    const double off = turbomap::norm(p.position - truth);
    far += off < 1 ? 0 : 1;
    worst = std::fmax(worst, off);
  }
  std::printf("%d of %d points created, %d wrong matches, at most %.2f m from the truth\n", accepted, points, wrong,
              worst);
  return accepted > points * 9 / 10 && wrong == 0 && far == 0 ? 0 : 1;
}
