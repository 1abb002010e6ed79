#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# each_header.sh LIST COMPILER OPTION...: reads each header of the list by itself, so one that forgets an include shows, which it does
# not after others that have it.
set -eu -o pipefail
list=$1
shift

# shellcheck disable=SC2016  # the inner shell's
xargs -P "$(nproc)" -I '{}' sh -c '
  echo "#include <$0>" | "$@" -fsyntax-only -x c++ - || { echo "$0 does not compile by itself"; exit 1; }' '{}' "$@" <"$list" 2>&1
