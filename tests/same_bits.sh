#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# same_bits.sh [COMPILER-FLAG...]: compiles the digests of adjustments (tests/adjustment/test_reproducible.cpp) with TURBOMAP_REPRODUCIBLE, by
# g++ and clang++, with little and much optimisation and for several processors, and compares them. Flags say where Eigen and Thrust are, if
# not where Debian puts them. Exit status 1 when they differ. Four minutes of processor time.
set -eu -o pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# shellcheck source=tests/compare_digests.sh
. tests/compare_digests.sh
flags=(-std=c++17 -w -ffp-contract=off -DTURBOMAP_REPRODUCIBLE=1 -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP -Iinclude -Itests "$@")
for folder in /usr/include/eigen3 /usr/local/cuda/include/cccl; do
  if [ -d "$folder" ]; then flags+=(-isystem "$folder"); fi
done
for compiler in g++ clang++; do
  if ! command -v "$compiler" >/dev/null; then echo "not here: $compiler"; continue; fi
  own=(); [ "$compiler" = clang++ ] || own=(-fno-tree-slp-vectorize)
  for how in '-O1 -march=x86-64' '-O2 -march=x86-64-v3' '-O3 -march=native'; do
    # shellcheck disable=SC2086  # several flags
    "$compiler" "${flags[@]}" "${own[@]}" $how tests/adjustment/test_reproducible.cpp tests/support/main.cpp -o "$work/test" -lpthread
    "$work/test" >"$work/out" || { cat "$work/out"; exit 1; }
    compare_digests "$compiler $how" reproducible
  done
done
require_compared
