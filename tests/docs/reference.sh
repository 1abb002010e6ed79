#!/bin/bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
#
# reference.sh [DOXYGEN]: the API reference has a word on every public symbol of the headers that reference.txt lists: those that
# users include and specialise, and what else is complete. Take a header into the list when it is.
cd "$(dirname "$0")/../.." || exit 1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
{
  cat docs/Doxyfile
  printf '%s\n' "OUTPUT_DIRECTORY = $scratch" 'EXTRACT_ALL = NO' 'WARN_IF_UNDOCUMENTED = YES' 'GENERATE_HTML = NO' \
    'GENERATE_XML = YES' 'QUIET = YES'
} | "${1:-doxygen}" - >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
status=0
while IFS= read -r header; do
  [[ -z $header || $header == \#* ]] && continue
  [[ -e include/turbomap/$header ]] || { echo "no header $header"; status=1; }
  # Macros are for instantiated.cpp files, and told of where they are defined.
  grep -F "include/turbomap/$header:" "$scratch/log" | grep 'is not documented' | grep -v '(macro definition)' && status=1
done <tests/docs/reference.txt
exit $status
