// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The adjustments that TURBOMAP_PRECOMPILED lists, compiled for all other files of the program.
#if defined(TURBOMAP_INSTANCE) && !defined(TURBOMAP_PRECOMPILED_IS_HERE)
#error "turbomap: headers of the library came before this file (a precompiled header, a unity build): it would compile nothing"
#endif
#define TURBOMAP_PRECOMPILED_IS_HERE

#include <turbomap/adjustment/levenberg_marquardt.hpp>
