#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# names.sh: finds what the documentation names and the repository does not have. Looked at are README.md, CONTRIBUTING.md,
# docs/*.md and the comments of include/:
#   in `backticks`   identifiers with an underscore, or called (`adjust(...)`), or qualified (`turbomap::adjust`); files;
#                    options (`--policy`). In comments, identifiers with an underscore also without backticks
#   links            files and headings
#   #include <turbomap/...>, also in code
#   \see             identifiers
# A name exists when the code (not a comment) of include/, tools/, examples/, tests/reference or tests/support has that word.
# And `--help` of every program has an example, and a script that is shown as a command can be run.
# names_allowed.txt lists the others, one regular expression a line.
set -eu -o pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$here/../.."
export LC_ALL=C

pages=(README.md CONTRIBUTING.md docs/*.md)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# --- what there is ---------------------------------------------------------------------------------------------------------

find . -path ./build -prune -o -path ./.git -prune -o -type f -print | sed 's,^\./,,' | sort >"$scratch/files"
mapfile -t headers < <(grep -E '^include/.*\.(hpp|cuh)$' "$scratch/files")
grep -E '^(include|tools|examples|tests/reference|tests/support)/.*\.(hpp|cpp|cu|cuh|inc)$' "$scratch/files" |
  xargs sed -E 's,//.*$,,' | grep -oE '[A-Za-z_][A-Za-z0-9_]*' | sort -u >"$scratch/words"
# Names of the build and of the scripts.
grep -E '(CMakeLists\.txt|\.cmake|\.cmake\.in|CMakePresets\.json)$|^(quickstart|\.ci/run)$' "$scratch/files" |
  xargs cat | grep -oE '[A-Za-z_][A-Za-z0-9_]*' | sort -u >>"$scratch/words"
# Fuzz targets.
sed -nE 's,^(tests|tools/tests)/fuzz/fuzz_(.*)\.cpp$,\2,p' "$scratch/files" >>"$scratch/words"
grep -hoE -- '--[a-z][a-z-]*' tools/*.cpp tools/*/options.hpp tools/simulation/keyframe_rules.hpp tools/*.py quickstart .ci/run | sort -u >"$scratch/options"
grep -vE '^#|^$' "$here/names_allowed.txt" >"$scratch/allowed" || true

# --- what is named: FILE:LINE<tab>KIND<tab>NAME ------------------------------------------------------------------------------

# Backticks and links outside of code blocks; includes everywhere.
awk '
  function spans(text, comment,    span, rest) {
    rest = text
    while (match(rest, /`[^`]+`/)) {
      span = substr(rest, RSTART + 1, RLENGTH - 2)
      rest = substr(rest, RSTART + RLENGTH)
      if (span ~ /^[A-Za-z0-9_.*\/-]+\.(hpp|cpp|cuh|cu|md|cmake|txt|inc|json)$/ || span ~ /^[A-Za-z0-9_.-]+\/[A-Za-z0-9_.*\/-]*$/) {
        print where "\tfile\t" span
        continue
      }
      while (match(span, /(^|[^A-Za-z0-9_-])--[a-z][a-z-]*/)) {
        option = substr(span, RSTART, RLENGTH)
        sub(/^[^-]*/, "", option)
        if (!comment) print where "\toption\t" option
        span = substr(span, 1, RSTART - 1) " " substr(span, RSTART + RLENGTH)
      }
      while (match(span, /[A-Za-z0-9_]+(::[A-Za-z_][A-Za-z0-9_]*)*\*?\(?/)) {
        name = substr(span, RSTART, RLENGTH)
        span = substr(span, RSTART + RLENGTH)
        if (name ~ /^[0-9]/) continue
        if (name ~ /^(std|thrust|cv|Eigen|Sophus|cub|boost|g2o)::/) continue
        called = sub(/\($/, "", name)
        if (name ~ /\*$/ && name !~ /_\*$/) sub(/\*$/, "", name)
        n = split(name, part, "::")
        for (i = 1; i <= n; ++i)
          if (called || n > 1 || part[i] ~ /[a-z0-9]_[a-z0-9*]/ || part[i] ~ /^TURBOMAP_/) print where "\tname\t" part[i]
      }
    }
  }
  FNR == 1 { code = 0 }
  { where = FILENAME ":" FNR }
  match($0, /#include <turbomap\/[^>]+>/) { print where "\theader\t" substr($0, RSTART + 10, RLENGTH - 11) }
  FILENAME ~ /\.md$/ {
    if (/^```/) { code = !code; next }
    if (code || /^    /) next
    spans($0, 0)
    rest = $0
    gsub(/`[^`]*`/, "", rest)
    while (match(rest, /\]\([^)]+\)/)) {
      target = substr(rest, RSTART + 2, RLENGTH - 3)
      rest = substr(rest, RSTART + RLENGTH)
      if (target !~ /^[a-z]+:/) print where "\tlink\t" target
    }
    next
  }
  /\/\// {
    comment = substr($0, index($0, "//"))
    spans(comment, 1)
    gsub(/`[^`]*`|[A-Za-z]+:\/\/[^ ]*|[A-Za-z0-9_.\/-]+\.[a-z]+|"[^"]*"/, " ", comment)
    while (match(comment, /[A-Za-z_][A-Za-z0-9_:]*/)) {
      name = substr(comment, RSTART, RLENGTH)
      comment = substr(comment, RSTART + RLENGTH)
      if (name ~ /^[a-z][a-z0-9]*(_[a-z0-9]+)+$/) print where "\tname\t" name
    }
    if (match($0, /\\see +[^ ]+/)) {
      name = substr($0, RSTART + 5, RLENGTH - 5)
      gsub(/[^A-Za-z0-9_:]/, "", name)
      n = split(name, part, "::")
      print where "\tname\t" part[n]
    }
  }' "${pages[@]}" "${headers[@]}" >"$scratch/named"

# --- the headings of each page, as links name them ---------------------------------------------------------------------------

for page in "${pages[@]}"; do
  awk -v page="$page" '
    /^```/ { code = !code }
    !code && /^#+ / {
      sub(/^#+ +/, "")
      heading = tolower($0)
      gsub(/[^a-z0-9 _-]/, "", heading)
      gsub(/ /, "-", heading)
      print page "#" heading
    }' "$page"
