# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# The tests of tests/consumer as part of this project's: one per way of using the library.
foreach(mode IN ITEMS package subdirectory fetch)
  set(users "")
  if(NOT TURBOMAP_FULL_MATRIX)
    if(mode STREQUAL "fetch" AND (TURBOMAP_WITH_CUDA OR NOT TURBOMAP_SOURCE_TESTS))
      continue()  # to a compiler the same as subdirectory
    endif()
    if(TURBOMAP_WITH_CUDA AND NOT TURBOMAP_HOST_TESTS)  # another build has those of C++ files alone
      set(users "cuda|mixed")
      if(mode STREQUAL "subdirectory")
        set(users "mixed")  # nvcc compiles the same mapper for both
      endif()
    endif()
  endif()
  set(test ${TURBOMAP_TEST_PREFIX}consumer_${mode})
  add_test(NAME ${test} COMMAND "${CMAKE_COMMAND}"
    -D "MODE=${mode}" -D "SOURCE=${turbomap_SOURCE_DIR}" -D "BUILD=${turbomap_BINARY_DIR}"
    -D "SCRATCH=${CMAKE_CURRENT_BINARY_DIR}/consumer" -D "GENERATOR=${CMAKE_GENERATOR}"
    -D "CXX=${CMAKE_CXX_COMPILER}" -D "CUDA=${TURBOMAP_WITH_CUDA}" -D "NVCC=${CMAKE_CUDA_COMPILER}"
    -D "CUDA_ARCHITECTURES=${CMAKE_CUDA_ARCHITECTURES}" -D "PREFIX_PATH=${CMAKE_PREFIX_PATH}" -D "USERS=${users}"
    -P "${CMAKE_CURRENT_LIST_DIR}/run.cmake")
  # One core, beside other tests, and first: these take longest.
  set_tests_properties(${test} PROPERTIES TIMEOUT 600 LABELS consumer COST 60 ENVIRONMENT CMAKE_BUILD_PARALLEL_LEVEL=1)
endforeach()
if(TURBOMAP_HOST_TESTS)
  set(test ${TURBOMAP_TEST_PREFIX}consumer_configure)
  add_test(NAME ${test} COMMAND "${CMAKE_COMMAND}"
    -D "SOURCE=${turbomap_SOURCE_DIR}" -D "BUILD=${turbomap_BINARY_DIR}" -D "SCRATCH=${CMAKE_CURRENT_BINARY_DIR}/consumer/configure"
    -D "GENERATOR=${CMAKE_GENERATOR}" -D "CXX=${CMAKE_CXX_COMPILER}" -D "PREFIX_PATH=${CMAKE_PREFIX_PATH}"
    -P "${CMAKE_CURRENT_LIST_DIR}/configure.cmake")
  set_tests_properties(${test} PROPERTIES TIMEOUT 300 LABELS consumer)
endif()
