# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# How the tests below tests/ and tools/tests/ are built.
#   test_NAME.cpp   the test test_NAME: every host policy in it
#   test_NAME.cu    the test test_NAME_device: the same under nvcc, on a CUDA device; only in a build with CUDA
# A program that cannot run here (no data, no device) ends with 77, which ctest reports as skipped.

option(TURBOMAP_SOURCE_TESTS "Tests that look at the source alone; a second build does not need them again" ON)
option(TURBOMAP_RECORDED_TESTS "Build the tests on recorded data" ON)
option(TURBOMAP_PRECOMPILED_TESTS "Parse the headers that all tests include once" OFF)
option(TURBOMAP_GROUPED_DEVICE_TESTS "Compile three tests for a device as one unit: half of it is headers that they share" OFF)
set(TURBOMAP_TEST_FILTER "" CACHE STRING "Build only the tests whose name matches this regular expression")

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
# missing include.
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
# the list names; for all else it stops. One OpenMP thread under the thread sanitizer: see tests/support/main.cpp.
set(turbomap_test_environment "")
if(TURBOMAP_DATA_DIR)
  list(APPEND turbomap_test_environment "TURBOMAP_DATA_DIR=${TURBOMAP_DATA_DIR}")
endif()
if(TURBOMAP_SANITIZE MATCHES "undefined")
  list(APPEND turbomap_test_environment
       "UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1:suppressions=${turbomap_SOURCE_DIR}/tests/support/ubsan.supp")
endif()
if(TURBOMAP_SANITIZE MATCHES "thread")
  list(APPEND turbomap_test_environment
       "OMP_NUM_THREADS=1" "TSAN_OPTIONS=suppressions=${turbomap_SOURCE_DIR}/tests/support/tsan.supp")
endif()

# These are about what an optimiser may do. All others, also those on recorded data, run for seconds at most, and compile in
# half to two thirds of the time when they are optimised little.
set(turbomap_optimised_tests "same_bits|same_map|strict|atomic|threads")

# Without optimisation (the preset asan, and the build of clang++ in .ci/run) each of these runs for up to two minutes: longer
# than its compilation with optimisation takes more.
set(turbomap_busy_tests "correspondence_search|epipolar_order|track_creation|filters|triangulation|covariance")
string(APPEND turbomap_busy_tests "|local_map_search|simulation|batch_bound|schur_system|interleavings|test_preintegration")
string(APPEND turbomap_busy_tests "|initialise|point_uncertainty|global_adjustment|projection_search|byte_budget|map_mirror")
string(APPEND turbomap_busy_tests "|adjustment_memory|duplicate_fusion|same_bits|extraction_opencv|keypoint_offset|uncertain_points")

# turbomap_add_test(SOURCE LABEL LIBRARY...): the test that is named after SOURCE. Labelled 'host' or 'recorded'; 'device'
# where SOURCE is a .cu file.
function(turbomap_add_test source label)
  cmake_path(GET source STEM name)
  cmake_path(GET source EXTENSION LAST_ONLY extension)
  set(main turbomap_test_main)
  if(extension STREQUAL ".cu")
    string(APPEND name _device)
    set(label device)
    set(main turbomap_test_main_device)
  endif()
  if(TURBOMAP_TEST_FILTER AND NOT name MATCHES "${TURBOMAP_TEST_FILTER}")
    return()
  endif()
  add_executable(${name} "${source}")
  target_link_libraries(${name} PRIVATE ${main} ${ARGN})
  set(precompiled "${TURBOMAP_PRECOMPILED_TESTS}")  # a header is precompiled for one level of optimisation
  if(extension STREQUAL ".cu")
    set(precompiled OFF)
  endif()
  if(name MATCHES "${turbomap_optimised_tests}")
    set(precompiled OFF)
  else()
    turbomap_compile_quickly(${name})
  endif()
  if(name MATCHES "${turbomap_busy_tests}")
    if(CMAKE_CXX_FLAGS_RELEASE STREQUAL "-O0")
      set(precompiled OFF)
      target_compile_options(${name} PRIVATE "$<$<AND:$<CONFIG:Release>,${turbomap_is_cxx}>:-O1>")
    endif()
    if(TURBOMAP_SANITIZE)
      set(precompiled OFF)
      target_compile_options(${name} PRIVATE "$<$<AND:$<CONFIG:Debug>,${turbomap_is_cxx}>:-O1>")
    endif()
  endif()
  if(precompiled)
    target_precompile_headers(${name} REUSE_FROM turbomap_test_headers)
  endif()
  turbomap_name_test(${name} "${label}" ${name})
