#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# same_decisions.sh [COMPILER-FLAG...]: compiles the digests of decisions (tests/mapping/test_same_map.cpp) with g++ and clang++,
# without and with optimisation and for several processors, and compares them. Flags say where Eigen and Thrust are, if not where
# Debian puts them. Exit status 1 when they differ. Ten minutes of processor time.
set -eu -o pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# shellcheck source=tests/compare_digests.sh
. tests/compare_digests.sh
flags=(-std=c++17 -w -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP -Iinclude -Itests "$@")
for folder in /usr/include/eigen3 /usr/local/cuda/include/cccl; do
  if [ -d "$folder" ]; then flags+=(-isystem "$folder"); fi
done
for compiler in g++ clang++; do
  if ! command -v "$compiler" >/dev/null; then echo "not here: $compiler"; continue; fi
  for how in -O0 '-O3 -march=x86-64' '-O3 -march=x86-64-v3' '-O3 -march=native' '-O3 -march=native -ffp-contract=off'; do
    # shellcheck disable=SC2086  # several flags
    "$compiler" "${flags[@]}" $how tests/mapping/test_same_map.cpp tests/support/main.cpp -o "$work/test" -lpthread
    "$work/test" -tc='decisions*' >"$work/out" || { cat "$work/out"; exit 1; }
    compare_digests "$compiler $how" digest
  done
done
require_compared
