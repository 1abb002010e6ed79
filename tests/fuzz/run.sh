#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# run.sh [SECONDS [TARGET...]]: builds the fuzz targets (or those named) in build/fuzz with clang++ and runs each for this
# time, 60 s by default, as many at a time as there are processors, from tests/fuzz/corpus. New inputs are kept in
# build/fuzz/corpus. An input that a target stops at is in build/fuzz/findings, and the exit status is 1.
set -eu -o pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
seconds=${1:-60}
targets=("${@:2}")

cmake --preset fuzz >/dev/null
if [ ${#targets[@]} -gt 0 ]; then
  cmake --build --preset fuzz --target "${targets[@]/#/fuzz_}"
else
  cmake --build --preset fuzz
  for program in build/fuzz/fuzz/fuzz_*; do targets+=("${program#build/fuzz/fuzz/fuzz_}"); done
fi
mkdir -p build/fuzz/findings
# Memory that was freed is kept for longer than a problem lasts; more of it is fresh pages, a quarter of the time.
export ASAN_OPTIONS=quarantine_size_mb=16:${ASAN_OPTIONS:-}
run() {  # TARGET
  local target=$1 log=build/fuzz/$1.log result=ok executions
  mkdir -p "build/fuzz/corpus/$target"
  local options=(-max_len=4096 -dict=tests/fuzz/numbers.dict)
  if grep -qsE '#include "(hostile|hostile_inertial|mapper_world).hpp"' "tests/fuzz/fuzz_$target.cpp"; then
    # Choices of a random problem: bytes without a grammar, and as many of them as a problem needs.
    options=(-max_len=256 -len_control=0)
  fi
  "build/fuzz/fuzz/fuzz_$target" "build/fuzz/corpus/$target" "tests/fuzz/corpus/$target" -max_total_time="$seconds" \
    "${options[@]}" -timeout=20 -rss_limit_mb=4096 -artifact_prefix="build/fuzz/findings/$target-" >"$log" 2>&1 ||
    result="FOUND SOMETHING, see $log"
  executions=$(sed -nE 's/^Done ([0-9]+) runs.*/\1/p' "$log")
  printf '%-22s %10s executions  %s\n' "$target" "${executions:--}" "$result"
  [ "$result" = ok ]
}
status=0 running=0
for target in "${targets[@]}"; do
  if [ "$running" -ge "$(nproc)" ]; then
    wait -n || status=1
    running=$((running - 1))
  fi
  run "$target" &
  running=$((running + 1))
done
for (( ; running > 0; --running)); do wait -n || status=1; done
exit $status
