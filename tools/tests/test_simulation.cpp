// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Simulated recordings: their statistics are those asked for, their geometry agrees with the truth written beside them.

#include "replay/arguments.hpp"
#include "simulation/calibration_file.hpp"
#include "simulation/simulate.hpp"
#include "simulation/walks.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include <turbomap/inertial/inertial_residual.hpp>
#include <turbomap/inertial/predict.hpp>
#include <turbomap/inertial/preintegrate.hpp>
#include <turbomap/io/recording.hpp>
#include <turbomap/io/trajectory_error.hpp>

#include "support/files.hpp"

namespace sim = turbomap::simulation;
using turbomap::recording;

namespace {

recording simulated(const sim::simulated_rig& rig, int keyframes, bool imu = false, std::uint64_t seed = 1) {
  sim::simulation_options options;
  options.motion.most_keyframes = keyframes, options.imu = imu, options.seed = seed;
  return sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
}
const recording& euroc() {
  static const recording r = simulated(sim::euroc_rig(), 16);
  return r;
}
const recording& tum_vi() {
  static const recording r = simulated(sim::tum_vi_rig(), 10, true);
  return r;
}

double median(std::vector<double> v) {
  REQUIRE_FALSE(v.empty());
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}
double mean(const std::vector<double>& v) {
  REQUIRE_FALSE(v.empty());
  double sum = 0;
  for (const double x : v) sum += x;
  return sum / static_cast<double>(v.size());
}

Eigen::Isometry3d isometry(const turbomap::rigid_transform<float>& T) {
  Eigen::Isometry3d I = Eigen::Isometry3d::Identity();
  I.linear() = Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).normalized().toRotationMatrix();
  I.translation() << T.tx, T.ty, T.tz;
  return I;
}
Eigen::Vector3d vector(const turbomap::vec3<float>& v) { return {v.x, v.y, v.z}; }

struct view_pair {
  std::size_t row1, row2;
};
/// Left keypoints of keyframes i and j that show the same scene point.
std::vector<view_pair> same_points(const recording& r, std::size_t i, std::size_t j) {
  std::map<std::int32_t, std::size_t> first;
  const auto left = [&](std::size_t k) {
    return r.keypoints(k).begin + (r.nleft[k] < 0 ? r.keypoints(k).size() : static_cast<std::size_t>(r.nleft[k]));
  };
  for (std::size_t row = r.keypoints(i).begin; row < left(i); ++row)
    if (r.sim_point_id[row] >= 0) first[r.sim_point_id[row]] = row;
  std::vector<view_pair> pairs;
  for (std::size_t row = r.keypoints(j).begin; row < left(j); ++row)
    if (first.count(r.sim_point_id[row]) != 0) pairs.push_back({first[r.sim_point_id[row]], row});
  return pairs;
}

}  // namespace

TEST_CASE("random numbers are the same everywhere") {
  sim::random_stream random(7, sim::purpose::scene_points, 1, 2, 3);
  CHECK(random.next() == 0xFE25D3599728F8E5u);
  CHECK(random.next() == 0xBAF4B1D7DC1E2E53u);
  std::vector<double> values, squares;
  for (int i = 0; i < 20000; ++i) values.push_back(random.normal()), squares.push_back(values.back() * values.back());
  CHECK(std::abs(mean(values)) < 0.03);
  CHECK(mean(squares) == doctest::Approx(1).epsilon(0.04));
}

TEST_CASE("the same seed gives the same recording, another one another") {
  const auto a = simulated(sim::euroc_rig(), 3), b = simulated(sim::euroc_rig(), 3),
             c = simulated(sim::euroc_rig(), 3, false, 2);
  CHECK((a.kp_desc == b.kp_desc));
  CHECK(std::memcmp(a.kp_xy.data(), b.kp_xy.data(), a.kp_xy.size() * sizeof(a.kp_xy[0])) == 0);
  CHECK_FALSE((a.kp_desc == c.kp_desc));
}

TEST_CASE("the motion's derivatives are those of its poses") {
  const sim::motion_spline motion(sim::builtin_trajectory(sim::euroc_rig().cameras[0].T_bc), 0.1);
  for (std::int64_t t = motion.begin_ns() + 10000000; t < motion.end_ns() - 10000000; t += 777777777) {
    const std::int64_t h = 10000;
    const auto before = motion.at(t - h), now = motion.at(t), after = motion.at(t + h);
    const double dt = 2e-9 * static_cast<double>(h);
    CHECK(((after.p_wb - before.p_wb) / dt - now.velocity).norm() < 1e-5);
    CHECK(((after.velocity - before.velocity) / dt - now.acceleration).norm() < 1e-3);
    CHECK((sim::log_so3(before.R_wb.conjugate() * after.R_wb) / dt - now.angular_velocity).norm() < 1e-5);
  }
  CHECK_THROWS_AS(sim::motion_spline({{0, {}}, {100, {}}}, 0.1), std::invalid_argument);
}

