// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The update of map points against its oracle, under every host policy, its edge cases, and what was recorded.

#include <turbomap/io/recording.hpp>

#include <thrust/execution_policy.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <limits>
#include <random>
#include <vector>

#include "appearance_cases.hpp"
#include "support/policies.hpp"
#include "support/support.hpp"

namespace turbomap_test {

/// A distance of 64 bits that is not whole: of points on a line.
struct double_on_line {
  using element = float;
  static constexpr int elements = 1, bytes = 4;
  using distance_type = double;
  static constexpr distance_type worst = std::numeric_limits<double>::max();
  static distance_type distance(const element* a, const element* b) {
    return *a < *b ? static_cast<double>(*b) - *a : static_cast<double>(*a) - *b;
  }
};
/// A distance of 8 bits.
struct byte_on_circle {
  using element = std::uint8_t;
  static constexpr int elements = 1, bytes = 1;
  using distance_type = std::uint8_t;
  static constexpr distance_type worst = 255;
  static distance_type distance(const element* a, const element* b) {
    const auto d = static_cast<std::uint8_t>(*a - *b);
    return d < 128 ? d : static_cast<std::uint8_t>(256 - d);
  }
};
/// A distance whose upper half does not fit a signed integer.
struct unsigned_on_line {
  using element = std::uint32_t;
  static constexpr int elements = 1, bytes = 4;
  using distance_type = std::uint32_t;
  static constexpr distance_type worst = 0xFFFFFFFFu;
  static distance_type distance(const element* a, const element* b) { return *a < *b ? *b - *a : *a - *b; }
};
/// Smaller is more alike, but below the distance to itself: a scalar product.
struct scalar_product {
  using element = float;
  static constexpr int elements = 1, bytes = 4;
  using distance_type = float;
  static constexpr distance_type worst = std::numeric_limits<float>::max();
  static distance_type distance(const element* a, const element* b) { return -(*a * *b); }
};

}  // namespace turbomap_test

