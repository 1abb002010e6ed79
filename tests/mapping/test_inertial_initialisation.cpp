// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Initialisation on a map: what is found is written, in metres; what is not found, or no longer fits, leaves the map alone.

#include <doctest/doctest.h>

#include <turbomap/map/validate.hpp>
#include <turbomap/mapping/inertial_initialisation.hpp>

#include <cmath>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>

#include "inertial_initialisation_cases.hpp"
#include "inertial_window_cases.hpp"

namespace turbomap_test {

/// Somebody else changes the map when the initialisation takes the guard again, to write.
struct disturbed_map : inertial_map {
  using inertial_map::inertial_map;
  int guards = 0, change = 0, at = 2;
  double bc_length = 1;  ///< of the quaternion of T_bc
};
/// The keyframe before the first one is the last one.
struct circular_map : inertial_map {
  using inertial_map::inertial_map;
  turbomap::map_keyframe_id first, last;
};
/// Its traits cannot name all of it.
struct unlisted_map : inertial_map {
  using inertial_map::inertial_map;
};
/// One point has no descriptor yet.
struct bare_point_map : inertial_map {
  using inertial_map::inertial_map;
  turbomap::map_point_id bare;
  int set_without_descriptor = 0;
};

}  // namespace turbomap_test

template <>
struct turbomap::map_traits<turbomap_test::disturbed_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  static std::unique_lock<std::mutex> guard(turbomap_test::disturbed_map& m) {
    if (++m.guards == m.at) {
      auto k = m.keyframe_at(7);
      if (m.change == 1) m.set_pose(k, {});
      if (m.change == 2)
        turbomap::bridge_motion<turbomap_test::inertial_map>(m, k),
            turbomap::erase_keyframe<turbomap_test::inertial_map>(m, k);
    }
    return {};
  }
};
template <>
struct turbomap::inertial_traits<turbomap_test::disturbed_map>
    : turbomap::inertial_traits<turbomap_test::inertial_map> {
  static rigid_transform<double> T_bc(const turbomap_test::disturbed_map& m) {
    auto T = m.T_bc();
    for (double* q : {&T.qx, &T.qy, &T.qz, &T.qw}) *q *= m.bc_length;
    return T;
  }
};
template <>
struct turbomap::map_traits<turbomap_test::circular_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  static keyframe previous(const turbomap_test::circular_map& m, keyframe k) {
    return k == m.first ? m.last : turbomap::map_traits<turbomap_test::inertial_map>::previous(m, k);
  }
};
template <>
struct turbomap::inertial_traits<turbomap_test::circular_map> : turbomap::inertial_traits<turbomap_test::inertial_map> {
};
template <>
struct turbomap::map_traits<turbomap_test::unlisted_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  static void for_each_keyframe() = delete;
};
template <>
struct turbomap::inertial_traits<turbomap_test::unlisted_map> : turbomap::inertial_traits<turbomap_test::inertial_map> {
};
template <>
struct turbomap::map_traits<turbomap_test::bare_point_map> : turbomap::map_traits<turbomap_test::inertial_map> {
  using base = turbomap::map_traits<turbomap_test::inertial_map>;
  static const element* descriptor_data(const turbomap_test::bare_point_map& m, point p) {
    return p == m.bare ? nullptr : base::descriptor_data(m, p);
  }
  static void set_appearance(turbomap_test::bare_point_map& m, point p, const turbomap::vec3<float>& normal, float min,
                             float max, const element* d) {
    if (d == nullptr) return void(++m.set_without_descriptor);
    base::set_appearance(m, p, normal, min, max, d);
  }
};
template <>
struct turbomap::inertial_traits<turbomap_test::bare_point_map>
    : turbomap::inertial_traits<turbomap_test::inertial_map> {};

