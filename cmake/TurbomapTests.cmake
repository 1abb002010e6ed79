# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# How the tests below tests/ and tools/tests/ are built.
#   test_NAME.cpp   the test test_NAME: every host policy in it
#   test_NAME.cu    the test test_NAME_device: the same under nvcc, on a CUDA device; only in a build with CUDA
# A program that cannot run here (no data, no device) ends with 77, which ctest reports as skipped.

option(TURBOMAP_SOURCE_TESTS "Tests that look at the source alone; a second build does not need them again" ON)
option(TURBOMAP_RECORDED_TESTS "Build the tests on recorded data" ON)
option(TURBOMAP_PRECOMPILED_TESTS "Parse the headers that all tests include once" OFF)
option(TURBOMAP_GROUPED_TESTS "Compile a few tests as one unit: half of each is headers and templates that they share" OFF)
set(TURBOMAP_TEST_FILTER "" CACHE STRING "Build only the tests whose name matches this regular expression")
set(TURBOMAP_UNRUN_TESTS "" CACHE STRING "Build the tests whose name matches this regular expression, and leave them to another build to run")

find_package(doctest CONFIG REQUIRED)
find_package(nlohmann_json CONFIG QUIET)
find_package(OpenCV QUIET COMPONENTS core imgproc imgcodecs calib3d features2d)
find_package(Sophus CONFIG QUIET)
find_package(manif CONFIG QUIET)

# turbomap_add_test_main(NAME): the object library NAME with the main function, and all that every test links.
function(turbomap_add_test_main name)
  add_library(${name} OBJECT "${turbomap_SOURCE_DIR}/tests/support/main.cpp")
  target_link_libraries(${name} PUBLIC turbomap_reference doctest::doctest)
  turbomap_compile_quickly(${name})
endfunction()
turbomap_add_test_main(turbomap_test_main)
if(TURBOMAP_WITH_CUDA)
  turbomap_add_test_main(turbomap_test_main_device)
  target_compile_definitions(turbomap_test_main_device PRIVATE TURBOMAP_TEST_NEEDS_DEVICE=1)
  target_link_libraries(turbomap_test_main_device PUBLIC CUDA::cudart_static)
endif()

# What every test reads before it comes to its subject: parsed once. The presets asan, tsan and cuda go without, and find a
# missing include, where each test is a unit of its own.
if(TURBOMAP_PRECOMPILED_TESTS)
  file(CONFIGURE OUTPUT "${turbomap_BINARY_DIR}/test_headers.cpp" CONTENT "" @ONLY)
  add_library(turbomap_test_headers OBJECT EXCLUDE_FROM_ALL "${turbomap_BINARY_DIR}/test_headers.cpp")
  target_link_libraries(turbomap_test_headers PRIVATE turbomap_reference doctest::doctest)
  turbomap_compile_quickly(turbomap_test_headers)
  target_precompile_headers(turbomap_test_headers PRIVATE <algorithm> <array> <cmath> <cstdint> <cstring> <functional> <limits>
    <map> <random> <set> <stdexcept> <string> <utility> <vector> <doctest/doctest.h> <thrust/execution_policy.h>
    "${turbomap_SOURCE_DIR}/tests/support/policies.hpp")
endif()

# Thrust binds references to null in its own code, so the sanitizer of undefined behaviour must be able to go on after what
# the list names; for all else it stops. One OpenMP thread under the thread sanitizer: see tests/support/main.cpp. Two under that of addresses,
# where tests run side by side: threads that wait by spinning made sixteen tests on sixteen cores ten times as slow.
set(turbomap_test_environment "")
if(TURBOMAP_DATA_DIR)
  list(APPEND turbomap_test_environment "TURBOMAP_DATA_DIR=${TURBOMAP_DATA_DIR}")
endif()
if(TURBOMAP_SANITIZE MATCHES "undefined")
  list(APPEND turbomap_test_environment
       "UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1:suppressions=${turbomap_SOURCE_DIR}/tests/support/ubsan.supp")
endif()
if(TURBOMAP_SANITIZE MATCHES "address")
  list(APPEND turbomap_test_environment "OMP_NUM_THREADS=2" "OMP_WAIT_POLICY=passive")
endif()
if(TURBOMAP_SANITIZE MATCHES "thread")
  list(APPEND turbomap_test_environment
       "OMP_NUM_THREADS=1" "TSAN_OPTIONS=suppressions=${turbomap_SOURCE_DIR}/tests/support/tsan.supp")
