// SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// \file
/// The only file that asks the compiler what it is. Everything else uses the names defined here.

#if __cplusplus < 201703L
#error "turbomap: C++17 is needed. A -std=c++11 or -std=c++14 in CMAKE_CXX_FLAGS comes before what a target asks for."
#endif

#include "version.hpp"

#if defined(__CUDACC__)
#define TURBOMAP_HAS_CUDA 1
#define TURBOMAP_HD __host__ __device__
#else
#define TURBOMAP_HAS_CUDA 0
#define TURBOMAP_HD
#endif

// Of an argument of a kernel that is only read: no thread copies it. CUDA knows it since 11.7; before, kernels do without.
#if TURBOMAP_HAS_CUDA && defined(__CUDACC_VER_MAJOR__) && __CUDACC_VER_MAJOR__ * 100 + __CUDACC_VER_MINOR__ >= 1107
#define TURBOMAP_GRID_CONSTANT __grid_constant__
#else
#define TURBOMAP_GRID_CONSTANT
#endif

// 1 in every file of a program: what takes time is named for profilers of NVIDIA (named_range.hpp).
#if !defined(TURBOMAP_WITH_NVTX)
#define TURBOMAP_WITH_NVTX 0
#endif

// 1: host adjustments give the same bits on every x86-64 processor, from g++ and clang++, in C++ files (docs/adjustment.md, The
// same bits; CUDA files compute with one lane, in another order). The compiler has to be told too, which the CMake option of
// this name does: -ffp-contract=off, and g++ -fno-tree-slp-vectorize.
#if !defined(TURBOMAP_REPRODUCIBLE)
#define TURBOMAP_REPRODUCIBLE 0
#endif

#if !TURBOMAP_HAS_CUDA && !defined(THRUST_DEVICE_SYSTEM)
#error \
    "turbomap: THRUST_DEVICE_SYSTEM is not defined, and without it Thrust assumes CUDA. Link the CMake target \
turbomap::turbomap, or compile with -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP (or _OMP, _TBB)."
#endif

// A function with one compiled body: neither inlined nor copied for a caller. Compilers choose per copy which products they
// fuse with a sum, so two copies of one function may differ in the last bit; whoever calls this one gets the same bits.
#if TURBOMAP_HAS_CUDA
#define TURBOMAP_ONE_BODY __attribute__((noinline, noclone))
#elif defined(__GNUC__) && !defined(__clang__)
#define TURBOMAP_ONE_BODY __attribute__((noipa))
#elif defined(__clang__)
#define TURBOMAP_ONE_BODY __attribute__((noinline))
#else
#define TURBOMAP_ONE_BODY
#endif

// A program may mix .cpp and .cu files, and files compiled for different processors: code that depends on the compiler
// or its target lives in an inline namespace named after both, so that the linker never merges two versions of it.
// Plain data (types, options, plans, views) and the traits that users specialise live in `turbomap` itself. Details of code
// are in `detail` inside the inline namespace, those of plain data in `turbomap::plain_detail`: a namespace of one name in
// both places is ambiguous (nvcc 11.8).
#define TURBOMAP_DETAIL_JOIN2(a, b) a##b
#define TURBOMAP_DETAIL_JOIN(a, b) TURBOMAP_DETAIL_JOIN2(a, b)
#if TURBOMAP_HAS_CUDA
#define TURBOMAP_DETAIL_COMPILER nvcc
#else
#define TURBOMAP_DETAIL_COMPILER host
#endif
#if defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__)
#define TURBOMAP_DETAIL_TARGET _avx512
#elif defined(__AVX2__) && defined(__FMA__)
#define TURBOMAP_DETAIL_TARGET _avx2
#elif defined(__POPCNT__)
#define TURBOMAP_DETAIL_TARGET _popcnt
#else
#define TURBOMAP_DETAIL_TARGET _base
#endif
#if TURBOMAP_REPRODUCIBLE
#define TURBOMAP_DETAIL_NUMBERS _reproducible
#else
#define TURBOMAP_DETAIL_NUMBERS
#endif
// Bytes of the vectors that math/pack.hpp computes with; 0: plain scalars. It follows the names above, so that one version
// of a function never meets the other.
#if TURBOMAP_HAS_CUDA || !defined(__GNUC__)
#define TURBOMAP_VECTOR_BYTES 0
#elif (defined(__AVX2__) && defined(__FMA__)) || (defined(__AVX512VPOPCNTDQ__) && defined(__AVX512VL__))
#define TURBOMAP_VECTOR_BYTES 32
#elif defined(__SSE2__) || defined(__ARM_NEON)
#define TURBOMAP_VECTOR_BYTES 16
#else
#define TURBOMAP_VECTOR_BYTES 0
#endif
#if TURBOMAP_VECTOR_BYTES > 0 && defined(__x86_64__)
#define TURBOMAP_X86_VECTORS 1
#else
#define TURBOMAP_X86_VECTORS 0
#endif
#define TURBOMAP_ABI \
  TURBOMAP_DETAIL_JOIN(TURBOMAP_DETAIL_COMPILER, TURBOMAP_DETAIL_JOIN(TURBOMAP_DETAIL_TARGET, TURBOMAP_DETAIL_NUMBERS))

#define TURBOMAP_BEGIN_NAMESPACE \
  namespace turbomap {           \
  inline namespace TURBOMAP_ABI {
#define TURBOMAP_END_NAMESPACE \
  }                            \
  }
