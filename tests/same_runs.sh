#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# same_runs.sh PROGRAM: runs PROGRAM (tests/mapping/test_same_runs.cpp) as several processes, with other addresses, another size of the
# environment and other numbers of threads, and compares the digests of maps that they print. Exit status 1 when they differ; 77 where
# the addresses of all are the same, so that the comparison would say little.
set -eu -o pipefail
program=$1
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# shellcheck source=tests/compare_digests.sh
. tests/compare_digests.sh

# run NAME COMMAND...
run() {
  local name=$1
  shift
  "$@" "$program" >"$work/out" || { cat "$work/out"; exit 1; }
  sed -n 's/^turbomap-address //p' "$work/out" >>"$work/addresses"
  compare_digests "$name" run
}

run 'one OpenMP thread' env OMP_NUM_THREADS=1
run 'three, a large environment' env OMP_NUM_THREADS=3 "TURBOMAP_PADDING=$(printf '%50000s' '')"
if command -v taskset >/dev/null; then
  cpu=$(taskset -pc $$ | sed -E 's/.*: *([0-9]+).*/\1/')
  run 'two, on one core: one thread of TBB' env OMP_NUM_THREADS=2 OMP_DYNAMIC=false taskset -c "$cpu"
fi
require_compared

# One digit of one digest is another: that must be seen.
sed -i '0,/^turbomap-run /{/^turbomap-run /{s/0$/x/;t;s/.$/0/}}' "$work/out"
if (compare_digests 'altered' run) >/dev/null; then echo 'an altered digest was not seen'; exit 1; fi

if [ "$(sort -u "$work/addresses" | wc -l)" -lt 2 ]; then echo 'no address space randomisation: skipped'; exit 77; fi
