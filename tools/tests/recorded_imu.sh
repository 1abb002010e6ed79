#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: recorded_imu.sh TURBOMAP-REPLAY RECORDING...
# Replays recordings with their IMU, of which nothing but the samples is taken. As a whole and between the recorded events, each
# aligned by itself, the error is at most that of the system that was recorded, and the scale is right to 1 %.
set -eu -o pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
replayer=$1
shift
there=0
for recording in "$@"; do
  [ -f "$recording/meta.json" ] || continue
  there=$((there + 1))
  "$replayer" "$recording" --no-bound --json "$work/replay.json" >/dev/null
  awk -v name="${recording##*/}" '
    function fail(why) { print "recorded_imu.sh: " name ": " why > "/dev/stderr"; failed = 1 }
    /^  "(ate_intervals_m|peer_ate_intervals_m)": \[/ { list = $1; at = 0; next }
    /^  \]/ { list = "" }
    list != "" { gsub(/[ ,]/, ""); if ($0 != "null") value[list, at] = $0 + 0; ++at; most = at > most ? at : most; next }
    /^  "(ate_rmse_m|peer_ate_rmse_m|map_faults|scale_error)": -?[0-9]/ { gsub(/[ ",]/, ""); split($0, pair, ":"); one[pair[1]] = pair[2] + 0; ++found }
    /"seconds"/ { initialised = 1 }
    END {
      if (found != 4) fail(found " of 4 numbers")
      if (!initialised) fail("not initialised")
      if (one["map_faults"] != 0) fail("the map has faults")
      if (!(one["ate_rmse_m"] > 0 && one["ate_rmse_m"] <= one["peer_ate_rmse_m"])) fail("ATE " one["ate_rmse_m"])
      if (!(one["scale_error"] >= -0.01 && one["scale_error"] <= 0.01)) fail("scale off by " one["scale_error"])
      for (i = 0; i < most; ++i)
        if (("\"peer_ate_intervals_m\":", i) in value) {
          ++compared
          if (!(value["\"ate_intervals_m\":", i] > 0 && value["\"ate_intervals_m\":", i] <= value["\"peer_ate_intervals_m\":", i]))
            fail("interval " i ": " value["\"ate_intervals_m\":", i])
        }
      if (!compared) fail("no interval was compared")
      exit failed
    }' "$work/replay.json"
done
[ "$there" != 0 ] || exit 77
