#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
#
# guides.sh ROOT [PAGE...]: types what README.md and the guides of docs/ tell a reader to type, and says how many seconds each
# page took. It stops at the first command that fails, and shows the end of its output.
#
#   ROOT   the folder of a Debian 12 that has git and nothing else: everything runs in it by chroot, as root. Or `/`: this
#          machine, where lines with apt-get are left out: what the pages need should be there (./quickstart asks for what is not)
#   PAGE   these pages only, as docs/cmake.md; README.md always comes first, because the others need its clone and its build
#
# Nothing is written down twice: commands and files come from the pages. HTML comments mark them, which readers do not see:
#   <!-- typed -->             the next block is commands, typed in the folder that holds the clone `turbomap`
#   <!-- typed in FOLDER -->   the same, in FOLDER below it
#   <!-- file NAME -->         the next block is what the reader has put into the file NAME
#   <!-- program NAME -->      here the reader has put all blocks of the page that are marked as compiled into the file NAME
# Each block has a shell of its own. The word ADDRESS stands for where the clone comes from: HEAD of this repository.
set -eu -o pipefail
[ $# -gt 0 ] || { sed -n '5,11s/^# \{0,1\}//p' "$0" >&2; exit 2; }
root=$(cd "$1" && pwd)
root=${root%/}
shift
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
mapfile -t pages < <(grep -l '^ *<!-- typed' docs/*.md)
[ $# = 0 ] || pages=("$@")

work=$(mktemp -d -p "$root/tmp")  # kept where a command failed
inside=${work#"$root"}
git init -q --bare -b main "$work/address"
git push -q "$work/address" HEAD:refs/heads/main
if [ -n "$root" ]; then
  echo 'APT::Get::Assume-Yes "true";' >"$work/apt.conf"
  # Nothing of this machine's environment.
  shell=(env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive
    APT_CONFIG="$inside/apt.conf" chroot "$root" bash)
else
  shell=(bash)
fi

script_of() {  # PAGE: a shell script of what is typed
  echo 'set -eu -o pipefail'
  [ -n "$root" ] || echo 'apt-get() { echo "left out: apt-get $*"; }'
  awk -v work="$inside" '
    function line(text) { return substr(text, 1, depth) ~ /^ *$/ ? substr(text, depth + 1) : text }
    function finish() {
      if (block == "typed") print script "\n)"
      if (block == "file") print script "END_OF_FILE"
      block = ""
    }
    function begin_file(name) { return "cd " work " && mkdir -p \"$(dirname " name ")\" && cat >" name " <<\"END_OF_FILE\"\n" }
    NR == FNR {  # the first time: the program of the page
      if (/^<!-- compiled -->/) marked = 1
      else if (/^```/) { in_program = marked; marked = 0 }
      else if (in_program) program = program $0 "\n"
      next
    }
    match($0, /<!-- (typed|file|program)( in)?( [^ ]+)? -->/) {
      finish()
      if ($2 == "program") print begin_file($3) program "END_OF_FILE"
      else {
        block = $2
        script = block == "file" ? begin_file($3) : "(\ncd " work "/" ($3 == "in" ? $4 : "") "\nset -x"
        fenced = -1
      }
      next
    }
    block == "" { next }
    fenced < 0 {  # before the first line of the block
      if (/^ *$/) next
      depth = match($0, /[^ ]/) - 1
      fenced = /^ *```/
      if (fenced) next
    }
    fenced && /^ *```/ || !fenced && /[^ ]/ && substr($0, 1, depth) ~ /[^ ]/ { finish(); next }
    {
      text = line($0)
      if (block == "typed") gsub(/ && /, "\n", text)  # `set -e` overlooks what fails before an &&
      script = script (block == "typed" ? "\n" text : text "\n")
    }
    END { finish() }' "$1" "$1" | sed "s,\<ADDRESS\>,$inside/address,"
}

for page in README.md "${pages[@]}"; do
  [ "$page" != README.md ] || [ ! -e "$work/done" ] || continue
  script_of "$page" >"$work/typed.sh"
  start=$SECONDS
  if ! "${shell[@]}" "$inside/typed.sh" </dev/null >"$work/log" 2>&1; then
    tail -n 30 "$work/log"
    echo "guides: $page: a command failed after $((SECONDS - start)) s (all output: $work/log)" >&2
    exit 1
  fi
  printf '%5d s  %s\n' $((SECONDS - start)) "$page"
  touch "$work/done"
done
rm -rf "$work"
