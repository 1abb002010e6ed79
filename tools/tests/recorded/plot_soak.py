#!/usr/bin/env python3
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""Draws the figures of test_recorded_soak: time and memory against the hours of recorded time.

    tools/tests/recorded/plot_soak.py soak_euroc_v102_stereo_1.csv docs/figures/soak_recorded.svg
"""

import csv
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent))
import evaluate  # noqa: E402

LICENCE = "\n<!-- SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors; SPDX-License-Identifier: Apache-2.0 -->"


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    with open(sys.argv[1], newline="") as file:
        rows = list(csv.DictReader(file))
    shown = rows[:12] + rows[12::max(1, len(rows) // 200)]  # the first passes whole: there the map grows
    line = lambda column, scale=1: [(float(r["recorded_hours"]), scale * float(r[column])) for r in shown]
    svg = evaluate.plot(f"{pathlib.Path(sys.argv[1]).stem}, {int(rows[-1]['keyframe']):,} keyframes", "hours of recorded time", "", {
        "ms, median of a pass": line("ms_median"), "ms, 99 % of a pass": line("ms_p99"), "memory, 10 MB": line("mb", 0.1)})
    head, tail = svg.split("\n", 1)
    pathlib.Path(sys.argv[2]).write_text(head + LICENCE + "\n" + tail)


if __name__ == "__main__":
    main()
