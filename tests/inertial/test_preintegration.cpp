// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Preintegration: against the paper's formulas, finite differences, closed forms, noise that was drawn, and itself in
// parts.

#include <doctest/doctest.h>

#include <thrust/execution_policy.h>

#include <cstring>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <turbomap/inertial/imu_integrator.hpp>
#include <turbomap/inertial/predict.hpp>

#include "preintegration_cases.hpp"
#include "support/policies.hpp"

namespace {

using namespace turbomap_test;
using turbomap::find_interval;
using turbomap::imu_history;
using turbomap::imu_integrator;
using turbomap::merge;
using turbomap::preintegrate;

constexpr std::int64_t ms = 1'000'000;

std::string message(const std::function<void()>& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing thrown";
}
void refused(const std::function<void()>& f, const std::string& argument, const std::string& rule) {
  const std::string text = message(f);
  CAPTURE(text);
  CHECK(text.find("turbomap: " + argument + " = ") == 0);
  CHECK(text.find(rule) != std::string::npos);
}

/// Largest difference of any part, relative.
double difference(const preintegration<double>& a, const preintegration<double>& b) {
  oracle_preintegration o;
  o.dt = b.dt, o.R = to_eigen(b.dR), o.V = to_eigen(b.dV), o.P = to_eigen(b.dP);
  o.J_Rg = to_eigen(b.J_Rg), o.J_Vg = to_eigen(b.J_Vg), o.J_Va = to_eigen(b.J_Va);
  o.J_Pg = to_eigen(b.J_Pg), o.J_Pa = to_eigen(b.J_Pa), o.C = covariance_of(b);
  return turbomap_test::difference(a, o);
}

TEST_CASE_TEMPLATE("intervals are what the paper makes of them", Policy, TURBOMAP_TEST_POLICIES) {
  check_against_oracle<double>(Policy{}, 1e-11);
  check_against_oracle<float>(Policy{}, 2e-4);
  check_sizes(Policy{});
}

TEST_CASE("all policies give the same bits") {
  const imu_motion m = make_imu_motion(3, 900, 100);
  const auto one = preintegrate_all<double>(sequential{}, m);
  for_each_parallel_policy([&](auto policy) {
    const auto other = preintegrate_all<double>(policy, m);
    CHECK(std::memcmp(one.data(), other.data(), one.size() * sizeof one[0]) == 0);
  });
}

TEST_CASE("derivatives by the bias are those of finite differences") {
  const imu_motion m = make_imu_motion(11, 400, 20);
  const double h = 1e-5;
  for (std::size_t i = 0; i < m.intervals.size(); ++i) {
    CAPTURE(i);
    const auto p = preintegrate(m.samples(), m.intervals[i], m.biases[i], {});
    for (int k = 0; k < 6; ++k) {
      CAPTURE(k);
      const auto at = [&](double step) {
        auto bias = m.biases[i];
        auto& v = k < 3 ? bias.gyro : bias.acceleration;
        (k % 3 == 0 ? v.x : k % 3 == 1 ? v.y : v.z) += step;
        return preintegrate(m.samples(), m.intervals[i], bias, {});
      };
      const auto up = at(h), down = at(-h);
      const Eigen::Matrix3d R = to_eigen(p.dR);
      const Eigen::Vector3d r =
          (oracle_log(R.transpose() * to_eigen(up.dR)) - oracle_log(R.transpose() * to_eigen(down.dR))) / (2 * h);
      const Eigen::Vector3d v = (to_eigen(up.dV) - to_eigen(down.dV)) / (2 * h);
      const Eigen::Vector3d x = (to_eigen(up.dP) - to_eigen(down.dP)) / (2 * h);
      Eigen::Vector3d by_R = Eigen::Vector3d::Zero();
      if (k < 3) by_R = to_eigen(p.J_Rg).col(k);
      CHECK((r - by_R).norm() < 1e-8);
      CHECK((v - to_eigen(k < 3 ? p.J_Vg : p.J_Va).col(k % 3)).norm() < 1e-7);
      CHECK((x - to_eigen(k < 3 ? p.J_Pg : p.J_Pa).col(k % 3)).norm() < 1e-7);
    }
  }
}

TEST_CASE("merging is integrating both") {
  const imu_motion m = make_imu_motion(5, 600, 0);
  std::mt19937_64 random(8);
  for (int repeat = 0; repeat < 200; ++repeat) {
    CAPTURE(repeat);
    // Three intervals that meet at samples: the knots are the same as those of the whole.
    std::vector<std::size_t> cut;
    while (cut.size() < 4) {
      const auto i = static_cast<std::size_t>(random() % m.t_ns.size());
      if (std::find(cut.begin(), cut.end(), i) == cut.end()) cut.push_back(i);
    }
    std::sort(cut.begin(), cut.end());
    const imu_bias<double> bias{random_vector(random, 0.1), random_vector(random, 0.5)};
    preintegration_options options;
    options.noise.rate = repeat % 2 == 0 ? 0 : 200;
    const auto part = [&](std::size_t i, std::size_t j) {
      return preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[cut[i]], m.t_ns[cut[j]]), bias, options);
    };
    const auto a = part(0, 1), b = part(1, 2), c = part(2, 3), whole = part(0, 3);
    CHECK(difference(merge(merge(a, b), c), whole) < 1e-11);
    CHECK(difference(merge(a, merge(b, c)), whole) < 1e-11);
    preintegration<double> none;
    none.bias = bias;
    CHECK(difference(merge(a, none), a) < 1e-14);
    CHECK(difference(merge(none, a), a) < 1e-14);
  }
}

