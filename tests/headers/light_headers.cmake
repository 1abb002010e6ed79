# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# cmake -D CXX=... -D INCLUDE=.../include -D LIST=light_headers.txt [-D UPDATE=ON] -P light_headers.cmake
# Light headers are what a user's own header includes to describe their types: they must cost next to nothing. LIST says per
# light header which standard headers it and the library's headers below it name; another one is an error. So is a header of
# LIST's line `never:` that the compiler (-M) meets at any depth, by way of another standard header too. UPDATE=ON writes the
# lines anew: look at the difference before you commit it.

cmake_minimum_required(VERSION 3.25)
file(GLOB_RECURSE light RELATIVE "${INCLUDE}" "${INCLUDE}/turbomap/*_options.hpp" "${INCLUDE}/turbomap/*_view.hpp"
     "${INCLUDE}/turbomap/options.hpp")
list(FILTER light EXCLUDE REGEX "^turbomap/adjustment/.*_view\\.hpp$")   # of the solver's own kernels, not for users to fill
list(APPEND light turbomap/map/map_traits.hpp turbomap/span.hpp turbomap/traits.hpp turbomap/types.hpp)
list(SORT light)

file(STRINGS "${LIST}" lines)
set(comments "")
set(known "")
foreach(line IN LISTS lines)
  if(line MATCHES "^#|^$|^never:")
    list(APPEND comments "${line}")
  endif()
  if(line MATCHES "^([^# ]+): *(.*)$")
    set(header "${CMAKE_MATCH_1}")
    string(REPLACE " " ";" allowed_${header} "${CMAKE_MATCH_2}")
    list(APPEND known "${header}")
  endif()
endforeach()
list(REMOVE_ITEM known never)

set(errors "")
set(text "")
foreach(header IN LISTS light)
  execute_process(COMMAND "${CXX}" -std=c++17 -M -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP "-I${INCLUDE}" -x c++
                          "${INCLUDE}/${header}" OUTPUT_VARIABLE files RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${header} does not compile by itself")
  endif()
  string(REGEX REPLACE "[\\\n ]+" ";" files "${files}")
  list(REMOVE_DUPLICATES files)

  set(named "")
  set(brought "")
  foreach(file IN LISTS files)
    string(FIND "${file}" "${INCLUDE}/turbomap/" at)
    if(at EQUAL 0)
      file(STRINGS "${file}" includes REGEX "^ *# *include *<")
      foreach(include IN LISTS includes)
        string(REGEX REPLACE "^ *# *include *<([^>]+)>.*" "\\1" include "${include}")
        list(APPEND named "${include}")
      endforeach()
    else()
      foreach(name IN LISTS allowed_never)
        if(file MATCHES "(/c\\+\\+/[^/]+|/c\\+\\+/v1|/include)/${name}$" OR (name MATCHES "/$" AND file MATCHES "/${name}"))
          list(APPEND brought "<${name}>")
        endif()
      endforeach()
    endif()
  endforeach()
  list(REMOVE_DUPLICATES named)
  list(SORT named)
  if(brought)
    list(REMOVE_DUPLICATES brought)
    string(APPEND errors "${header} brings ${brought}: light headers never do\n")
  endif()

  set(new ${named})
  list(REMOVE_ITEM new ${allowed_${header}} "")
  if(new)
    string(APPEND errors "${header} has new standard headers: ${new}\n")
  endif()
  list(REMOVE_ITEM known "${header}")
  string(REPLACE ";" " " named "${named}")
  string(APPEND text "${header}: ${named}\n")
endforeach()
foreach(header IN LISTS known)
  string(APPEND errors "${header} is in the list, but is no light header\n")
endforeach()

if(UPDATE)
  list(JOIN comments "\n" head)
  file(WRITE "${LIST}" "${head}\n${text}")
elseif(errors)
  message("${errors}If the new ones are meant:\n  cmake -D UPDATE=ON -D CXX=${CXX} -D INCLUDE=${INCLUDE} -D LIST=${LIST} \
-P ${CMAKE_CURRENT_LIST_FILE}")
  message(FATAL_ERROR "light headers became heavier")
endif()