namespace {

using namespace turbomap_test;
using turbomap::distance_order;
using turbomap::real_descriptor;

TEST_CASE_TEMPLATE("points of pinhole keyframes", Policy, TURBOMAP_TEST_POLICIES) {
  const Policy policy{};
  unsigned seed = 1;
  for (const motion how : {motion::sideways, motion::forward, motion::turn_at_origin, motion::anything})
    check_update<Policy, orb_bits>(policy, pinhole_rig(50), seed++, how);
  check_update<Policy, orb_bits>(policy, pinhole_rig(), 11, motion::anything, 3, 2.0F);
  check_update<Policy, orb_bits>(policy, pinhole_rig(), 12, motion::anything, 1, 1.0F);
}
TEST_CASE_TEMPLATE("points of fisheye and mixed rigs", Policy, TURBOMAP_TEST_POLICIES) {
  const Policy policy{};
  check_update<Policy, orb_bits>(policy, fisheye_rig(), 21, motion::anything);
  check_update<Policy, orb_bits>(policy, fisheye_rig(3), 22);
  check_update<Policy, orb_bits>(policy, mixed_rig(), 23, motion::anything);
}
TEST_CASE_TEMPLATE("other descriptors", Policy, TURBOMAP_TEST_POLICIES) {
  const Policy policy{};
  check_update<Policy, turbomap::binary_descriptor<488>>(policy, pinhole_rig(), 31);
  check_update<Policy, real_descriptor<float, 64>>(policy, pinhole_rig(), 32);
  check_update<Policy, real_descriptor<std::int8_t, 24>>(policy, fisheye_rig(), 33);
}

/// Sets of one-element descriptors: sorted, equal, alternating and random ones of all sizes.
template <class Descriptor, class Element>
void check_medoids(Element make) {
  static_assert(Descriptor::elements == 1);
  std::mt19937 random(7);
  for (int n = 1; n <= 150; n += n < 20 ? 1 : 13) {
    for (int shape = 0; shape < 6; ++shape) {
      std::vector<typename Descriptor::element> e;
      for (int i = 0; i < n; ++i) {
        const int value[] = {
            i, n - i, 5, i % 2 == 0 ? i : 3, static_cast<int>(random() % 9), static_cast<int>(random() % 100000)};
        e.push_back(make(value[shape]));
      }
      std::vector<const typename Descriptor::element*> rows;
      for (const auto& x : e) rows.push_back(&x);
      const int expected = oracle_medoid<Descriptor>(rows);
      CAPTURE(n);
      CAPTURE(shape);
      const auto nth = [&e](int j) { return &e[static_cast<std::size_t>(j)]; };
      CHECK(turbomap::medoid_with_table<Descriptor>(n, nth) == expected);
      CHECK(turbomap::medoid_without_memory<Descriptor>(n, nth) == expected);
    }
  }
}

TEST_CASE("the medoid of any number of descriptors, distances of every type") {
  const auto as = [](auto scale) { return [scale](int v) { return static_cast<decltype(scale)>(v) * scale; }; };
  check_medoids<double_on_line>(as(0.37F));
  check_medoids<byte_on_circle>([](int v) { return static_cast<std::uint8_t>(v * 37); });
  check_medoids<unsigned_on_line>([](int v) { return static_cast<std::uint32_t>(v) * 40009u; });
  check_medoids<scalar_product>([](int v) { return static_cast<float>(v % 7) - 2.5F; });
  check_medoids<turbomap::binary_descriptor<8>>([](int v) { return static_cast<std::uint8_t>(v * 91); });
  check_medoids<real_descriptor<float, 1>>(as(1e-3F));
  check_medoids<real_descriptor<float, 1>>(
      [](int v) { return v % 3 == 0 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(v) * 1e16F; });
}

TEST_CASE_TEMPLATE("the medoid of alike descriptors of several widths", Descriptor, turbomap::binary_descriptor<256>,
                   turbomap::binary_descriptor<488>, turbomap::binary_descriptor<512>, turbomap::binary_descriptor<768>,
                   real_descriptor<float, 8>) {
  using element = typename Descriptor::element;
  std::mt19937 random(11);
  for (int n = 1; n <= 131; n += n < 40 ? 1 : 13) {
    std::vector<element> first(Descriptor::elements), all;
    for (auto& e : first) e = static_cast<element>(random() % 256);
    for (int i = 0; i < n; ++i) {
      all.insert(all.end(), first.begin(), first.end());
      for (unsigned changes = random() % 20; changes > 0; --changes)
        *(all.end() - 1 - static_cast<std::ptrdiff_t>(random() % Descriptor::elements)) =
            static_cast<element>(random() % 256);
    }
    const auto nth = [&](int i) { return all.data() + i * Descriptor::elements; };
    std::vector<const element*> rows;
    for (int i = 0; i < n; ++i) rows.push_back(nth(i));
    CAPTURE(n);
    CHECK(turbomap::medoid_with_table<Descriptor>(n, nth) == oracle_medoid<Descriptor>(rows));
  }
}

TEST_CASE("distances become integers in the same order") {
  const auto ascend = [](const auto& values) {
    for (std::size_t i = 1; i < values.size(); ++i) CHECK(distance_order(values[i - 1]) < distance_order(values[i]));
  };
  const float f = std::numeric_limits<float>::max(), inf = std::numeric_limits<float>::infinity();
  ascend(std::array{-f, -2.0F, -1e-45F, 0.0F, 1e-45F, 1.0F, 1.0000001F, f, inf});
  ascend(std::array{-1e300, -1.0, -5e-324, 0.0, 5e-324, 1.0, 1e300, std::numeric_limits<double>::quiet_NaN()});
  ascend(std::array{-5, 0, 7, std::numeric_limits<int>::max()});
  ascend(std::array<std::uint64_t, 3>{0, std::uint64_t{1} << 62, std::uint64_t{1} << 63});
  ascend(std::array<std::int8_t, 3>{-128, 0, 127});
  CHECK(distance_order(-0.0F) == distance_order(0.0F));
  CHECK(distance_order(-0.0) == distance_order(0.0));
  CHECK(distance_order(std::nanf("")) == distance_order(-inf));
  using turbomap::detail::midpoint;
  CHECK(midpoint(std::numeric_limits<int>::min(), std::numeric_limits<int>::max()) == -1);
  CHECK(midpoint(3, 4) == 3);
  CHECK(midpoint(-4, -3) == -4);
  CHECK(midpoint(0xFFFFFFF0u, 0xFFFFFFFFu) == 0xFFFFFFF7u);
}

TEST_CASE_TEMPLATE("points that need no oracle", Policy, TURBOMAP_TEST_POLICIES) { check_known_points<Policy>(); }
TEST_CASE_TEMPLATE("nothing to update", Policy, TURBOMAP_TEST_POLICIES) { check_empty_updates<Policy>(); }
TEST_CASE_TEMPLATE("descriptors that are no numbers", Policy, TURBOMAP_TEST_TWO_POLICIES) {
  check_descriptors_of_nan<Policy>();
}
TEST_CASE_TEMPLATE("arguments", Policy, TURBOMAP_TEST_TWO_POLICIES) { check_update_arguments<Policy>(); }
TEST_CASE_TEMPLATE("memory", Policy, TURBOMAP_TEST_POLICIES) {
  check_update_allocations<Policy>(std::pmr::get_default_resource());
}

/// The keyframes of a recording without what an update does not read.
struct recorded_keyframes {
  using posed = turbomap::posed_keyframe<orb_bits, fisheye_camera>;

