// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// The host half of the mixed user: the same mapper, in a .cpp.

#include <thrust/execution_policy.h>

#include "mapper.hpp"
#include "mixed.hpp"

my::plans my::map_on_host(const std::vector<frame>& frames) {
  mapper<std::decay_t<decltype(thrust::seq)>> m(thrust::seq);
  for (const frame& f : frames) m.insert(f);
  return m.map();
}
