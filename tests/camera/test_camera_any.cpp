// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// any_camera is the model it holds; a user's own model; rigs; and device against host to the bit.

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <random>
#include <stdexcept>
#include <turbomap/camera/any_camera.hpp>
#include <turbomap/camera/brown_conrady.hpp>
#include <turbomap/camera/double_sphere.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/rig.hpp>
#include <type_traits>
#include <vector>

#include "support/support.hpp"

using namespace turbomap;

namespace {

/// A user's own model, required members only: the equidistant fisheye.
struct equidistant {
  using scalar = double;
  double f;
  template <class S>
  TURBOMAP_HD bool project(const vec3<S>& p, vec2<S>& pixel) const {
    using std::atan2;
    using std::sqrt;
    const S r = sqrt(p.x * p.x + p.y * p.y), scale = S(f) * atan2(r, p.z) / r;
    if (!(r > S(0))) return false;
    pixel = {scale * p.x, scale * p.y};
    return true;
  }
  template <class S>
  TURBOMAP_HD bool unproject(const vec2<S>& pixel, vec3<S>& ray) const {
    using std::sqrt;
    const S r = sqrt(pixel.x * pixel.x + pixel.y * pixel.y);
    if (!(r > S(0))) return false;
    S s, c;
    sin_cos(S(r / S(f)), s, c);
    ray = {s * pixel.x / r, s * pixel.y / r, c};
    return true;
  }
};
struct not_a_camera {
  using scalar = float;
  template <class S>
  bool project(const vec3<S>&, vec2<S>&) const;
};

using mixed =
    any_camera<pinhole<float>, kannala_brandt<float>, brown_conrady<double>, double_sphere<double>, equidistant>;

const pinhole<float> model_a{458.6F, 457.3F, 320.2F, 238.4F};
const kannala_brandt<float> model_b{190.9F, 191.4F, 320.2F, 238.4F, 0.0034823F, 0.00071503F, -0.0020532F, 0.00020293F};
const brown_conrady<double> model_c{458.6, 457.3, 320.2, 238.4, -0.283, 0.0739, 0.00019, 0.0000176, -0.002};
const double_sphere<double> model_d{190.9, 191.1, 320.2, 238.4, -0.19, 0.58};

template <class T>
bool same(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

template <class C>
void check_same(const C& model, int index) {
  const mixed camera = model;
  CHECK(camera.index() == index);
  REQUIRE(camera.template get_if<C>() != nullptr);
  CHECK(same(*camera.template get_if<C>(), model));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  using S = strict<double>;
  for (int i = 0; i < 200; ++i) {
    const vec3<S> p{uniform(random), uniform(random), uniform(random)};
    const vec2<S> q{320 + 300 * uniform(random), 240 + 200 * uniform(random)};
    vec2<S> a{0, 0}, b{0, 0};
    vec3<S> c{0, 0, 0}, d{0, 0, 0};
    mat23<S> e{}, f{};
    CHECK(camera.project(p, a) == model.project(p, b));
    CHECK(same(a, b));
    CHECK(camera.unproject(q, c) == model.unproject(q, d));
    CHECK(same(c, d));
    if constexpr (has_jacobian_v<C>) {
      CHECK(camera.jacobian(p, e) == model.jacobian(p, f));
      CHECK(same(e, f));
    } else {
      CHECK_FALSE(camera.jacobian(p, e));
    }
    vec2<S> at_once{0, 0};
    mat23<S> with{};
    if constexpr (has_project_with_jacobian_v<C>) {
      CHECK(camera.project_with_jacobian(p, at_once, with) == model.project(p, b));
      CHECK(same(at_once, b));
      CHECK(same(with, f));
    } else {
      CHECK_FALSE(camera.project_with_jacobian(p, at_once, with));
    }
  }
  const image_bounds image{0, 0, 640, 480};
  CHECK(camera.min_pixels_per_radian(image) == min_pixels_per_radian(model, image));
  pinhole<double> h{}, k{};
  CHECK(camera.as_pinhole(h) == as_pinhole(model, k));
  CHECK(same(h, k));
  CHECK_NOTHROW(camera.validate());
}

}  // namespace

TEST_CASE("any_camera has the answers of the model it holds") {
  check_same(model_a, 0);
  check_same(model_b, 1);
  check_same(model_c, 2);
  check_same(model_d, 3);
  check_same(equidistant{300}, 4);
}

TEST_CASE("any_camera is plain data, assignable, and a camera model itself") {
  static_assert(std::is_trivially_copyable_v<mixed> && is_camera_v<mixed> && has_jacobian_v<mixed>);
  static_assert(std::is_same_v<mixed::scalar, double>);
  static_assert(std::is_same_v<any_camera<pinhole<float>, kannala_brandt<float>>::scalar, float>);
  mixed camera;
  CHECK(camera.index() == 0);
  CHECK(camera.get_if<pinhole<float>>()->fx == 1);
  CHECK(camera.get_if<equidistant>() == nullptr);
  camera = model_d;
  CHECK(camera.index() == 3);
  mixed copy;
  std::memcpy(static_cast<void*>(&copy), &camera, sizeof copy);
  CHECK(copy.get_if<double_sphere<double>>()->xi == -0.19);
  camera = pinhole<float>{-1, 1, 0, 0};
  CHECK_THROWS_AS(camera.validate(), std::invalid_argument);
}

TEST_CASE("equal cameras have equal bytes, whatever was in their memory before") {
  const auto check = [](const auto& kind, const auto& model) {
    using camera = std::decay_t<decltype(kind)>;
    struct place {
      alignas(camera) unsigned char bytes[sizeof(camera)];
    } zeros, ones;
    std::memset(zeros.bytes, 0, sizeof zeros.bytes), std::memset(ones.bytes, 0xFF, sizeof ones.bytes);
    ::new (static_cast<void*>(zeros.bytes)) camera(model);
    ::new (static_cast<void*>(ones.bytes)) camera(model);
    CHECK(std::memcmp(zeros.bytes, ones.bytes, sizeof zeros.bytes) == 0);
  };
  using floats = any_camera<pinhole<float>, kannala_brandt<float>>;
  check(floats{}, pinhole<float>{300, 301, 320, 240});
  check(floats{}, kannala_brandt<float>{});
  check(mixed{}, model_a);
  check(mixed{}, model_b);
  check(mixed{}, model_c);
  check(mixed{}, model_d);
}

TEST_CASE("the camera concept: a user's own model, and what is missing") {
  static_assert(is_camera_v<pinhole<float>> && is_camera_v<kannala_brandt<double>> &&
                is_camera_v<brown_conrady<float>> && is_camera_v<double_sphere<float>>);
  static_assert(is_camera_v<equidistant> && require_camera<equidistant>());
  static_assert(!is_camera_v<int> && !is_camera_v<not_a_camera>);
  static_assert(has_jacobian_v<pinhole<float>> && !has_jacobian_v<equidistant>);
  static_assert(has_project_with_jacobian_v<kannala_brandt<float>> && !has_project_with_jacobian_v<equidistant>);
  pinhole<double> h{};
  CHECK_FALSE(as_pinhole(equidistant{300}, h));
  CHECK(min_pixels_per_radian(equidistant{300}, image_bounds{0, 0, 640, 480}) == 0);
  CHECK_NOTHROW(validate_camera(equidistant{-1}));  // it does not check itself
}

TEST_CASE("rigs") {
  const auto mono = make_mono_rig(model_a, 47.9);
  static_assert(decltype(mono)::size() == 1);
  CHECK(mono[0].bf == 47.9);
  CHECK(mono[0].T_camera_body.qw == 1);
  CHECK_NOTHROW(validate_rig(mono));

  rigid_transform<double> T;
  T.tx = -0.1;
  auto stereo = make_stereo_rig(mixed(model_a), mixed(model_b), T);
  CHECK(stereo.size() == 2);
  CHECK(stereo[0].T_camera_body.tx == 0);
  CHECK(stereo[1].T_camera_body.tx == -0.1);
  CHECK(stereo[1].camera.index() == 1);
  CHECK(stereo[1].bf == 0);
  CHECK(stereo.view().size() == 2);
  CHECK(&stereo.view()[1] == &stereo[1]);
  CHECK_NOTHROW(validate_rig(stereo));
  static_assert(std::is_trivially_copyable_v<decltype(stereo)>);

  auto bad = stereo;
  bad.cameras[1].T_camera_body.qw = 0.5;
  CHECK_THROWS_AS(validate_rig(bad), std::invalid_argument);
  bad = stereo;
  bad.cameras[0].bf = -1;
  CHECK_THROWS_AS(validate_rig(bad), std::invalid_argument);
  bad = stereo;
  bad.cameras[1].T_camera_body.ty = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(validate_rig(bad), std::invalid_argument);
  bad = stereo;
  bad.cameras[1].camera = kannala_brandt<float>{};
  bad.cameras[0].camera = pinhole<float>{0, 1, 0, 0};
  CHECK_THROWS_AS(validate_rig(bad), std::invalid_argument);
  CHECK_THROWS_AS(validate_rig(rig_view<pinhole<float>>{}), std::invalid_argument);
}

#if TURBOMAP_HAS_CUDA
namespace {
struct answers {
  vec3<strict<double>> ray;
  vec2<strict<double>> pixel;
  mat23<strict<double>> jacobian;
  vec2<strict<double>> pixel_at_once;
  mat23<strict<double>> jacobian_at_once;
  std::int64_t defined;  // 64 bits: no padding, which a memory checker would find in the copy to the host
};
static_assert(sizeof(answers) == 20 * sizeof(double));
TURBOMAP_HD answers ask(const mixed& camera, double u, double v) {
  answers r{};
  r.defined = camera.unproject(vec2<strict<double>>{u, v}, r.ray) ? 1 : 0;
  r.defined += camera.project(r.ray, r.pixel) ? 2 : 0;
  r.defined += camera.jacobian(r.ray, r.jacobian) ? 4 : 0;
  r.defined += camera.project_with_jacobian(r.ray, r.pixel_at_once, r.jacobian_at_once) ? 8 : 0;
  return r;
}
// The pixels are exact, fused or not.
__global__ void ask_all(mixed camera, answers* out, int width) {
  out[blockIdx.x * width + threadIdx.x] = ask(camera, 5.25 * threadIdx.x - 300, 5.125 * blockIdx.x - 300);
}
}  // namespace

TEST_CASE("device and host give the same bits for every model") {
  int devices = 0;
  if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
    turbomap_test::skip("no CUDA device");
    return;
  }
  const int width = 256, height = 200;
  answers* d_out = nullptr;
  REQUIRE(cudaMalloc(&d_out, width * height * sizeof(answers)) == cudaSuccess);
  for (const mixed& camera :
       {mixed(model_a), mixed(model_b), mixed(model_c), mixed(model_d), mixed(equidistant{300})}) {
    ask_all<<<height, width>>>(camera, d_out, width);
    std::vector<answers> out(width * height);
    REQUIRE(cudaMemcpy(out.data(), d_out, out.size() * sizeof(answers), cudaMemcpyDeviceToHost) == cudaSuccess);
    int different = 0, defined = 0;
    for (int i = 0; i < width * height; ++i) {
      const answers host = ask(camera, 5.25 * (i % width) - 300, 5.125 * (i / width) - 300);
      different += std::memcmp(&host, &out[i], sizeof host) != 0;
      defined += host.defined >= 3;
    }
    CHECK(different == 0);
    CHECK(defined > 1000);
  }
  cudaFree(d_out);
}
#endif
