// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The policy that a context of thrust::seq keeps: one thread, on the host. The type of thrust::seq is only named here, since its
/// header brings some hundreds of others with the Thrust of CUDA 13; who passes it includes that.

#include <thrust/system/detail/sequential/execution_policy.h>

THRUST_NAMESPACE_BEGIN
namespace detail {
struct seq_t;
}  // namespace detail
THRUST_NAMESPACE_END

namespace turbomap {

/// A policy of Thrust: its algorithms take it, where their headers are included. What a context has in the place of thrust::seq.
struct sequential_policy : thrust::system::detail::sequential::execution_policy<sequential_policy> {
  /// The policy.
  constexpr sequential_policy() = default;
  /// There is but one, so thrust::seq is it.
  // NOLINTNEXTLINE(google-explicit-constructor)
  constexpr sequential_policy(const thrust::detail::seq_t&) {}
};

}  // namespace turbomap
