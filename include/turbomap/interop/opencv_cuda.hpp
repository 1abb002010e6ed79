// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Arrays of a keyframe_view that lie in matrices of OpenCV on a device, without a copy. Not included by anything else; needs
/// OpenCV's core module only, with or without CUDA, and no CUDA header. It is plain pointers: nothing here touches the device.
///
///     cv::cuda::GpuMat d = cv::cuda::createContinuous(n, 32, CV_8UC1);  // before the detector fills it: see below
///     view.descriptor = turbomap::descriptors_from_gpu_mat<turbomap::binary_descriptor<256>>(d).data();
///     view.pixel = turbomap::span_from_gpu_mat<turbomap::vec2<float>>(pixels).data();

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/core/cuda.hpp>
#include <string>

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
struct gpu_mat_type {
  static constexpr int value = cv::DataType<T>::type;
};
template <>
struct gpu_mat_type<half> {
  static constexpr int value = CV_16FC1;
};
template <>
struct gpu_mat_type<vec2<float>> {
  static constexpr int value = CV_32FC2;
};
template <>
struct gpu_mat_type<vec3<float>> {
  static constexpr int value = CV_32FC3;
};

template <class T>
void check_gpu_mat(const cv::cuda::GpuMat& matrix) {
  if (matrix.type() != gpu_mat_type<T>::value)
    reject("matrix.type()", cv::typeToString(matrix.type()),
           ("must be " + cv::typeToString(gpu_mat_type<T>::value)).c_str());
  // cudaMallocPitch pads the rows of a matrix that GpuMat makes itself.
  require(matrix.isContinuous(), "matrix.step", matrix.step,
          "is more than a row: make the matrix by cv::cuda::createContinuous before it is filled, or copy it into one");
}

}  // namespace detail

/// One array of a keyframe: a row or a column of uint8 (octave, camera), float (angle, u_right, depth), vec2<float> (pixel,
/// CV_32FC2) or vec3<float> (bearing, CV_32FC3), in the memory of the device, without a copy: valid as long as the matrix is, and
/// filled when its stream has come so far. Throws std::invalid_argument when the type of its elements is another, or it has
/// several rows and columns, or is not continuous.
template <class T>
span<const T> span_from_gpu_mat(const cv::cuda::GpuMat& matrix) {
  if (matrix.empty()) return {};
  require(matrix.rows == 1 || matrix.cols == 1, "matrix.rows", matrix.rows, "must be one row or one column");
  detail::check_gpu_mat<T>(matrix);
  return {reinterpret_cast<const T*>(matrix.data),
          static_cast<std::size_t>(matrix.rows) * static_cast<std::size_t>(matrix.cols)};
}

/// The rows of a matrix with one descriptor each, in the memory of the device, without a copy: valid as long as the matrix is.
/// Throws std::invalid_argument when the type of its elements or the length of a row is another, or it is not continuous, as
/// matrices of several rows are not unless they were made by cv::cuda::createContinuous.
template <class Descriptor>
span<const typename Descriptor::element> descriptors_from_gpu_mat(const cv::cuda::GpuMat& matrix) {
  using element = typename Descriptor::element;
  static_assert(require_descriptor<Descriptor>());
  if (matrix.empty()) return {};
  if (matrix.cols != Descriptor::elements)
    reject("matrix.cols", matrix.cols,
           ("must be " + std::to_string(Descriptor::elements) + ", the elements of this descriptor").c_str());
  detail::check_gpu_mat<element>(matrix);
  return {reinterpret_cast<const element*>(matrix.data), static_cast<std::size_t>(matrix.rows) * Descriptor::elements};
}

TURBOMAP_END_NAMESPACE
