#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: imu.sh TURBOMAP-SIMULATE TURBOMAP-REPLAY
# Replays simulated recordings with their IMU, of which nothing but the samples is known (--uninitialised). One camera, a
# rectified pair and two fisheyes that shake: initialised within 15 s of motion, the scale right to 1 %; one camera also after 5 s of
# rest, which culling makes one interval. One camera that moves evenly: not initialised. On a map of objects the same holds, and each step of the initialisation
# comes at the same time as on flat arrays. (The bits are compared by test_objects_map.cpp: two instances of one template need not be
# contracted alike by the compiler.)
set -eu -o pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

. "$(dirname "$0")/shaken.sh"
shaken >"$work/shaken.tum"
awk 'NR == 1 { for (i = 0; i < 100; ++i) print 995 + 0.05 * i, $2, $3, $4, $5, $6, $7, $8 } { print }' \
  "$work/shaken.tum" >"$work/rested.tum"

# replay NAME EXPECTED SIMULATE-ARGUMENTS...   EXPECTED: known, unknown
replay() {
  local name=$1 expected=$2
  shift 2
  "$simulate" "$@" --imu --uninitialised --out "$work/$name" >/dev/null
  map "$name" "$expected" simple
  map "$name" "$expected" objects --imu
  if ! diff <(grep '"seconds"' "$work/$name.simple.json") <(grep '"seconds"' "$work/$name.objects.json") >&2; then
    echo "imu.sh: $name: initialised at other times on a map of objects" >&2
    exit 1
  fi
}
# map NAME EXPECTED MAP REPLAY-ARGUMENTS...
map() {
  local name=$1.$3 expected=$2 recording=$work/$1 kind=$3
  shift 3
  "$replayer" "$recording" --map "$kind" "$@" --no-bound --json "$work/$name.json" >/dev/null
  awk -F '[:,]' -v name="$name" -v expected="$expected" '
    /^  "(ate_rmse_m|map_faults|scale_error)": -?[0-9]/ { gsub(/[ "]/, "", $1); value[$1] = $2 + 0 }
    /"not_initialised"/ { refused = 1 }
    /"seconds"/ && !first { first = $2 + 0 }
    function fail(why) { print "imu.sh: " name ": " why > "/dev/stderr"; failed = 1 }
    END {
      if (!("map_faults" in value) || value["map_faults"] != 0) fail("the map has faults")
      if (expected == "unknown") {
        if (!refused || first) fail("initialised without excitation")
      } else {
        if (refused || !(first > 0 && first <= 15)) fail("initialised after " first " s")
        if (!("scale_error" in value) || value["scale_error"] > 0.01 || value["scale_error"] < -0.01)
          fail("scale off by " value["scale_error"])
        if (!(value["ate_rmse_m"] > 0 && value["ate_rmse_m"] < 0.005)) fail("ATE " value["ate_rmse_m"])
      }
      exit failed
    }' "$work/$name.json"
}
simulate=$1 replayer=$2
replay mono known "$work/shaken.tum" --mono
replay rested known "$work/rested.tum" --mono
replay stereo known "$work/shaken.tum"
replay fisheye known "$work/shaken.tum" --camera tum-vi
# Two fisheye cameras of which the right one's distortion is told wrongly: worse, and as recorded where it is told as it is.
distorted() {
  "$replayer" "$work/fisheye" --no-bound --right-distortion "$1" --json "$work/distorted.json" >/dev/null
  grep -o "\"$2\": .*" "$work/distorted.json"
}
recorded=$(tr -d ' \n' <"$work/fisheye/meta.json" | sed 's/.*"camera2":\[\([^]]*\)\].*/\1/' | cut -d, -f5-8)
if [ "$(distorted "$recorded" map_digest)" != "$(grep -o '"map_digest": .*' "$work/fisheye.simple.json")" ]; then
  echo "imu.sh: another map with the recorded distortion" >&2
  exit 1
fi
{ grep -o '"ate_rmse_m": .*' "$work/fisheye.simple.json"; distorted "0.05,0,0,0" ate_rmse_m; } |
  awk '{ e[NR] = $2 + 0 } END { if (!(NR == 2 && e[2] > 2 * e[1])) { print "imu.sh: a wrong distortion: " e[1] ", " e[2] >"/dev/stderr"; exit 1 } }'
if "$replayer" "$work/mono" --right-distortion "$recorded" >/dev/null 2>&1; then
  echo "imu.sh: one camera has a right one" >&2
  exit 1
fi
replay even unknown corridor --mono --keyframes 40
