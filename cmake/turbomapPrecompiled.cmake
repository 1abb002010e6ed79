# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# turbomap_compile_into(TARGET [TYPES HEADER])
# Compiles the algorithms once for TARGET, with its flags, as files of its own: each other C++ file of it that uses them compiles
# in about half the time. HEADER lists the instances, as it would stand in an #include of these files; without it those of
# turbomap/precompiled_types.hpp. See docs/cmake.md.
function(turbomap_compile_into target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TYPES" "")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "turbomap_compile_into(${target}): unknown arguments: ${arg_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT arg_TYPES)
    set(arg_TYPES "turbomap/precompiled_types.hpp")
  endif()
  set(folder "${CMAKE_CURRENT_FUNCTION_LIST_DIR}/precompiled")
  set(files "${folder}/searches.cpp" "${folder}/adjustments.cpp")
  target_sources(${target} PRIVATE ${files})
  # A header of ours that is parsed before they begin declares the instances that they are to compile.
  set_source_files_properties(${files} TARGET_DIRECTORY ${target}
                              PROPERTIES SKIP_PRECOMPILE_HEADERS ON SKIP_UNITY_BUILD_INCLUSION ON)
  target_compile_definitions(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:TURBOMAP_PRECOMPILED=\"${arg_TYPES}\">")
endfunction()
