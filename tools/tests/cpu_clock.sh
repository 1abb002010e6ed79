#!/usr/bin/env bash
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0

# usage: cpu_clock.sh LIBTURBOMAP-CPU-CLOCK PYTHON
# A process that waits for another uses no processor time of its own: with the library its monotonic clock stands still.
set -eu -o pipefail
library=$1 python=$2
waited='import os, time
begin = time.monotonic()
os.system("env -u LD_PRELOAD sleep 0.3")
print(int(1000 * (time.monotonic() - begin)))'
without=$("$python" -c "$waited")
with=$(LD_PRELOAD=$library "$python" -c "$waited")
echo "waited $without ms, of which processor time $with ms"
[ "$without" -ge 300 ] && [ "$with" -lt 200 ]
