#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: bench.sh TURBOMAP-BENCH RECORDING STAGE...
# Every named stage of a recording is timed. turbomap-bench itself fails where a result differs from its oracle's.
set -eu -o pipefail
bench=$1 recording=$2
shift 2
if [ ! -d "$recording" ]; then
  echo "turbomap-test skipped: no $recording"
  exit 77
fi
printed=$("$bench" --recording "$recording" --repetitions 1)
echo "$printed"
for stage in "$@"; do
  if ! grep -q "^$stage " <<<"$printed"; then
    echo "bench.sh: $stage is missing" >&2
    exit 1
  fi
done
