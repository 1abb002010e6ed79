// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Which version of the library these headers are. Before 1.0 a minor version may change an interface: CHANGELOG.md.

/// Major, minor and patch number: macros, for code that must compile with several versions.
#define TURBOMAP_VERSION_MAJOR 0
/// Minor number.
#define TURBOMAP_VERSION_MINOR 1
/// Patch number.
#define TURBOMAP_VERSION_PATCH 0
/// To compare: 1.2.3 is 10203.
#define TURBOMAP_VERSION (TURBOMAP_VERSION_MAJOR * 10000 + TURBOMAP_VERSION_MINOR * 100 + TURBOMAP_VERSION_PATCH)
