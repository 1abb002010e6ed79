#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: damaged_imu.sh TURBOMAP-SIMULATE TURBOMAP-REPLAY
# Replays simulated recordings whose IMU samples were damaged.
#   samples that are missing, for a part of an interval between keyframes and for whole ones; equal times: such an interval has no
#   motion, which is counted; the IMU is initialised all the same, and the map is as good as without the damage
#   times that decrease, a value that is not a number: the recording is refused, and the message names array and row
#   an accelerometer at the end of its range, which a recording does not tell: the map stays sound and its error below 3 cm; with
#   one camera, before the initialisation, the IMU is not initialised, and the map keeps its unit
set -eu -o pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
simulate=$1 replayer=$2
cd "$(dirname "$0")" && . ./shaken.sh && cd "$work"
fail() { echo "damaged_imu.sh: $*" >&2; exit 1; }

shaken >shaken.tum
"$simulate" shaken.tum --imu --uninitialised --out stereo >/dev/null
"$simulate" shaken.tum --mono --imu --uninitialised --out mono >/dev/null

# Rows of an array: a header of 128 bytes (v1.0: 10 and what the two bytes from the eighth on say), then the numbers.
samples=$((($(wc -c <stereo/imu_t_ns.npy) - 128) / 8))
[ "$(head -c 10 stereo/imu_t_ns.npy | od -An -tu1 | tr -d ' \n')" = 1477885778089101180 ] || fail "another header"
# rows FILE BYTES-OF-A-ROW FIRST COUNT
rows() { tail -c +$((129 + $2 * $3)) "$1" | head -c $(($2 * $4)) || true; }
# overwrite FILE BYTE: with what is read
overwrite() { dd of="$1" bs=1 seek="$2" conv=notrunc status=none; }
# array TYPE SHAPE: a header, and what is read
array() { printf '\223NUMPY\001\000v\000%-117s\n' "{'descr': '$1', 'fortran_order': False, 'shape': $2, }" && cat; }

# without NAME OF FIRST COUNT: so many samples are missing
without() {
  cp -r "$2" "$1"
  local left=$((samples - $4)) end=$(($3 + $4))
  { rows "$2/imu_t_ns.npy" 8 0 "$3"; rows "$2/imu_t_ns.npy" 8 $end $((samples - end)); } |
    array '<i8' "($left,)" >"$1/imu_t_ns.npy"
  { rows "$2/imu_gyro_acc.npy" 48 0 "$3"; rows "$2/imu_gyro_acc.npy" 48 $end $((samples - end)); } |
    array '<f8' "($left, 6)" >"$1/imu_gyro_acc.npy"
}
# same_time NAME ROW OTHER: the time of a row becomes that of another
same_time() { rows "$1/imu_t_ns.npy" 8 "$3" 1 | overwrite "$1/imu_t_ns.npy" $((128 + 8 * $2)); }
# saturated NAME FIRST COUNT: 40 m/s^2 along x
saturated() {
  for ((row = $2; row < $2 + $3; ++row)); do
    printf '\0\0\0\0\0\0\104\100' | overwrite "$1/imu_gyro_acc.npy" $((128 + 48 * row + 24))
  done
}

# value NAME KEY: of the JSON of a replay; nothing: it is not there
value() { sed -n "s/^ *\"$2\": \([^,]*\),*$/\1/p" "$1.json" | head -n 1; }
replay() { "$replayer" "$1" --no-bound --json "$1.json" "${@:2}" >/dev/null; }
# goes_on NAME INTERVALS ERROR [REPLAY-ARGUMENTS...]: so many intervals without motion at least, ATE below ERROR (m)
goes_on() {
  local name=$1 intervals=$2 error=$3
  replay "$name" "${@:4}" || fail "$name: the replay failed"
  [ "$(value "$name" map_faults)" = 0 ] || fail "$name: the map has faults"
  local holes
  holes=$(value "$name" intervals_without_motion)
  if [ "$intervals" = 0 ]; then
    [ "$holes" = 0 ] || fail "$name: $holes intervals without motion"
  else
    [ "$holes" -ge "$intervals" ] || fail "$name: $holes intervals without motion"
    value "$name" first_refusal | grep -q "samples.t_ns\[" || fail "$name: refused without the sample's name"
  fi
  awk -v e="$(value "$name" ate_rmse_m)" -v most="$error" 'BEGIN { exit !(e > 0 && e < most) }' ||
    fail "$name: ATE $(value "$name" ate_rmse_m)"
}
initialised() { [ -n "$(value "$1" seconds)" ] || fail "$1: not initialised"; }
# refused NAME ROW-AND-RULE
refused() {
  if replay "$1" 2>"$1.error"; then fail "$1: not refused"; fi
  grep -q "$2" "$1.error" || fail "$1: $(cat "$1.error")"
}

without whole stereo 100 0
cmp stereo/imu_t_ns.npy whole/imu_t_ns.npy
cmp stereo/imu_gyro_acc.npy whole/imu_gyro_acc.npy
goes_on whole 0 0.001
initialised whole

# 200 samples per second; keyframes are 0.3 to 0.5 s apart.
without part stereo 2000 20
goes_on part 1 0.001
initialised part
without second stereo 2000 200
goes_on second 2 0.001
initialised second
goes_on second 2 0.001 --map objects --imu
without three_seconds stereo 2000 600
goes_on three_seconds 5 0.001
initialised three_seconds
without early stereo 300 200  # while it waits for its initialisation
goes_on early 2 0.001
initialised early
without mono_second mono 2000 200
goes_on mono_second 2 0.002
initialised mono_second
without mono_early mono 300 200
goes_on mono_early 2 0.002
initialised mono_early

cp -r stereo equal
same_time equal 2000 1999
same_time equal 3000 2999
goes_on equal 2 0.001
initialised equal
cp -r stereo falls
same_time falls 2000 1990
refused falls "array imu_t_ns: row 2000 is earlier than the one before"
cp -r stereo nan
printf '\0\0\0\0\0\0\370\177' | overwrite nan/imu_gyro_acc.npy $((128 + 48 * 2000 + 24))
refused nan "array imu_gyro_acc: row 2000 holds a number that is not finite"

for first in 400 2000 3000; do  # a tenth of a second: 4 m/s that there never were
  cp -r stereo saturated_$first
  saturated saturated_$first $first 20
  goes_on saturated_$first 0 0.03
done
cp -r mono mono_saturated
saturated mono_saturated 400 20
# Not initialised, the map keeps the unit of the poses that came in, 0.4 m, which alone is an ATE of 0.3006 m (0.3027 m are
# measured). A map that lost its way has more of it, one whose unit was changed another scale.
goes_on mono_saturated 0 0.307
awk -v e="$(value mono_saturated scale_error)" 'BEGIN { exit !(e > 1.47 && e < 1.53) }' ||
  fail "mono_saturated: the scale is off by $(value mono_saturated scale_error), not by 1.5"
[ -n "$(value mono_saturated not_initialised)" ] || fail "mono_saturated: initialised by what contradicts the poses"
