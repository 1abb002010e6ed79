# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# cmake -D MODE=package|subdirectory|fetch ... -P run.cmake: configures, builds and runs the consumer in SCRATCH/MODE.
# USERS: a regular expression of the programs, by default all.

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    list(JOIN ARGV " " line)
    message(FATAL_ERROR "${line}: ${status}")
  endif()
endfunction()

set(folder "${SCRATCH}/${MODE}")
file(REMOVE_RECURSE "${folder}")
if(MODE STREQUAL "package")
  run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${folder}/prefix")
  list(PREPEND PREFIX_PATH "${folder}/prefix")
endif()
list(JOIN PREFIX_PATH "\\;" prefix_path)
set(options -D "CMAKE_CXX_COMPILER=${CXX}" -D "CMAKE_PREFIX_PATH=${prefix_path}" -D "TURBOMAP_CONSUME=${MODE}"
            -D "TURBOMAP_SOURCE=${SOURCE}")
if(USERS)
  list(APPEND options -D "CONSUMER_USERS=${USERS}")
endif()
if(CUDA)
  list(JOIN CUDA_ARCHITECTURES "\\;" architectures)
  list(APPEND options -D CONSUMER_CUDA=ON -D "CMAKE_CUDA_COMPILER=${NVCC}" -D "CMAKE_CUDA_ARCHITECTURES=${architectures}")
endif()
run("${CMAKE_COMMAND}" -S "${SOURCE}/tests/consumer" -B "${folder}/build" -G "${GENERATOR}" ${options})
run("${CMAKE_COMMAND}" --build "${folder}/build")
run("${CMAKE_CTEST_COMMAND}" --test-dir "${folder}/build" --output-on-failure --no-tests=error)
