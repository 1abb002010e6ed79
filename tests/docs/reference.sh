#!/bin/bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
#
# reference.sh [DOXYGEN]: the API reference has a word on every public symbol of every header, and no comment names what is not
# there. Left out by rule:
# - namespaces `detail`;
# - macros: they are for instantiated.cpp files, and told of where they are defined;
# - in cuda/, kernels and overloads of launchers: what they compute is told at the generic launcher, how at the top of the file.
cd "$(dirname "$0")/../.." || exit 1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
{
  cat docs/Doxyfile
  printf '%s\n' "OUTPUT_DIRECTORY = $scratch" 'EXTRACT_ALL = NO' 'WARN_IF_UNDOCUMENTED = YES' 'GENERATE_HTML = NO' \
    'GENERATE_XML = YES' 'QUIET = YES'
} | "${1:-doxygen}" - >"$scratch/log" 2>&1 || { cat "$scratch/log"; exit 1; }
[[ -s $scratch/xml/index.xml ]] || { cat "$scratch/log"; exit 1; }
! grep -E 'include/turbomap/.*(is not documented|link request|in the argument list|grouping command)' "$scratch/log" |
  grep -v '(macro definition)' | grep -vE '/cuda/[^:]*:.* Member (launch_\w+|\w+_kernel)\('
