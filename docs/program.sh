#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
#
# docs/program.sh PAGE [FLAG...]: compiles and runs the program of a page of the documentation. The blocks of a page that are
# marked as compiled are one program, in build/docs/PAGE.cpp. It shows its commands: they are all that a program of yours needs.
# A page without `int main` is compiled only. PAGE as local_mapping, for docs/local_mapping.md.
set -eu
[ $# -gt 0 ] || { sed -n '5,8s/^# //p' "$0" >&2; exit 2; }
cd "$(dirname "$0")/.."
page=$1
shift
mkdir -p build/docs
awk '/^<!-- compiled -->/ { marked = 1; next } /^```/ { inside = marked; marked = 0; next } inside' \
  "docs/$page.md" >"build/docs/$page.cpp"
[ -s "build/docs/$page.cpp" ] || { echo "docs/$page.md has no program" >&2; exit 2; }
output=(-o "$page")
grep -q 'int main(' "build/docs/$page.cpp" || output=(-c)

set -x
cd build/docs
g++ -std=c++17 -O2 -I../../include -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP "$page.cpp" "${output[@]}" "$@"
[ "${output[0]}" = -c ] || "./$page"
