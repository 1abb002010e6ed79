// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Keypoints, descriptors and cameras from and to OpenCV. Not included by anything else; needs OpenCV's core module only.
///
///     orb->detectAndCompute(image, {}, cv_keypoints, cv_descriptors);
///     const auto keypoints = turbomap::keypoints_from_opencv(cv_keypoints);
///     const auto descriptors = turbomap::descriptors_from_opencv<turbomap::binary_descriptor<256>>(cv_descriptors);
///     const auto camera = turbomap::brown_conrady_from_opencv<float>(K, distortion);

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

#include "../camera/brown_conrady.hpp"
#include "../camera/kannala_brandt.hpp"
#include "../camera/pinhole.hpp"
#include "../config.hpp"
#include "../descriptor/descriptor_concept.hpp"
#include "../descriptor/half.hpp"
#include "../error.hpp"
#include "../span.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

namespace detail {
/// The type of a matrix that holds elements of T.
template <class T>
inline constexpr int mat_type = cv::DataType<T>::type;
template <>
inline constexpr int mat_type<half> = CV_16F;

/// A size or matrix of OpenCV as it prints itself, for messages.
template <class Value>
std::string streamed(const Value& value) {
  std::ostringstream text;
  text << value;
  return text.str();
}
}  // namespace detail

/// One keypoint: position, octave, and orientation (0 where OpenCV has none, its -1). Throws std::invalid_argument when the
/// octave is not in [0, 255]: SIFT packs several numbers into it, unpack them first. The position is OpenCV's: that of its ORB is off
/// by up to a pixel, see in_full_image() (camera/full_image_keypoint.hpp).
inline keypoint from_opencv(const cv::KeyPoint& in, std::uint8_t camera = 0) {
  require(in.octave >= 0 && in.octave <= 255, "octave", in.octave,
          "must be a pyramid level in [0, 255]; OpenCV's SIFT packs more than the level into it");
  keypoint out;
  out.x = in.pt.x, out.y = in.pt.y;
  out.angle = in.angle < 0 ? 0 : in.angle;
  out.octave = static_cast<std::uint8_t>(in.octave);
  out.camera = camera;
  return out;
}
/// All keypoints of one image. Throws as from_opencv().
inline std::vector<keypoint> keypoints_from_opencv(const std::vector<cv::KeyPoint>& in, std::uint8_t camera = 0) {
  std::vector<keypoint> out;
  out.reserve(in.size());
  for (const cv::KeyPoint& k : in) out.push_back(from_opencv(k, camera));
  return out;
}
/// Back, e.g. to draw it. `size` is the diameter at octave 0 (31: ORB's patch), which a keypoint does not hold.
inline cv::KeyPoint to_opencv(const keypoint& in, float size = 31, float scale_factor = pyramid().scale_factor) {
  for (int o = 0; o < in.octave; ++o) size *= scale_factor;
  return {in.x, in.y, size, in.angle, 0, in.octave};
}

/// The rows of a descriptor matrix, one after the other, without a copy: valid as long as the matrix is. Throws
/// std::invalid_argument when the element type or the row length is another, or the matrix is not continuous (clone() it).
template <class Descriptor>
span<const typename Descriptor::element> descriptors_from_opencv(const cv::Mat& descriptors) {
  using element = typename Descriptor::element;
  static_assert(require_descriptor<Descriptor>());
  static_assert(sizeof(element) == CV_ELEM_SIZE(detail::mat_type<element>));
  if (descriptors.empty()) return {};
  if (descriptors.type() != detail::mat_type<element>)
    reject("descriptors.type()", cv::typeToString(descriptors.type()), "is not the element type of this descriptor");
  if (descriptors.cols != Descriptor::elements)
    reject("descriptors.cols", descriptors.cols,
           ("must be " + std::to_string(Descriptor::elements) + ", the elements of this descriptor").c_str());
  require(descriptors.isContinuous(), "descriptors.isContinuous()", false, "must be; clone() the matrix");
  return {descriptors.ptr<element>(), static_cast<std::size_t>(descriptors.rows) * Descriptor::elements};
}
/// A matrix of its own with one descriptor per row. Throws std::invalid_argument when the last descriptor is not whole.
template <class Descriptor>
cv::Mat descriptors_to_opencv(span<const typename Descriptor::element> descriptors) {
  using element = typename Descriptor::element;
  static_assert(require_descriptor<Descriptor>());
  require(descriptors.size() % Descriptor::elements == 0, "descriptors.size()", descriptors.size(),
          "must be a multiple of the elements of this descriptor");
  cv::Mat out(static_cast<int>(descriptors.size() / Descriptor::elements), Descriptor::elements,
              detail::mat_type<element>);
  for (std::size_t i = 0; i < descriptors.size(); ++i) out.ptr<element>()[i] = descriptors[i];
  return out;
}