TEST_CASE("an interval that is merged at another bias is taken there to first order") {
  const imu_motion m = make_imu_motion(6, 400, 0);
  const imu_bias<double> bias{{0.01, -0.02, 0.005}, {0.1, 0.2, -0.1}};
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const double step = k == 0 ? 1e-3 : 1e-4;
    const imu_bias<double> other{{bias.gyro.x + step, bias.gyro.y - step, bias.gyro.z + step}, {0.1 + step, 0.2, -0.1}};
    const auto a = preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[3], m.t_ns[150]), bias, {});
    const auto b = preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[150], m.t_ns[300]), other, {});
    const auto whole = preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[3], m.t_ns[300]), bias, {});
    const auto merged = merge(a, b);
    CHECK(turbomap::same_bias(merged.bias, bias));
    error[k] = (to_eigen(merged.dP) - to_eigen(whole.dP)).norm() + (to_eigen(merged.dR) - to_eigen(whole.dR)).norm();
  }
  CHECK(error[0] < 1e-5);
  CHECK(error[1] < error[0] / 80);  // quadratic
}

TEST_CASE("the correction by the bias leaves out what is of second order; the rule when to integrate again") {
  const imu_motion m = make_imu_motion(12, 400, 1, 1);
  const auto in = find_interval(m.samples(), m.t_ns[10], m.t_ns[10] + 1000 * ms);
  const imu_bias<double> bias{};
  const auto p = preintegrate(m.samples(), in, bias, {});
  const preintegration_options options;
  const double limit = options.max_gyro_bias_change;
  const imu_bias<double> near{{0, 0.999 * limit, 0}, {0, 0, 0.999 * options.max_acceleration_bias_change}};
  CHECK_FALSE(turbomap::needs_integration(p, near, options));
  CHECK(turbomap::needs_integration(p, {{0, 1.001 * limit, 0}, {0, 0, 0}}, options));
  CHECK(turbomap::needs_integration(p, {{0, 0, 0}, {0, -0.101, 0}}, options));
  auto longer = p;
  longer.dt = 4;
  CHECK_FALSE(turbomap::needs_integration(longer, {{0, 0.249 * limit, 0}, {0, 0, 0}}, options));
  CHECK(turbomap::needs_integration(longer, {{0, 0.251 * limit, 0}, {0, 0, 0}}, options));
  // What the defaults promise: below the noise of the same second.
  const auto first_order = turbomap::rebased(p, near), exact = preintegrate(m.samples(), in, near, options);
  CHECK(oracle_log(to_eigen(exact.dR).transpose() * to_eigen(first_order.dR)).norm() < std::sqrt(p.C_RR(0, 0)));
  CHECK((to_eigen(exact.dV) - to_eigen(first_order.dV)).norm() < std::sqrt(p.C_VV(0, 0)));
  CHECK((to_eigen(exact.dP) - to_eigen(first_order.dP)).norm() < std::sqrt(p.C_PP(0, 0)));
  // The accelerometer's alone is exact.
  const imu_bias<double> far{{0, 0, 0}, {3, -2, 1}};
  CHECK((to_eigen(preintegrate(m.samples(), in, far, {}).dP) - to_eigen(turbomap::rebased(p, far).dP)).norm() < 1e-12);
}

