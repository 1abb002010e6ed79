# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# For scripts that compile a test in several ways (same_decisions.sh, same_bits.sh, same_architectures.sh), or run it in several (same_runs.sh):
# whether the digests that it prints are the same. Source it; `work` is a folder of the script's own.

compared=0

# compare_digests NAME KINDS: those of lines `turbomap-KIND NAME-OF-DIGEST DIGEST` in $work/out, with those of the first call.
compare_digests() {
  sed -nE "s/^turbomap-($2) //p" "$work/out" >"$work/found"
  printf '%-40s %s\n' "$1" "$(awk '{ print $2 }' "$work/found" | tr '\n' ' ')"
  [ -s "$work/found" ] || { echo 'no digests'; exit 1; }
  [ -e "$work/first" ] || cp "$work/found" "$work/first"
  cmp -s "$work/first" "$work/found" || { echo 'DIFFERENT'; exit 1; }
  compared=$((compared + 1))
}

# To be called at the end: one alone is compared with nothing.
require_compared() {
  [ "$compared" -ge 2 ] || { echo 'fewer than two: nothing was compared'; exit 1; }
}
