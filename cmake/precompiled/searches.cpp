// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

// The stores and searches that TURBOMAP_PRECOMPILED lists, compiled for all other files of the program.
#if defined(TURBOMAP_INSTANCE) && !defined(TURBOMAP_PRECOMPILED_IS_HERE)
#error "turbomap: headers of the library came before this file (a precompiled header, a unity build): it would compile nothing"
#endif
#define TURBOMAP_PRECOMPILED_IS_HERE

#include <turbomap/appearance/update_appearance.hpp>
#include <turbomap/fusion/projection_search.hpp>
#include <turbomap/matching/correspondence_search.hpp>
#include <turbomap/matching/point_creation.hpp>
#include <turbomap/matching/track_creation.hpp>
#include <turbomap/store/keyframe_store.hpp>