TEST_CASE("the covariance is that of drawn noise") {
  imu_motion m = make_imu_motion(21, 12, 0);
  const auto in = find_interval(m.samples(), m.t_ns[1] + ms, m.t_ns[10] - ms);
  preintegration_options options;
  options.noise.gyro = 1e-3, options.noise.acceleration = 1e-2;
  const auto p = preintegrate(m.samples(), in, imu_bias<double>{}, options);
  // White noise constant over each step, of the variance that the step's length says.
  auto steps = oracle_steps(m.t_ns, m.sample, in);
  std::mt19937_64 random(1);
  std::normal_distribution<double> n(0, 1);
  const auto draw = [&](double sigma) {
    return Eigen::Vector3d(sigma * n(random), sigma * n(random), sigma * n(random));
  };
  const int draws = 20000;
  Eigen::Matrix<double, 9, 9> sum;
  sum.setZero();
  for (int k = 0; k < draws; ++k) {
    auto noisy = steps;
    for (auto& s : noisy)
      s.w += draw(options.noise.gyro / std::sqrt(s.dt)), s.a += draw(options.noise.acceleration / std::sqrt(s.dt));
    const auto o = oracle_integrate(noisy, {0, 0, 0}, {0, 0, 0}, {});
    Eigen::Matrix<double, 9, 1> e;
    e << oracle_log(to_eigen(p.dR).transpose() * o.R), o.V - to_eigen(p.dV), o.P - to_eigen(p.dP);
    sum += e * e.transpose();
  }
  CHECK(covariance_difference(covariance_of(p).topLeftCorner(9, 9), sum / draws) < 0.04);
}

TEST_CASE("closed forms: at rest, a turn, measurements linear in time") {
  imu_motion m;
  for (int i = 0; i < 50; ++i) m.t_ns.push_back(i * 5 * ms), m.sample.push_back({{0, 0, 0}, {0, 0, 9.81}});
  const auto rest = preintegrate(m.samples(), find_interval(m.samples(), 7 * ms, 207 * ms), imu_bias<double>{}, {});
  CHECK((to_eigen(rest.dR) - Eigen::Matrix3d::Identity()).norm() < 1e-15);
  CHECK(rest.dt == doctest::Approx(0.2).epsilon(1e-14));
  CHECK(rest.dV.z == doctest::Approx(9.81 * 0.2).epsilon(1e-14));
  CHECK(rest.dP.z == doctest::Approx(9.81 * 0.02).epsilon(1e-13));

  for (auto& s : m.sample) s = {{0.3, -0.7, 1.1}, {0, 0, 0}};
  const auto turn = preintegrate(m.samples(), find_interval(m.samples(), 7 * ms, 207 * ms), imu_bias<double>{}, {});
  CHECK((oracle_log(to_eigen(turn.dR)) - 0.2 * Eigen::Vector3d(0.3, -0.7, 1.1)).norm() < 1e-14);

  // Interpolated at both ends, and extrapolated by 3 ms: a line is a line.
  for (std::size_t i = 0; i < m.sample.size(); ++i)
    m.sample[i] = {{0, 0, 0.01 * static_cast<double>(i)}, {0.02 * static_cast<double>(i), 0, 0}};
  const auto check = [&](std::int64_t begin, std::int64_t end) {
    const auto p =
        preintegrate(m.samples(), find_interval(m.samples(), begin, end), imu_bias<double>{{0, 0, 0}, {0, 0, 0}}, {});
    const double a = static_cast<double>(begin) * 1e-9, b = static_cast<double>(end) * 1e-9;
    CHECK(oracle_log(to_eigen(p.dR)).z() == doctest::Approx(0.01 / 0.005 * (b * b - a * a) / 2).epsilon(1e-12));
    CHECK(p.dt == doctest::Approx(b - a).epsilon(1e-14));
  };
  check(7 * ms, 208 * ms);
  check(-3 * ms, 248 * ms);
  check(11 * ms, 12 * ms);  // inside one pair of samples
  check(5 * ms, 10 * ms);
  check(241 * ms, 249 * ms);  // after the last but one
}

