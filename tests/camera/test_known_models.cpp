// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// Which cameras are computed in packs: those of a known model, also when any_camera holds one; with the parameters of the camera.

#include <turbomap/camera/any_camera.hpp>
#include <turbomap/camera/double_sphere.hpp>
#include <turbomap/camera/kannala_brandt.hpp>
#include <turbomap/camera/known_models.hpp>
#include <turbomap/camera/pinhole.hpp>

#include <doctest/doctest.h>

using namespace turbomap;

namespace {

using either = any_camera<pinhole<float>, kannala_brandt<float>>;
static_assert(is_pinhole_v<pinhole<float>> && is_pinhole_v<pinhole<double>>);
static_assert(!is_pinhole_v<either> && !is_pinhole_v<kannala_brandt<float>>);
static_assert(may_be_kannala_brandt_v<kannala_brandt<float>> && may_be_kannala_brandt_v<either>);
static_assert(!may_be_kannala_brandt_v<pinhole<float>> && !may_be_kannala_brandt_v<double_sphere<float>> &&
              !may_be_kannala_brandt_v<any_camera<pinhole<float>, double_sphere<float>>>);

TEST_CASE("a Kannala-Brandt camera gives its parameters, any_camera those that it holds, others are none") {
  const kannala_brandt<float> fisheye{191, 192, 254, 255, 0.01F, 0.02F, -0.03F, 0.04F};
  kannala_brandt<double> model, held;
  CHECK(as_kannala_brandt(fisheye, model));
  CHECK(as_kannala_brandt(either(fisheye), held));
  for (const auto& m : {model, held}) {
    CHECK(m.fx == 191);
    CHECK(m.fy == 192);
    CHECK(m.cx == 254);
    CHECK(m.cy == 255);
    CHECK(m.k1 == static_cast<double>(0.01F));
    CHECK(m.k2 == static_cast<double>(0.02F));
    CHECK(m.k3 == static_cast<double>(-0.03F));
    CHECK(m.k4 == static_cast<double>(0.04F));
  }
  CHECK(!as_kannala_brandt(pinhole<float>{}, model));
  CHECK(!as_kannala_brandt(either(pinhole<float>{}), model));
  CHECK(!as_kannala_brandt(double_sphere<float>{}, model));
}

}  // namespace
