// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Covariances of points against an oracle and against the spread of points estimated from noisy pixels; what a gate that
/// knows them refuses.

#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/point_uncertainty.hpp>
#include <turbomap/math/strict.hpp>

#include <cmath>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "reference/uncertainty_oracle.hpp"
#include "scenes/matching_rigs.hpp"

namespace {

using namespace turbomap_test;
using turbomap::decision;
using turbomap::symmetric3;
using turbomap::vec2;
using turbomap::vec3;

oracle_pose looking(double x, double y, double turn) {
  const oracle_pose T_wc{Eigen::AngleAxisd(turn, Eigen::Vector3d(0.2, 1, 0.1).normalized()).toRotationMatrix(),
                         {x, y, 0}};
  return T_wc.inverse();
}

template <class S, class Camera>
symmetric3<S> covariance(const std::vector<uncertainty_view<Camera>>& views, const Eigen::Vector3d& X) {
  symmetric3<S> information;
  double distance = 0;
  for (const auto& v : views) {
    distance = std::max(distance, (v.T_cw * X).norm());
    turbomap::projected_point<S> p;
    if (!turbomap::project_point(v.camera, to_isometry<S>(v.T_cw), S(v.bf), {S(X.x()), S(X.y()), S(X.z())}, p))
      continue;
    turbomap::add_information(information, p, v.bf > 0, S(v.sigma2), S(v.correlation));
  }
  return turbomap::covariance_from(information, S(distance));
}

/// How far two covariances are apart: the largest and least ratio of variances along any direction, as |log|.
double apart(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Matrix3d L = a.llt().matrixL();
  const Eigen::Matrix3d M = L.inverse() * b * L.inverse().transpose();
  const Eigen::Vector3d s = M.jacobiSvd().singularValues();
  return std::max(std::abs(std::log(s(0))), std::abs(std::log(s(2))));
}

template <class Camera>
struct case_of {
  const char* name;
  std::vector<uncertainty_view<Camera>> views;
  Eigen::Vector3d X;
};
template <class Camera>
struct no_derivative {  // a user's camera without jacobian()
  using scalar = typename Camera::scalar;
  Camera camera;
  template <class S>
  bool project(const vec3<S>& p, vec2<S>& pixel) const {
    return camera.project(p, pixel);
  }
  template <class S>
  bool unproject(const vec2<S>& pixel, vec3<S>& ray) const {
    return camera.unproject(pixel, ray);
  }
};

std::vector<case_of<pinhole_camera>> pinhole_cases() {
  const pinhole_camera c = pinhole_rig().cameras[0].camera;
  const oracle_pose a = looking(0, 0, 0.05), b = looking(0.4, 0.1, -0.02), d = looking(-0.3, 0.2, 0.1);
  return {{"mono pair", {{c, a}, {c, b, 0, 1.44, 0}}, {0.3, -0.4, 4}},
          {"stereo", {{c, a, 48}}, {0.3, -0.4, 3}},
          {"stereo, correlated", {{c, a, 48, 1, 31.0 / 32}}, {0.3, -0.4, 4}},
          {"stereo and mono", {{c, a, 48, 1.2, 0}, {c, b}}, {-0.6, 0.3, 5}},
          {"four views", {{c, a, 48, 1.2, 0.5}, {c, b}, {c, d, 48, 2, 0.5}, {c, a}}, {-0.6, 0.3, 5}}};
}
std::vector<case_of<fisheye_camera>> fisheye_cases() {
  const auto rig = fisheye_rig();
  const oracle_pose T = looking(0, 0, 0.05), T2 = looking(0.3, 0.1, 0);
  const auto left = to_oracle_pose(rig.cameras[0].T_camera_body), right = to_oracle_pose(rig.cameras[1].T_camera_body);
  return {{"fisheye rig", {{rig.cameras[0].camera, left * T}, {rig.cameras[1].camera, right * T}}, {0.2, 0.3, 1.5}},
          {"fisheye rig, two frames",
           {{rig.cameras[0].camera, left * T}, {rig.cameras[1].camera, right * T}, {rig.cameras[0].camera, left * T2}},
           {-0.9, 0.3, 1.2}}};
}

/// In double and strict, with a derivative and without.
template <class Camera>
void check_oracle(const std::vector<case_of<Camera>>& cases) {
  for (const auto& c : cases) {
    CAPTURE(c.name);
    const Eigen::Matrix3d expected = oracle_point_covariance(c.views, c.X);
    const double size = expected.norm();
    CHECK((to_eigen(covariance<double>(c.views, c.X)) - expected).norm() < 1e-6 * size);
    const Eigen::Matrix3d strict = to_eigen(covariance<decision>(c.views, c.X));
    CHECK((strict - expected).norm() < 1e-6 * size);
    CHECK((strict - to_eigen(covariance<double>(c.views, c.X))).norm() < 1e-11 * size);
    std::vector<uncertainty_view<no_derivative<Camera>>> bare;
    for (const auto& v : c.views) bare.push_back({{v.camera}, v.T_cw, v.bf, v.sigma2, v.correlation});
    CHECK((to_eigen(covariance<double>(bare, c.X)) - expected).norm() < 1e-6 * size);
    CHECK((to_eigen(covariance<decision>(bare, c.X)) - expected).norm() < 1e-6 * size);
  }
}

/// The maximum-likelihood point of noisy pixels, by Gauss and Newton's method from the truth.
template <class Camera>
Eigen::Vector3d estimate(const std::vector<uncertainty_view<Camera>>& views, const std::vector<Eigen::VectorXd>& seen,
                         Eigen::Vector3d X) {
  for (int step = 0; step < 5; ++step) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < views.size(); ++k) {
      const Eigen::MatrixXd J = views[k].derivative(X), W = views[k].noise().inverse();
      H += J.transpose() * W * J;
      g += J.transpose() * W * (seen[k] - views[k](X));
    }
    X += H.ldlt().solve(g);
  }
  return X;
}
Eigen::VectorXd draw(const Eigen::MatrixXd& covariance, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd z(covariance.rows());
  for (auto& x : z) x = normal(random);
  return covariance.llt().matrixL() * z;
}

