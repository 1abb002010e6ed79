// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Keypoints, descriptors and cameras from OpenCV and back.

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <turbomap/camera/full_image_keypoint.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/descriptor/real.hpp>
#include <turbomap/interop/opencv.hpp>
#include <vector>

using namespace turbomap;

namespace {

const cv::Matx33d K(458.6, 0, 320.2, 0, 457.3, 238.4, 0, 0, 1);

/// The camera and OpenCV put points on the same pixels.
template <class Camera, class Project>
void check_projects_alike(const Camera& camera, Project project) {
  const std::vector<cv::Point3d> points{{0.1, 0.2, 1}, {-0.5, 0.3, 2}, {0.4, -0.4, 1.5}};
  std::vector<cv::Point2d> expected;
  project(points, expected);
  for (std::size_t i = 0; i < points.size(); ++i) {
    vec2<double> pixel{};
    REQUIRE(camera.project(vec3<double>{points[i].x, points[i].y, points[i].z}, pixel));
    CHECK(std::hypot(pixel.x - expected[i].x, pixel.y - expected[i].y) < 1e-9);
  }
}

}  // namespace

TEST_CASE("keypoints keep position, angle and octave") {
  const cv::KeyPoint in(12.25F, 3.5F, 31, 270, 0.1F, 4);
  const keypoint k = from_opencv(in, 1);
  CHECK(k.x == 12.25F);
  CHECK(k.y == 3.5F);
  CHECK(k.angle == 270);
  CHECK(k.octave == 4);
  CHECK(k.camera == 1);
  CHECK(k.u_right < 0);
  CHECK(k.depth < 0);
  CHECK(k.group == keypoint::no_group);
  const cv::KeyPoint back = to_opencv(k);
  CHECK(back.pt == in.pt);
  CHECK(back.angle == in.angle);
  CHECK(back.octave == in.octave);
  CHECK(back.size == doctest::Approx(31 * std::pow(1.2, 4)));
  CHECK(from_opencv(cv::KeyPoint(0, 0, 31)).angle == 0);  // OpenCV's -1: unknown
}

TEST_CASE("in_full_image finds the pixel that resize() made a level's pixel of") {
  // Each pixel of the image holds its own column; so does each pixel of a level, of the column in the full image.
  constexpr int height = 40;
  struct {
    int width;
    float factor;
    std::uint8_t octaves;
  } const pyramids[] = {
      {752, 1.2F, 8}, {645, 1.2F, 8}, {1241, 2, 4}, {1242, 2, 4}};  // 645 / 1.2 = 537.5, 1241 / 2 = 620.5
  for (const auto& p : pyramids) {
    CAPTURE(p.width);
    cv::Mat level(height, p.width, CV_64F);
    for (int row = 0; row < height; ++row)
      for (int column = 0; column < p.width; ++column) level.at<double>(row, column) = column;
    for (std::uint8_t octave = 0; octave < p.octaves; ++octave) {
      const auto s = static_cast<float>(std::pow(static_cast<double>(p.factor), octave));
      const int columns = cvRound(static_cast<float>(p.width) * (1 / s));  // as cv::ORB has it
      const int rows = cvRound(static_cast<float>(height) * (1 / s));
      if (octave > 0) cv::resize(level, level, cv::Size(columns, rows), 0, 0, cv::INTER_LINEAR);
      for (const int column : {5, columns / 2, columns - 6}) {
        keypoint k;
        k.x = static_cast<float>(column) * s, k.octave = octave, k.u_right = 3 * s, k.depth = 2;
        const keypoint there = in_full_image(k, p.width, height, p.factor);
        CHECK(std::abs(static_cast<double>(there.x) - level.at<double>(rows / 2, column)) < 0.02);
        CHECK(there.depth * (there.x - there.u_right) == doctest::Approx(2 * (k.x - k.u_right)).epsilon(1e-4));
      }
    }
  }
  keypoint k;
  k.x = 7, k.y = 9;
  const keypoint same = in_full_image(k, 752, 40, 1.2F);
  CHECK(same.x == 7);
  CHECK(same.y == 9);
  CHECK(same.u_right == -1);
  k.octave = 30;
  CHECK_THROWS_AS(in_full_image(k, 752, 40, 1.2F), std::invalid_argument);
  CHECK_THROWS_AS(in_full_image(k, 0, 40, 1.2F), std::invalid_argument);
}

