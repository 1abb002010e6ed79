# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# cmake -D SOURCE=... -D BUILD=... -D SCRATCH=... -D GENERATOR=... -D CXX=... [-D PREFIX_PATH=...] -P configure.cmake
# Projects that are configured and not built: the library by two ways at once, components that are not there, what a parent
# installs. What must fail, must say why.

cmake_minimum_required(VERSION 3.22)
file(REMOVE_RECURSE "${SCRATCH}")
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${SCRATCH}/prefix" RESULT_VARIABLE status OUTPUT_QUIET)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "the package of ${BUILD} is not installed: ${status}")
endif()
list(PREPEND PREFIX_PATH "${SCRATCH}/prefix")
list(JOIN PREFIX_PATH "\\;" prefix_path)

# configure(NAME TEXT [FAILS WORDS...] [OPTIONS ...]): a project of the lines TEXT. FAILS: what its error must say, in any lines.
function(configure name text)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "" "FAILS;OPTIONS")
  file(WRITE "${SCRATCH}/${name}/CMakeLists.txt" "cmake_minimum_required(VERSION 3.22)\nproject(${name} LANGUAGES CXX)\n${text}")
  execute_process(
    COMMAND "${CMAKE_COMMAND}" -S "${SCRATCH}/${name}" -B "${SCRATCH}/${name}/build" -G "${GENERATOR}" -D "CMAKE_CXX_COMPILER=${CXX}"
            -D "CMAKE_PREFIX_PATH=${prefix_path}" -D "TURBOMAP_SOURCE=${SOURCE}" ${arg_OPTIONS}
    RESULT_VARIABLE status OUTPUT_QUIET ERROR_VARIABLE said)
  string(REGEX REPLACE "[ \n]+" " " words "${said}")
  foreach(expected IN LISTS arg_FAILS)
    string(FIND "${words}" "${expected}" at)
    if(at EQUAL -1)
      message(FATAL_ERROR "${name}: cmake does not say '${expected}':\n${said}")
    endif()
  endforeach()
  if((arg_FAILS AND status EQUAL 0) OR (NOT arg_FAILS AND NOT status EQUAL 0))
    message(FATAL_ERROR "${name}: cmake ended with ${status}:\n${said}")
  endif()
endfunction()

# A dependency of the project looks for what the project has as a folder. Its own turbomap_compile_into stays.
configure(folder_then_package [[
add_subdirectory("${TURBOMAP_SOURCE}" turbomap)
find_package(turbomap 0.1 CONFIG REQUIRED OPTIONAL_COMPONENTS Eigen OMP TBB CUDA)
find_package(turbomap 0.1 CONFIG REQUIRED)
file(WRITE "${CMAKE_CURRENT_SOURCE_DIR}/user.cpp" "int main() {}")
add_executable(user user.cpp)
target_link_libraries(user PRIVATE turbomap::turbomap)
if(turbomap_OMP_FOUND)
  target_link_libraries(user PRIVATE turbomap::omp)
endif()
turbomap_compile_into(user)
get_target_property(sources user SOURCES)
get_target_property(include turbomap::turbomap INTERFACE_INCLUDE_DIRECTORIES)
foreach(path IN ITEMS ${sources} ${include})
  if(path MATCHES "/prefix/")
    message(FATAL_ERROR "${path} is of the package")
  endif()
endforeach()
]])
configure(package_then_folder [[
find_package(turbomap 0.1 CONFIG REQUIRED)
add_subdirectory("${TURBOMAP_SOURCE}" turbomap)
]] FAILS "turbomap is there already, by find_package(turbomap)" "put add_subdirectory before find_package")

# Of what is asked for and not there, all is named; what is optional is not.
set(disabled "")
foreach(package IN ITEMS Eigen3 OpenMP TBB)
  list(APPEND disabled -D CMAKE_DISABLE_FIND_PACKAGE_${package}=ON)
endforeach()
configure(missing "find_package(turbomap 0.1 CONFIG REQUIRED COMPONENTS Eigen OMP TBB CUDA)" OPTIONS ${disabled} FAILS
          "Eigen: install Eigen 3.4" "OMP: take a compiler with OpenMP" "TBB: install TBB (libtbb-dev)" "CUDA: enable the language CUDA")
configure(optional [[
find_package(turbomap 0.1 CONFIG QUIET COMPONENTS CUDA OPTIONAL_COMPONENTS TBB)
if(turbomap_FOUND OR NOT turbomap_NOT_FOUND_MESSAGE MATCHES "^CUDA: [^:]*$")
  message(FATAL_ERROR "found: ${turbomap_FOUND}, message: ${turbomap_NOT_FOUND_MESSAGE}")
endif()
find_package(turbomap 0.1 CONFIG REQUIRED OPTIONAL_COMPONENTS CUDA TBB)
]] OPTIONS ${disabled})

# What is installed with a project of another name goes to our folders.
configure(parent [[
include(GNUInstallDirs)
add_subdirectory("${TURBOMAP_SOURCE}" turbomap)
]] OPTIONS -D TURBOMAP_INSTALL=ON)
execute_process(COMMAND "${CMAKE_COMMAND}" --install "${SCRATCH}/parent/build" --prefix "${SCRATCH}/parent/prefix" OUTPUT_QUIET)
if(EXISTS "${SCRATCH}/parent/prefix/share/doc/parent" OR NOT EXISTS "${SCRATCH}/parent/prefix/share/doc/turbomap/LICENSE")
  message(FATAL_ERROR "parent: LICENSE is not in share/doc/turbomap")
endif()
