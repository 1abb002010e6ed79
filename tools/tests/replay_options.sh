#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: replay_options.sh TURBOMAP-SIMULATE TURBOMAP-REPLAY PYTHON
# What turbomap-replay refuses, and what it says of recordings that are too short or of which the truth is known in part.
set -eu -o pipefail
simulate=$1 replayer=$2 python=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
  echo "replay_options.sh: $1" >&2
  exit 1
}
# refused WORDS OPTION...: ends with 2, and says so
refused() {
  local words=$1 status=0
  shift
  "$replayer" "$@" >"$work/out" 2>&1 || status=$?
  [ "$status" = 2 ] || fail "status $status of $*: $(cat "$work/out")"
  grep -qF -- "$words" "$work/out" || fail "$* says: $(cat "$work/out")"
}

"$simulate" builtin --keyframes 6 --out "$work/short" >/dev/null
short=$work/short
refused '--rate: nan is not a positive number' "$short" --rate nan
refused '--stereo-correlation: nan' "$short" --stereo-correlation nan
refused '--global-rounds: not without' "$short" --global-rounds 2
refused '--marginal-prior: the replay is without an IMU' "$short" --marginal-prior
refused '--beside cuda: this program was built without it' "$short" --beside seq,cuda
refused 'its folder does not exist' "$short" --json "$work/none/a.json"
for option in '--beside all' --error-parts '--map objects' --imu; do
  # shellcheck disable=SC2086  # an option and its value
  refused 'not together with --check' "$short" --check $option
done

# Six keyframes are too few for statistics. Over a recorded run, whose times stay: the peer's, not of this recording.
printf 'iter,ms_process,ms_mpculling,ms_sft,ms_createnew,ms_fuse,ms_lba,ms_cull_orig\n0,1,1,1,2,1,1,1\n' >"$short/timing.csv"
"$replayer" "$short" --no-bound --beside seq --json "$work/short.json" --trajectory "$work/t.txt" --report "$work/r.html" \
  >"$work/out"
if grep -qw 'nan\|-nan' "$work/out"; then fail "of six keyframes: $(cat "$work/out")"; fi
if grep -q peer_ms_mean "$work/short.json"; then fail 'six simulated keyframes have a peer'; fi

# Ground truth that begins late: the keyframes before it are left out of the error.
cat >"$work/late.py" <<'PY'
import pathlib, sys
for name, skipped in (("gt_t_ns", 8), ("gt_Twb", 56)):
    path = pathlib.Path(sys.argv[1]) / (name + ".npy")
    data = path.read_bytes()
    begin = 10 + int.from_bytes(data[8:10], "little")
    header = data[10:begin].decode()
    rows = int(header.split("(")[1].split(",")[0])
    left = rows - rows // 2
    header = header.replace("(%d," % rows, "(%d," % left).rstrip().ljust(begin - 11) + "\n"
    path.write_bytes(data[:10] + header.encode() + data[begin + skipped * (rows - left):])
PY
"$simulate" builtin --keyframes 12 --out "$work/late" >/dev/null
"$python" "$work/late.py" "$work/late"
"$replayer" "$work/late" --no-bound --json "$work/late.json" >"$work/out"
grep -q 'of the 6 keyframes whose time ground truth covers' "$work/out" || fail "half of the truth: $(cat "$work/out")"
grep -q '"ate_keyframes": 6' "$work/late.json" || fail 'ate_keyframes'
awk -F '[:,]' '/^  "ate_rmse_m"/ { right = $2 + 0 > 0 && $2 + 0 < 0.01 } END { exit !right }' "$work/late.json" || fail "$(grep ate_ "$work/late.json")"

# A name that is not UTF-8, over a result that is there.
odd=$(printf '%s/odd\377' "$work")
cp -r "$short" "$odd"
echo old >"$work/odd.json"
"$replayer" "$odd" --no-bound --json "$work/odd.json" >/dev/null
grep -q '"map_digest"' "$work/odd.json" || fail 'no result of a recording whose name is not UTF-8'
