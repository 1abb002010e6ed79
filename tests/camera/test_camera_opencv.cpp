// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Pinhole, Brown-Conrady and Kannala-Brandt against OpenCV's projectPoints and undistortPoints. Built where OpenCV is.

#include <doctest/doctest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/pinhole.hpp>
#include <vector>

using namespace turbomap;

namespace {

const pinhole<double> plain{458.6, 457.3, 320.2, 238.4};
const brown_conrady<double> distorted{458.6, 457.3, 320.2, 238.4, -0.283, 0.0739, 0.00019, 0.0000176, -0.002};
const kannala_brandt<double> fisheye{190.9, 191.4, 320.2, 238.4, 0.0034823, 0.00071503, -0.0020532, 0.00020293};

template <class C>
cv::Matx33d matrix(const C& c) {
  return {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1};
}

/// Points in front of the camera, within `slope` of the optical axis.
std::vector<cv::Point3d> points(double slope) {
  std::mt19937 random(12);
  std::uniform_real_distribution<double> side(-slope, slope), depth(0.3, 20);
  std::vector<cv::Point3d> result;
  for (int i = 0; i < 500; ++i) {
    const double z = depth(random);
    result.emplace_back(side(random) * z, side(random) * z, z);
  }
  return result;
}

std::vector<cv::Point2d> pixels() {
  std::vector<cv::Point2d> result;
  for (int v = 0; v <= 480; v += 24)
    for (int u = 0; u <= 640; u += 32) result.emplace_back(u, v);
  return result;
}

template <class C>
void check_project(const C& camera, const std::vector<cv::Point3d>& in, const std::vector<cv::Point2d>& expected) {
  REQUIRE(in.size() == expected.size());
  for (std::size_t i = 0; i < in.size(); ++i) {
    vec2<double> pixel{};
    REQUIRE(camera.project(vec3<double>{in[i].x, in[i].y, in[i].z}, pixel));
    CHECK(std::abs(pixel.x - expected[i].x) < 1e-9);
    CHECK(std::abs(pixel.y - expected[i].y) < 1e-9);
  }
}

template <class C>
void check_unproject(const C& camera, const std::vector<cv::Point2d>& in, const std::vector<cv::Point2d>& expected,
                     double tolerance) {
  REQUIRE(in.size() == expected.size());
  for (std::size_t i = 0; i < in.size(); ++i) {
    vec3<double> ray{};
    REQUIRE(camera.unproject(vec2<double>{in[i].x, in[i].y}, ray));
    CHECK(std::abs(ray.x / ray.z - expected[i].x) < tolerance * (1 + std::abs(expected[i].x)));
    CHECK(std::abs(ray.y / ray.z - expected[i].y) < tolerance * (1 + std::abs(expected[i].y)));
  }
}

}  // namespace

TEST_CASE("projectPoints") {
  const auto in = points(0.7);
  std::vector<cv::Point2d> out;
  cv::projectPoints(in, cv::Vec3d(), cv::Vec3d(), matrix(plain), cv::noArray(), out);
  check_project(plain, in, out);
  const cv::Vec<double, 5> k(distorted.k1, distorted.k2, distorted.p1, distorted.p2, distorted.k3);
  cv::projectPoints(in, cv::Vec3d(), cv::Vec3d(), matrix(distorted), k, out);
  check_project(distorted, in, out);
}

TEST_CASE("undistortPoints") {
  const auto in = pixels();
  std::vector<cv::Point2d> out;
  const cv::Vec<double, 5> k(distorted.k1, distorted.k2, distorted.p1, distorted.p2, distorted.k3);
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-14);
  cv::undistortPoints(in, out, matrix(distorted), k, cv::noArray(), cv::noArray(), until);
  check_unproject(distorted, in, out, 1e-9);
}

TEST_CASE("fisheye::projectPoints and undistortPoints") {
  const auto in = points(3);
  const cv::Vec4d k(fisheye.k1, fisheye.k2, fisheye.k3, fisheye.k4);
  std::vector<cv::Point2d> out;
  cv::fisheye::projectPoints(in, out, cv::Vec3d(), cv::Vec3d(), matrix(fisheye), k);
  check_project(fisheye, in, out);

  std::vector<cv::Point2d> inner;  // OpenCV gives tan(theta): in front of the camera only
  for (const auto& p : pixels())
    if (std::hypot(p.x - fisheye.cx, p.y - fisheye.cy) < 1.3 * 190) inner.push_back(p);
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-15);
  cv::fisheye::undistortPoints(inner, out, matrix(fisheye), k, cv::noArray(), cv::noArray(), until);
  check_unproject(fisheye, inner, out, 1e-9);
}
