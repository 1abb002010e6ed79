// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Names for what a profiler of NVIDIA shows on its time line (NVTX). Compile every file of a program with -DTURBOMAP_WITH_NVTX=1,
/// with the headers of the CUDA toolkit; then keyframes, stages and searches are named ranges of the domain "turbomap", under any
/// policy and compiler. Without the macro nothing is left of it.

#include "config.hpp"

#if TURBOMAP_WITH_NVTX
#include <nvtx3/nvtx3.hpp>
#endif

TURBOMAP_BEGIN_NAMESPACE

#if TURBOMAP_WITH_NVTX

namespace detail {

struct nvtx_domain {
  static constexpr const char* name = "turbomap";
};

}  // namespace detail

/// From here to the end of the block. Ranges of a thread nest.
class named_range {
 public:
  /// \param name  must stay valid: a literal
  explicit named_range(const char* name) : range_(name) {}

 private:
  nvtx3::scoped_range_in<detail::nvtx_domain> range_;
};

#else

/// Without NVTX: nothing.
class [[maybe_unused]] named_range {
 public:
  /// Does nothing.
  constexpr explicit named_range(const char*) {}
};

#endif

TURBOMAP_END_NAMESPACE