endif()

# These are about what an optimiser may do. All others, also those on recorded data, run for seconds at most, and compile in
# half to two thirds of the time when they are optimised little.
set(turbomap_optimised_tests "same_bits|same_map|same_runs|strict|atomic|threads")

# Without optimisation (the preset asan, and the build of clang++ in .ci/run) each of these runs for up to two minutes: longer
# than its compilation with optimisation takes more.
set(turbomap_busy_tests "correspondence_search|epipolar_order|track_creation|filters|triangulation|covariance")
string(APPEND turbomap_busy_tests "|local_map_search|simulation|batch_bound|schur_system|interleavings|test_preintegration")
string(APPEND turbomap_busy_tests "|initialise|point_uncertainty|global_adjustment|projection_search|byte_budget|map_mirror")
string(APPEND turbomap_busy_tests "|adjustment_memory|duplicate_fusion|same_bits|extraction_opencv|keypoint_offset|uncertain_points")
string(APPEND turbomap_busy_tests "|cholesky|motion_only|error_parts|bad_rows|border_prior|inertial_window")
set(turbomap_large_tests "bad_rows")  # where optimisation takes minutes under a sanitizer, and saves seconds

# turbomap_test_kind(SOURCE RESULT): 'optimised', 'busy', or 'quick', which is all others.
function(turbomap_test_kind source result)
  cmake_path(GET source FILENAME name)
  set(kind quick)
  if(name MATCHES "\\.cu$")
    # nvcc optimises as it is told for all
  elseif(TURBOMAP_UNRUN_TESTS AND name MATCHES "${TURBOMAP_UNRUN_TESTS}")
    # nothing that takes its time
  elseif(TURBOMAP_SANITIZE AND name MATCHES "${turbomap_large_tests}")
    # as the build's flags say
  elseif(name MATCHES "${turbomap_busy_tests}" AND (CMAKE_CXX_FLAGS_RELEASE STREQUAL "-O0" OR TURBOMAP_SANITIZE))
    set(kind busy)
  elseif(name MATCHES "${turbomap_optimised_tests}")
    set(kind optimised)
  endif()
  set(${result} ${kind} PARENT_SCOPE)
endfunction()

# turbomap_add_test_program(NAME SOURCE KIND LIBRARY...): SOURCE is one test, or several as one unit.
function(turbomap_add_test_program name source kind)
  add_executable(${name} "${source}")
  if(source MATCHES "\\.cu$")
    target_link_libraries(${name} PRIVATE turbomap_test_main_device ${ARGN})
    if(NOT TURBOMAP_LINK_PROGRAMS AND NOT TURBOMAP_FULL_MATRIX)
      # Nothing runs, and ptxas takes two fifths of the time. It sees the library's kernels in the programs' units.
      list(TRANSFORM CMAKE_CUDA_ARCHITECTURES REPLACE "^([0-9]+)(-real)?$" "\\1-virtual")
      set_target_properties(${name} PROPERTIES CUDA_ARCHITECTURES "${CMAKE_CUDA_ARCHITECTURES}")
    endif()
    return()
  endif()
  target_link_libraries(${name} PRIVATE turbomap_test_main ${ARGN})
  if(NOT kind STREQUAL "optimised")
    turbomap_compile_quickly(${name})
  endif()
  if(kind STREQUAL "busy")
    target_compile_options(${name} PRIVATE "$<${turbomap_is_cxx}:-O1>")
  endif()
  if(TURBOMAP_PRECOMPILED_TESTS AND kind STREQUAL "quick")  # a header is precompiled for one level of optimisation
    target_precompile_headers(${name} REUSE_FROM turbomap_test_headers)
  endif()
endfunction()

# turbomap_add_test(SOURCE LABEL LIBRARY...): the test that is named after SOURCE. Labelled 'host' or 'recorded'; 'device'
# where SOURCE is a .cu file.
function(turbomap_add_test source label)
  cmake_path(GET source STEM name)
  turbomap_test_kind("${source}" kind)
  if(source MATCHES "\\.cu$")
    string(APPEND name _device)
    set(label device)
  endif()
  turbomap_add_test_program(${name} "${source}" ${kind} ${ARGN})
  turbomap_name_test(${name} "${label}" ${name})
endfunction()