TEST_CASE("a motion with a gap of years is refused, and the gap is named") {
  const auto error = [](auto call) -> std::string {
    try {
      call();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "nothing thrown";
  };
  constexpr std::int64_t second = 1000000000;
  const auto spline = [&](const std::vector<turbomap::stamped_pose>& poses) {
    return error([&] { sim::motion_spline(poses, 0.1); });
  };
  const std::string gap = spline({{0, {}}, {second, {}}, {1400000000 * second, {}}, {1400000009 * second, {}}});
  CHECK(turbomap_test::has(gap, "poses: spans 1400000009 s, 1399999999 s of it between poses 2 and 3"));
  CHECK(turbomap_test::has(spline({{-9200000000 * second, {}}, {9200000000 * second, {}}}),
                           "poses: spans 18400000000 s"));
  CHECK(spline({{0, {}}, {3600 * second, {}}}) == "nothing thrown");

  const turbomap_test::temporary_directory folder;
  const std::string file = (folder / "gap.tum").string();
  turbomap::write_trajectory(file, {{0, {}}, {1400000000 * second, {}}});
  CHECK(turbomap_test::has(error([&] { sim::trajectory(file, {}, Eigen::Isometry3d::Identity()); }),
                           "gap.tum: spans 1400000000 s"));
  turbomap::write_trajectory(file, {{0, {}}});
  CHECK(turbomap_test::has(error([&] { sim::trajectory(file, {}, Eigen::Isometry3d::Identity()); }), "gap.tum = 1"));
}

TEST_CASE("long walks: a room is seen again and again, a corridor not") {
  const sim::simulated_rig rig = sim::euroc_rig();
  sim::simulation_options options;
  options.motion.most_keyframes = 60;
  // How many points of keyframe 10 keyframe 50 sees again: one lap later.
  const auto seen_again = [&](const char* walk) {
    const auto r = sim::simulate(sim::trajectory(walk, options.motion, rig.cameras[0].T_bc), rig, options);
    REQUIRE(r.keyframe_count() == 60);
    return same_points(r, 10, 50).size();
  };
  CHECK(seen_again("room") > 100);
  CHECK(seen_again("corridor") < 30);
  CHECK_THROWS_AS(sim::trajectory("no_such_file", options.motion, rig.cameras[0].T_bc), std::runtime_error);
}

TEST_CASE("descriptors: the same point at 38, different ones at 119") {
  const recording& r = euroc();
  std::vector<double> same, same_group, different, without_group;
  for (std::size_t i = 0; i + 2 < r.keyframe_count(); ++i)
    for (const auto [a, b] : same_points(r, i, i + 2)) {
      same.push_back(sim::hamming(r.kp_desc[a], r.kp_desc[b]));
      same_group.push_back(r.kp_node[a] == r.kp_node[b]);
    }
  for (std::size_t a = 0; a + 7919 < r.kp_desc.size(); a += 3)
    if (r.sim_point_id[a] != r.sim_point_id[a + 7919])
      different.push_back(sim::hamming(r.kp_desc[a], r.kp_desc[a + 7919]));
  for (const auto node : r.kp_node) without_group.push_back(node == turbomap::keypoint::no_group);
  CHECK(median(same) >= 36);
  CHECK(median(same) <= 40);
  CHECK(std::abs(mean(different) - 119) <= 3);
  CHECK(mean(same_group) > 0.55);
  CHECK(std::abs(mean(without_group) - 0.09) < 0.03);
  MESSAGE("same point: median " << median(same) << ", in the same group " << mean(same_group)
                                << "; different points: mean " << mean(different) << "; without a group "
                                << mean(without_group));
}

TEST_CASE("keypoints are spread over octaves and images as an extractor's") {
  for (const recording* r : {&euroc(), &tum_vi()}) {
    const double cameras = r->meta.camera2.empty() ? 1 : 2, features = r->meta.is_fisheye() ? 1000 : 1200;
    std::vector<double> octaves(8, 0.0);
    for (const auto o : r->kp_octave) octaves[o] += 1.0 / static_cast<double>(r->kp_octave.size());
    double expected = (1 - 1 / 1.2) / (1 - std::pow(1.2, -8));
    for (int o = 0; o < 8; ++o, expected /= 1.2)
      CHECK(octaves[static_cast<std::size_t>(o)] == doctest::Approx(expected).epsilon(0.05));
    for (std::size_t i = 0; i < r->keyframe_count(); ++i)
      CHECK(std::abs(static_cast<double>(r->keypoints(i).size()) - cameras * features) < cameras * 90);
    for (const auto& p : r->kp_xy) {
      CHECK((p.x >= 19 && p.x <= static_cast<float>(r->meta.width) - 20));
      CHECK((p.y >= 19 && p.y <= static_cast<float>(r->meta.height) - 20));
    }
    std::vector<double> clutter;
    for (const auto p : r->sim_point_id) clutter.push_back(p < 0);
    CHECK(mean(clutter) > 0.15);
    CHECK(mean(clutter) < 0.5);
  }
}

TEST_CASE("keypoints lie where the true pose projects their points, up to the noise") {
  const auto rigs = {sim::euroc_rig(), sim::tum_vi_rig()};
  const recording* recordings[] = {&euroc(), &tum_vi()};
  std::size_t which = 0;
  for (const sim::simulated_rig& rig : rigs) {
    const recording& r = *recordings[which++];
    std::vector<double> errors, stereo, left, right;
    for (std::size_t i = 0; i < r.keyframe_count(); ++i) {
      const auto keypoints = r.gather_keypoints(i);
      for (std::size_t k = 0; k < keypoints.size(); ++k) {
        const auto point = r.sim_point_id[r.keypoints(i).begin + k];
        if (point < 0) continue;
        Eigen::Isometry3d T = isometry(r.sim_T_cw_true[i]);
        if (keypoints[k].camera == 1) T = isometry(r.meta.T_rl) * T;
        const Eigen::Vector3d x = T * vector(r.sim_point_xyz[static_cast<std::size_t>(point)]);
        Eigen::Vector2d pixel;
        REQUIRE(rig.cameras[keypoints[k].camera].project(x, pixel));
        const double scale = std::pow(1.2, keypoints[k].octave), sigma = rig.noise_px * scale;
        errors.push_back(std::pow((keypoints[k].x - pixel.x()) / sigma, 2));
        errors.push_back(std::pow((keypoints[k].y - pixel.y()) / sigma, 2));
        if (keypoints[k].u_right < 0) continue;
        const double disparity = keypoints[k].x - keypoints[k].u_right, wrong = disparity - r.meta.bf / x.z();
        stereo.push_back(std::pow(wrong / (rig.disparity_noise_px * scale), 2));
        right.push_back((keypoints[k].u_right - pixel.x() + r.meta.bf / x.z()) / sigma);
        left.push_back((keypoints[k].x - pixel.x()) / sigma);
      }
    }
    CHECK(mean(errors) == doctest::Approx(1).epsilon(0.03));
    CHECK(stereo.empty() == r.meta.is_fisheye());
    if (stereo.empty()) continue;
    CHECK(mean(stereo) == doctest::Approx(1).epsilon(0.06));
    std::vector<double> together;
    for (std::size_t k = 0; k < left.size(); ++k) together.push_back(left[k] * right[k]);
    CHECK(mean(together) == doctest::Approx(1).epsilon(0.05));  // u and u_right err alike
  }
}

TEST_CASE("the noise that was simulated is told, and so is the correlation that replays adjust with") {
  sim::simulated_rig rig = sim::euroc_rig();
  CHECK(euroc().meta.noise_px == 0.5);
  CHECK(euroc().meta.disparity_noise_px == 0.13);
  CHECK(tum_vi().meta.noise_px == sim::fisheye_noise_px);
  CHECK(tum_vi().meta.disparity_noise_px == -1);
  turbomap_replay::arguments a;
  CHECK(a.correlation(euroc()) == doctest::Approx(1 - 0.13 * 0.13 / (2 * 0.5 * 0.5)));
  CHECK(a.correlation(tum_vi()) == 0);
  rig.disparity_noise_px = 0;
  CHECK(a.correlation(simulated(rig, 3)) == 0.9999);
  rig.disparity_noise_px = 1;  // worse than independent errors: not modelled
  CHECK(a.correlation(simulated(rig, 3)) == 0);
  recording old = euroc();
  old.meta.noise_px = old.meta.disparity_noise_px = -1;
  CHECK(a.correlation(old) == 0);
  old.sim_point_id.clear();
  CHECK(a.correlation(old) == 0.9835);
  a.stereo_correlation = 0.5;
  CHECK(a.correlation(euroc()) == 0.5);
}

TEST_CASE("true matches satisfy the epipolar constraint up to the noise") {
  const recording& r = euroc();
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = r.meta.camera1[0], K(1, 1) = r.meta.camera1[1], K(0, 2) = r.meta.camera1[2], K(1, 2) = r.meta.camera1[3];
  const double rig_noise = sim::euroc_rig().noise_px;
  std::vector<double> errors;
  for (std::size_t i = 0; i + 1 < r.keyframe_count(); ++i) {
    const Eigen::Isometry3d T = isometry(r.sim_T_cw_true[i + 1]) * isometry(r.sim_T_cw_true[i]).inverse();
    Eigen::Matrix3d skew;
    skew << 0, -T(2, 3), T(1, 3), T(2, 3), 0, -T(0, 3), -T(1, 3), T(0, 3), 0;
    const Eigen::Matrix3d F = K.inverse().transpose() * skew * T.linear() * K.inverse();
    for (const auto [a, b] : same_points(r, i, i + 1)) {
      const Eigen::Vector3d x1(r.kp_xy[a].x, r.kp_xy[a].y, 1), x2(r.kp_xy[b].x, r.kp_xy[b].y, 1);
      const Eigen::Vector3d l2 = F * x1, l1 = F.transpose() * x2;
      const double variance = std::pow(1.44, r.kp_octave[b]) * l2.head<2>().squaredNorm() +
                              std::pow(1.44, r.kp_octave[a]) * l1.head<2>().squaredNorm();
      errors.push_back(std::pow(x2.dot(l2) / rig_noise, 2) / variance);
    }
  }
  CHECK(errors.size() > 1000);
  CHECK(mean(errors) == doctest::Approx(1).epsilon(0.1));  // chi-square, one degree of freedom
}

TEST_CASE("orientations turn with the camera") {
  const recording& r = euroc();
  std::vector<double> turns;
  for (std::size_t i = 0; i + 1 < r.keyframe_count(); ++i)
    for (const auto [a, b] : same_points(r, i, i + 1))
      turns.push_back(std::abs(std::remainder(r.kp_angle[a] - r.kp_angle[b], 360.0)));
  CHECK(median(turns) > 3);
  CHECK(median(turns) < 15);
}

TEST_CASE("boxes hide what is behind them") {
  const std::vector<Eigen::Vector3d> path{{0, 0, 0}, {1, 0, 0}, {2, 1, 0}, {0, 2, 0.5}};
  const sim::scene scene(path, {}, 3);
  REQUIRE(scene.boxes().size() >= 4);
  for (const auto& box : scene.boxes()) {
    for (const auto& p : path) CHECK(box.exteriorDistance(p) >= 0.5);
    const Eigen::Vector3d middle = box.center(), behind = middle + 2 * (middle - path[0]).normalized();
    CHECK_FALSE(scene.visible(path[0], behind));
    CHECK_FALSE(scene.visible(behind, path[0]));
  }
  // Against a march along the ray, an independent way to find out.
  std::size_t hidden = 0, shown = 0;
  for (std::uint64_t i = 0; i < 600; ++i) {
    const sim::scene_point p = scene.point(i, 1.2, 8);
    const Eigen::Vector3d centre = path[i % path.size()];
    if (p.normal.dot(centre - p.position) <= 0.05) continue;
    bool blocked = false;
    double closest = 1;
    for (int s = 0; s < 2000; ++s) {
      const Eigen::Vector3d x = centre + (s / 2000.0) * (p.position - centre);
      for (const auto& box : scene.boxes()) {
        blocked = blocked || box.contains(x);
        closest = s < 1990 && !box.contains(x) ? std::min(closest, box.exteriorDistance(x)) : closest;
      }
    }
    if (!blocked && closest < 0.01) continue;  // grazes an edge: the march may step over it
    CHECK(scene.visible(centre, p.position) == !blocked);
    (blocked ? hidden : shown) += 1;
  }
  CHECK(hidden > 20);
  CHECK(shown > 100);
}

TEST_CASE("associations are those of a map: true, mostly old, with some duplicates") {
  for (const recording* r : {&euroc(), &tum_vi()}) {
    std::size_t old = 0;
    for (std::size_t i = 0; i < r->keyframe_count(); ++i)
      for (std::size_t a = r->associations(i).begin; a < r->associations(i).end; ++a) {
        const std::size_t row = r->keypoints(i).begin + static_cast<std::size_t>(r->assoc_kp[a]);
        for (const auto ref : {r->assoc_ref[a], r->assoc_ref2[a]}) {
          const std::size_t at =
              r->keypoints(static_cast<std::size_t>(ref.keyframe)).begin + static_cast<std::size_t>(ref.keypoint);
          CHECK(r->sim_point_id[at] == r->sim_point_id[row]);
          CHECK(r->sim_track_id[at] == r->sim_track_id[row]);
          if (r->assoc_new[a] == 0) CHECK(ref.keyframe < static_cast<std::int32_t>(i));
        }
        CHECK(r->assoc_ref2[a].keyframe <= r->assoc_ref[a].keyframe);
        old += r->assoc_new[a] == 0;
      }
    const double share = static_cast<double>(r->assoc_kp.size()) / static_cast<double>(r->kp_xy.size());
    CHECK(share > 0.35);  // a map begins with few
    CHECK(share < 0.7);
    CHECK(old > r->assoc_kp.size() / 4);
    for (std::size_t k = 0; k < r->recent_found.size(); ++k) CHECK(r->recent_found[k] <= r->recent_visible[k]);
  }
  std::map<std::int32_t, std::set<std::int32_t>> tracks;
  for (std::size_t row = 0; row < euroc().sim_point_id.size(); ++row)
    if (euroc().sim_point_id[row] >= 0 && euroc().sim_track_id[row] >= 0)
      tracks[euroc().sim_point_id[row]].insert(euroc().sim_track_id[row]);
  const auto duplicates =
      std::count_if(tracks.begin(), tracks.end(), [](const auto& t) { return t.second.size() > 1; });
  CHECK(duplicates > 20);
  CHECK(duplicates < static_cast<std::ptrdiff_t>(tracks.size() / 4));
}

TEST_CASE("recorded poses drift away from the truth, slowly") {
  const recording& r = euroc();
  double distance = 0;
  for (std::size_t i = 1; i < r.keyframe_count(); ++i)
    distance += (isometry(r.sim_T_cw_true[i]).inverse().translation() -
                 isometry(r.sim_T_cw_true[i - 1]).inverse().translation())
                    .norm();
  const double error =
      (isometry(r.T_cw.back()).inverse().translation() - isometry(r.sim_T_cw_true.back()).inverse().translation())
          .norm();
  CHECK(distance > 2);
  CHECK(error > 1e-5 * distance);
  CHECK(error < 1e-2 * distance);
  CHECK((isometry(r.T_cw[0]).matrix() - isometry(r.sim_T_cw_true[0]).matrix()).norm() < 1e-6);
}

TEST_CASE("without a drift in position, rotations drift by 2e-4 rad per metre, as the pages say") {
  sim::motion_options options;
  options.drift_metres_per_metre = 0;
  std::vector<Eigen::Isometry3d> straight(2001, Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < straight.size(); ++i) straight[i].translation().x() = static_cast<double>(i);
  const auto poses = sim::drifting_poses(straight, options, 1);
  double squares = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Eigen::Isometry3d step = poses[i - 1].inverse() * poses[i];
    CHECK((step.translation() - Eigen::Vector3d::UnitX()).norm() < 1e-9);
    squares += sim::log_so3(Eigen::Quaterniond(step.linear())).squaredNorm();
  }
  CHECK(std::sqrt(squares / 6000) == doctest::Approx(2e-4).epsilon(0.05));
}

