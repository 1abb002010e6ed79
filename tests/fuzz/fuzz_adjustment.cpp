// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Bundle adjustment with every solver and precision, motion-only, covariances of frames and directions that nothing tells, on small
// problems: frames at one
// place, landmarks behind cameras or far away, rows twice, numbers at the ends of their types.

#include <thrust/execution_policy.h>

#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include <turbomap/adjustment/covariance.hpp>
#include <turbomap/adjustment/levenberg_marquardt.hpp>
#include <turbomap/adjustment/motion_only.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>

#include "hostile.hpp"
#include "scenes/matching_rigs.hpp"

using namespace turbomap_fuzz;

namespace {

using policy = std::decay_t<decltype(thrust::seq)>;
using pose = turbomap::rigid_transform<double>;

/// Rows of frames in a line and landmarks before them; then some numbers are replaced.
template <class Camera>
struct problem {
  std::vector<turbomap::rig_camera<Camera>> cameras;
  std::vector<pose> poses;
  std::vector<turbomap::vec3<double>> points, pixel;
  std::vector<std::uint8_t> fixed, fixed_points, camera;
  std::vector<std::int32_t> frame, landmark;
  std::vector<double> information;
  bool spoilt = false;

  problem(const turbomap_test::test_rig<Camera>& rig, choices& c) : cameras(rig.cameras) {
    for (std::size_t i = 0, n = 1 + c.below(5); i < n; ++i) {
      pose T;
      T.tx = -0.3 * static_cast<double>(c.flag() ? i : 0), T.qy = 0.02 * static_cast<double>(i);
      T.qw = std::sqrt(1 - T.qy * T.qy);
      poses.push_back(T), fixed.push_back(c.byte() % 3 == 0 ? 1 : 0);
    }
    for (std::size_t i = 0, n = c.below(9); i < n; ++i) {
      points.push_back({0.2 * static_cast<double>(c.below(20)) - 2, 0.2 * static_cast<double>(c.below(10)) - 1,
                        1 + 0.5 * static_cast<double>(c.below(20))});
      fixed_points.push_back(c.byte() % 5 == 0 ? 1 : 0);
    }
    for (std::size_t f = 0; f < poses.size(); ++f)
      for (std::size_t l = 0; l < points.size(); ++l)
        if (const unsigned sees = c.byte() % 8; sees != 0) add(f, l, c), sees == 1 ? add(f, l, c) : void();
    for (unsigned n = c.byte() % 8; n > 0; --n, spoilt = true) {
      const unsigned what = c.byte() % 5;
      if (what == 0) spoil(poses[c.below(poses.size())], c);
      if (what == 1 && !points.empty()) points[c.below(points.size())] = c.vector(20);
      if (pixel.empty()) continue;
      const std::size_t r = c.below(pixel.size());
      if (what == 2) pixel[r] = c.vector(1000);
      if (what == 3) information[r] = c.number(4);
      if (what == 4) pixel[r].z = c.number(1000);
    }
  }
  void add(std::size_t f, std::size_t l, choices& c) {
    const std::size_t which = c.below(cameras.size());
    const auto& m = cameras[which];
    const auto body = turbomap::to_isometry<double>(poses[f]) * points[l];
    const auto p = turbomap::to_isometry<double>(m.T_camera_body) * body;
    turbomap::vec2<double> uv{100, 100};
    if (!m.camera.project(p, uv)) uv = {100, 100};
    const double noise = static_cast<double>(c.byte()) / 64 - 2;
    const bool stereo = m.bf > 0 && c.flag();
    pixel.push_back({uv.x + noise, uv.y - noise, stereo ? uv.x - m.bf / p.z : -1});
    frame.push_back(static_cast<std::int32_t>(f)), landmark.push_back(static_cast<std::int32_t>(l));
    camera.push_back(static_cast<std::uint8_t>(which)), information.push_back(1);
  }
};

bool same(const std::vector<pose>& a, const std::vector<pose>& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(pose)) == 0;
}