# turbomap_name_test(NAME LABEL COMMAND...): COMMAND is the test NAME, of which ctest knows how it ends and what it needs.
function(turbomap_name_test name label)
  if(TURBOMAP_UNRUN_TESTS AND name MATCHES "${TURBOMAP_UNRUN_TESTS}")
    message(STATUS "turbomap: ${name} is built and not run")
    return()
  endif()
  if(TURBOMAP_SANITIZE AND name STREQUAL "test_interleavings")  # four minutes for each of its cases: side by side
    turbomap_name_test(${name}_of_the_map "${label}" ${ARGN} --last=1)
    turbomap_name_test(${name}_of_a_copy "${label}" ${ARGN} --first=2 --last=2)
    turbomap_name_test(${name}_of_the_rest "${label}" ${ARGN} --first=3)
    return()
  endif()
  set(test ${TURBOMAP_TEST_PREFIX}${name})
  add_test(NAME ${test} COMMAND ${ARGN})
  set_tests_properties(${test} PROPERTIES TIMEOUT 1200 SKIP_RETURN_CODE 77 LABELS "${label}")
  if(name MATCHES "interleavings|uncertain_points")
    set_tests_properties(${test} PROPERTIES COST 600)  # the longest begin first, also where ctest has not timed them yet
  endif()
  set_property(TEST ${test} PROPERTY ENVIRONMENT "${turbomap_test_environment}")
  if(name MATCHES "local_mapper|time_budget|threads|context")  # they look at the clock, or at threads of their own
    set_property(TEST ${test} PROPERTY RUN_SERIAL ON)
  endif()
endfunction()

# How many tests, on the host of one folder, are one unit at most: more take too much memory, and would leave a core without work at the end.
set(turbomap_group.cpp 8)
set(turbomap_group.cu 6)

# turbomap_test_place(SOURCE RESULT): where SOURCE stands in a unit of several tests. 'inside' a namespace of its own; 'last', and
# outside, where it adds to a namespace of the library's or of the tests'; 'alone' where it defines a macro, asks for a header by
# the preprocessor or includes another test.
function(turbomap_test_place source result)
  file(STRINGS "${source}" alone LIMIT_COUNT 1 REGEX "^#define|^#if __has_include|^#include \".*\\.cpp\"")
  file(STRINGS "${source}" last LIMIT_COUNT 1 REGEX "^namespace turbomap|^struct turbomap::")
  if(alone)
    set(${result} alone PARENT_SCOPE)
  elseif(last)
    set(${result} last PARENT_SCOPE)
  else()
    set(${result} inside PARENT_SCOPE)
  endif()
endfunction()

# turbomap_add_grouped_tests(LABEL KIND LIBRARIES FILE...): the tests of the FILEs as one program, compiled as one unit: first
# what any of them includes, then each in its place. Each is a test of its own all the same, by doctest's choice of a file, so
# a test case stands in such a file and not in a header.
function(turbomap_add_grouped_tests label kind libraries)
  list(GET ARGN 0 first)
  cmake_path(GET first STEM program)
  cmake_path(GET first EXTENSION LAST_ONLY extension)
  set(suffix "")
  if(extension STREQUAL ".cu")
    set(suffix _device)
    set(label device)
  endif()
  string(APPEND program _and_more${suffix})
  set(included "")
  set(parts "")
  foreach(source IN LISTS ARGN)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${source}")
    cmake_path(GET source STEM name)
    cmake_path(GET source PARENT_PATH folder)
    file(STRINGS "${source}" lines REGEX "^#include ")
    foreach(line IN LISTS lines)
      if(line MATCHES "\"(.*)\"")
        set(header "${folder}/${CMAKE_MATCH_1}")
        if(EXISTS "${header}")
          set(line "#include \"${header}\"")
        endif()
      endif()
      list(APPEND included "${line}")
    endforeach()
    turbomap_test_place("${source}" place)
    if(place STREQUAL "inside")
      string(APPEND parts "namespace ${name} {\n#include \"${source}\"\n}\n")
    else()
      string(APPEND parts "#include \"${source}\"\n")
    endif()
    turbomap_name_test(${name}${suffix} "${label}" ${program} "--source-file=*/${name}${extension}")
  endforeach()
  list(REMOVE_DUPLICATES included)
  list(JOIN included "\n" included)
  set(unit "${CMAKE_CURRENT_BINARY_DIR}/${program}${extension}")
  file(CONFIGURE OUTPUT "${unit}" CONTENT "${included}\n${parts}" @ONLY)
  turbomap_add_test_program(${program} "${unit}" ${kind} ${libraries})
endfunction()

