// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Robust kernels: functions rho of chi2 (the squared, whitened error) that grow slower than chi2 itself, with
/// rho(s) = s for small s, and their derivative, the weight of iteratively reweighted least squares.
///
/// The user's own kernel is a trivially copyable function object; rho must be monotone, 0 at 0:
///
///     struct my_kernel { TURBOMAP_HD void operator()(double chi2, double& rho, double& weight) const; };

#include <cmath>

#include "../config.hpp"
#include "../math/functions.hpp"
#include "../math/pack.hpp"

namespace turbomap {

/// Plain least squares.
struct no_kernel {
  /// It takes packs too, several residuals at once.
  static constexpr bool for_packs = true;
  /// Sets rho(chi2) and its derivative by chi2, the weight.
  template <class S, class = detail::this_target>
  TURBOMAP_HD void operator()(const S& chi2, S& rho, S& weight) const {
    rho = chi2, weight = S(1);
  }
};

/// Linear beyond |e| = delta: rho = 2 delta |e| - delta^2 [Huber 1964].
struct huber {
  double delta2 = 5.991;  ///< delta^2; 95 % of chi-square with two degrees of freedom
  /// It takes packs too, several residuals at once.
  static constexpr bool for_packs = true;
  /// Sets rho(chi2) and its derivative by chi2, the weight.
  template <class S, class = detail::this_target>
  TURBOMAP_HD void operator()(const S& chi2, S& rho, S& weight) const {
    using std::sqrt;
    const S d2(delta2);
    const S ratio = sqrt(d2 / larger(chi2, d2));  // delta / |e|, 1 inside
    weight = ratio;
    rho = select_greater(chi2, d2, (chi2 + chi2) * ratio - d2, chi2);
  }
};

/// Logarithmic: rho = c^2 log(1 + chi2 / c^2) [Cauchy, Lorentz].
struct cauchy {
  double c2 = 5.991;  ///< c^2: where the weight is one half
  /// Sets rho(chi2) and its derivative by chi2, the weight.
  TURBOMAP_HD void operator()(double chi2, double& rho, double& weight) const {
    const double x = chi2 / c2;
    rho = c2 * ::log1p(x), weight = 1 / (1 + x);
  }
};

/// Constant beyond |e| = c: rho = c^2/3 (1 - (1 - chi2/c^2)^3) [Beaton and Tukey 1974].
struct tukey {
  double c2 = 21.95;  ///< c^2; 4.685^2 gives 95 % efficiency on Gaussian errors
  /// Sets rho(chi2) and its derivative by chi2, the weight.
  TURBOMAP_HD void operator()(double chi2, double& rho, double& weight) const {
    const double x = chi2 < c2 ? 1 - chi2 / c2 : 0;
    rho = c2 / 3 * (1 - x * x * x), weight = x * x;
  }
};

}  // namespace turbomap
