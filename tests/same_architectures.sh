#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# same_architectures.sh [COMPILER-FLAG...]: compiles the loop of local mapping on a device (tests/mapping/test_local_mapper.cu, and with its
# adjustments test_adjusted_decisions.cu) for the virtual architectures 75, 80 and 90, which the driver translates for the GPU at hand, and
# compares the digests that they print: decisions, and without adjustments the bits of what is computed of points. Those that the GPU is too
# old for are passed over. Exit status 1 when they differ.
# Twenty minutes of processor time.
set -eu -o pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# shellcheck source=tests/compare_digests.sh
. tests/compare_digests.sh
flags=(-O1 -std=c++17 --expt-relaxed-constexpr --extended-lambda -diag-suppress=20012 -Iinclude -Itests
  -isystem /usr/include/eigen3 "$@")
for architecture in 75 80 90; do
  nvcc "${flags[@]}" -gencode "arch=compute_$architecture,code=compute_$architecture" -x cu \
    tests/mapping/test_local_mapper.cu tests/mapping/test_adjusted_decisions.cu \
    tests/support/main.cpp -o "$work/test_$architecture" &
done
wait
for architecture in 75 80 90; do
  if ! "$work/test_$architecture" -tc='decisions*' >"$work/out" 2>&1; then
    if grep -q 'no kernel image' "$work/out"; then echo "compute_$architecture: not for this GPU"; continue; fi
    cat "$work/out"
    exit 1
  fi
  compare_digests "compute_$architecture" 'digest|device-bits'
done
require_compared