TEST_CASE("samples whose times come in bursts: no slope is made of their noise") {
  // At rest, 200 Hz, stamped in pairs 50 us apart; the interval begins and ends 5 ms outside of them.
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const turbomap::imu_noise noise;
  const double gyro = noise.gyro * std::sqrt(200), force = noise.acceleration * std::sqrt(200);
  const auto draw = [&](double sigma) {
    const double x = sigma * normal(random), y = sigma * normal(random);
    return vec3<double>{x, y, sigma * normal(random)};
  };
  for (int n = 0; n < 200; ++n) {
    imu_motion m;
    for (int i = 0; i < 10; ++i)
      for (int pair = 0; pair < 2; ++pair) {
        m.t_ns.push_back(i * 10 * ms + pair * ms / 20);
        m.sample.push_back({draw(gyro), vec3<double>{0, 0, 9.81} + draw(force)});
      }
    const std::int64_t end = m.t_ns.back() + 5 * ms;
    const auto p = preintegrate(m.samples(), find_interval(m.samples(), -5 * ms, end), imu_bias<double>{}, {});
    const auto off = p.dV - p.dt * vec3<double>{0, 0, 9.81};
    CHECK(turbomap::norm(off) < 8 * std::sqrt(p.C_VV(0, 0)));
    CHECK(oracle_log(to_eigen(p.dR)).norm() < 8 * std::sqrt(p.C_RR(0, 0)));
  }
  // Farther out than twice the time between two samples the measurement is what it is there.
  const std::vector<std::int64_t> t{0, 1 * ms};
  const std::vector<imu_sample> line{{{0, 0, 1}, {0, 0, 0}}, {{0, 0, 2}, {0, 0, 0}}};
  const auto at = [&](std::int64_t time) { return turbomap::detail::sample_at(t.data(), line.data(), 0, time).gyro.z; };
  CHECK(at(-2 * ms) == -1);
  CHECK(at(-9 * ms) == -1);
  CHECK(at(3 * ms) == 4);
  CHECK(at(9 * ms) == 4);
  CHECK(at(ms / 2) == 1.5);
}

