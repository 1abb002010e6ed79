#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: before_after.sh TURBOMAP-BEFORE-AFTER RECORDING
# Local mapping written by hand and the library make the same map under the same rules. A recording without visual words, of which
# neither would find a match, is refused.
set -eu -o pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$1" "$2"

cp -r "$2" "$work/recording"
words=$work/recording/log_kp_node.npy
# All bits set: no word. A .npy file is a header, its size in bytes 8 and 9 without those ten, and the numbers.
header=$((10 + $(od -An -tu2 -j8 -N2 "$words")))
{
  head -c "$header" "$2/log_kp_node.npy"
  head -c $(($(wc -c <"$words") - header)) /dev/zero | tr '\0' '\377'
} >"$work/none.npy"
mv -f "$work/none.npy" "$words"
status=0
"$1" "$work/recording" >"$work/said" 2>&1 || status=$?
if [ "$status" != 2 ] || ! grep -q 'has no visual words' "$work/said"; then
  echo "before_after.sh: without visual words: status $status: $(cat "$work/said")" >&2
  exit 1
fi
