// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Camera models whose formulas are computed in packs (math/pack.hpp), several points at once: pinhole and Kannala-Brandt. Which of them
/// a camera is, by its type or, for any_camera, when the program runs.

#include "../config.hpp"
#include "any_camera.hpp"
#include "kannala_brandt.hpp"
#include "pinhole.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// True, with the model in double, where a camera is of this model: it is computed in packs then.
template <class Camera>
bool as_kannala_brandt(const Camera&, kannala_brandt<double>&) {
  return false;
}
/// Such a camera: takes its parameters.
template <class T>
bool as_kannala_brandt(const kannala_brandt<T>& c, kannala_brandt<double>& model) {
  model.fx = c.fx, model.fy = c.fy, model.cx = c.cx, model.cy = c.cy;
  model.k1 = c.k1, model.k2 = c.k2, model.k3 = c.k3, model.k4 = c.k4;
  return true;
}
/// Any camera: asks the one that is held.
template <class... Cameras>
bool as_kannala_brandt(const any_camera<Cameras...>& c, kannala_brandt<double>& model) {
  bool is = false;
  c.visit([&](const auto& held) { is = as_kannala_brandt(held, model); });
  return is;
}

/// Models whose type says which formulas apply: the others are not compiled for them.
template <class Camera>
inline constexpr bool is_pinhole_v = false;
/// A pinhole is one.
template <class T>
inline constexpr bool is_pinhole_v<pinhole<T>> = true;
/// Models of which some camera may be a pinhole.
template <class Camera>
inline constexpr bool may_be_pinhole_v = is_pinhole_v<Camera>;
/// Any camera may be one if it can hold one; as_pinhole() tells.
template <class... Cameras>
inline constexpr bool may_be_pinhole_v<any_camera<Cameras...>> = (is_pinhole_v<Cameras> || ...);
/// Models of which some camera may be a Kannala-Brandt one.
template <class Camera>
inline constexpr bool may_be_kannala_brandt_v = false;
/// Kannala-Brandt is one.
template <class T>
inline constexpr bool may_be_kannala_brandt_v<kannala_brandt<T>> = true;
/// Any camera may be one if it can hold one.
template <class... Cameras>
inline constexpr bool may_be_kannala_brandt_v<any_camera<Cameras...>> = (may_be_kannala_brandt_v<Cameras> || ...);

TURBOMAP_END_NAMESPACE