TEST_CASE("prediction: a body on a circle, in free fall") {
  // On a circle of radius r about z, nose outwards: the force points inwards, and upwards against gravity.
  const double r = 2, rate = 1.5, g = 9.81, seconds = 0.8;
  imu_motion m;
  for (int i = 0; i < 1000; ++i) m.t_ns.push_back(i * ms), m.sample.push_back({{0, 0, rate}, {-r * rate * rate, 0, g}});
  turbomap::inertial_state<double> start;  // at (r, 0, 0), axes as the world's
  start.T_cw.tx = -r, start.velocity = {0, r * rate, 0};
  const double angle = rate * seconds;
  double error[2];
  for (const auto rule : {turbomap::integration_rule::midpoint, turbomap::integration_rule::first_order}) {
    preintegration_options options;
    options.rule = rule;
    const auto in = find_interval(m.samples(), 0, static_cast<std::int64_t>(seconds * 1e9));
    const auto end = turbomap::predict(start, preintegrate(m.samples(), in, imu_bias<double>{}, options), {0, 0, -g});
    const auto T_wb = turbomap::inverse(turbomap::to_isometry<double>(end.T_cw));
    error[rule == turbomap::integration_rule::midpoint ? 0 : 1] =
        (to_eigen(T_wb.t) - r * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0)).norm() +
        (to_eigen(end.velocity) - r * rate * Eigen::Vector3d(-std::sin(angle), std::cos(angle), 0)).norm();
    CHECK((oracle_log(to_eigen(T_wb.R)) - Eigen::Vector3d(0, 0, angle)).norm() < 1e-12);
  }
  CHECK(error[0] < 2e-6);  // (rate dt)^2
  CHECK(error[1] < 5e-3);  // rate dt
  CHECK(error[1] > 1e-3);

  for (auto& s : m.sample) s = {{0, 0, 0}, {0, 0, 0}};
  start.velocity = {1, 0, 2};
  const auto fall = preintegrate(m.samples(), find_interval(m.samples(), 0, 500 * ms), imu_bias<double>{}, {});
  const auto fallen = turbomap::predict(start, fall, {0, 0, -g});
  CHECK(-fallen.T_cw.tx == doctest::Approx(r + 0.5).epsilon(1e-12));
  CHECK(-fallen.T_cw.tz == doctest::Approx(1 - g / 8).epsilon(1e-12));
  CHECK(fallen.velocity.z == doctest::Approx(2 - g / 2).epsilon(1e-12));
}

TEST_CASE("samples pushed as they come give the motion of each frame since the keyframe") {
  const imu_motion m = make_imu_motion(31, 500, 0);
  const imu_bias<double> bias{{0.01, 0, -0.02}, {0.1, -0.1, 0.05}};
  imu_integrator<double> imu({}, bias);
  std::size_t next = 0;
  const std::int64_t start = m.t_ns[4] + ms;
  imu.restart(start);
  std::vector<imu_history> histories;
  std::vector<preintegration<double>> values;
  preintegration<double> expected;
  std::int64_t keyframe = start;
  for (int frame = 1; frame <= 30; ++frame) {
    const std::int64_t t = start + frame * 50 * ms;
    while (m.t_ns[next] < t + 7 * ms) imu.push(m.t_ns[next], m.sample[next]), ++next;
    const auto piece = preintegrate(m.samples(), find_interval(m.samples(), t - 50 * ms, t), bias, {});
    expected = keyframe == t - 50 * ms ? piece : merge(expected, piece);
    const auto& got = imu.advance(t);
    CHECK(difference(got, expected) < 1e-12);
    if (frame % 7 != 0) continue;
    histories.push_back(imu.history()), values.push_back(got);
    imu.restart(t), keyframe = t;
    CHECK(imu.value().dt == 0);
    CHECK(imu.history().t_ns.front() <= t);
  }
  REQUIRE(histories.size() == 4);
  // A culled keyframe: its successor takes its time over, as value and as samples, which may be integrated anew.
  imu_history joined = histories[1];
  turbomap::append(joined, histories[2]);
  const auto merged = merge(values[1], values[2]);
  CHECK(difference(preintegrate(joined, bias, {}), merged) < 1e-12);
  CHECK(merged.dt == doctest::Approx(0.7).epsilon(1e-12));
  const imu_bias<double> other{{0.05, 0.02, 0.01}, {0.5, 0.1, 0}};
  CHECK(difference(preintegrate(joined, other, {}),
                   merge(preintegrate(histories[1], other, {}), preintegrate(histories[2], other, {}))) < 1e-12);
  const std::size_t before = joined.t_ns.size();
  CHECK_THROWS_AS(turbomap::append(joined, histories[0]), std::invalid_argument);
  CHECK(joined.t_ns.size() == before);
  imu_history none;
  turbomap::append(none, joined);
  CHECK(none.pieces.size() == 14);
  turbomap::append(none, imu_history{});
  CHECK(none.pieces.size() == 14);
}