# turbomap_add_script_test(NAME LABEL SCRIPT ARGUMENT...): a bash script that looks at the source.
find_program(TURBOMAP_BASH bash)
mark_as_advanced(TURBOMAP_BASH)
function(turbomap_add_script_test name label script)
  if(TURBOMAP_BASH)
    set(test ${TURBOMAP_TEST_PREFIX}${name})
    add_test(NAME ${test} COMMAND "${TURBOMAP_BASH}" "${CMAKE_CURRENT_SOURCE_DIR}/${script}" ${ARGN}
             COMMAND_EXPAND_LISTS)
    set_tests_properties(${test} PROPERTIES TIMEOUT 300 LABELS ${label})
  else()
    message(STATUS "turbomap: no test ${name}: bash was not found")
  endif()
endfunction()

# turbomap_add_tests(LABEL LABEL FILES FILE... [LIBRARIES LIBRARY...] [JSON REGEX] [OPENCV REGEX]): a test per FILE that this
# build compiles. A file whose path matches a regular expression needs that library too; where it was not found, cmake says
# that the test is missing.
function(turbomap_add_tests)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "LABEL;JSON;OPENCV" "FILES;LIBRARIES")
  foreach(file IN LISTS arg_FILES)
    cmake_path(RELATIVE_PATH file BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" OUTPUT_VARIABLE path)
    if((path MATCHES "\\.cu$" AND NOT TURBOMAP_WITH_CUDA) OR (path MATCHES "\\.cpp$" AND NOT TURBOMAP_HOST_TESTS))
      continue()
    endif()
    cmake_path(GET file STEM name)
    if(TURBOMAP_TEST_FILTER AND NOT name MATCHES "${TURBOMAP_TEST_FILTER}")
      continue()
    endif()
    set(libraries ${arg_LIBRARIES})
    set(missing "")
    if(arg_JSON AND path MATCHES "${arg_JSON}")
      list(APPEND libraries nlohmann_json::nlohmann_json)
      if(NOT nlohmann_json_FOUND)
        list(APPEND missing nlohmann_json)
      endif()
    endif()
    if(arg_OPENCV AND path MATCHES "${arg_OPENCV}")
      list(APPEND libraries ${OpenCV_LIBS})
      if(NOT OpenCV_FOUND)
        list(APPEND missing OpenCV)
      endif()
    endif()
    turbomap_test_kind("${file}" kind)
    set(place alone)
    if(TURBOMAP_GROUPED_TESTS AND NOT kind STREQUAL "optimised")
      turbomap_test_place("${file}" place)
    endif()
    if(missing)
      message(STATUS "turbomap: no test ${path}: ${missing} was not found")
    elseif(place STREQUAL "alone")
      turbomap_add_test("${file}" "${arg_LABEL}" ${libraries})
    else()
      cmake_path(GET path PARENT_PATH folder)
      cmake_path(GET path EXTENSION LAST_ONLY extension)
      string(MAKE_C_IDENTIFIER "${folder}_${kind}${extension}" group)
      if(extension STREQUAL ".cu")  # what all of these share is more than what a folder shares
        set(group device)
      endif()
      list(APPEND groups ${group})
      set(kind_${group} ${kind})
      set(most_${group} ${turbomap_group${extension}})
      list(APPEND ${place}_${group} "${file}")
      list(APPEND libraries_${group} ${libraries})
    endif()
  endforeach()
  list(REMOVE_DUPLICATES groups)
  foreach(group IN LISTS groups)
    list(REMOVE_DUPLICATES libraries_${group})
    list(LENGTH inside_${group} size)
    list(LENGTH last_${group} units)  # one in each unit
    math(EXPR least "(${size} + ${units} + ${most_${group}} - 1) / ${most_${group}}")
    if(units LESS least)
      set(units ${least})
    endif()
    foreach(unit RANGE 1 ${units})
      math(EXPR begin "${size} * (${unit} - 1) / ${units}")
      math(EXPR count "${size} * ${unit} / ${units} - ${begin}")
      list(SUBLIST inside_${group} ${begin} ${count} files)
      if(last_${group})
        list(POP_FRONT last_${group} last)
        list(APPEND files "${last}")
      endif()
      list(LENGTH files count)
      if(count EQUAL 1)
        turbomap_add_test(${files} "${arg_LABEL}" ${libraries_${group}})
      else()
        turbomap_add_grouped_tests("${arg_LABEL}" ${kind_${group}} "${libraries_${group}}" ${files})
      endif()
    endforeach()
  endforeach()
endfunction()