  explicit recorded_keyframes(const std::filesystem::path& directory) : recording(turbomap::read_recording(directory)) {
    cameras.resize(recording.meta.is_fisheye() ? 2 : 1);
    if (cameras.size() == 2) cameras[1].T_camera_body = turbomap::cast<double>(recording.meta.T_rl);
    for (std::size_t k = 0; k < recording.keyframe_count(); ++k) {
      posed& p = all.emplace_back();
      const auto rows = recording.keypoints(k);
      camera.emplace_back();
      for (const auto& keypoint : recording.gather_keypoints(k)) camera.back().push_back(keypoint.camera);
      p.view.keypoint_count = static_cast<int>(rows.size());
      p.view.camera = camera.back().data();
      p.view.octave = recording.kp_octave.data() + rows.begin;
      p.view.descriptor = recording.kp_desc.data()->data() + rows.begin * orb_bits::elements;
      p.view.cameras = cameras.data(), p.view.camera_count = static_cast<int>(cameras.size());
    }
  }
  void rewind() {
    // A keyframe that was culled is no longer moved: its last pose is the one that its points were updated with.
    for (std::size_t k = 0; k < all.size(); ++k) all[k].T_cw = turbomap::cast<double>(recording.final_T_cw[k]);
  }
  turbomap::recording recording;
  std::vector<turbomap::rig_camera<fisheye_camera>> cameras;
  std::vector<std::vector<std::uint8_t>> camera;
  std::vector<posed> all;
};

struct recorded_totals {
  long points = 0, descriptor_differs = 0;
  double normal_error = 0, range_error = 0;  // the largest; relative
};

/// One snapshot: the points of its keyframe after fusion. Culled keyframes that linger in the recorded lists of
/// observers count for the geometry, not for the descriptor.
void check_recorded_update(recorded_keyframes& keyframes, const std::filesystem::path& snapshot,
                           recorded_totals& totals) {
  const auto rows = [&snapshot](const char* name, auto row) {
    return turbomap::read_npy_rows<decltype(row)>(snapshot / (std::string(name) + ".npy"));
  };
  using vec3f = turbomap::vec3<float>;
  const auto alive = rows("kf_alive", std::int32_t());
  const auto poses = rows("kf_Tcw", turbomap::rigid_transform<float>());
  std::vector<bool> lives(keyframes.all.size());
  keyframes.rewind();
  for (std::size_t i = 0; i < alive.size(); ++i) {
    lives[static_cast<std::size_t>(alive[i])] = true;
    keyframes.all[static_cast<std::size_t>(alive[i])].T_cw = turbomap::cast<double>(poses[i]);
  }
  const auto position = rows("fpost_pos", vec3f()), normal = rows("fpost_normal", vec3f());
  const auto least = rows("fpost_mindist", float()), most = rows("fpost_maxdist", float());
  const auto descriptor = rows("fpost_desc", std::array<std::uint8_t, 32>());
  const auto reference = rows("fpost_refkf", std::int32_t());
  const auto offset = rows("fpost_obs_off", std::int64_t());
  const auto observer = rows("fpost_obs_kf", std::int32_t());
  const auto seen = rows("fpost_obs_lr", std::array<std::int32_t, 2>());
  observed_points all, living;
  for (std::size_t i = 0; i < position.size(); ++i) {
    std::vector<turbomap::point_observation> views, living_views;
    for (auto o = static_cast<std::size_t>(offset[i]); o < static_cast<std::size_t>(offset[i + 1]); ++o)
      for (const std::int32_t keypoint : seen[o])
        if (keypoint >= 0) {
          views.push_back({observer[o], keypoint});
          if (lives[static_cast<std::size_t>(observer[o])]) living_views.push_back(views.back());
        }
    all.add(turbomap::cast<double>(position[i]), reference[i], views);
    living.add(turbomap::cast<double>(position[i]), reference[i], living_views);
  }
  using posed = recorded_keyframes::posed;
  turbomap::appearance_options geometry, descriptors;
  geometry.scales = descriptors.scales = keyframes.recording.meta.pyramid();
  geometry.descriptors = false, descriptors.geometry = false;
  turbomap::context<parallel> ctx{parallel{}};
  turbomap::appearances<orb_bits, fisheye_camera, parallel> updates(ctx);
  update_plan<orb_bits> measured, represented;
  turbomap::update_appearance(ctx, all.view(), turbomap::span<const posed>(keyframes.all), geometry, updates);
  updates.plan(ctx, measured.points, measured.descriptors);
  turbomap::update_appearance(ctx, living.view(), turbomap::span<const posed>(keyframes.all), descriptors, updates);
  updates.plan(ctx, represented.points, represented.descriptors);
  for (std::size_t i = 0; i < position.size(); ++i) {
    const auto& p = measured.points[i];
    ++totals.points;
    totals.descriptor_differs +=
        std::memcmp(descriptor[i].data(), represented.descriptors.data() + i * 32, 32) == 0 ? 0 : 1;
    const auto worst = [](double& so_far, double error) { so_far = error <= so_far ? so_far : error; };
    worst(totals.normal_error, turbomap::norm(turbomap::cast<double>(p.normal) - turbomap::cast<double>(normal[i])));
    worst(totals.range_error, std::abs(0.8 * p.min_distance / least[i] - 1));
    worst(totals.range_error, std::abs(1.2 * p.max_distance / most[i] - 1));
  }
}

TEST_CASE("recorded updates are reproduced") {
  for (const char* name : {"euroc_v102_stereo", "euroc_v102_inertial", "tum_room1_stereo", "tum_room1_inertial"}) {
    const auto directory = turbomap_test::data(std::string("recordings/") + name);
    if (!directory) continue;
    recorded_totals totals;
    CAPTURE(std::string(name));
    recorded_keyframes keyframes(*directory);
    for (const std::int32_t iteration : keyframes.recording.meta.snapshots) {
      CAPTURE(iteration);
      char folder[16];
      std::snprintf(folder, sizeof folder, "snap_%04d", static_cast<int>(iteration));
      check_recorded_update(keyframes, *directory / folder, totals);
    }
    MESSAGE(std::string(name) << ": " << totals.points << " points, normals within " << totals.normal_error
                              << ", ranges within " << totals.range_error);
    CHECK(totals.points > 1000);
    CHECK(totals.descriptor_differs == 0);
    // The peer computes in float, and worlds are metres wide: a few units of rounding.
    CHECK(totals.normal_error < 3e-6);
    CHECK(totals.range_error < 3e-6);
  }
}

}  // namespace
