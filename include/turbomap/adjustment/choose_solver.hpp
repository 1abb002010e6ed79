// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which solver adjust() takes where the options say `automatic`: dense for few unknowns, sparse where the reduced matrix has many
/// empty blocks, conjugate gradients beyond. The limits are options.

#include "../config.hpp"
#include "../context.hpp"
#include "block_finder.hpp"
#include "options.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// One of those that the program is compiled with. A matrix with few empty blocks gains nothing from sparsity.
/// \tparam Solvers  a solver_list   \param data  a problem_data
template <class Solvers, class Policy, class Data>
reduced_solver choose_solver(context<Policy>& ctx, Data& data, const adjustment_options& options) {
  if (options.solver != reduced_solver::automatic) return options.solver;
  constexpr bool dense = Solvers::has(reduced_solver::dense), sparse = Solvers::has(reduced_solver::sparse);
  constexpr bool pcg = Solvers::has(reduced_solver::pcg);
  const int unknowns = data.structure.free_frames * Data::dof;
  const bool lists_fit = !pcg || block_finder::count_pairs(data.structure) <= options.pair_limit;
  if (dense && lists_fit && (unknowns <= options.dense_limit || !(sparse || pcg))) return reduced_solver::dense;
  if (!pcg) return sparse ? reduced_solver::sparse : reduced_solver::dense;
  if (!sparse || !lists_fit || unknowns > options.sparse_limit) return reduced_solver::pcg;
  const double f = data.structure.free_frames, blocks = static_cast<double>(data.count_blocks(ctx.policy()));
  return blocks > options.sparse_fill * f * f / 2 ? reduced_solver::pcg : reduced_solver::sparse;
}

TURBOMAP_END_NAMESPACE
