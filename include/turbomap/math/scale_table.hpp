// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The scales of the image pyramid as tables: every stage that decides by octave looks them up here.

#include "../config.hpp"
#include "../types.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// Octaves are bytes: a table has a row for every one, whatever the pyramid's levels.
inline constexpr int scale_table_size = 256;

/// scale[o] = scale_factor^o and, if not null, sigma2[o] = scale_factor^(2 o) px^2, scale_table_size of each. Computed in
/// float and level by level, as [ORB-SLAM3] does: the tables decide, so they must be the recorded ones.
inline void fill_scales(const pyramid& p, float* scale, float* sigma2) {
  float s = 1;
  for (int o = 0; o < scale_table_size; ++o) {
    scale[o] = s;
    if (sigma2 != nullptr) sigma2[o] = s * s;
    s *= p.scale_factor;
  }
}

TURBOMAP_END_NAMESPACE
