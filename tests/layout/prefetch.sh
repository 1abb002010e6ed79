#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# prefetch.sh CXX [flags]: what map/read_ahead.hpp asks memory for is in the compiled code. g++ removes calls of functions
# that only prefetch (prefetch.hpp).
set -eu -o pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# 4 of `entry`, 3 of `views`; loops may be copied.
asked=$("$@" -std=c++17 -O2 -DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP -I"$here/../../include" -x c++ -S -o - - <<'SOURCE' |
#include <turbomap/camera/pinhole.hpp>
#include <turbomap/descriptor/binary.hpp>
#include <turbomap/map/read_ahead.hpp>
#include <turbomap/map/simple_map/simple_map.hpp>

using map = turbomap::simple_map<turbomap::binary_descriptor<256>, turbomap::pinhole<float>>;
double sum(const map& m, turbomap::map_keyframe_id k) {
  double s = 0;
  turbomap::for_each_slot_ahead<turbomap::point_data::entry + turbomap::point_data::views>(
      m, k, [&](std::size_t, const turbomap::map_point_id& p) {
        if (m.alive(p)) s += turbomap::map_traits<map>::position(m, p).x;
      });
  return s;
}
SOURCE
  grep -cE '^[[:space:]]*(prefetch|prfm|pld|dcbt)') || asked=0
if [ "$asked" -lt 7 ]; then
  echo "prefetch.sh: the compiled loop asks memory $asked times, not 7 or more"
  exit 1
fi
