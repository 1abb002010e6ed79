// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0

/// \file
/// All of the library without a component: it must not need Eigen, OpenMP or TBB.

#include <turbomap/turbomap.hpp>

#include "frame.hpp"

int main() { return my::make_frames().empty() ? 1 : 0; }
