// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Evaluates a function object once per case where a policy computes: the same arithmetic on the host and on a device.

#include <cstddef>
#include <vector>

#include <turbomap/array.hpp>
#include <turbomap/context.hpp>
#include <turbomap/packed_inputs.hpp>
#include <turbomap/parallel.hpp>

namespace turbomap_test {

/// Index = case.
template <class Function, class Case, class Result>
struct evaluate_one {
  const Case* cases;
  Result* results;

  TURBOMAP_HD void operator()(int i) const { Function{}(cases[i], results[i]); }
};

/// [case] what `Function{}(case, result)` writes. Cases and results are plain data.
template <class Function, class Result, class Policy, class Case>
std::vector<Result> evaluate(const Policy& policy, const std::vector<Case>& cases) {
  turbomap::context<Policy> ctx{policy};
  turbomap::array<std::byte, turbomap::memory_of_t<Policy>> memory;
  turbomap::array<Result, turbomap::memory_of_t<Policy>> results;
  turbomap::packed_inputs inputs;
  const auto given = inputs.place<Case>(cases.size());
  ctx.begin_call();
  const auto block = ctx.begin_upload(memory, inputs.bytes());
  given.copy(block, cases.data());
  ctx.send(block, inputs.bytes());
  results.resize_discard(cases.size());
  turbomap::for_each_index(ctx.policy(), static_cast<int>(cases.size()),
                           evaluate_one<Function, Case, Result>{given.resident(block), results.data()});
  std::vector<Result> host(cases.size());
  turbomap::copy_out(ctx.policy(), host.data(), results.data(), host.size() * sizeof(Result));
  ctx.synchronize();
  return host;
}

}  // namespace turbomap_test