TEST_CASE("a fisheye pair: partners show the same point, in the other image") {
  const recording& r = tum_vi();
  std::size_t partners = 0;
  for (std::size_t i = 0; i < r.keyframe_count(); ++i)
    for (std::size_t row = r.keypoints(i).begin; row < r.keypoints(i).end; ++row) {
      if (r.kp_lrmatch[row] < 0) continue;
      const std::size_t other = r.keypoints(i).begin + static_cast<std::size_t>(r.kp_lrmatch[row]);
      CHECK(r.keypoints(i).begin + static_cast<std::size_t>(r.kp_lrmatch[other]) == row);
      CHECK(r.sim_point_id[row] == r.sim_point_id[other]);
      const auto left = r.keypoints(i).begin + static_cast<std::size_t>(r.nleft[i]);
      CHECK((row < left) != (other < left));
      ++partners;
    }
  CHECK(partners > r.kp_xy.size() / 8);
  CHECK(*std::max_element(r.kp_uright.begin(), r.kp_uright.end()) == -1);
}

TEST_CASE("a monocular recording has no depth, and starts with points of two views") {
  const recording r = simulated(sim::monocular(sim::euroc_rig()), 6);
  CHECK(r.meta.sensor == "monocular");
  CHECK(r.meta.bf == 0);
  CHECK(*std::max_element(r.kp_uright.begin(), r.kp_uright.end()) == -1);
  CHECK(*std::max_element(r.kp_depth.begin(), r.kp_depth.end()) == -1);
  const auto first = r.associations(0);
  CHECK(first.size() > 50);
  for (std::size_t a = 0; a < r.assoc_new.size(); ++a) CHECK(static_cast<bool>(r.assoc_new[a]) == (a < first.end));
  CHECK(r.associations(1).size() > 30);
}