TEST_CASE("an octave that is not a level is refused") {
  CHECK_THROWS_AS(from_opencv(cv::KeyPoint(0, 0, 7, 0, 0, 0x1FF00)), std::invalid_argument);
  CHECK_THROWS_AS(keypoints_from_opencv({cv::KeyPoint(0, 0, 7, 0, 0, -1)}), std::invalid_argument);
}

TEST_CASE("descriptors are seen without a copy, and copied back") {
  using D = binary_descriptor<256>;
  cv::Mat image(200, 200, CV_8U), mat;
  cv::randu(image, 0, 255);
  std::vector<cv::KeyPoint> keypoints;
  cv::ORB::create()->detectAndCompute(image, {}, keypoints, mat);
  REQUIRE(mat.rows > 10);
  const auto rows = descriptors_from_opencv<D>(mat);
  CHECK(rows.data() == mat.data);
  CHECK(rows.size() == mat.total());
  CHECK(D::distance(rows.data(), rows.data() + D::elements) ==
        static_cast<int>(cv::norm(mat.row(0), mat.row(1), cv::NORM_HAMMING)));
  CHECK(cv::norm(descriptors_to_opencv<D>(rows), mat, cv::NORM_INF) == 0);
  CHECK(descriptors_from_opencv<D>(cv::Mat()).empty());

  const cv::Mat floats = cv::Mat::ones(3, 128, CV_32F);
  CHECK(descriptors_from_opencv<real_descriptor<float, 128>>(floats).size() == 384);
}

TEST_CASE("descriptors of 16-bit numbers") {
  using D = real_descriptor<turbomap::half, 64>;
  cv::Mat floats(3, 64, CV_32F), mat;
  for (int i = 0; i < 3 * 64; ++i) floats.ptr<float>()[i] = 0.25F * static_cast<float>(i) - 7;
  floats.convertTo(mat, CV_16F);
  const auto rows = descriptors_from_opencv<D>(mat);
  CHECK(static_cast<const void*>(rows.data()) == mat.data);
  REQUIRE(rows.size() == 3 * 64);
  for (std::size_t i = 0; i < rows.size(); ++i) CHECK(to_float(rows[i]) == 0.25F * static_cast<float>(i) - 7);
  const cv::Mat back = descriptors_to_opencv<D>(rows);
  CHECK(back.type() == CV_16F);
  CHECK(std::memcmp(back.data, mat.data, rows.size() * sizeof(turbomap::half)) == 0);
  CHECK_THROWS_AS(descriptors_from_opencv<D>(floats), std::invalid_argument);
  CHECK_THROWS_AS(descriptors_from_opencv<D>(cv::Mat::zeros(3, 64, CV_16U)), std::invalid_argument);
}

TEST_CASE("descriptors of another kind are refused") {
  using D = binary_descriptor<256>;
  CHECK_THROWS_AS(descriptors_from_opencv<D>(cv::Mat::zeros(3, 32, CV_32F)), std::invalid_argument);
  CHECK_THROWS_WITH(descriptors_from_opencv<D>(cv::Mat::zeros(3, 61, CV_8U)),
                    "turbomap: descriptors.cols = 61: must be 32, the elements of this descriptor");
  const cv::Mat wide = cv::Mat::zeros(3, 64, CV_8U);
  CHECK_THROWS_AS(descriptors_from_opencv<D>(wide.colRange(0, 32)), std::invalid_argument);
  const std::vector<std::uint8_t> broken(33);
  CHECK_THROWS_AS(descriptors_to_opencv<D>(broken), std::invalid_argument);
}

