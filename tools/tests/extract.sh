#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: extract.sh TURBOMAP-EXTRACT TURBOMAP-REPLAY [EUROC-LAYOUT]
# What is no data set is refused with one line and status 2; three pairs of EuRoC, the camera at rest, become a recording that
# turbomap-replay replays, and whose --error-parts it refuses. Without EUROC-LAYOUT this part is skipped: status 77.
set -eu -o pipefail
extract=$1 replayer=$2 images=${3:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() { echo "extract.sh: $*" >&2; exit 1; }
status=0
"$extract" "$work" --out "$work/recording" 2>"$work/errors" || status=$?
[ "$status" = 2 ] || fail "status $status for an empty folder"
[ "$(wc -l <"$work/errors")" = 1 ] || fail "not one line: $(cat "$work/errors")"
[ ! -e "$work/recording" ] || fail "something was written"

if [ -z "$images" ]; then
  echo "skipped: TURBOMAP_DATA_DIR is not set; it should hold euroc-layout"
  exit 77
fi
[ -d "$images" ] || fail "$images is not there"
for second in 3 4 5; do echo "140371527$second.262142976 0 0 0 0 0 0 1"; done >"$work/rest.tum"
"$extract" "$images" --trajectory "$work/rest.tum" --out "$work/recording" >"$work/said"
grep -q ': 3 keyframes of 3 images' "$work/said" || fail "$(cat "$work/said")"
"$replayer" "$work/recording" --associate projected --json "$work/replay.json" >/dev/null
awk -F '[:,]' '/^  "(ate_rmse_m|map_faults|map_points)": [0-9]/ { gsub(/[ "]/, "", $1); value[$1] = $2 + 0 }
  END { exit !("ate_rmse_m" in value && value["ate_rmse_m"] < 0.01 && "map_faults" in value && value["map_faults"] == 0 && value["map_points"] > 100) }' \
  "$work/replay.json" || fail "$(cat "$work/replay.json")"

status=0
"$replayer" "$work/recording" --error-parts >/dev/null 2>"$work/errors" || status=$?
[ "$status" = 2 ] || fail "--error-parts: status $status"
grep -q -e '--error-parts: the recording is not a simulated one' "$work/errors" || fail "$(cat "$work/errors")"