TEST_CASE("a new bias is taken by the derivatives, or by integrating again") {
  const imu_motion m = make_imu_motion(33, 300, 0);
  imu_integrator<double> imu;
  for (std::size_t i = 0; i < m.t_ns.size(); ++i) imu.push(m.t_ns[i], m.sample[i]);
  imu.restart(m.t_ns[2]);
  for (const std::size_t i : {50U, 90U, 140U}) imu.advance(m.t_ns[i]);
  const auto value = imu.value();
  CHECK_FALSE(imu.set_bias({{0.005, 0, 0}, {0.05, 0, 0}}));
  CHECK(difference(imu.value(), value) == 0);
  const imu_bias<double> far{{0.05, -0.02, 0}, {0, 0, 0.4}};
  CHECK(imu.set_bias(far));
  CHECK(turbomap::same_bias(imu.value().bias, far));
  const auto whole = preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[2], m.t_ns[140]), far, {});
  CHECK(difference(imu.value(), whole) < 1e-11);
  imu.advance(m.t_ns[200]);
  const auto longer = preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[2], m.t_ns[200]), far, {});
  CHECK(difference(imu.value(), longer) < 1e-11);

  imu.restart(m.t_ns[200]);  // no motion to keep: the next one is at the new bias, near as it may be
  const imu_bias<double> near{{0.051, -0.02, 0}, {0, 0.01, 0.4}};
  CHECK_FALSE(imu.set_bias(near));
  CHECK(turbomap::same_bias(imu.advance(m.t_ns[220]).bias, near));
  const imu_bias<double> nearer{{0.052, -0.02, 0}, {0, 0.01, 0.4}};  // near: this motion stays, the next one has it
  CHECK_FALSE(imu.set_bias(nearer));
  CHECK(turbomap::same_bias(imu.value().bias, near));
  imu.restart(m.t_ns[220]);
  CHECK(turbomap::same_bias(imu.advance(m.t_ns[240]).bias, nearer));
  imu.clear();  // a clock that was set back
  CHECK_THROWS_AS(imu.advance(m.t_ns[250]), std::invalid_argument);
  for (std::size_t i = 0; i < 50; ++i) imu.push(m.t_ns[i], m.sample[i]);
  imu.restart(m.t_ns[2]);
  CHECK(turbomap::same_bias(imu.advance(m.t_ns[40]).bias, nearer));
  CHECK_THROWS_AS(imu.set_bias({{NAN, 0, 0}, {}}), std::invalid_argument);
  CHECK_NOTHROW(imu_integrator<double>({}, {{1e308, 1e308, 0}, {}}));  // each number is finite
}

