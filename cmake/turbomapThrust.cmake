# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# Finds Thrust (the target Thrust::Thrust) for this project and, installed beside turbomapConfig.cmake, for its users:
# what the project has already; CMAKE_PREFIX_PATH; a CUDA toolkit's; the system's (e.g. libthrust-dev 1.17 of Debian 12).
# A macro, because find_package() must leave its variables with the caller.

macro(turbomap_find_thrust)
  if(NOT TARGET Thrust::Thrust)
    # A toolkit keeps its packages in lib64/cmake, where find_package() does not look by itself on Debian.
    set(_turbomap_toolkits "${CUDAToolkit_ROOT}" "$ENV{CUDAToolkit_ROOT}" "$ENV{CUDA_HOME}" "$ENV{CUDA_PATH}")
    find_program(TURBOMAP_NVCC nvcc PATHS /usr/local/cuda/bin)
    mark_as_advanced(TURBOMAP_NVCC)
    foreach(_turbomap_nvcc IN ITEMS "${CMAKE_CUDA_COMPILER}" "${TURBOMAP_NVCC}")
      if(_turbomap_nvcc)
        file(REAL_PATH "${_turbomap_nvcc}" _turbomap_toolkit)
        cmake_path(GET _turbomap_toolkit PARENT_PATH _turbomap_toolkit)
        cmake_path(GET _turbomap_toolkit PARENT_PATH _turbomap_toolkit)
        list(APPEND _turbomap_toolkits "${_turbomap_toolkit}")
      endif()
    endforeach()
    list(APPEND _turbomap_toolkits /usr/local/cuda)
    list(REMOVE_ITEM _turbomap_toolkits "")
    list(REMOVE_DUPLICATES _turbomap_toolkits)
    set(_turbomap_hints "")
    foreach(_turbomap_toolkit IN LISTS _turbomap_toolkits)
      foreach(_turbomap_lib IN ITEMS lib64 lib targets/${CMAKE_SYSTEM_PROCESSOR}-linux/lib)
        list(APPEND _turbomap_hints "${_turbomap_toolkit}/${_turbomap_lib}/cmake")
      endforeach()
    endforeach()
    find_package(Thrust CONFIG QUIET HINTS ${_turbomap_hints})
    if(NOT TARGET Thrust::Thrust)
      find_package(CCCL CONFIG QUIET HINTS ${_turbomap_hints})
    endif()
  endif()
  if(TARGET Thrust::Thrust)
    set(turbomap_thrust_found ON)
  else()
    set(turbomap_thrust_found OFF)
    if("${ARGV0}" STREQUAL "REQUIRED")
      message(FATAL_ERROR "turbomap: Thrust was not found. Install libthrust-dev (Debian, Ubuntu) or a CUDA toolkit, or "
                          "name the place of thrust-config.cmake or cccl-config.cmake in CMAKE_PREFIX_PATH.")
    endif()
  endif()
endmacro()