endfunction()

# turbomap_name_test(NAME LABEL COMMAND...): COMMAND is the test NAME, of which ctest knows how it ends and what it needs.
function(turbomap_name_test name label)
  set(test ${TURBOMAP_TEST_PREFIX}${name})
  add_test(NAME ${test} COMMAND ${ARGN})
  set_tests_properties(${test} PROPERTIES TIMEOUT 600 SKIP_RETURN_CODE 77 LABELS "${label}")
  set_property(TEST ${test} PROPERTY ENVIRONMENT "${turbomap_test_environment}")
  if(name MATCHES "local_mapper|time_budget|threads|context")  # they look at the clock, or at threads of their own
    set_property(TEST ${test} PROPERTY RUN_SERIAL ON)
  endif()
endfunction()

# turbomap_can_be_grouped(SOURCE RESULT): whether SOURCE may stand in a namespace beside other tests: it defines no macro, opens
# no namespace of the library's or of the tests' and includes no other test.
function(turbomap_can_be_grouped source result)
  file(STRINGS "${source}" apart REGEX "^#define|^namespace turbomap|^#include \".*\\.cpp\"" LIMIT_COUNT 1)
  if(apart)
    set(${result} OFF PARENT_SCOPE)
  else()
    set(${result} ON PARENT_SCOPE)
  endif()
endfunction()

# turbomap_add_device_tests(LIBRARIES FILE...): the tests of the FILEs as one program, compiled as one unit: first what any of
# them includes, then each in a namespace of its own. Each is a test of its own all the same, by doctest's choice of a file.
function(turbomap_add_device_tests libraries)
  list(GET ARGN 0 first)
  cmake_path(GET first STEM program)
  string(APPEND program _and_more_device)
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
    string(APPEND parts "namespace ${name} {\n#include \"${source}\"\n}\n")
    turbomap_name_test(${name}_device device ${program} "--source-file=*/${name}.cu")
  endforeach()
  list(REMOVE_DUPLICATES included)
  list(JOIN included "\n" included)
  file(CONFIGURE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/${program}.cu" CONTENT "${included}\n${parts}" @ONLY)
  add_executable(${program} "${CMAKE_CURRENT_BINARY_DIR}/${program}.cu")
  target_link_libraries(${program} PRIVATE turbomap_test_main_device ${libraries})
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
  set(group "")
  foreach(file IN LISTS arg_FILES)
    cmake_path(RELATIVE_PATH file BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" OUTPUT_VARIABLE path)
    if((path MATCHES "\\.cu$" AND NOT TURBOMAP_WITH_CUDA) OR (path MATCHES "\\.cpp$" AND NOT TURBOMAP_HOST_TESTS))
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
    set(grouped OFF)
    if(TURBOMAP_GROUPED_DEVICE_TESTS AND path MATCHES "\\.cu$" AND NOT TURBOMAP_TEST_FILTER)
      turbomap_can_be_grouped("${file}" grouped)
    endif()
    if(missing)
      message(STATUS "turbomap: no test ${path}: ${missing} was not found")
    elseif(grouped)
      list(APPEND group "${file}")
      list(APPEND group_libraries ${libraries})
      list(REMOVE_DUPLICATES group_libraries)
      list(LENGTH group size)
      if(size EQUAL 3)
        turbomap_add_device_tests("${group_libraries}" ${group})
        set(group "")
        set(group_libraries "")
      endif()
    else()
      turbomap_add_test("${file}" "${arg_LABEL}" ${libraries})
    endif()
  endforeach()
  if(group)
    turbomap_add_device_tests("${group_libraries}" ${group})
  endif()
endfunction()