TEST_CASE("faulty data are refused by name and value") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const imu_motion good = make_imu_motion(41, 100, 0);
  const auto begin = good.t_ns[10] + ms, end = good.t_ns[60] + ms;
  const auto in = find_interval(good.samples(), begin, end);
  preintegration_options options;
  const auto with = [&](const std::function<void(imu_motion&)>& damage) {
    return [&, damage] {
      imu_motion m = good;
      damage(m);
      preintegrate(m.samples(), in, imu_bias<double>{}, options);
    };
  };
  CHECK(message(with([](imu_motion&) {})) == "nothing thrown");
  refused(with([](imu_motion& m) { m.t_ns[30] = m.t_ns[29]; }), "samples.t_ns[30]", "after the sample before");
  refused(with([](imu_motion& m) { std::swap(m.t_ns[30], m.t_ns[31]); }), "samples.t_ns[31]",
          "after the sample before");
  refused(with([&](imu_motion& m) { m.sample[30].gyro.y = nan; }), "samples.sample[30].gyro.y", "must be finite");
  refused(with([](imu_motion& m) { m.sample[60].acceleration.z = INFINITY; }), "samples.sample[60].acceleration.z",
          "finite");
  refused(with([](imu_motion& m) {
            for (std::size_t i = 30; i < 100; ++i) m.t_ns[i] += 60 * ms;
          }),
          "samples.t_ns[30]", "max_gap");
  refused(  // the whole interval is in the gap
      [&] {
        imu_motion m = good;
        for (std::size_t i = 30; i < 100; ++i) m.t_ns[i] += 600 * ms;
        const auto inside = find_interval(m.samples(), m.t_ns[29] + 100 * ms, m.t_ns[29] + 400 * ms);
        preintegrate(m.samples(), inside, imu_bias<double>{}, options);
      },
      "samples.t_ns[30]", "max_gap");
  // So far apart that 64 bits with a sign do not hold the difference.
  refused(with([](imu_motion& m) {
            for (int i = 0; i < 30; ++i)
              m.t_ns[static_cast<std::size_t>(i)] = std::numeric_limits<std::int64_t>::min() + i * ms;
          }),
          "samples.t_ns[30]", "max_gap");
  refused(with([](imu_motion& m) { m.sample.pop_back(); }), "samples.sample.size()", "that of t_ns");
  refused(with([](imu_motion& m) { m.t_ns.resize(61), m.sample.resize(61); }), "interval.last", "is no sample");
  options.gyro_range = 4, options.acceleration_range = 16;
  CHECK(message(with([](imu_motion&) {})) == "nothing thrown");
  refused(with([](imu_motion& m) { m.sample[20].gyro.x = -4; }), "samples.sample[20].gyro.x", "saturated");
  refused(with([](imu_motion& m) { m.sample[20].acceleration.y = 16.5; }), "samples.sample[20].acceleration.y",
          "saturated");
  options = {};

  const auto find = [&](std::int64_t from, std::int64_t to) {
    return [&, from, to] { find_interval(good.samples(), from, to); };
  };
  refused(find(end, begin), "end_ns", "after begin_ns");
  refused(find(begin, begin), "end_ns", "after begin_ns");
  refused(find(good.t_ns[99], good.t_ns[99] + ms), "begin_ns", "no samples");
  refused(find(good.t_ns[0] - 2 * ms, good.t_ns[0] - ms), "end_ns", "no samples");
  refused([&] { find_interval({}, 0, 1); }, "samples.t_ns.size()", "needs two samples");
  const auto integrate = [&](std::int64_t from, std::int64_t to) {
    return [&, from, to] {
      preintegrate(good.samples(), find_interval(good.samples(), from, to), imu_bias<double>{}, options);
    };
  };
  CHECK(message(integrate(good.t_ns[0] - 10 * ms, good.t_ns[99] + 10 * ms)) == "nothing thrown");
  refused(integrate(good.t_ns[0] - 11 * ms, good.t_ns[20]), "interval.begin_ns", "max_extrapolation");
  refused(integrate(good.t_ns[20], good.t_ns[99] + 11 * ms), "interval.end_ns", "max_extrapolation");

  const auto wrong = [&](const std::function<void(imu_interval&)>& damage) {
    return [&, damage] {
      imu_interval i = in;
      damage(i);
      preintegrate(good.samples(), i, imu_bias<double>{}, options);
    };
  };
  refused(wrong([](imu_interval& i) { i.first = -1; }), "interval.first", "negative");
  refused(wrong([](imu_interval& i) { i.last = i.first; }), "interval.last", "two samples");
  refused(wrong([](imu_interval& i) { --i.first; }), "interval.first", "not the last sample");
  refused(wrong([](imu_interval& i) { ++i.last; }), "interval.last", "not the first sample");
  refused(wrong([](imu_interval& i) { i.end_ns = i.begin_ns; }), "interval.end_ns", "after begin_ns");
  refused(
      [&] {
        preintegrate(good.samples(), in, imu_bias<double>{{nan, 0, 0}, {0, 0, 0}}, options);
      },
      "bias.gyro", "finite");
  const auto set = [&](double preintegration_options::*field, double value) {
    return [&, field, value] {
      preintegration_options o;
      o.*field = value;
      preintegrate(good.samples(), in, imu_bias<double>{}, o);
    };
  };
  refused(set(&preintegration_options::max_gap, 0), "options.max_gap", "positive");
  refused(set(&preintegration_options::max_gap, 1e10), "options.max_gap", "at most 1e9");
  refused(set(&preintegration_options::max_extrapolation, 1e10), "options.max_extrapolation", "at most 1e9");
  refused(set(&preintegration_options::max_extrapolation, -1), "options.max_extrapolation", "negative");
  refused(set(&preintegration_options::gyro_range, nan), "options.gyro_range", "finite");
}