TEST_CASE("a monocular map begins with two views that have parallax, a stereo map at once") {
  // At rest for 2 s, then on the spot around by 1.5 rad in 2 s, then straight on.
  std::vector<turbomap::stamped_pose> poses;
  for (int i = 0; i <= 160; ++i) {
    const double t = i * 0.05, turn = std::clamp((t - 2) * 0.75, 0.0, 1.5), x = 0.5 * std::max(t - 4, 0.0);
    poses.push_back({i * std::int64_t{50000000}, {0, 0, std::sin(turn / 2), std::cos(turn / 2), x, 0, 0}});
  }
  const sim::motion_options options;
  const sim::motion_spline motion(poses, options.knot_seconds);
  const auto bodies = [&](bool monocular) {
    const sim::planned_motion plan = sim::plan_motion(motion, options, monocular);
    std::vector<sim::body_state> all;
    for (const std::size_t k : plan.keyframes) all.push_back(plan.frames[k].body);
    REQUIRE(all.size() > 4);
    return all;
  };
  const auto one = bodies(true), two = bodies(false);
  CHECK((one[1].p_wb - one[0].p_wb).norm() >= options.first_metres);
  CHECK(one[1].R_wb.angularDistance(one[0].R_wb) < options.monocular_share * options.keyframe_radians);
  CHECK((one[2].p_wb - one[1].p_wb).norm() < 0.75 * options.keyframe_metres);
  CHECK((two[1].p_wb - two[0].p_wb).norm() < 0.01);
}

