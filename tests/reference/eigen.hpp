// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// Eigen for the oracles, without one false alarm: g++ 12 takes its own AVX-512 intrinsics for uninitialised where Eigen
/// uses them. Functions that decompose matrices stand between the two macros.

#if defined(__GNUC__) && !defined(__clang__)
#define TURBOMAP_TEST_EIGEN_BEGIN                                                            \
  _Pragma("GCC diagnostic push") _Pragma("GCC diagnostic ignored \"-Wmaybe-uninitialized\"") \
      _Pragma("GCC diagnostic ignored \"-Wuninitialized\"")
#define TURBOMAP_TEST_EIGEN_END _Pragma("GCC diagnostic pop")
#else
#define TURBOMAP_TEST_EIGEN_BEGIN
#define TURBOMAP_TEST_EIGEN_END
#endif

TURBOMAP_TEST_EIGEN_BEGIN
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>
TURBOMAP_TEST_EIGEN_END
