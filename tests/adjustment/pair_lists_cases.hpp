// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// What conjugate gradients must not make: the lists of blocks and pairs of the reduced matrix, which grow with the square of the
/// frames that see a landmark.

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <memory_resource>

#include "adjustment_cases.hpp"

namespace turbomap_test {

/// Passes on to another resource, and counts the bytes of all allocations, those that were given back included.
class byte_counting_resource : public std::pmr::memory_resource {
 public:
  explicit byte_counting_resource(std::pmr::memory_resource* upstream) : upstream_(upstream) {}
  std::size_t bytes = 0;

 private:
  void* do_allocate(std::size_t n, std::size_t alignment) override {
    bytes += n;
    return upstream_->allocate(n, alignment);
  }
  void do_deallocate(void* p, std::size_t n, std::size_t alignment) override { upstream_->deallocate(p, n, alignment); }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }

  std::pmr::memory_resource* upstream_;
};

/// The lists of blocks are empty, and never held anything.
inline void check_no_block_lists(const turbomap::adjustment_structure& s) {
  CHECK(s.pairs.capacity() == 0);
  CHECK(s.block_row.capacity() == 0);
  CHECK(s.block_column.capacity() == 0);
  CHECK(s.factor_list.capacity() == 0);
  CHECK(s.block_pair.size() == 1);
  CHECK(s.block_factor.size() == 1);
}

/// Bytes that a problem and its adjustment allocated, and those of the list of pairs.
struct pcg_memory {
  std::size_t taken, pairs;
};

/// Adjusts twelve landmarks that `frames` frames see, and looks at the lists afterwards.
/// \param resource  of the policy's memory   \param bytes  what was allocated so far, there and on the host
template <class Policy, class Bytes>
pcg_memory memory_of_pcg(const Policy& policy, std::pmr::memory_resource* resource, Bytes bytes, int frames,
                         const turbomap::adjustment_options& options) {
  const auto s = make_adjustment_scene(scene_kind::mono, frames, 2, 12, 3);
  const std::size_t before = bytes();
  turbomap::context<Policy> ctx{policy, resource};
  turbomap::bundle_problem<Policy, pose_frame, turbomap::reprojections<scene_camera>> problem(ctx);
  problem.assign(ctx, s.frame_input(), s.landmark_input(), s.group());
  const auto summary = turbomap::adjust<float64_methods>(ctx, problem, options);
  const std::size_t taken = bytes() - before;
  CHECK(summary.accepted > 0);
  REQUIRE(!summary.each.empty());
  CHECK(summary.each[0].linear_iterations > 0);
  check_no_block_lists(problem.structure());

  // What a solver that forms the matrix lists.
  const auto pairs = static_cast<std::size_t>(turbomap::block_finder::count_pairs(problem.structure()));
  problem.data().need_blocks(ctx.policy());
  CHECK(problem.structure().pairs.size() == pairs);
  const std::size_t size = pairs * sizeof(turbomap::slot_pair);
  CHECK(bytes() - before >= taken + size);
  return {taken, size};
}

/// Whether pcg was asked for, or chosen for the number of pairs, or for how few blocks are empty.
template <class Policy, class Bytes>
void check_pcg_lists_no_pairs(const Policy& policy, std::pmr::memory_resource* resource, Bytes bytes) {
  for (int why = 0; why < 3; ++why) {
    CAPTURE(why);
    turbomap::adjustment_options options = in_float64();
    options.max_iterations = 2;
    if (why == 0) options.solver = turbomap::reduced_solver::pcg;
    if (why == 1) options.pair_limit = 1000;
    if (why == 2) options.dense_limit = 0, options.sparse_limit = 1 << 20;
    const pcg_memory few = memory_of_pcg(policy, resource, bytes, 600, options);
    const pcg_memory twice = memory_of_pcg(policy, resource, bytes, 1200, options);
    CHECK(2 * twice.pairs > 7 * few.pairs);
    CHECK(twice.taken < 3 * few.taken);
    CHECK(twice.taken < twice.pairs);
  }
}

}  // namespace turbomap_test