namespace detail {

/// fx fy cx cy of a 3x3 camera matrix, float or double.
template <class Camera>
void take_matrix(const cv::Mat& K, Camera& camera) {
  using T = typename Camera::scalar;
  require(K.rows == 3 && K.cols == 3 && K.channels() == 1, "K.size()", detail::streamed(K.size()),
          "a camera matrix is 3x3");
  require(K.depth() == CV_64F || K.depth() == CV_32F, "K.type()", cv::typeToString(K.type()),
          "must be float or double");
  cv::Matx33d m;
  K.convertTo(m, CV_64F);
  require(m(0, 1) == 0, "K(0, 1)", m(0, 1), "the camera models have no skew");
  require(m(1, 0) == 0 && m(2, 0) == 0 && m(2, 1) == 0 && m(2, 2) == 1, "K", detail::streamed(m),
          "is no camera matrix");
  camera.fx = static_cast<T>(m(0, 0)), camera.fy = static_cast<T>(m(1, 1));
  camera.cx = static_cast<T>(m(0, 2)), camera.cy = static_cast<T>(m(1, 2));
}

/// Distortion coefficients in a row, at least `count` of them, zero where there are none at all.
inline std::vector<double> take_coefficients(const cv::Mat& distortion, std::size_t count) {
  if (distortion.empty()) return std::vector<double>(count, 0.0);
  require(distortion.channels() == 1 && (distortion.rows == 1 || distortion.cols == 1), "distortion.size()",
          detail::streamed(distortion.size()), "must be one row or one column");
  require(distortion.depth() == CV_64F || distortion.depth() == CV_32F, "distortion.type()",
          cv::typeToString(distortion.type()), "must be float or double");
  cv::Mat row;
  distortion.convertTo(row, CV_64F);
  std::vector<double> d(row.begin<double>(), row.end<double>());
  require(d.size() >= 4, "distortion.total()", d.size(), "OpenCV's models have four coefficients or more");
  if (d.size() < count) d.resize(count, 0.0);
  for (std::size_t i = count; i < d.size(); ++i)
    require(d[i] == 0, ("distortion[" + std::to_string(i) + "]").c_str(), d[i],
            "this camera model has no such coefficient");
  return d;
}

}  // namespace detail

/// \name Cameras
/// \param K           3x3 camera matrix without skew, float or double
/// \param distortion  as OpenCV orders them: k1 k2 p1 p2 [k3] (Brown-Conrady; further ones must be 0), k1 k2 k3 k4 (fisheye
///                    module); empty: none
/// Throws std::invalid_argument naming what does not fit, also what no camera can have.
/// @{
template <class T>
pinhole<T> pinhole_from_opencv(const cv::Mat& K) {
  pinhole<T> camera;
  detail::take_matrix(K, camera);
  camera.validate();
  return camera;
}
template <class T>
brown_conrady<T> brown_conrady_from_opencv(const cv::Mat& K, const cv::Mat& distortion) {
  brown_conrady<T> camera;
  detail::take_matrix(K, camera);
  const std::vector<double> d = detail::take_coefficients(distortion, 5);
  camera.k1 = static_cast<T>(d[0]), camera.k2 = static_cast<T>(d[1]);
  camera.p1 = static_cast<T>(d[2]), camera.p2 = static_cast<T>(d[3]), camera.k3 = static_cast<T>(d[4]);
  camera.validate();
  return camera;
}
template <class T>
kannala_brandt<T> kannala_brandt_from_opencv(const cv::Mat& K, const cv::Mat& distortion) {
  kannala_brandt<T> camera;
  detail::take_matrix(K, camera);
  const std::vector<double> d = detail::take_coefficients(distortion, 4);
  camera.k1 = static_cast<T>(d[0]), camera.k2 = static_cast<T>(d[1]);
  camera.k3 = static_cast<T>(d[2]), camera.k4 = static_cast<T>(d[3]);
  camera.validate();
  return camera;
}
/// The camera matrix of any of the three.
template <class Camera>
cv::Matx33d camera_matrix_to_opencv(const Camera& c) {
  return {double(c.fx), 0, double(c.cx), 0, double(c.fy), double(c.cy), 0, 0, 1};
}
/// Coefficients for cv::projectPoints, cv::undistortPoints, ...
template <class T>
cv::Vec<double, 5> distortion_to_opencv(const brown_conrady<T>& c) {
  return {double(c.k1), double(c.k2), double(c.p1), double(c.p2), double(c.k3)};
}
/// Coefficients for the functions of cv::fisheye.
template <class T>
cv::Vec4d distortion_to_opencv(const kannala_brandt<T>& c) {
  return {double(c.k1), double(c.k2), double(c.k3), double(c.k4)};
}
/// @}

TURBOMAP_END_NAMESPACE
