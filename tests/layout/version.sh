#!/bin/bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
#
# The version is the same in every place that names it.
cd "$(dirname "$0")/../.." || exit 1
number() { sed -n "s/^#define TURBOMAP_VERSION_$1 \([0-9]*\)$/\1/p" include/turbomap/version.hpp; }
version=$(number MAJOR).$(number MINOR).$(number PATCH)
status=0
expect() {  # FILE TEXT
  grep -qF -- "$2" "$1" || { echo "$1 lacks '$2': include/turbomap/version.hpp says $version"; status=1; }
}
expect CMakeLists.txt "project(turbomap VERSION $version "
expect package.xml "<version>$version</version>"
expect docs/Doxyfile "PROJECT_NUMBER         = $version"
expect CHANGELOG.md "## [$version]"
exit $status
