// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Arrays in matrices of OpenCV on a device. The matrices are real ones, around memory of the host, which an OpenCV without CUDA can
/// make too: what is tested is where the pointers go, and what is refused. A search reads them under a policy of the host.

#include <doctest/doctest.h>

#include <stdexcept>
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/descriptor/real.hpp>
#include <turbomap/interop/opencv_cuda.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <type_traits>
#include <vector>

using namespace turbomap;
using cv::cuda::GpuMat;

namespace {

using orb = binary_descriptor<256>;
using camera = pinhole<float>;

/// A matrix of so many rows and columns around a vector, rows `step` bytes apart.
template <class T>
GpuMat around(std::vector<T>& data, int rows, int cols, int type, std::size_t step = cv::Mat::AUTO_STEP) {
  return {rows, cols, type, static_cast<void*>(data.data()), step};
}
template <class F>
std::string refusal(F f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "none";
}

}  // namespace

TEST_CASE("arrays are where the matrix is") {
  std::vector<float> numbers(12);
  std::vector<std::uint8_t> bytes(64);
  const auto pixels = span_from_gpu_mat<vec2<float>>(around(numbers, 1, 6, CV_32FC2));
  CHECK(static_cast<const void*>(pixels.data()) == numbers.data());
  CHECK(pixels.size() == 6);
  const auto rays = span_from_gpu_mat<vec3<float>>(around(numbers, 4, 1, CV_32FC3));  // a column
  CHECK(static_cast<const void*>(rays.data()) == numbers.data());
  CHECK(rays.size() == 4);
  CHECK(span_from_gpu_mat<float>(around(numbers, 1, 12, CV_32FC1)).size() == 12);
  CHECK(span_from_gpu_mat<std::uint8_t>(around(bytes, 1, 64, CV_8UC1)).data() == bytes.data());
  const auto descriptors = descriptors_from_gpu_mat<orb>(around(bytes, 2, 32, CV_8UC1));
  CHECK(descriptors.data() == bytes.data());
  CHECK(descriptors.size() == 64);
  using learned = real_descriptor<float, 4>;
  CHECK(descriptors_from_gpu_mat<learned>(around(numbers, 3, 4, CV_32FC1)).size() == 12);
}

TEST_CASE("descriptors of 16-bit numbers are where the matrix is") {
  std::vector<std::uint16_t> numbers(128);
  const auto descriptors =
      descriptors_from_gpu_mat<real_descriptor<turbomap::half, 64>>(around(numbers, 2, 64, CV_16FC1));
  CHECK(static_cast<const void*>(descriptors.data()) == numbers.data());
  CHECK(descriptors.size() == 128);
  CHECK(refusal([&] {
          descriptors_from_gpu_mat<real_descriptor<turbomap::half, 64>>(around(numbers, 2, 64, CV_16UC1));
        }) == "turbomap: matrix.type() = CV_16UC1: must be CV_16FC1");
}

TEST_CASE("nothing is in an empty matrix") {
  CHECK(span_from_gpu_mat<float>(GpuMat()).empty());
  CHECK(descriptors_from_gpu_mat<orb>(GpuMat()).empty());
}

TEST_CASE("what does not fit is named") {
  std::vector<float> numbers(128);
  std::vector<std::uint8_t> bytes(1024);
  CHECK(refusal([&] { span_from_gpu_mat<float>(around(numbers, 1, 6, CV_32FC2)); }) ==
        "turbomap: matrix.type() = CV_32FC2: must be CV_32FC1");
  CHECK(refusal([&] { span_from_gpu_mat<float>(around(numbers, 2, 6, CV_32FC1)); }) ==
        "turbomap: matrix.rows = 2: must be one row or one column");
  CHECK(refusal([&] { span_from_gpu_mat<float>(around(numbers, 4, 1, CV_32FC1, 16)); }).find("matrix.step = 16") !=
        std::string::npos);
  CHECK(refusal([&] { descriptors_from_gpu_mat<orb>(around(bytes, 2, 31, CV_8UC1)); }) ==
        "turbomap: matrix.cols = 31: must be 32, the elements of this descriptor");
  CHECK(refusal([&] { descriptors_from_gpu_mat<orb>(around(numbers, 2, 32, CV_32FC1)); }) ==
        "turbomap: matrix.type() = CV_32FC1: must be CV_8UC1");
  // As GpuMat makes it itself: rows of 32 bytes, 512 apart.
  CHECK(refusal([&] { descriptors_from_gpu_mat<orb>(around(bytes, 2, 32, CV_8UC1, 512)); }).find("createContinuous") !=
        std::string::npos);
  CHECK(descriptors_from_gpu_mat<orb>(around(bytes, 1, 32, CV_8UC1, 512)).size() == 32);  // one row has no gap
}

TEST_CASE("a search reads the matrices") {
  // One point, (0.5, 0, 4) m, from two places 1 m apart; the descriptors of a second keypoint are far from it.
  std::vector<float> pixel_a{433.25F, 240, 20, 20}, pixel_b{318.75F, 240, 700, 400};
  std::vector<float> ray_a(6), ray_b(6);
  std::vector<std::uint8_t> descriptor_a(64), descriptor_b(64), octave(2);
  std::fill(descriptor_a.begin() + 32, descriptor_a.end(), std::uint8_t{0xFF});
  std::fill(descriptor_b.begin() + 32, descriptor_b.end(), std::uint8_t{0xAA});
  const rig_camera<camera> rig{{458, 458, 376, 240}, {}, 0, {}};
  const auto view_of = [&](std::vector<float>& pixels, std::vector<float>& rays,
                           std::vector<std::uint8_t>& descriptors) {
    for (std::size_t i = 0; i < 2; ++i) {
      vec3<float> ray{};
      rig.camera.unproject(vec2<float>{pixels[2 * i], pixels[2 * i + 1]}, ray);
      rays[3 * i] = ray.x, rays[3 * i + 1] = ray.y, rays[3 * i + 2] = ray.z;
    }
    keyframe_view<orb, camera> v;
    v.keypoint_count = 2;
    v.pixel = span_from_gpu_mat<vec2<float>>(around(pixels, 1, 2, CV_32FC2)).data();
    v.bearing = span_from_gpu_mat<vec3<float>>(around(rays, 1, 2, CV_32FC3)).data();
    v.octave = span_from_gpu_mat<std::uint8_t>(around(octave, 1, 2, CV_8UC1)).data();
    v.descriptor = descriptors_from_gpu_mat<orb>(around(descriptors, 2, 32, CV_8UC1)).data();
    v.cameras = &rig, v.camera_count = 1;
    return v;
  };
  using posed = posed_keyframe<orb, camera>;
  const posed a{view_of(pixel_a, ray_a, descriptor_a), {}, {}};
  const posed b{view_of(pixel_b, ray_b, descriptor_b), {0, 0, 0, 1, -1, 0, 0}, {}};
  context ctx;
  const auto matches = search_correspondences(ctx, a, span<const posed>(&b, 1)).plan(ctx);
  REQUIRE(matches.size() == 1);
  CHECK(matches[0].query == 0);
  CHECK(matches[0].candidate == 0);
}