done >"$scratch/headings"

# --- compare -----------------------------------------------------------------------------------------------------------------

awk -F '\t' -v words="$scratch/words" -v files="$scratch/files" -v options="$scratch/options" \
  -v headings="$scratch/headings" -v allowed="$scratch/allowed" '
  function there(path,    f, r) {
    if (path in file || path in folder) return 1
    if (path !~ /\*/) return 0
    r = path
    gsub(/\./, "\\.", r); gsub(/\*/, "[^/]*", r)
    for (f in file) if (f ~ "^" r "$") return 1
    return 0
  }
  function named_file(path,    f) {
    sub(/\/$/, "", path)
    if (there(path) || there("include/" path) || there("include/turbomap/" path) || there("tools/" path) ||
        there("tests/" path) || there("docs/" path) || there("tools/tests/" path)) return 1
    if (path !~ /\//) return path in base
    return 0
  }
  function resolve(from, path,    n, part, i, k, out) {
    sub(/[^\/]*$/, "", from)
    n = split(from path, part, "/")
    k = 0
    for (i = 1; i <= n; ++i) {
      if (part[i] == "." || part[i] == "") continue
      if (part[i] == "..") { --k; continue }
      out[++k] = part[i]
    }
    path = out[1]
    for (i = 2; i <= k; ++i) path = path "/" out[i]
    return path
  }
  BEGIN {
    while ((getline line < words) > 0) word[line] = 1
    while ((getline line < options) > 0) option[line] = 1
    while ((getline line < headings) > 0) heading[line] = 1
    while ((getline line < allowed) > 0) pattern[++patterns] = line
    while ((getline line < files) > 0) {
      file[line] = 1
      n = split(line, part, "/")
      base[part[n]] = 1
      path = ""
      for (i = 1; i < n; ++i) { path = path (i > 1 ? "/" : "") part[i]; folder[path] = 1 }
    }
    for (w in word) { while (match(w, /_[^_]*$/)) { w = substr(w, 1, RSTART - 1); prefix[w "_*"] = 1 } }
  }
  {
    split($1, at, ":")
    good = 0
    for (i = 1; i <= patterns && !good; ++i) good = $3 ~ "^(" pattern[i] ")$"
    if (good) next
    if ($2 == "name") good = $3 in word || $3 in prefix
    else if ($2 == "option") good = $3 in option
    else if ($2 == "header") good = ("include/" $3) in file
    else if ($2 == "file") good = named_file($3)
    else {
      n = split($3, target, "#")
      path = target[1] == "" ? at[1] : resolve(at[1], target[1])
      sub(/\/$/, "", path)
      good = path in file || path in folder
      if (good && n == 2 && path ~ /\.md$/) good = (path "#" target[2]) in heading
    }
    if (!good) { print $1 ": no " $2 " " $3; ++bad }
  }
  END { exit bad > 0 }' "$scratch/named"

without=$(grep -LE '"Examples?:' tools/*.cpp || true)
if [[ -n $without ]]; then
  echo "$without: --help has no example"
  exit 1
fi

for script in $(sed -nE 's,^ *(\./)?([a-z]+/[A-Za-z0-9_/]+\.(py|sh))( .*)?$,\2,p' "${pages[@]}" | sort -u); do
  if [[ ! -x $script ]]; then
    echo "$script: shown as a command, and cannot be run"
    exit 1
  fi
done
