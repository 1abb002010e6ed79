// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which instances of the algorithms this program compiles in files of their own (cmake/precompiled), so that its other files
/// need not: they are then declared as `extern template`. None, unless TURBOMAP_PRECOMPILED names the header that lists
/// them; see docs/cmake.md and precompiled_types.hpp.

#include "config.hpp"

// nvcc's instances are others (config.hpp), and compiled in each file.
#if defined(TURBOMAP_PRECOMPILED) && !TURBOMAP_HAS_CUDA
#include TURBOMAP_PRECOMPILED
#else
#define TURBOMAP_PRECOMPILED_STORES(instantiate)
#define TURBOMAP_PRECOMPILED_SEARCHES(instantiate)
#define TURBOMAP_PRECOMPILED_ADJUSTMENTS(instantiate)
#endif

// What an instance is declared with, here and, where it is compiled, there.
#if defined(TURBOMAP_PRECOMPILED_IS_HERE)
#define TURBOMAP_INSTANCE template
#else
#define TURBOMAP_INSTANCE extern template
#endif