/// Points estimated from noisy pixels scatter as the covariance says, and a gate with it lets 95 % of true pixels of another
/// camera pass. `scale` of the noise: first-order propagation is for small errors.
template <class Camera>
void check_monte_carlo(const std::vector<case_of<Camera>>& cases, const uncertainty_view<Camera>& other, double scale) {
  constexpr int samples = 4000;
  std::mt19937 random(11);
  for (auto c : cases) {
    CAPTURE(c.name);
    for (auto& v : c.views) v.sigma2 *= scale * scale;
    const Eigen::Matrix3d Sigma = to_eigen(covariance<double>(c.views, c.X));
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    int beyond = 0, beyond_exact = 0;
    for (int i = 0; i < samples; ++i) {
      std::vector<Eigen::VectorXd> seen;
      for (const auto& v : c.views) seen.push_back(v(c.X) + draw(v.noise(), random));
      const Eigen::Vector3d X = estimate(c.views, seen, c.X);
      scatter += (X - c.X) * (X - c.X).transpose() / samples;

      uncertainty_view<Camera> o = other;
      o.sigma2 *= scale * scale;
      const Eigen::VectorXd e = o(c.X) + draw(o.noise(), random) - o(X);
      turbomap::projected_point<double> p;
      REQUIRE(turbomap::project_point(o.camera, to_isometry<double>(o.T_cw), o.bf, {X.x(), X.y(), X.z()}, p));
      const auto J_Sigma_J = turbomap::projected_covariance(covariance<double>(c.views, X), p.by_X);
      const auto L = turbomap::spread_of_difference(J_Sigma_J, o.bf > 0, o.sigma2, o.correlation);
      const vec3<double> w = turbomap::solve_lower(L, vec3<double>{e(0), e(1), o.bf > 0 ? e(2) : 0});
      const double gate = o.bf > 0 ? 7.815 : 5.991;
      beyond += turbomap::squared_norm(w) > gate ? 1 : 0;
      beyond_exact += e.dot(o.noise().inverse() * e) > gate ? 1 : 0;

      if (i > 20) continue;  // the same by the oracle
      const Eigen::MatrixXd C = oracle_spread(o, X, oracle_point_covariance(c.views, X));
      CHECK(turbomap::squared_norm(w) == doctest::Approx(e.dot(C.inverse() * e)).epsilon(1e-5));
    }
    CHECK(apart(Sigma, scatter) < std::log(1.15));  // variances within 15 % in every direction; sampling alone: 5 %
    CHECK(std::abs(beyond - 0.05 * samples) < 0.015 * samples);
    CHECK(beyond_exact > 0.07 * samples);
  }
}

}  // namespace

