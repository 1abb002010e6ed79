// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// Which solver `automatic` is, at each limit and beyond it.

#include <doctest/doctest.h>

#include <turbomap/adjustment/choose_solver.hpp>
#include <turbomap/adjustment/methods.hpp>
#include <turbomap/context.hpp>

#include <cstdint>

#include "support/policies.hpp"

namespace {

using turbomap::reduced_solver;
using turbomap::solver_list;

/// What choose_solver() reads of a problem: its size, its pairs, its blocks.
struct sizes_only {
  static constexpr int dof = 6;
  turbomap::adjustment_structure structure;
  std::int64_t blocks = 0;

  sizes_only(int frames, std::int64_t pairs, std::int64_t block_count) : blocks(block_count) {
    structure.free_frames = frames;
    structure.elsewhere = true, structure.sizes.pairs = pairs;
  }
  template <class Policy>
  std::int64_t count_blocks(const Policy&) const {
    return blocks;
  }
};

template <reduced_solver... Solvers>
reduced_solver chosen(sizes_only problem, reduced_solver asked = reduced_solver::automatic) {
  turbomap::adjustment_options options;  // the limits, in frames: dense 10, sparse 100; blocks: 0.25 of 20^2 / 2 is 50
  options.solver = asked;
  options.dense_limit = 60, options.sparse_limit = 600, options.sparse_fill = 0.25, options.pair_limit = 1000;
  turbomap::context<turbomap_test::sequential> ctx{turbomap_test::sequential{}};
  return turbomap::choose_solver<solver_list<Solvers...>>(ctx, problem, options);
}

TEST_CASE("automatic takes the first solver whose limits hold") {
  constexpr reduced_solver dense = reduced_solver::dense, sparse = reduced_solver::sparse, pcg = reduced_solver::pcg;
  CHECK(chosen<dense, sparse, pcg>({10, 1000, 45}) == dense);
  CHECK(chosen<dense, sparse, pcg>({11, 1000, 0}) == sparse);
  CHECK(chosen<dense, sparse, pcg>({20, 1000, 50}) == sparse);
  CHECK(chosen<dense, sparse, pcg>({20, 1000, 51}) == pcg);
  CHECK(chosen<dense, sparse, pcg>({100, 1000, 99}) == sparse);
  CHECK(chosen<dense, sparse, pcg>({101, 1000, 99}) == pcg);
  CHECK(chosen<dense, sparse, pcg>({10, 1001, 45}) == pcg);
  CHECK(chosen<dense, sparse>({20, 1001, 190}) == sparse);
  CHECK(chosen<dense, pcg>({11, 1000, 0}) == pcg);
  CHECK(chosen<sparse, pcg>({10, 1000, 0}) == sparse);
  CHECK(chosen<dense>({101, 1001, 5000}) == dense);
  CHECK(chosen<dense, sparse, pcg>({10, 1000, 45}, pcg) == pcg);
}

}  // namespace
