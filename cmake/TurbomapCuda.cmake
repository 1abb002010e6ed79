# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# Sets TURBOMAP_WITH_CUDA: whether our own tests and programs are compiled for CUDA too. The target turbomap::turbomap does
# not depend on it. As a part of another project AUTO never enables a language: we use CUDA when that project does.

set(TURBOMAP_WITH_CUDA OFF)
if(NOT (TURBOMAP_BUILD_TESTS OR TURBOMAP_BUILD_EXAMPLES OR TURBOMAP_BUILD_TOOLS))
  return()
endif()
if(TURBOMAP_CUDA STREQUAL "AUTO")
  if(PROJECT_IS_TOP_LEVEL)
    include(CheckLanguage)
    check_language(CUDA)
  endif()
  if(CMAKE_CUDA_COMPILER)
    set(TURBOMAP_WITH_CUDA ON)
  endif()
elseif(TURBOMAP_CUDA)
  set(TURBOMAP_WITH_CUDA ON)
endif()
if(TURBOMAP_WITH_CUDA)
  if(TURBOMAP_FULL_MATRIX)
    set(CMAKE_CUDA_ARCHITECTURES 75 80 86 87 89 90)
  endif()
  enable_language(CUDA)
  find_package(CUDAToolkit REQUIRED)
endif()