TEST_CASE("covariances of points are those of the oracle") {
  check_oracle(pinhole_cases());
  check_oracle(fisheye_cases());
}

TEST_CASE("covariances of points are those of noisy views") {
  const pinhole_camera c = pinhole_rig().cameras[0].camera;
  check_monte_carlo<pinhole_camera>(pinhole_cases(), {c, looking(-0.4, -0.2, 0.08)}, 0.3);
  check_monte_carlo<pinhole_camera>(pinhole_cases(), {c, looking(-0.4, -0.2, 0.08), 48, 1, 0.5}, 0.3);
  check_monte_carlo<fisheye_camera>(fisheye_cases(), {fisheye_rig().cameras[0].camera, looking(-0.4, -0.2, 0.08)}, 0.3);
}

TEST_CASE("a point whose views leave its distance open is known to within it") {
  const pinhole_camera c = pinhole_rig().cameras[0].camera;
  const oracle_pose a = looking(0, 0, 0), b = looking(0, 0, 0.1);
  const Eigen::Vector3d X(0, 0, 4);
  for (const auto& views : {std::vector<uncertainty_view<pinhole_camera>>{{c, a}}, {{c, a}, {c, b}, {c, a}}}) {
    const Eigen::Matrix3d Sigma = to_eigen(covariance<double>(views, X));
    CHECK(std::sqrt(Sigma(2, 2)) == doctest::Approx(4).epsilon(1e-3));
    CHECK(std::sqrt(Sigma(0, 0)) < 4.0 / 458);
    // In the camera that saw it, its pixel is as certain as before; it fits any pixel along the ray in another one.
    turbomap::projected_point<double> p;
    REQUIRE(turbomap::project_point(c, to_isometry<double>(a), 0.0, {0, 0, 4}, p));
    CHECK(turbomap::projected_covariance(covariance<double>(views, X), p.by_X).xx < 1.001);
    REQUIRE(turbomap::project_point(c, to_isometry<double>(looking(0.5, 0, 0)), 0.0, {0, 0, 4}, p));
    const auto C = turbomap::projected_covariance(covariance<double>(views, X), p.by_X);
    CHECK(C.xx > 50 * 50);
    CHECK(C.yy < 1.001);
  }
}

TEST_CASE("a view that does not see the point tells nothing of it") {
  const pinhole_camera c = pinhole_rig().cameras[0].camera;
  turbomap::projected_point<double> p;
  CHECK_FALSE(turbomap::project_point(c, to_isometry<double>(oracle_pose{}), 0.0, {0, 0, -1}, p));
  CHECK_FALSE(turbomap::project_point(c, to_isometry<double>(oracle_pose{}), 48.0, {0, 0, 0}, p));
}

TEST_CASE("an exact point leaves the pixel's own noise; covariances rounded to float do not take from it") {
  using turbomap::spread_of_difference;
  const auto L = spread_of_difference(symmetric3<double>{}, true, 1.44, 0.5);
  const vec3<double> e{1, 2, -1}, w = turbomap::solve_lower(L, e);
  const Eigen::Vector3d d(1, 2, -1);
  uncertainty_view<pinhole_camera> v;
  v.bf = 1, v.sigma2 = 1.44, v.correlation = 0.5;
  CHECK(turbomap::squared_norm(w) == doctest::Approx(d.dot(v.noise().inverse() * d)));
  const auto mono = spread_of_difference(symmetric3<double>{}, false, 1.44, 0.5);
  CHECK(turbomap::squared_norm(turbomap::solve_lower(mono, vec3<double>{1, 2, 0})) == doctest::Approx(5 / 1.44));
  const symmetric3<double> negative{-3, 0, -3, 0, 0, -3};  // an eigenvalue that rounding made negative
  const auto least = spread_of_difference(negative, true, 1.0, 0.0);
  CHECK(turbomap::squared_norm(turbomap::solve_lower(least, e)) == doctest::Approx(6));
}
