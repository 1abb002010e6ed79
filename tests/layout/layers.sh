#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# layers.sh: who may include whom (layers.txt allows no more than is needed), and where details of the library stand: `detail`
# inside the inline namespace of config.hpp, `plain_detail` outside; one name in both places is ambiguous to some compilers. That
# no test case is in a header: where several tests are one program, each runs the cases of its own file only. And that there is no
# circle: whichever header of the library a file includes first, each finds what it includes at its top already read.
set -eu -o pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$here/../.."
export LC_ALL=C

mapfile -t files < <(find include tests tools examples -name '*.hpp' -o -name '*.cpp' -o -name '*.cuh' -o -name '*.cu' -o -name '*.inc' | sort)
printf '%s\n' "${files[@]}" | awk -v rules="$here/layers.txt" '
  function area_of(path,    a, best) {
    best = ""
    for (a in allowed) if ((path == a || index(path, a "/") == 1) && length(a) > length(best)) best = a
    return best
  }
  function resolve(folder, path,    n, part, i, k, out) {
    n = split(folder "/" path, part, "/")
    k = 0
    for (i = 1; i <= n; ++i) {
      if (part[i] == "." || part[i] == "") continue
      if (part[i] == "..") --k; else out[++k] = part[i]
    }
    path = out[1]
    for (i = 2; i <= k; ++i) path = path "/" out[i]
    return path
  }
  function complain(text) { print text; bad = 1 }
  # Reads a header as a compiler does, each file once. What stands below the code (CUDA versions of it) comes after it, so it may
  # include the header that it stands in.
  function read_once(path,    i, to) {
    seen[path] = first_read
    half_read[path] = 1
    for (i = 1; i <= includes[path]; ++i) {
      to = included[path, i]
      if (below[path, i]) delete half_read[path]
      if (seen[to] != first_read) read_once(to)
      else if (to in half_read && !below[path, i] && !((path, i) in told)) {
        complain(path ": a circle: it reads " to " half, where " first_read " is included first")
        told[path, i] = 1
      }
    }
    delete half_read[path]
  }
  BEGIN {
    while ((getline line < rules) > 0)
      if (line !~ /^#/ && match(line, /^[^:]+:/)) allowed[substr(line, 1, RLENGTH - 1)] = substr(line, RLENGTH + 1) " "
  }
  { file[$0] = 1; order[++count] = $0 }
  END {
    for (f = 1; f <= count; ++f) {
      path = order[f]
      folder = path
      sub(/\/[^\/]*$/, "", folder)
      from = area_of(path)
      if (from == "") complain(path ": no line of layers.txt is about it")
      inside = thrust = code = 0
      for (number = 1; (getline line < path) > 0; ++number) {
        if (line ~ /^TURBOMAP_BEGIN_NAMESPACE/) inside = 1
        if (line ~ /^(TURBOMAP_BEGIN_NAMESPACE|namespace )/) {
          code = 1
          if (path ~ /^include\// && below[path, includes[path]]) complain(path ":" number ": code after an include that stands below code")
        }
        if (line ~ /^TURBOMAP_END_NAMESPACE/) inside = 0
        if (line ~ /^THRUST_NAMESPACE_BEGIN/) thrust = 1
        if (line ~ /^THRUST_NAMESPACE_END/) thrust = 0
        if (path ~ /^include\// && line ~ /^namespace (turbomap::)?detail/ && !inside && !thrust)
          complain(path ":" number ": `detail` belongs into the inline namespace; outside it is `plain_detail`")
        if (path ~ /^include\// && line ~ /^namespace (turbomap::)?plain_detail/ && inside)
          complain(path ":" number ": `plain_detail` belongs outside of the inline namespace")
        if (path ~ /\.(hpp|cuh|inc)$/ && line ~ /^ *TEST_CASE/)
          complain(path ":" number ": a test case belongs into the file of its test")
        if (line !~ /^ *# *include "/) continue
        target = line
        sub(/^[^"]*"/, "", target); sub(/".*/, "", target)
        to = resolve(folder, target)
        if (!(to in file) && path ~ /^(tests|tools)\// && ("tests/" target) in file) to = "tests/" target
        if (!(to in file) && path ~ /^tools\// && ("tools/" target) in file) to = "tools/" target
        if (!(to in file)) { complain(path ":" number ": there is no \"" target "\""); continue }
        area = area_of(to)
        used[from " " area] = 1
        included[path, ++includes[path]] = to
        below[path, includes[path]] = code
        if (area != from && index(allowed[from], " " area " ") == 0 && allowed[from] !~ /\*/)
          complain(path ":" number ": " from " must not include " area " (" to ")")
      }
      close(path)
    }
    for (f = 1; f <= count; ++f)
      if (order[f] ~ /^include\//) read_once(first_read = order[f])
    for (from in allowed) {
      n = split(allowed[from], area_list, " ")
      for (i = 1; i <= n; ++i)
        if (area_list[i] != "*" && !((from " " area_list[i]) in used))
          complain("layers.txt: no file of " from " includes " area_list[i])
    }
    exit bad
  }'
