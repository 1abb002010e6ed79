# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# How this repository's own programs, examples and tests are compiled. None of it reaches a consumer.

if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

# The oldest standard that we promise, whatever this compiler's default is.
set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CUDA_STANDARD 17)

set(TURBOMAP_TEST_PREFIX "" CACHE STRING "Prefix of the names of the tests, to tell several builds apart in one ctest run")

# Recorded data that some tests and examples read; they skip themselves without it. An empty value leaves the choice to the
# environment variable TURBOMAP_DATA_DIR when the tests run.
set(turbomap_data_default "$ENV{TURBOMAP_DATA_DIR}")
if(NOT turbomap_data_default)
  cmake_path(SET turbomap_data_default NORMALIZE "${PROJECT_SOURCE_DIR}/../shared/data")
  if(NOT IS_DIRECTORY "${turbomap_data_default}")
    set(turbomap_data_default "")
  endif()
endif()
set(TURBOMAP_DATA_DIR "${turbomap_data_default}" CACHE PATH "Folder of the recorded data")

# Every host policy that this machine has is in one program: sequential always, OpenMP and TBB where they are found. C++ files
# ask by these macros (tests through tests/support/policies.hpp); nvcc compiles neither.
find_package(OpenMP QUIET COMPONENTS CXX)
find_package(TBB CONFIG QUIET)
set(TURBOMAP_WITH_OPENMP ${OpenMP_CXX_FOUND})
set(TURBOMAP_WITH_TBB ${TBB_FOUND})

add_library(turbomap_developer INTERFACE)
target_link_libraries(turbomap_developer INTERFACE turbomap::turbomap Threads::Threads)
if(TURBOMAP_WITH_OPENMP)
  target_link_libraries(turbomap_developer INTERFACE OpenMP::OpenMP_CXX)
  target_compile_definitions(turbomap_developer INTERFACE "$<$<COMPILE_LANGUAGE:CXX>:TURBOMAP_WITH_OPENMP=1>")
else()
  message(STATUS "turbomap: no tests and no programs under the policy omp: OpenMP was not found")
endif()
if(TURBOMAP_WITH_TBB)
  target_link_libraries(turbomap_developer INTERFACE TBB::tbb)
  target_compile_definitions(turbomap_developer INTERFACE "$<$<COMPILE_LANGUAGE:CXX>:TURBOMAP_WITH_TBB=1>")
else()
  message(STATUS "turbomap: no tests and no programs under the policy tbb: TBB was not found")
endif()

# The oracles: tests and tools compare with them. They include the library, each other and Eigen, nothing of tests or tools.
if((TURBOMAP_BUILD_TESTS OR TURBOMAP_BUILD_TOOLS) AND NOT TARGET turbomap::eigen)
  message(FATAL_ERROR "turbomap: the tests and the tools need Eigen 3.4, which was not found; the library does not")
endif()
add_library(turbomap_reference INTERFACE)
target_include_directories(turbomap_reference INTERFACE "${PROJECT_SOURCE_DIR}/tests")
target_link_libraries(turbomap_reference INTERFACE turbomap_developer $<TARGET_NAME_IF_EXISTS:turbomap::eigen>)

# The parts of the programs in tools/, for the programs themselves and for their tests.
add_library(turbomap_tools INTERFACE)
target_include_directories(turbomap_tools INTERFACE "${PROJECT_SOURCE_DIR}/tools")
target_link_libraries(turbomap_tools INTERFACE turbomap_reference)

set(turbomap_is_cxx "$<COMPILE_LANG_AND_ID:CXX,GNU,Clang,AppleClang>")
set(turbomap_is_nvcc "$<COMPILE_LANG_AND_ID:CUDA,NVIDIA>")
target_compile_options(turbomap_developer INTERFACE
  "$<${turbomap_is_cxx}:-Wall;-Wextra;-Wpedantic>"
  # 20012: Eigen's defaulted functions with an execution space; harmless. 20011 and 20014 (a host function called on the
  # device) are never suppressed.
  "$<${turbomap_is_nvcc}:-diag-suppress=20012;-Xcompiler=-Wall,-Wextra>")
if(TURBOMAP_WERROR)
  target_compile_options(turbomap_developer INTERFACE
    "$<${turbomap_is_cxx}:-Werror>" "$<${turbomap_is_nvcc}:-Werror=cross-execution-space-call>")
endif()
if(TURBOMAP_NATIVE_ARCH)
  # For nvcc's host code as well: Eigen aligns its types as the processor likes, so both must mean the same one.
  target_compile_options(turbomap_developer INTERFACE
    "$<${turbomap_is_cxx}:-march=native>" "$<${turbomap_is_nvcc}:-Xcompiler=-march=native>")
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 14)
    # g++ 12 and 13 warn of their own AVX-512 intrinsics (GCC bug 105593) wherever Eigen inlines them. The builds for any
    # processor keep these warnings.
    target_compile_options(turbomap_developer INTERFACE
      "$<${turbomap_is_cxx}:-Wno-uninitialized;-Wno-maybe-uninitialized;-Wno-array-bounds>")
  endif()
endif()
if(TURBOMAP_SANITIZE)
  set(turbomap_sanitizer_flags -fsanitize=${TURBOMAP_SANITIZE} -fno-omit-frame-pointer)
  target_compile_options(turbomap_developer INTERFACE "$<${turbomap_is_cxx}:${turbomap_sanitizer_flags}>")
  target_link_options(turbomap_developer INTERFACE ${turbomap_sanitizer_flags})
endif()

# turbomap_compile_quickly(TARGET): a release build's -O3 becomes -O1, for what runs for moments.
function(turbomap_compile_quickly target)
  if(CMAKE_CXX_FLAGS_RELEASE MATCHES "-O[23]")
    target_compile_options(${target} PRIVATE "$<$<AND:$<CONFIG:Release>,${turbomap_is_cxx}>:-O1>")
  endif()
endfunction()

option(TURBOMAP_LINK_PROGRAMS "Off, in a build with CUDA: of the programs but turbomap-bench, what is for a device is compiled, and nothing runs" ON)
if(TURBOMAP_WITH_CUDA AND NOT TURBOMAP_LINK_PROGRAMS AND NOT TURBOMAP_HOST_TESTS)
  set(turbomap_programs_are_only_compiled ON)
endif()

# turbomap_add_program(NAME SOURCE... [CUDA_SOURCES SOURCE.cu...])
# An executable <build>/bin/NAME. In a build with CUDA, CUDA_SOURCES are part of it and TURBOMAP_PROGRAM_WITH_CUDA=1 is
# defined in all its files. nvcc is never given a .cpp: it cannot compile Thrust's OpenMP backend there, so a .cu file names
# no OpenMP policy.
function(turbomap_add_program name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "CUDA_SOURCES")
  if(turbomap_programs_are_only_compiled)
    add_library(${name} OBJECT ${arg_CUDA_SOURCES})
    target_link_libraries(${name} PRIVATE turbomap_developer)
    target_compile_definitions(${name} PRIVATE TURBOMAP_PROGRAM_WITH_CUDA=1)
    return()
  endif()
  add_executable(${name} ${arg_UNPARSED_ARGUMENTS})
  target_link_libraries(${name} PRIVATE turbomap_developer)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${turbomap_BINARY_DIR}/bin")
  if(TURBOMAP_WITH_CUDA)
    target_sources(${name} PRIVATE ${arg_CUDA_SOURCES})
    target_link_libraries(${name} PRIVATE CUDA::cudart_static)
    target_compile_definitions(${name} PRIVATE TURBOMAP_PROGRAM_WITH_CUDA=1)
  endif()
endfunction()
