// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which solvers and precisions of adjust() a program compiles. Each pair of the two is code of its own, and most programs
/// use one or two of the nine.

#include "options.hpp"

namespace turbomap {

/// Solvers that a program is compiled with.
template <reduced_solver... Solvers>
struct solver_list {
  /// Whether it is among them.
  static constexpr bool has(reduced_solver solver) { return (false || ... || (solver == Solvers)); }
};

/// Precisions that a program is compiled with.
template <precision... Precisions>
struct precision_list {
  /// Whether it is among them.
  static constexpr bool has(precision numbers) { return (false || ... || (numbers == Precisions)); }
};

/// What adjust() chooses among at run time:
///
///     using methods = adjustment_methods<solver_list<reduced_solver::dense>, precision_list<precision::float64>>;
///     adjust<methods>(ctx, problem, options);
template <class Solvers = solver_list<reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg>,
          class Precisions = precision_list<precision::mixed>>
struct adjustment_methods {
  /// A solver_list.
  using solvers = Solvers;
  /// A precision_list.
  using precisions = Precisions;
};

/// All solvers in all precisions.
using every_adjustment_method =
    adjustment_methods<solver_list<reduced_solver::dense, reduced_solver::sparse, reduced_solver::pcg>,
                       precision_list<precision::float64, precision::mixed, precision::float32>>;

}  // namespace turbomap