template <class Camera>
void adjust(turbomap::context<policy>& ctx, const problem<Camera>& p, choices& c) {
  using rows = turbomap::reprojections<Camera>;
  rows observations = turbomap::huber_reprojections<Camera>({p.cameras.data(), static_cast<int>(p.cameras.size())});
  observations.frame = p.frame, observations.landmark = p.landmark, observations.pixel = p.pixel;
  observations.information = p.information, observations.camera = p.camera;
  observations.stereo_correlation = c.flag() ? 0 : 0.6;
  turbomap::adjustment_options o;
  o.max_iterations = static_cast<int>(c.below(6)), o.max_retries = static_cast<int>(c.below(8));
  o.damping = c.flag() ? turbomap::damping_rule::identity : turbomap::damping_rule::diagonal;
  o.solver = static_cast<turbomap::reduced_solver>(c.below(4));
  o.numbers = static_cast<turbomap::precision>(c.below(3));
  turbomap::bundle_problem<policy, turbomap::pose_frame, rows> problem(ctx);
  if (!allowed([&] { problem.assign(ctx, {p.poses, p.fixed}, {p.points, p.fixed_points}, observations); })) return;
  const auto summary = turbomap::adjust<turbomap::every_adjustment_method>(ctx, problem, o);
  std::vector<pose> found;
  problem.frames(ctx, found);
  if (summary.accepted == 0) {
    expect(same(found, p.poses), "without an accepted step the estimate is what was given");
  } else {
    expect(finite({summary.cost_final}) && summary.cost_final <= summary.cost_initial, "steps lower the cost");
    for (std::size_t f = 0; f < found.size(); ++f) {
      expect(is_unit(found[f]), "poses are poses");
      if (p.fixed[f] != 0) expect(std::memcmp(&found[f], &p.poses[f], sizeof(pose)) == 0, "what is fixed stays");
    }
    std::vector<turbomap::vec3<double>> landmarks;
    problem.landmarks(ctx, landmarks);
    for (const auto& x : landmarks) expect(finite({x.x, x.y, x.z}), "landmarks are finite");
  }
  std::vector<double> chi2, depth, covariance;
  problem.template chi2<0>(ctx, chi2, depth);
  expect(chi2.size() == p.pixel.size(), "every row has its chi2");
  const std::vector<std::int32_t> asked{0, static_cast<std::int32_t>(p.poses.size()) - 1};
  if (c.flag() && asked[1] > 0) {
    const bool all = turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(asked), covariance);
    if (all)
      for (std::size_t i = 0; i < 12; ++i)
        expect(finite({covariance[13 * i]}) && covariance[13 * i] >= 0, "variances of what is determined are finite");
  }
  if (c.byte() % 4 == 1) {
    const int open = turbomap::undetermined_directions(ctx, problem);
    std::vector<std::int32_t> frames;
    int unknowns = 0;
    for (std::size_t f = 0; f < p.poses.size(); ++f)
      frames.push_back(static_cast<std::int32_t>(f)), unknowns += p.fixed[f] != 0 ? 0 : 6;
    expect(open >= 0 && open <= unknowns, "there are no more directions than unknowns");
    const bool all = turbomap::frame_covariance(ctx, problem, turbomap::span<const std::int32_t>(frames), covariance);
    expect(!all || open == 0, "where every frame is determined nothing is open");
    bool held = p.spoilt || unknowns < 6 * static_cast<int>(frames.size());
    for (const auto fixed : p.fixed_points) held = held || fixed != 0;
    if (!held) expect(open >= 6, "of frames and landmarks that nothing holds the gauge is open");
  }
}

/// Frames one by one, their points fixed.
template <class Camera>
void track(turbomap::context<policy>& ctx, const problem<Camera>& p, choices& c) {
  std::vector<turbomap::vec3<double>> points;
  for (const auto l : p.landmark) points.push_back(p.points[static_cast<std::size_t>(l)]);
  std::vector<std::int32_t> begin{0};
  for (std::size_t f = 0; f < p.poses.size(); ++f) {
    std::int32_t end = begin.back();
    while (static_cast<std::size_t>(end) < p.frame.size() &&
           p.frame[static_cast<std::size_t>(end)] == static_cast<int>(f))
      ++end;
    begin.push_back(end);
  }
  std::vector<turbomap::point_covariance> covariance;
  if (c.flag()) {
    covariance.resize(points.size());
    for (auto& s : covariance) s.xx = s.yy = s.zz = 1e-4 * c.byte();
    if (!covariance.empty()) covariance[c.below(covariance.size())].yx = c.number(1);
  }
  turbomap::motion_only<Camera, policy> adjust_poses(ctx);
  std::vector<turbomap::posed_frame> found;
  std::vector<std::uint8_t> outlier;
  turbomap::motion_only_options o;
  o.stereo_correlation = c.flag() ? 0 : 0.6;
  if (!allowed([&] {
        adjust_poses(ctx,
                     {{p.cameras.data(), static_cast<int>(p.cameras.size())},
                      p.poses,
                      begin,
                      points,
                      p.pixel,
                      p.information,
                      p.camera,
                      covariance},
                     o, found, outlier);
      }))
    return;
  for (std::size_t f = 0; f < found.size(); ++f)
    if (found[f].adjusted != 0)
      expect(is_unit(found[f].T_cw), "adjusted poses are poses");
    else
      expect(std::memcmp(&found[f].T_cw, &p.poses[f], sizeof(pose)) == 0, "a pose that was not adjusted stays");
}

template <class Camera>
void run(const turbomap_test::test_rig<Camera>& rig, choices& c) {
  turbomap::context<policy> ctx;
  const problem<Camera> p(rig, c);
  adjust(ctx, p, c);
  track(ctx, p, c);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  choices c(data, size);
  const unsigned rig = c.byte() % 4;
  if (rig < 2)
    run(turbomap_test::pinhole_rig(rig == 0 ? 0 : 50), c);
  else
    run(turbomap_test::fisheye_rig(static_cast<int>(rig)), c);
  return 0;
}