TEST_CASE_TEMPLATE("a call that is refused leaves the last result", Policy, TURBOMAP_TEST_POLICIES) {
  imu_motion m = make_imu_motion(51, 200, 5);
  turbomap::context<Policy> ctx{Policy{}};
  turbomap::preintegrations<double, Policy> result(ctx);
  const auto call = [&] {
    turbomap::preintegrate(ctx, m.samples(), span<const imu_interval>(m.intervals),
                           span<const imu_bias<double>>(m.biases), {}, result);
  };
  call();
  const auto before = result.values(ctx);
  const imu_motion good = m;
  m.sample[static_cast<std::size_t>(m.intervals[4].last)].gyro.x = INFINITY;
  CHECK_THROWS_AS(call(), std::invalid_argument);
  m = good, m.biases.pop_back();
  CHECK_THROWS_AS(call(), std::invalid_argument);
  const auto after = result.values(ctx);
  REQUIRE(after.size() == before.size());
  CHECK(std::memcmp(before.data(), after.data(), before.size() * sizeof before[0]) == 0);
}

TEST_CASE("what an integrator refuses changes nothing") {
  const imu_motion m = make_imu_motion(61, 200, 0);
  preintegration_options options;
  options.gyro_range = 10;
  imu_integrator<double> imu(options);
  for (std::size_t i = 0; i < 50; ++i) imu.push(m.t_ns[i], m.sample[i]);
  refused([&] { imu.advance(m.t_ns[20]); }, "t_ns", "restart() first");
  imu.restart(m.t_ns[1]);
  imu.advance(m.t_ns[20]);
  const auto value = imu.value();
  refused([&] { imu.push(m.t_ns[49], m.sample[50]); }, "t_ns", "after the sample before");
  refused([&] { imu.push(m.t_ns[50], {{10, 0, 0}, {0, 0, 0}}); }, "sample.gyro.x", "saturated");
  refused([&] { imu.push(m.t_ns[50], {{1, 0, 0}, {0, NAN, 0}}); }, "sample.acceleration.y", "finite");
  refused([&] { imu.advance(m.t_ns[20]); }, "t_ns", "after the time before");
  refused([&] { imu.advance(m.t_ns[49] + 11 * ms); }, "interval.end_ns", "max_extrapolation");
  refused([&] { imu.set_bias({{NAN, 0, 0}, {0, 0, 0}}); }, "bias.gyro", "finite");
  CHECK(imu.history().t_ns.size() == imu.history().sample.size());
  CHECK(difference(imu.value(), value) == 0);
  // A hole of 25 samples: the frame after it has no motion; a new keyframe goes on.
  for (std::size_t i = 75; i < 150; ++i) imu.push(m.t_ns[i], m.sample[i]);
  refused([&] { imu.advance(m.t_ns[80]); }, "samples.t_ns[49]", "max_gap");
  CHECK(difference(imu.value(), value) == 0);
  imu.restart(m.t_ns[80]);
  const auto p = preintegrate(m.samples(), find_interval(m.samples(), m.t_ns[80], m.t_ns[100]), imu_bias<double>{}, {});
  CHECK(difference(imu.advance(m.t_ns[100]), p) < 1e-14);
  refused([] { imu_integrator<double> bad({}, {{0, NAN, 0}, {0, 0, 0}}); }, "bias.gyro", "finite");
}

}  // namespace
