// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The damping of Levenberg and Marquardt's method: what is added to the normal equations to make a step shorter, and
/// how it follows from what the last step gained [Nielsen 1999].

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/strict.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// What is added to a diagonal element h of the normal equations.
struct damping {
  double lambda;        ///< not negative
  bool scaled = false;  ///< by h itself, kept within [1e-6, 1e32] [Marquardt 1963; the bounds are Ceres']

  /// What is added to h.
  TURBOMAP_HD double operator()(double h) const {
    return scaled ? lambda * (h < 1e-6 ? 1e-6 : h > 1e32 ? 1e32 : h) : lambda;
  }
};

/// Lambda from step to step: smaller after a step that gained what the quadratic model promised, larger and larger (2, 4,
/// 8, ... times) while steps are refused.
struct damping_control {
  double lambda = 0;  ///< damping of the next step
  double growth = 2;  ///< factor of lambda after the next refused step

  /// Whether a step is worth taking, and the damping of the next one.
  /// \param predicted  the decrease that the quadratic model promised
  TURBOMAP_HD bool accepts(double cost_before, double cost_after, double predicted) {
    const double ratio = (cost_before - cost_after) / predicted;
    if (!detail::is_finite(cost_after) || !detail::is_finite(ratio) || !(ratio > 0)) {
      refuse();
      return false;
    }
    const decision x = decision(2) * decision(ratio) - decision(1);
    const double scale = (decision(1) - x * x * x).value;
    lambda *= scale < 1.0 / 3 ? 1.0 / 3 : scale > 2.0 / 3 ? 2.0 / 3 : scale;
    growth = 2;
    return true;
  }
  /// A step that could not be solved for.
  TURBOMAP_HD void refuse() { lambda *= growth, growth *= 2; }
};

TURBOMAP_END_NAMESPACE
