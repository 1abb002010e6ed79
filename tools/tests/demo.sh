#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: demo.sh TURBOMAP-REPLAY RECORDING POLICY
# Replays the demo's recording: the JSON has the keys of the trajectory errors, and the map is worth showing. It is better than
# the poses that came in, and not far from the best that the observations allow. Keyframes that come all at once skip stages.
# To adjust the whole map at the end makes it better still.
set -eu -o pipefail
most=${DEMO_TIMES_BOUND:-3}  # the error of the map, times that of the batch adjustment

json=$(mktemp)
trap 'rm -f "$json"' EXIT
"$1" "$2" --policy "$3" --json "$json"
awk -F '[:,]' -v most="$most" '
  /^  "(ate_[a-z]*_*rmse_m|observations_per_point|map_faults)": [0-9]/ {
    gsub(/[ "]/, "", $1)
    value[$1] = $2 + 0
  }
  function fail(why) { print "demo.sh: " why > "/dev/stderr"; failed = 1 }
  END {
    for (i = split("ate_rmse_m ate_input_rmse_m ate_batch_rmse_m observations_per_point map_faults", keys, " "); i > 0; --i)
      if (!(keys[i] in value)) fail("the JSON has no " keys[i])
    if (failed) exit 1
    ate = value["ate_rmse_m"]
    if (!(value["ate_batch_rmse_m"] > 0)) fail("the bound is " value["ate_batch_rmse_m"])
    if (!(ate < value["ate_input_rmse_m"])) fail("ATE " ate ": not better than the poses that came in")
    if (!(ate <= most * value["ate_batch_rmse_m"])) fail("ATE " ate ": more than " most " times the bound")
    if (!(value["observations_per_point"] >= 2)) fail("observations per point: " value["observations_per_point"])
    if (value["map_faults"] != 0) fail("the map has faults")
    exit failed
  }' "$json"

# All keyframes at once: each but the last finds the next one waiting.
"$1" "$2" --policy "$3" --no-bound --rate 1e9 --json "$json" >/dev/null
awk -F '[:,]' '
  /^  "(keyframes|skipped)"/ || /^    "adjustment": [0-9]/ {
    gsub(/[ "]/, "", $1)
    value[$1] = $2 + 0
  }
  END {
    if (value["skipped"] > 0 && value["skipped"] == value["keyframes"] - 1 && value["adjustment"] == value["skipped"]) exit 0
    print "demo.sh: --rate: " value["skipped"] " of " value["keyframes"] " keyframes skipped a stage, " value["adjustment"] \
          " their adjustment" > "/dev/stderr"
    exit 1
  }' "$json"

# All of the map together at the end, duplicates looked for between: better than before, and still sound.
"$1" "$2" --policy "$3" --no-bound --global-adjustment end --global-rounds 2 --json "$json" >/dev/null
awk -F '[:,]' '
  /^  "(ate_rmse_m|ate_before_global_rmse_m|map_faults)"/ {
    gsub(/[ "]/, "", $1)
    value[$1] = $2 + 0
  }
  END {
    ate = value["ate_rmse_m"]; before = value["ate_before_global_rmse_m"]
    if (ate > 0 && ate < before && "map_faults" in value && value["map_faults"] == 0) exit 0
    print "demo.sh: --global-adjustment: ATE " ate ", before " before ", map faults " value["map_faults"] > "/dev/stderr"
    exit 1
  }' "$json"

# Two mappers at a time make the same map as one.
digest=$(grep -o '"map_digest": *"[^"]*"' "$json")
"$1" "$2" --policy "$3" --global-adjustment end --global-rounds 2 --mappers 2 --json "$json"
if ! grep -q '"same_map": true' "$json" || [ "$(grep -o '"map_digest": *"[^"]*"' "$json")" != "$digest" ]; then
  echo "demo.sh: --mappers: not the map of one: $digest, $(cat "$json")" >&2
  exit 1
fi

# Options that would do nothing are refused, by their names.
said=$(mktemp)
trap 'rm -f "$json" "$said"' EXIT
for option in "--imu-noise 2" --pixel-centres "--culling-observers 8 --preset accurate" "--growth --mappers 2" \
  "--trajectory /dev/null --mappers 2" "--ply /dev/null --mappers 2" "--report /dev/null --mappers 2" "--error-parts --mappers 2" \
  "--merge-causes --mappers 2"; do
  status=0
  # shellcheck disable=SC2086  # options and their values
  "$1" "$2" --policy "$3" --no-bound $option >"$said" 2>&1 || status=$?
  if [ "$status" != 2 ] || ! grep -q -e "${option%% *}" "$said"; then
    echo "demo.sh: $option: not refused by name: status $status: $(cat "$said")" >&2
    exit 1
  fi
done

# The preset: no keyframe is culled, the whole map is adjusted, and the parts of its error are told.
"$1" "$2" --policy "$3" --no-bound --preset accurate --error-parts --json "$json" >/dev/null
awk -F '[:,]' '
  /^  "(ate_rmse_m|ate_before_global_rmse_m|map_faults|keyframes|keyframes_left)"/ {
    gsub(/[ "]/, "", $1)
    value[$1] = $2 + 0
  }
  /^    "(own|right|joined|known|all)"/ { ++parts }
  END {
    if (value["ate_rmse_m"] > 0 && value["ate_rmse_m"] < value["ate_before_global_rmse_m"] && value["map_faults"] == 0 &&
        value["keyframes"] > 0 && value["keyframes_left"] == value["keyframes"] && parts == 5) exit 0
    for (v in value) print "demo.sh: --preset accurate: " v " " value[v] > "/dev/stderr"
    print "demo.sh: --preset accurate: error parts " parts > "/dev/stderr"
    exit 1
  }' "$json"

# The other preset ends with rounds of fusion and adjustment, too. One policy says it for all: they give one map.
if [ "$3" = seq ]; then
  digest() {
    "$@" --no-bound --preset balanced --json "$json" >/dev/null && sed -n 's/^ *"map_digest": "\(.*\)",*$/\1/p' "$json"
  }
  without=$(digest "$1" "$2" --global-rounds 0)
  three=$(digest "$1" "$2" --global-rounds 3)
  preset=$(digest "$1" "$2")
  if [ -z "$without" ] || [ -z "$preset" ] || [ "$preset" != "$three" ] || [ "$preset" = "$without" ]; then
    echo "demo.sh: --preset balanced: the map is $preset, with three rounds $three, with none $without" >&2
    exit 1
  fi
fi