namespace {

/// How far integrated samples are from the motion after `seconds`: rotation (rad), velocity (m/s), position (m).
struct integration_error {
  double rotation, velocity, position;
};
integration_error integrated(const sim::motion_spline& motion, double rate_hz, double seconds,
                             turbomap::integration_rule rule) {
  sim::imu_noise none;
  none.gyro = none.acceleration = none.gyro_walk = none.acceleration_walk = 0, none.rate_hz = rate_hz;
  const std::int64_t begin = motion.begin_ns(), end = begin + static_cast<std::int64_t>(seconds * 1e9);
  const sim::imu_record imu = sim::simulate_imu(motion, begin, end, none, 1);
  turbomap::preintegration_options options;
  options.rule = rule;
  const turbomap::imu_samples samples{imu.t_ns, imu.samples};
  const auto& b = imu.bias[0];  // no walk
  const auto p = turbomap::preintegrate(samples, turbomap::find_interval(samples, begin, end),
                                        turbomap::imu_bias<double>{{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}, options);
  const auto state = [&](std::int64_t t) {
    const sim::body_state s = motion.at(t);
    const Eigen::Quaterniond q = s.R_wb.conjugate();
    const Eigen::Vector3d at = -(q * s.p_wb);
    turbomap::inertial_state<double> x;
    x.T_cw = {q.x(), q.y(), q.z(), q.w(), at.x(), at.y(), at.z()};
    x.velocity = {s.velocity.x(), s.velocity.y(), s.velocity.z()};
    return x;
  };
  turbomap::inertial_state<double> from = state(begin);
  from.bias = p.bias;
  const auto reached = turbomap::predict(from, p, {0, 0, -sim::gravity}), truth = state(end);
  const auto T = turbomap::to_isometry<double>(reached.T_cw), U = turbomap::to_isometry<double>(truth.T_cw);
  return {turbomap::norm(turbomap::rotation_log(turbomap::transpose(T.R) * U.R)),
          turbomap::norm(reached.velocity - truth.velocity),
          turbomap::norm(turbomap::camera_centre(T) - turbomap::camera_centre(U))};
}

}  // namespace

TEST_CASE("inertial data without noise integrate to the motion, to the order of the integrator") {
  const sim::motion_spline motion(sim::builtin_trajectory(sim::euroc_rig().cameras[0].T_bc), 0.1);
  using turbomap::integration_rule;
  for (const double seconds : {1.0, 5.0}) {
    const auto a = integrated(motion, 100, seconds, integration_rule::midpoint),
               b = integrated(motion, 200, seconds, integration_rule::midpoint),
               c = integrated(motion, 200, seconds, integration_rule::first_order);
    MESSAGE(seconds << " s at 200 Hz: rotation " << b.rotation << ", velocity " << b.velocity << ", position "
                    << b.position << "; by the first order " << c.velocity << ", " << c.position);
    // Second order: twice the rate, a quarter of the error.
    CHECK(a.rotation > 3.5 * b.rotation);
    CHECK(a.velocity > 3.5 * b.velocity);
    CHECK(a.position > 3.5 * b.position);
    CHECK(b.rotation < 1e-5 * seconds);
    CHECK(b.velocity < 1e-4 * seconds);
    CHECK(b.position < 1e-4 * seconds * seconds);
    CHECK(c.velocity > 10 * b.velocity);
  }
}

TEST_CASE("an inertial recording has the truth beside it, and its samples agree with it") {
  const recording& r = tum_vi();
  REQUIRE(r.has_imu());
  REQUIRE(r.sim_velocity_true.size() == r.keyframe_count());
  REQUIRE(r.sim_bias_true.size() == r.keyframe_count());
  const turbomap::imu_samples samples{r.imu_t_ns, r.imu};
  turbomap::preintegration_options options;
  const sim::imu_noise noise = sim::tum_vi_rig().imu;
  options.noise = {noise.gyro, noise.acceleration, noise.gyro_walk, noise.acceleration_walk, 0};
  const auto state = [&](std::size_t i) {
    const auto& b = r.sim_bias_true[i];
    const auto v = turbomap::cast<double>(r.sim_velocity_true[i]);
    return turbomap::inertial_state<double>{
        turbomap::normalised(turbomap::cast<double>(r.sim_T_cw_true[i])), v, {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}}};
  };
  CHECK(std::abs(r.sim_bias_true[0][0]) > 1e-4);
  for (std::size_t i = 0; i + 1 < r.keyframe_count(); ++i) {
    const auto from = state(i), to = state(i + 1);
    const auto p =
        turbomap::preintegrate(samples, turbomap::find_interval(samples, r.t_ns[i], r.t_ns[i + 1]), from.bias, options);
    double e[9], W[81];
    turbomap::inertial_residual(p, turbomap::to_isometry<double>(r.meta.T_bc), from, to, {0, 0, -sim::gravity}, e);
    REQUIRE(turbomap::inertial_whitening(p, W));
    double chi2 = 0;
    for (int row = 0; row < 9; ++row) {
      double w = 0;
      for (int k = 0; k <= row; ++k) w += W[9 * row + k] * e[k];
      chi2 += w * w;
    }
    CHECK(chi2 < 40);  // nine degrees of freedom; more than 33.7 once in 10,000
  }
}