namespace {

using namespace turbomap_test;
using turbomap::initialisation_end;

TEST_CASE("gravity, velocities, biases and the scale are those of the truth") {
  using turbomap::norm;
  for (const double unit : {1.0, 0.2, 3.0}) {
    CAPTURE(unit);
    auto s = visual_scene(unit);
    turbomap::initialisation_options options;
    options.monocular = unit != 1;
    inertial_map_traits::set_covariance(s.map, s.points[0], {1, 2, 3, 4, 5, 6});
    turbomap::inertial_initialisation<inertial_map> initialise;
    const auto& found = initialise(s.map, s.keyframes.back(), options);
    REQUIRE(found.end == initialisation_end::initialised);
    CHECK(found.scale == doctest::Approx(1 / unit).epsilon(0.01));  // by which the map was scaled
    CHECK((found.scale_sigma > 0) == options.monocular);
    CHECK(s.map.initialised());
    CHECK(norm(s.map.gravity() - vec3<double>{0, 0, -9.81}) < 0.02);
    CHECK_FALSE(found.integrate_again);  // the samples were integrated at the biases that were found
    for (std::size_t i = 0; i < s.keyframes.size(); ++i) {
      const auto k = s.keyframes[i];
      CHECK(norm(s.map.velocity(k) - s.truth[i].velocity) < 0.02);
      CHECK(norm(s.map.bias(k).gyro - s.truth[i].bias.gyro) < 1e-3);
      CHECK(norm(s.map.bias(k).acceleration - s.truth[i].bias.acceleration) < 0.05);
      const auto &T = s.map.T_cw(k), &truth = s.truth[i].T_cw;
      CHECK(norm(vec3<double>{T.tx - truth.tx, T.ty - truth.ty, T.tz - truth.tz}) <
            0.01 * (1 + norm(vec3<double>{truth.tx, truth.ty, truth.tz})));
    }
    for (std::size_t l = 0; l < s.points.size(); ++l)
      CHECK(norm(s.map.position(s.points[l]) - s.true_points[l]) < 0.01 * (1 + norm(s.true_points[l])));
    const auto& c = inertial_map_traits::covariance(s.map, s.points[0]);
    CHECK(c.xx == doctest::Approx(1 / (unit * unit)).epsilon(0.02));
    CHECK(c.zy == doctest::Approx(5 / (unit * unit)).epsilon(0.02));
    CHECK(turbomap::validate(s.map).empty());
  }
}

TEST_CASE("a point without a descriptor is scaled, and its appearance left alone") {
  const auto s = visual_scene(0.2);
  bare_point_map map(8, s.map.T_bc());
  static_cast<inertial_map&>(map) = s.map;
  map.bare = s.points[1];
  const auto before = s.map.position(map.bare);
  turbomap::initialisation_options options;
  options.monocular = true;
  turbomap::inertial_initialisation<bare_point_map> initialise;
  const auto& found = initialise(map, s.keyframes.back(), options);
  REQUIRE(found.end == initialisation_end::initialised);
  CHECK(map.set_without_descriptor == 0);
  CHECK(map.position(map.bare).x == doctest::Approx(found.scale * before.x));
  CHECK(map.position(map.bare).z == doctest::Approx(found.scale * before.z));
}

TEST_CASE("an interval of seconds: its samples are integrated again before the estimate is judged") {
  auto s = visual_scene(0.4, 1, 44);
  for (std::size_t i = 1; i <= 20; ++i) {  // as culling leaves it of a rest: 5.25 s
    turbomap::bridge_motion(s.map, s.keyframes[i]);
    turbomap::erase_keyframe(s.map, s.keyframes[i]);
  }
  const imu_bias<double> wrong{{0.05, -0.05, 0.05}, {0, 0, 0}};
  for (std::size_t i = 21; i < s.keyframes.size(); ++i) {
    const auto h = s.map.samples(s.keyframes[i]);
    s.map.set_motion(s.keyframes[i], turbomap::preintegrate(h, wrong, {}), h);
  }
  turbomap::initialisation_options options;
  options.monocular = true;
  turbomap::inertial_initialisation<inertial_map> initialise;
  SUBCASE("initialised") {
    const auto& found = initialise(s.map, s.keyframes.back(), options);
    REQUIRE(found.end == initialisation_end::initialised);
    CHECK(found.scale == doctest::Approx(2.5).epsilon(0.003));
    CHECK(turbomap::norm(found.bias.gyro - s.truth[0].bias.gyro) < 1e-3);
    CHECK_FALSE(found.integrate_again);
  }
  SUBCASE("not initialised: the map is as it was, but for the biases of its motions") {
    options.max_scale_sigma = 0;
    const auto& found = initialise(s.map, s.keyframes.back(), options);
    CHECK(found.end == initialisation_end::scale_unknown);
    CHECK(found.scale == doctest::Approx(2.5).epsilon(0.01));
    CHECK_FALSE(s.map.initialised());
    for (const auto k : {s.keyframes[0], s.keyframes[30]}) {
      CHECK(turbomap::norm(s.map.velocity(k)) == 0);
      CHECK(turbomap::same_bias<double>(s.map.bias(k), {}));
    }
    CHECK(turbomap::norm(s.map.motion(s.keyframes[30])->bias.gyro - s.truth[0].bias.gyro) < 5e-3);
  }
}

TEST_CASE("no step was found: nothing is integrated at a bias that is no estimate") {
  auto s = visual_scene(0.4);
  for (std::size_t i = 1; i < s.keyframes.size(); ++i) {
    const auto h = s.map.samples(s.keyframes[i]);
    auto p = turbomap::preintegrate(h, i == 1 ? imu_bias<double>{{0.5, -0.5, 0.5}, {0, 0, 0}} : imu_bias<double>{}, {});
    if (i == 7) p.C_RR(0, 0) = p.C_RR(1, 1) = p.C_RR(2, 2) = -1e6;  // no covariance: the edge has no weight
    s.map.set_motion(s.keyframes[i], p, h);
  }
  turbomap::inertial_initialisation<inertial_map> initialise;
  const auto& found = initialise(s.map, s.keyframes.back());
  CHECK(found.end == initialisation_end::interrupted);
  CHECK_FALSE(found.integrate_again);
  CHECK(turbomap::same_bias<double>(s.map.motion(s.keyframes[12])->bias, {}));
}

TEST_CASE("without samples the estimate is made once") {
  const auto s = visual_scene(0.2);
  disturbed_map map(8, s.map.T_bc());
  static_cast<inertial_map&>(map) = s.map;
  map.at = -1;
  for (std::size_t i = 1; i < s.keyframes.size(); ++i) map.set_motion(s.keyframes[i], *s.map.motion(s.keyframes[i]));
  turbomap::initialisation_options options;
  options.monocular = true, options.max_scale_sigma = 0;
  turbomap::inertial_initialisation<disturbed_map> initialise;
  const auto& found = initialise(map, s.keyframes.back(), options);
  CHECK(found.end == initialisation_end::scale_unknown);
  CHECK(found.integrate_again);
  CHECK(map.guards == 2);  // read, and asked for another bias in vain
}

TEST_CASE("somebody moves a keyframe while samples are integrated again") {
  const auto s = visual_scene(0.2);
  turbomap::initialisation_options options;
  options.monocular = true;
  for (const int at : {2, 4}) {  // when they are to be integrated again; when the result is to be written
    CAPTURE(at);
    disturbed_map map(8, s.map.T_bc());
    static_cast<inertial_map&>(map) = s.map;
    map.change = 1, map.at = at;
    turbomap::inertial_initialisation<disturbed_map> initialise;
    initialise(map, s.keyframes.back(), options);
    CHECK(map.guards == at);
    CHECK(initialise.stale());
    CHECK_FALSE(map.initialised());
    CHECK(turbomap::norm(map.velocity(s.keyframes[3])) == 0);
    CHECK((map.motion(s.keyframes[3])->bias.gyro.x == 0) == (at == 2));
  }
}

TEST_CASE("how far back it looks; keyframes before and after hear of the bias") {
  auto s = visual_scene(3);
  s.map.clear_motion(s.keyframes[2]);  // by its poses alone, then
  turbomap::initialisation_options options;
  options.monocular = true, options.most_seconds = 3.5;  // 15 keyframes
  turbomap::inertial_initialisation<inertial_map> initialise;
  const auto& found = initialise(s.map, s.keyframes[18], options);
  REQUIRE(found.end == initialisation_end::initialised);
  CHECK(found.velocity.size() == 15);
  CHECK(s.velocity_error(0, 1) < 0.05);
  CHECK(s.velocity_error(2, 19) < 0.05);
  CHECK(s.velocity_error(1, 2) < 3);
  CHECK(s.velocity_error(1, 2) > 0.05);  // a mean over the interval
  for (const std::size_t k : {0, 1, 3, 4}) CHECK(turbomap::same_bias(s.map.bias(s.keyframes[k]), found.bias));
  CHECK(s.map.motion(s.keyframes[4])->bias.acceleration.x == found.bias.acceleration.x);
  CHECK_FALSE(s.map.motion(s.keyframes[19])->bias.acceleration.x == 0);
  for (std::size_t k = 0; k < 4; ++k) s.map.set_velocity(s.keyframes[k], {7, 0, 0});
  initialise(s.map, s.keyframes[18], options);  // a refinement leaves what adjustments may have found
  CHECK(s.map.velocity(s.keyframes[3]).x == doctest::Approx(7 * found.scale));
  options.most_seconds = 1;  // less than min_seconds
  CHECK_THROWS_WITH_AS(initialise(s.map, s.keyframes[18], options), doctest::Contains("options.most_seconds"),
                       std::invalid_argument);

  const auto whole = visual_scene(1);
  circular_map circle(8, whole.map.T_bc());
  static_cast<inertial_map&>(circle) = whole.map;
  circle.first = whole.keyframes.front(), circle.last = whole.keyframes.back();
  circle.set_motion(circle.first, *circle.motion(circle.last));
  turbomap::inertial_initialisation<circular_map> of_circle;
  CHECK(of_circle(circle, circle.last).velocity.size() == whole.keyframes.size());
}

TEST_CASE("keyframes before the estimate whose motion cannot be used get velocities by their poses alone") {
  turbomap::initialisation_options options;
  options.monocular = true, options.most_seconds = 3.5;  // 15 keyframes
  auto unmeasured = visual_scene(3);
  unmeasured.map.clear_motion(unmeasured.keyframes[2]);
  turbomap::inertial_initialisation<inertial_map> initialise;
  REQUIRE(initialise(unmeasured.map, unmeasured.keyframes[18], options).end == initialisation_end::initialised);
  for (const auto what : {imu_damage::huge_velocity, imu_damage::huge_position, imu_damage::other_duration,
                          imu_damage::motion_not_finite}) {
    CAPTURE(std::string(to_string(what)));
    auto s = visual_scene(3);
    damage(s.map, s.keyframes[2], what);
    REQUIRE(initialise(s.map, s.keyframes[18], options).end == initialisation_end::initialised);
    CHECK(s.map.velocity(s.keyframes[1]).x == unmeasured.map.velocity(unmeasured.keyframes[1]).x);
    CHECK(s.map.velocity(s.keyframes[0]).x == unmeasured.map.velocity(unmeasured.keyframes[0]).x);
  }
}

TEST_CASE("not initialised: the map is as it was") {
  turbomap::inertial_initialisation<inertial_map> initialise;
  auto s = visual_scene(1);
  auto before = s.state();
  CHECK(initialise(s.map, {}).end != initialisation_end::initialised);  // the first that it is asked
  CHECK(initialise.stale());
  CHECK(initialise(s.map, s.keyframes[4]).end == initialisation_end::too_few_keyframes);
  CHECK(initialise(s.map, {}).end != initialisation_end::initialised);
  CHECK(initialise.stale());
  CHECK(s.state() == before);
  s.map.clear_motion(s.keyframes[15]);  // a gap: only what comes after it counts
  before = s.state();
  CHECK(initialise(s.map, s.keyframes.back()).end == initialisation_end::too_few_keyframes);
  CHECK(s.state() == before);
  CHECK_FALSE(s.map.initialised());
  const auto good = *s.map.motion(s.keyframes[18]);
  auto bad = good;
  bad.dt += 0.02;  // another interval's
  s.map.set_motion(s.keyframes[18], bad);
  before = s.state();
  CHECK_THROWS_WITH_AS(initialise(s.map, s.keyframes.back()), doctest::Contains("motion.dt"), std::invalid_argument);
  CHECK(s.state() == before);
  bad = good;
  bad.dP.x = std::numeric_limits<double>::quiet_NaN();
  s.map.set_motion(s.keyframes[18], bad);
  before = s.state();
  CHECK_THROWS_AS(initialise(s.map, s.keyframes.back()), std::invalid_argument);
  CHECK(s.state() == before);
}

TEST_CASE("a T_bc that is no pose is refused, as an adjustment refuses it") {
  const auto s = visual_scene(1);
  for (const double length : {0.0, 0.5, 2.0, std::numeric_limits<double>::quiet_NaN()}) {
    CAPTURE(length);
    disturbed_map map(8, s.map.T_bc());
    static_cast<inertial_map&>(map) = s.map;
    map.bc_length = length;
    turbomap::inertial_initialisation<disturbed_map> initialise;
    CHECK_THROWS_WITH_AS(initialise(map, s.keyframes.back()), doctest::Contains("T_bc"), std::invalid_argument);
    CHECK_FALSE(map.initialised());
  }
}

TEST_CASE("a map whose traits cannot name all of it is not scaled: said before anything is done") {
  const auto s = visual_scene(1);
  unlisted_map map(8, s.map.T_bc());
  static_cast<inertial_map&>(map) = s.map;
  turbomap::inertial_initialisation<unlisted_map> initialise;
  turbomap::initialisation_options options;
  options.monocular = true;
  CHECK_THROWS_WITH_AS(initialise(map, s.keyframes.back(), options), doctest::Contains("for_each_keyframe"),
                       std::invalid_argument);
  CHECK(map.motion(s.keyframes[3])->bias.acceleration.x == 0);  // not integrated again
  CHECK_FALSE(map.initialised());
  options.monocular = false;
  CHECK(initialise(map, s.keyframes.back(), options).end == initialisation_end::initialised);
}

TEST_CASE("a keyframe moved or taken out meanwhile: nothing is written") {
  const auto s = visual_scene(1);
  for (const int change : {0, 1, 2}) {
    CAPTURE(change);
    disturbed_map map(8, s.map.T_bc());
    static_cast<inertial_map&>(map) = s.map;
    map.change = change;
    turbomap::inertial_initialisation<disturbed_map> initialise;
    CHECK(initialise(map, s.keyframes.back()).end == initialisation_end::initialised);
    CHECK(initialise.stale() == (change != 0));
    CHECK(map.initialised() == (change == 0));
    CHECK((map.velocity(s.keyframes[3]).x == 0) == (change != 0));
  }
}

}  // namespace
