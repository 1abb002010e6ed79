// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Rigs of cameras that no lens is like: of any model, with any parameters that their validate() lets pass or refuses.

#include <cmath>
#include <cstddef>
#include <iterator>
#include <type_traits>

#include "hostile.hpp"
#include "scenes/matching_rigs.hpp"

namespace turbomap_fuzz {

/// Every model of the library, in rigs of mixed models too.
using any_model = turbomap::any_camera<turbomap::pinhole<float>, turbomap::kannala_brandt<float>,
                                       turbomap::brown_conrady<double>, turbomap::double_sphere<double>>;

/// How far the parameters of a camera may be from those of a lens.
enum class lens {
  real,     ///< as they are
  bent,     ///< distorted up to several times as much
  hostile,  ///< any numbers
};

namespace detail {

template <class T>
T any_number(choices& c, double scale) {
  if constexpr (std::is_same_v<T, float>)
    return c.single(scale);
  else
    return c.number(scale);
}
/// One of the intrinsics, or one of the coefficients that distort.
template <class Camera, class T, std::size_t N>
void replace_one(Camera& camera, T* const (&distortion)[N], lens how, choices& c) {
  T* const intrinsics[] = {&camera.fx, &camera.fy, &camera.cx, &camera.cy};
  const std::size_t which = c.below(4 + N);
  if (how == lens::hostile) {
    if (which < 4)
      *intrinsics[which] = any_number<T>(c, 1000);
    else
      *distortion[which - 4] = any_number<T>(c, which % 2 == 0 ? 1 : 1e-2);
  } else {
    const double bend = static_cast<double>(c.byte()) / 32 - 4;
    if (which < 4)
      *intrinsics[which] *= static_cast<T>(1.25 + 0.125 * bend);
    else
      *distortion[which - 4] *= static_cast<T>(bend);
  }
}

}  // namespace detail

template <class T>
void bend(turbomap::pinhole<T>& k, lens how, choices& c) {
  T* const all[] = {&k.fx, &k.fy, &k.cx, &k.cy};
  T& one = *all[c.below(4)];
  one = how == lens::hostile ? detail::any_number<T>(c, 1000) : one * static_cast<T>(0.5 + c.byte() / 128.0);
}
template <class T>
void bend(turbomap::kannala_brandt<T>& k, lens how, choices& c) {
  detail::replace_one(k, {&k.k1, &k.k2, &k.k3, &k.k4}, how, c);
}
template <class T>
void bend(turbomap::brown_conrady<T>& k, lens how, choices& c) {
  detail::replace_one(k, {&k.k1, &k.k2, &k.p1, &k.p2, &k.k3}, how, c);
}
/// Its two shape parameters are in an interval: bent ones stay there.
template <class T>
void bend(turbomap::double_sphere<T>& k, lens how, choices& c) {
  if (how == lens::hostile) return detail::replace_one(k, {&k.xi, &k.alpha}, how, c);
  const T share = static_cast<T>(c.byte() / 255.0);
  (c.flag() ? k.xi : k.alpha) = c.flag() ? share : share * share;
}
/// It has no validate(): what it promises of its pixels is its own business.
inline void bend(turbomap_test::equisolid_camera& k, lens how, choices& c) {
  k.f = how == lens::hostile ? std::ldexp(1.0, static_cast<int>(c.below(40)) - 10) : 100 + 2.0 * c.byte();
}
template <class... Cameras>
void bend(turbomap::any_camera<Cameras...>& k, lens how, choices& c) {
  k.visit([&](auto held) { bend(held, how, c), k = held; });
}

/// One to three cameras, each of any model.
inline turbomap_test::test_rig<any_model> draw_models(choices& c) {
  const any_model models[] = {turbomap_test::pinhole_camera{300, 301, 256, 255}, turbomap_test::fisheye(),
                              turbomap_test::brown_conrady_rig().cameras[0].camera,
                              turbomap_test::double_sphere_rig().cameras[0].camera};
  turbomap_test::test_rig<any_model> rig;
  rig.bounds = {0, 0, 512, 512};
  const turbomap::rigid_transform<double> mounts[] = {{}, turbomap_test::beside(), turbomap_test::beside(90)};
  for (std::size_t i = 0, n = 1 + c.below(3); i < n; ++i)
    rig.cameras.push_back({models[c.below(std::size(models))], mounts[i], c.byte() % 4 == 3 ? 40.0 : 0.0, {}});
  return rig;
}
/// run(rig) with such a rig, or one time in `once_in` with that of a user's own model, which has none of the optional members.
template <class Run>
int run_on_models(choices& c, unsigned once_in, const Run& run) {
  if (c.byte() % once_in == once_in - 1)
    run(turbomap_test::equisolid_rig());
  else
    run(draw_models(c));
  return 0;
}
/// Bends up to three times a camera of the rig, now and then its mount or its second image. False: no rig can be so.
template <class Camera>
bool bend(turbomap_test::test_rig<Camera>& rig, lens how, choices& c) {
  if (how == lens::real) return true;
  for (unsigned n = 1 + c.byte() % 3; n > 0; --n) {
    auto& mounted = rig.cameras[c.below(rig.cameras.size())];
    bend(mounted.camera, how, c);
    if (how == lens::hostile && c.byte() % 8 == 7) spoil(mounted.T_camera_body, c);
    if (how == lens::hostile && c.byte() % 8 == 7) mounted.bf = c.number(50);
  }
  return allowed([&rig] {
    turbomap::validate_rig(turbomap::rig_view<Camera>{rig.cameras.data(), static_cast<int>(rig.cameras.size())});
  });
}

}  // namespace turbomap_fuzz