TEST_CASE("the truth of an inertial recording is written and read; half of it is refused") {
  const turbomap_test::temporary_directory folder;
  const auto at = folder / "r";
  turbomap::write_recording(at, tum_vi());
  const auto r = turbomap::read_recording(at);
  CHECK(r.sim_bias_true == tum_vi().sim_bias_true);
  REQUIRE(r.sim_velocity_true.size() == r.keyframe_count());
  CHECK(r.sim_velocity_true[3].x == tum_vi().sim_velocity_true[3].x);
  std::filesystem::remove(at / "sim_bias_true.npy");
  CHECK(turbomap_test::has(turbomap_test::bad_file_message([&] { turbomap::read_recording(at); }), "sim_bias_true"));
}

TEST_CASE("a recording of a system whose IMU is not initialised: another world, without stereo another unit") {
  sim::simulation_options options;
  options.motion.most_keyframes = 5, options.imu = true, options.imu_initialised = false;
  for (const bool mono : {false, true}) {
    const sim::simulated_rig rig = mono ? sim::monocular(sim::euroc_rig()) : sim::euroc_rig();
    const auto r = sim::simulate(sim::builtin_trajectory(rig.cameras[0].T_bc), rig, options);
    CHECK(r.meta.sensor == "inertial");
    CHECK((r.meta.bf == 0) == mono);
    CHECK(*std::max_element(r.bimu.begin(), r.bimu.end()) == 0);
    CHECK((isometry(r.sim_T_cw_true[0]).matrix() - Eigen::Matrix4d::Identity()).norm() < 1e-6);
    const auto length = [&](const auto& T) { return (isometry(T[4]).inverse().translation()).norm(); };
    const auto centre = [&](std::size_t i) {
      const auto c = turbomap::true_camera_centre(r, r.t_ns[i]).value();
      return Eigen::Vector3d(c.x, c.y, c.z);
    };
    const double metres = (centre(4) - centre(0)).norm(), unit = mono ? options.monocular_unit : 1;
    CHECK(length(r.sim_T_cw_true) == doctest::Approx(metres / unit).epsilon(1e-5));
    CHECK(length(r.T_cw) == doctest::Approx(metres / unit).epsilon(0.02));
    // Points of associations are in the same unit: they project to where their keypoints are.
    std::vector<double> off;
    for (std::size_t a = r.associations(1).begin; a < r.associations(1).end; ++a) {
      Eigen::Vector2d pixel;
      const auto& p = r.kp_xy[r.keypoints(1).begin + static_cast<std::size_t>(r.assoc_kp[a])];
      if (rig.cameras[0].project(isometry(r.T_cw[1]) * vector(r.assoc_pos[a]), pixel))
        off.push_back((pixel - Eigen::Vector2d(p.x, p.y)).norm());
    }
    CHECK(median(off) < 3);
    const Eigen::Vector3d v = vector(r.sim_velocity_true[2]);
    CHECK(v.norm() > 0.1);  // m/s, whatever the unit
    CHECK(v.norm() < 3);
  }
}

