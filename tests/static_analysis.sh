#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# static_analysis.sh [COMPILER-FLAG...]: clang-tidy with the checks of .clang-tidy on all public headers: once as they are, in one
# file, and once as two whole mappers use them, since the analyser follows only templates that are instantiated. Flags say where
# Eigen, Thrust and OpenCV are, if not where Debian puts them. Exit status 1 with a finding, 77 where there is no clang-tidy.
# About two minutes of processor time.
set -eu -o pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
command -v clang-tidy >/dev/null || { echo 'static_analysis: no clang-tidy here'; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp .clang-tidy "$work"
flags=(-std=c++17 -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP -Iinclude -Iexamples "$@")
for folder in /usr/include/eigen3 /usr/include/opencv4 /usr/local/cuda/include/cccl; do
  if [ -d "$folder" ]; then flags+=(-isystem "$folder"); fi
done

# A header of interop/ or io/ counts where the library that it includes is here.
while read -r header; do
  missing=
  while read -r library; do
    printf '#include <%s>\n' "$library" >"$work/library.cpp"
    clang++ -fsyntax-only -w "${flags[@]}" "$work/library.cpp" 2>/dev/null || missing=$library
  done < <(grep -ohE '^#include <(opencv2|sophus|manif|nlohmann)/[^>]+' "include/$header" | cut -d'<' -f2)
  if [ -z "$missing" ]; then echo "#include <$header>"; else echo "static_analysis: not $header: no $missing" >&2; fi
done < <(cd include && find turbomap -name '*.hpp' | LC_ALL=C sort) >"$work/all_headers.cpp"
for example in 05_local_mapping 07_stereo_inertial; do  # included: what is found in the examples themselves is not asked for
  printf '#include "%s.cpp"  // NOLINT\n' "$example" >"$work/user_$example.cpp"
done
clang-tidy --quiet "$work"/all_headers.cpp "$work"/user_*.cpp -- "${flags[@]}"
