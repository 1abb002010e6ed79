// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Bisection, on the host and on a device.

#include "config.hpp"

TURBOMAP_BEGIN_NAMESPACE

/// The first i of [begin, end) with holds(i), or end. Once it holds it holds for all that follow. O(log(end - begin)).
template <class Index, class Holds>
TURBOMAP_HD Index first_where(Index begin, Index end, const Holds& holds) {
  while (begin < end) {
    const Index middle = begin + (end - begin) / 2;
    if (holds(middle))
      end = middle;
    else
      begin = middle + 1;
  }
  return begin;
}

TURBOMAP_END_NAMESPACE