TEST_CASE("a calibration file gives a rig, or is refused by name") {
  const turbomap_test::temporary_directory folder;
  const std::string T =
      "  T_cam_imu: #rows\n    - [1.0, 0, 0, 0.05]\n    - [0, 1.0, 0, 0]\n    - [0, 0, 1.0, 0]\n    - [0.0, 0.0, 0.0, "
      "1.0]\n";
  const std::string right =
      "  T_cam_imu:\n    - [1.0, 0, 0, -0.15]\n    - [0, 1.0, 0, 0]\n    - [0, 0, 1.0, 0]\n    - [0, 0, 0, 1]\n";
  const std::string lens = "  distortion_coeffs: [1e-3, 0.2e-3,0,0]\n  distortion_model: equidistant\n";
  const std::string rest = "  intrinsics: [190, 191, 255, 256] #fu, fv, cu, cv\n  resolution: [512, 512]\n";
  const auto rig = [&](const std::string& text) {
    turbomap_test::write_bytes(folder / "c.yaml", "%YAML:1.0\n\n" + text);
    return sim::read_rig(folder / "c.yaml");
  };
  const auto pair = rig("cam0:\n" + T + lens + rest + "cam1:\n" + right + lens + rest);
  REQUIRE(pair.cameras.size() == 2);
  CHECK(pair.baseline == doctest::Approx(0.2));
  CHECK(pair.cameras[0].parameters() == std::vector<double>{190, 191, 255, 256, 1e-3, 0.2e-3, 0, 0});
  CHECK(pair.cameras[0].T_bc.translation().x() == doctest::Approx(-0.05));
  const auto stereo = rig("cam0:\n" + T + rest + "cam1:\n" + right + rest);
  CHECK(stereo.rectified());
  CHECK(rig("cam0:\n" + T + rest).baseline == 0);
  const auto imu = rig("cam0:\n" + T + rest + "imu0:\n  accelerometer_noise_density: 0.01\n  update_rate: 400.0 #Hz\n");
  CHECK(imu.imu.acceleration == 0.01);
  CHECK(imu.imu.rate_hz == 400);
  CHECK(imu.imu.gyro == sim::imu_noise{}.gyro);
  const auto error = [&](const std::string& text) { return turbomap_test::bad_file_message([&] { rig(text); }); };
  CHECK(turbomap_test::has(error("cam1:\n" + T + rest), "there is no cam0"));
  CHECK(turbomap_test::has(error("cam0:\n" + T), "cam0: intrinsics needs 4 numbers"));
  CHECK(turbomap_test::has(error("cam0:\n" + rest), "cam0: T_imu_cam needs 16"));
  CHECK(turbomap_test::has(error("cam0:\n" + T + rest + "  distortion_model: spline\n"), "'spline'"));
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const auto camera = [&](const std::string& from, const std::string& to) {
    return error(replaced("cam0:\n" + T + lens + rest, from, to));
  };
  for (const char* number : {"inf", "nan", "-inf", "1e400"}) {
    CAPTURE(number);
    CHECK(turbomap_test::has(camera("255", number), "cam0: intrinsics has a number that is not finite"));
    CHECK(turbomap_test::has(camera("1e-3", number), "cam0: distortion_coeffs has a number that is not finite"));
  }
  for (const char* size : {"[512, 1e12]", "[512, 30]"})
    CHECK(turbomap_test::has(camera("[512, 512]", size), "cam0: resolution must be more than 38 and less than 65536"));
  for (const char* row : {"[0, 2, 0, 0]", "[0, -1, 0, 0]", "[0, 0, 0, 0]", "[0, 1, 0, 1e300]"}) {
    CAPTURE(row);
    CHECK(turbomap_test::has(camera("[0, 1.0, 0, 0]", row), "cam0: T_cam_imu is not a rotation and a translation"));
  }
  CHECK(turbomap_test::has(camera("[0.0, 0.0, 0.0, 1.0]", "[0, 0, 1, 1]"), "T_cam_imu is not a rotation"));
  const std::string no_rate = "imu0:\n  update_rate: 0\n", two = "imu0:\n  gyroscope_random_walk: [1e-5, 2e-5]\n";
  CHECK(
      turbomap_test::has(error("cam0:\n" + T + rest + no_rate), "imu0: update_rate needs one number from 1 to 10000"));
  CHECK(turbomap_test::has(error("cam0:\n" + T + rest + two), "imu0: gyroscope_random_walk"));
}
