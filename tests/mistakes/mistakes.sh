#!/bin/bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
#
# mistakes.sh COMPILER [FLAG...]: every mistake of mistakes.txt is one error, which says what the list says. The flags say where
# Thrust is, if not where the compiler looks.
folder=$(cd "$(dirname "$0")" && pwd)
compiler=$1
failed=0
mistakes=0
while IFS= read -r line; do
  [[ $line == \#* || -z $line ]] && continue
  mistakes=$((mistakes + 1))
  macros=${line%%:*}
  text=${line#*:}
  text=${text# }
  beside=
  [[ $text == *" | "* ]] && beside=${text#* | } text=${text%% | *}
  output=$("$compiler" "${@:2}" -std=c++17 -fsyntax-only -I"$folder/../../include" -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP \
    $(for m in ${macros//+/ }; do echo "-D$m"; done) "$folder/mistakes.cpp" 2>&1)
  errors=$(grep 'error:' <<<"$output")
  count=$(grep -c . <<<"$errors")
  wanted=1
  [[ -z $text ]] && wanted=0
  if [[ $count != "$wanted" ]] || { [[ -n $text ]] && ! grep -qF -- "$text" <<<"$errors"; } ||
    { [[ -n $beside ]] && ! grep -q -E -- "${beside}" <<<"$output"; }; then
    echo "$compiler, $macros: $count errors, where the error must say: $text $beside"
    head -n 5 <<<"$errors"
    failed=1
  fi
done <"$folder/mistakes.txt"
if [[ $mistakes == 0 ]]; then
  echo "$folder/mistakes.txt lists no mistake"
  failed=1
fi
exit $failed
