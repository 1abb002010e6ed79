// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Asks memory for what is read soon, in functions that do nothing else. g++ takes a function of nothing but
/// `__builtin_prefetch` for one without effects, and removes calls of it that it has not inlined by then.

namespace turbomap {

/// Asks memory for the cache line at an address; any address will do.
inline void prefetch_line(const void* at) {
#if defined(__GNUC__)
  __builtin_prefetch(at);
  asm volatile("");  // no instruction, but an effect: whatever calls this keeps it
#else
  (void)at;
#endif
}

}  // namespace turbomap