TEST_CASE("cameras project as OpenCV does, and come back") {
  const cv::Vec3d zero(0, 0, 0);
  check_projects_alike(pinhole_from_opencv<double>(cv::Mat(K)), [&](auto& points, auto& pixels) {
    cv::projectPoints(points, zero, zero, K, cv::noArray(), pixels);
  });
  const cv::Mat five = (cv::Mat_<double>(1, 5) << -0.28, 0.07, 2e-4, -1e-4, -0.002);
  const auto distorted = brown_conrady_from_opencv<double>(cv::Mat(K), five);
  check_projects_alike(distorted,
                       [&](auto& points, auto& pixels) { cv::projectPoints(points, zero, zero, K, five, pixels); });
  const cv::Mat four = (cv::Mat_<double>(4, 1) << 0.0035, 0.0007, -0.002, 0.0002);
  const auto fisheye = kannala_brandt_from_opencv<double>(cv::Mat(K), four);
  check_projects_alike(
      fisheye, [&](auto& points, auto& pixels) { cv::fisheye::projectPoints(points, pixels, zero, zero, K, four); });

  CHECK(camera_matrix_to_opencv(distorted) == K);
  CHECK(cv::norm(cv::Mat(distortion_to_opencv(distorted)).t(), five) == 0);
  CHECK(cv::norm(cv::Mat(distortion_to_opencv(fisheye)), four) == 0);
}

TEST_CASE("coefficients: four, or more that are zero, or none") {
  const cv::Mat matrix(K);
  CHECK(brown_conrady_from_opencv<float>(matrix, (cv::Mat_<float>(1, 4) << 0.5F, 0, 0, 0)).k1 == 0.5F);
  CHECK(brown_conrady_from_opencv<float>(matrix, cv::Mat()).k1 == 0);
  cv::Mat eight = cv::Mat::zeros(1, 8, CV_64F);
  CHECK_NOTHROW(brown_conrady_from_opencv<float>(matrix, eight));
  eight.at<double>(6) = 0.1;  // of OpenCV's rational model
  CHECK_THROWS_WITH(brown_conrady_from_opencv<float>(matrix, eight),
                    "turbomap: distortion[6] = 0.1: this camera model has no such coefficient");
  CHECK_THROWS_AS(brown_conrady_from_opencv<float>(matrix, cv::Mat::zeros(1, 3, CV_64F)), std::invalid_argument);
  CHECK_THROWS_AS(kannala_brandt_from_opencv<float>(matrix, cv::Mat::zeros(2, 2, CV_64F)), std::invalid_argument);
  CHECK_THROWS_AS(kannala_brandt_from_opencv<float>(matrix, cv::Mat::ones(1, 5, CV_64F)), std::invalid_argument);
  CHECK_THROWS_AS(brown_conrady_from_opencv<float>(matrix, cv::Mat::zeros(1, 4, CV_32S)), std::invalid_argument);
}

TEST_CASE("matrices that are no camera are refused") {
  CHECK_THROWS_AS(pinhole_from_opencv<float>(cv::Mat::eye(3, 4, CV_64F)), std::invalid_argument);
  CHECK_THROWS_AS(pinhole_from_opencv<float>(cv::Mat::eye(3, 3, CV_8U)), std::invalid_argument);
  CHECK_THROWS_AS(pinhole_from_opencv<float>(cv::Mat()), std::invalid_argument);
  cv::Mat skew(K, true);
  skew.at<double>(0, 1) = 0.5;
  CHECK_THROWS_WITH(pinhole_from_opencv<float>(skew), "turbomap: K(0, 1) = 0.5: the camera models have no skew");
  cv::Mat flipped(K, true);
  flipped.at<double>(1, 1) = -400;
  CHECK_THROWS_AS(pinhole_from_opencv<float>(flipped), std::invalid_argument);
  cv::Mat nan(K, true);
  nan.at<double>(0, 2) = NAN;
  CHECK_THROWS_AS(pinhole_from_opencv<float>(nan), std::invalid_argument);
}
