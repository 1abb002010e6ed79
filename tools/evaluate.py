#!/usr/bin/env python3
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluates local mapping as the TurboMap paper does, and writes tables (CSV, Markdown), plots (SVG) and one HTML page.

Replays every recording of DATA/recordings and simulated ones under each policy that turbomap-replay was built with: stage
times beside those that the recorded system needed, trajectory errors, time per keyframe over the run, keyframes that come
faster than recorded, and whether the map is the same for every run, policy and number of threads. One replay at a time, so
that times can be quoted. Results are kept in the work folder: a run that was cut off goes on where it was. They are made anew when
the program, the recording or the problem has changed.

    tools/evaluate.py --out evaluation                      everything, into the folder evaluation/
    tools/evaluate.py --quick --out evaluation              one policy's stress test, few simulated recordings
    tools/evaluate.py --quick --docs docs/evaluation.md     ... and into the page, with the figures as CSV beside it
    tools/evaluate.py --check docs/evaluation.md            whether the page shows those figures and no other"""

import csv
import datetime
import hashlib
import html
import json
import math
import os
import pathlib
import platform
import re
import resource
import statistics
import subprocess
import sys
import textwrap
import time

import evaluate_creation as replays
from evaluate_creation import get, ratio, show

STAGES = ["process", "point_culling", "search", "creation", "fusion", "adjustment", "keyframe_culling", "total"]
PEER_COLUMNS = {"process": "ms_process", "point_culling": "ms_mpculling", "search": "ms_sft", "fusion": "ms_fuse",
                "adjustment": "ms_lba", "keyframe_culling": "ms_cull_orig"}  # creation: ms_createnew less the search
WARM_UP = 11  # keyframes left out of the means, as turbomap-replay does
RATES = ["1", "2", "4", "8"]
PAPER = {"euroc": 1.3, "tum": 1.6}  # 'TurboMap: GPU-Accelerated Local Mapping for Visual SLAM', abstract: whole mapping, a GPU
CERES_MS = 90  # per iteration of synthetic-lba/30-20-6000 where and when the recorded system was timed
ABLATION = {"search_exact": "search", "creation": "creation", "duplicates": "fusion", "map_update": "point update", "adjustment":
            "adjustment", "point_culling": "point culling", "culling": "keyframe culling"}  # stages of turbomap-bench
# Of the size of these three problems of BAL: cameras, points, observations.
GENERATED = {"Ladybug-1723": "1723,156502,678718", "Venice-1778": "1778,993923,5001946", "Final-13682": "13682,4456117,28987644"}
SECONDS_PER_KEYFRAME = 0.015  # of a replay, for a first guess of the time left
SECONDS_OF_BENCH, SECONDS_OF_BUNDLE, SECONDS_OF_GENERATED = 3, 2, 20  # per repetition of all snapshots of a recording; per problem
SECONDS_OF_BUNDLE_PER_MB = 2  # of a BAL file
KERNEL_TIMES = "libturbomap-kernel-times.so"
CUPTI = ("/usr/local/cuda/lib64/libcupti.so", "/usr/local/cuda/extras/CUPTI/lib64/libcupti.so")
ONE_THREAD = "one thread"
BEGIN, END = "<!-- evaluate: begin -->", "<!-- evaluate: end -->"
COLOURS = ["#06c", "#c60", "#090", "#b0b", "#888", "#c22"]


def parse_arguments():
    what, how, examples = __doc__.split("\n\n")
    p = replays.common_arguments(f"{what}\n\n{how}", "examples:\n" + examples)
    p.add_argument("--quick", action="store_true", help="stress test under one policy, one simulated trajectory, fewer repetitions")
    p.add_argument("--runs", type=replays.positive, help="replays of each recording and policy, of which the fastest counts; default 3, --quick 1")
    p.add_argument("--policies", type=replays.words, help="default: seq, omp, tbb and cuda, as far as they run here")
    p.add_argument("--trajectories", type=replays.words, help="of simulated recordings; default: all, --quick: builtin")
    p.add_argument("--keyframes", type=replays.positive, help="per simulated recording; default 100, --quick 40")
    p.add_argument("--no-recorded", action="store_true", help="simulated recordings only")
    p.add_argument("--no-simulated", action="store_true", help="recordings only")
    p.add_argument("--no-inertial", action="store_true", help="no replays with the recordings' IMU")
    p.add_argument("--no-times", action="store_true", help="errors and determinism only: for a machine that is busy with other work")
    p.add_argument("--commit", help="that the programs were built from; default: that of this working tree")
    p.add_argument("--options", default="", help="for every replay")
    p.add_argument("--out", type=pathlib.Path, default=pathlib.Path("evaluation"), help="folder of the results")
    p.add_argument("--docs", type=pathlib.Path, metavar="PAGE", help="write the tables between the marks of this page too")
    p.add_argument("--check", type=pathlib.Path, metavar="PAGE", help="compare this page with the CSV beside it, and end")
    args = p.parse_args()
    args.given = given(args)
    args.policy, args.seeds, args.noise, args.drift = "seq", ["1"], ["0.5"], "0.01"
    args.rigs = [rig for rig in replays.RIGS if rig != "mono" and not (args.no_inertial and rig.endswith("inertial"))]
    args.seconds = []  # that each program took whose results are shown, also in a run before this one
    args.runs = 1 if args.no_times else args.runs or (1 if args.quick else 3)
    args.keyframes = args.keyframes or (40 if args.quick else 100)
    args.trajectories = args.trajectories or (["builtin"] if args.quick else None)
    return args


def given(args):
    """The options that say what is run and how, as they were given; not those that say where."""
    shown = []
    for name in ("quick", "runs", "policies", "trajectories", "keyframes", "no_recorded", "no_simulated", "no_inertial", "no_times", "options"):
        value = getattr(args, name)
        if value:
            words = ",".join(value) if isinstance(value, list) else str(value)
            shown.append("--" + name.replace("_", "-") + ("" if value is True else f" '{words}'" if " " in words else f" {words}"))
    return " ".join(shown)


# --- the recorded system ------------------------------------------------------------------------------------------------

def peer_rows(folder):
    """[{stage: ms, 'arrival': ms}] of the recorded system (the peer), by keyframe. Empty: not recorded."""
    for name in ("timing_quiet.csv", "timing.csv"):
        if (folder / name).exists():
            break
    else:
        return []
    rows = []
    with open(folder / name, newline="") as file:
        table_of_peer = csv.DictReader(file)
        try:
            for row in table_of_peer:
                ms = {stage: float(row[column]) for stage, column in PEER_COLUMNS.items()}
                ms["creation"] = float(row["ms_createnew"]) - ms["search"]
                ms["total"] = sum(ms.values())
                rows.append({**ms, "arrival": 1000 * float(row["timestamp"]), "told": int(row["iter"]) > 10 and row["snapshot"] == "0"})
        except KeyError as column:
            sys.exit(f"evaluate: {folder / name}: there is no column {column}")
        except (TypeError, ValueError):  # a field that is missing is None
            sys.exit(f"evaluate: {folder / name}: line {table_of_peer.line_num}: a number is missing")
    for row in reversed(rows):
        row["arrival"] -= rows[0]["arrival"]
    return rows


def meta_of(folder):
    """What a recording's meta.json says."""
    try:
        meta = json.loads((folder / "meta.json").read_text())
    except ValueError as fault:
        sys.exit(f"evaluate: {folder / 'meta.json'}: {fault}")
    return meta if isinstance(meta, dict) else {}  # which turbomap-replay will refuse


def peer_under_load(rows, rate):
    """What the peer would skip and how late it would be at `rate`, computed from its recorded times by the rules of
    turbomap-replay --rate: fusion, adjustment and keyframe culling are skipped while the next keyframe waits."""
    clock, skipped, latencies = 0.0, dict.fromkeys(("fusion", "adjustment", "keyframe_culling"), 0), []
    arrivals = [row["arrival"] / rate for row in rows]
    for i, row in enumerate(rows):
        clock = max(clock, arrivals[i]) + sum(row[s] for s in ("process", "point_culling", "search", "creation"))
        for stage in skipped:
            if i + 1 < len(rows) and arrivals[i + 1] <= clock:
                skipped[stage] += 1
            else:
                clock += row[stage]
        latencies.append(clock - arrivals[i])
    return skipped, statistics.median(latencies[WARM_UP:] or latencies), max(latencies)


# --- what is run --------------------------------------------------------------------------------------------------------

class set_up:
    """One recording, with or without its IMU."""

    def __init__(self, name, folder, options=(), command=None):
        self.name, self.folder, self.options, self.command = name, folder, list(options), command


def all_cases(args):
    made = []
    for name, folder in replays.recorded(args):
        made.append(set_up(name, folder))
        if meta_of(folder).get("sensor") == "inertial" and not args.no_inertial:
            made.append(set_up(name + ", IMU", folder, ["--imu"]))
    if not args.no_simulated:
        for rig, trajectory, _, _, folder, command in replays.simulated(args):
            imu = ["--imu"] if rig.endswith("inertial") else []
            made.append(set_up(f"simulated {rig}, {trajectory}", folder, ["--no-bound", *imu], command))
    return made


def problems(args):
    """{name: BAL file}; the folder is named where two have a file of one name."""
    files = sorted(args.data.glob("bal*/problem*.txt"))
    stems = [file.stem for file in files]
    return {file.stem if stems.count(file.stem) == 1 else f"{file.parent.name}/{file.stem}": file for file in files}


def keyframe_count(args, case):
    rows = peer_rows(case.folder)
    return len(rows) or args.keyframes


def policies(args):
    """Those that the program runs on this machine, by a replay of nothing but a name: one that is not there is refused."""
    if args.policies:
        return args.policies
    program, found = str(args.bin / "turbomap-replay"), []
    for policy in ("seq", "omp", "tbb", "cuda"):
        done = subprocess.run([program, str(args.work / "no_recording"), "--policy", policy], capture_output=True, text=True)
        if "no_recording" in done.stderr:  # it got as far as reading
            found.append(policy)
    return found


class progress:
    """Says on stderr how much is done and how long the rest will take; jobs are weighed by the seconds that they may take."""

    def __init__(self, weights):
        self.total, self.done, self.fresh, self.begin = sum(weights), 0, 0, time.monotonic()
        self.say(f"{len(weights)} runs of programs, about {minutes(self.total)}, less what is kept from before")

    def say(self, text):
        if sys.stderr.isatty():
            print("\r\033[K" + text, end="", file=sys.stderr, flush=True)
        else:
            print(text, file=sys.stderr, flush=True)

    def advance(self, weight, seconds, name):
        self.done += weight
        if seconds > 0.05:  # not kept from before
            self.fresh += weight
        rate = (time.monotonic() - self.begin) / self.fresh if self.fresh else 1
        self.say(f"{100 * self.done / self.total:3.0f} %, about {minutes((self.total - self.done) * rate)} left: {name}")
        if self.done >= self.total and sys.stderr.isatty():
            print(file=sys.stderr)


def minutes(seconds):
    return f"{seconds / 60:.0f} min" if seconds >= 90 else f"{seconds:.0f} s"


def run_all(args, made, names):
    """What every program said: replays {(case name, policy, what): JSON}, Ceres' clock, BAL problems by (name, policy), generated ones, stages alone, what
    became of each stage on a device, and what went wrong besides the replays [(recording or problem, policy, what, fault)]."""
    jobs = []  # (weight, name, work)
    results, measured, adjusted, made_problems, alone, device, faults = {}, {}, {}, {}, {}, {}, []
    # Of each set-up that was replayed: what its first replay found out from observations, which takes a quarter of its time, holds for
    # the others. []: the recording says it.
    centres = {}

    def keep(to, key, what, found, policy="-"):
        if "failed" in found:
            faults.append((key[0] if isinstance(key, tuple) else key, policy, what, found["failed"]))
        else:
            to[key] = found

    def add_device_parts(case):
        def work():
            if case.name in centres:  # else all replays failed, which is told
                keep(device, case.name, "kernels and transfers", device_parts(args, case, centres[case.name]), "cuda")
        jobs.append((keyframe_count(args, case) * SECONDS_PER_KEYFRAME, f"{case.name}, kernels and transfers", work))

    def add_replay(case, policy, what, more, options):
        def work():
            fault = replays.simulate(case.folder, case.command) if case.command else None
            found = {"failed": fault} if fault else replays.replay(
                args, case.folder, [*case.options, *options, *centres.get(case.name, [])], policy=policy, **more)
            if "failed" not in found:
                centres.setdefault(case.name, [])
            if "keypoint_offset" in found:
                centres[case.name] = ["--pixel-centres" if found["pixel_centres"] else "--no-pixel-centres"]
            results[case.name, policy, what] = found
            args.seconds.append(found.get("wall_s", 0))
        jobs.append((keyframe_count(args, case) * SECONDS_PER_KEYFRAME, f"{case.name}, {policy}, {what}", work))

    threads = ["1"] if args.quick else ["1", "2"]
    stressed = [name for name in names if name in ("seq", "cuda")] or names[:1]  # one core, and a device
    if args.quick:
        stressed = stressed[:1]
    for case in made:
        for policy in names:
            for n in range(1, args.runs + 1):
                add_replay(case, policy, f"run {n}", dict(run=f"run {n}", growth=True), [])
        if not args.quick or not (case.command or case.options):
            for count in threads if "omp" in names else ():
                add_replay(case, "omp", f"OMP_NUM_THREADS={count}",
                           dict(run=f"threads {count}", environment={"OMP_NUM_THREADS": count}), [])
        if args.no_times:
            continue
        if not case.command and not (args.quick and case.options):
            for policy in stressed:
                for rate in RATES:
                    add_replay(case, policy, "rate " + rate, {}, ["--rate", rate])
        if not case.command and not case.options:
            for policy in names[:1] if args.quick else names:
                jobs.append(stages_alone(args, case, policy, lambda found, case=case, policy=policy: keep(
                    alone, (case.name, policy), "stages alone", found, policy)))
        if not case.command and "cuda" in names and (args.bin / KERNEL_TIMES).exists():
            add_device_parts(case)
    if not args.no_times:
        jobs.append((SECONDS_OF_BUNDLE, "Ceres' clock", lambda: keep(measured, "Ceres' clock", "synthetic-lba", ceres_clock(args))))
        for name, problem in problems(args).items():
            seconds = SECONDS_OF_BUNDLE + SECONDS_OF_BUNDLE_PER_MB * problem.stat().st_size / 1e6
            for policy in ("-", "cuda") if "cuda" in names else ("-",):
                jobs.append((seconds, f"{name}, {policy}", lambda name=name, problem=problem, policy=policy: keep(
                    adjusted, (name, policy), "bundle adjustment", bundle(args, problem, policy), policy)))
        for name, size in GENERATED.items() if "cuda" in names and not args.quick and (args.bin / "turbomap-bundle").exists() else ():
            jobs.append((SECONDS_OF_GENERATED, f"generated, as {name}", lambda name=name, size=size: keep(
                made_problems, name, "generated", generated(args, size), "cuda")))
    jobs = [job for job in jobs if job]
    shown = progress([weight for weight, *_ in jobs])
    for weight, name, work in jobs:
        begin = time.monotonic()
        work()
        shown.advance(weight, time.monotonic() - begin, name)
    clock = get(measured, "Ceres' clock", "ceres", "ms_per_iteration")
    return results, clock, {name: found for name, found in adjusted.items() if found}, made_problems, alone, device, faults


# --- tables -------------------------------------------------------------------------------------------------------------

class table:
    """`names`: of the first columns; rows: (their values, {column: text})."""

    def __init__(self, title, note, names):
        self.title, self.note, self.names, self.rows = title, note, names, []

    def add(self, key, values):
        shown = {column: show(value) for column, value in values.items() if value is not None}
        if shown:
            self.rows.append((tuple(key), shown))

    def markdown(self):
        return f"### {self.title}\n{textwrap.fill(self.note, 138)}\n\n" + replays.table(self.names, self.rows)

    def html(self):
        columns = list(dict.fromkeys(c for _, values in self.rows for c in values))
        cells = lambda tag, texts: "".join(f"<{tag}>{html.escape(str(t))}</{tag}>" for t in texts)
        body = "".join(f"<tr>{cells('td', [*key, *(values.get(c, '-') for c in columns)])}</tr>\n" for key, values in self.rows)
        return (f"<h2>{html.escape(self.title)}</h2>\n<p>{html.escape(self.note)}</p>\n"
                f"<table>\n<tr>{cells('th', [*self.names, *columns])}</tr>\n{body}</table>\n")


def number(shown):
    """The number that show() made text of."""
    return float(shown.replace(",", ""))


def write_csv(path, tables):
    """All figures as they are shown, one per line: title, note, names of the keys, keys, column, value. A | within a key is \\|."""
    with open(path, "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["table", "note", "names", "key", "column", "value"])
        for t in tables:
            for key, values in t.rows:
                for column, value in values.items():
                    out.writerow([t.title, t.note, "|".join(t.names), "|".join(k.replace("|", "\\|") for k in key), column, value])


def read_csv(path):
    tables = {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            t = tables.setdefault(row["table"], table(row["table"], row["note"], row["names"].split("|")))
            key = tuple(k.replace("\\|", "|") for k in re.split(r"(?<!\\)\|", row["key"]))
            if not t.rows or t.rows[-1][0] != key:
                t.rows.append((key, {}))
            t.rows[-1][1][row["column"]] = row["value"]
    return list(tables.values())


def said_by(*command):
    """What a command prints; '' where there is none, or it fails."""
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def machine(args, names, clock, results):
    t = table("Machine", "Where and when these figures were printed, and by which options. The commit has a + where the working tree had changes.",
              ["fact"])
    model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")),
                 platform.processor()) if os.path.exists("/proc/cpuinfo") else platform.processor()
    head = said_by("git", "-C", str(replays.ROOT), "rev-parse", "--short", "HEAD")
    if head and said_by("git", "-C", str(replays.ROOT), "status", "--porcelain", "--untracked-files=no"):
        head += "+"
    devices = said_by("nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader") if "cuda" in names else ""
    for fact, value in (("processor", f"{model}, {os.cpu_count()} threads"), ("device, driver", devices.replace("\n", "; ") or None),
                        ("date", datetime.date.today().isoformat()), ("commit of the programs", args.commit or head or "unknown"),
                        ("compiled by, for", "; ".join(dict.fromkeys(f["compiled"] for f in results.values() if "compiled" in f)) or None),
                        ("policies", ", ".join(names)), ("options", args.given or "none"),
                        ("wall clock of the programs, one after the other", minutes(sum(args.seconds))),
                        ("Ceres' clock", f"{clock:.1f} ms per iteration" if clock else "not measured: no turbomap-ceres-bundle")):
        t.add([fact], {"value": value})
    return t


def ceres_clock(args):
    """What turbomap-ceres-bundle finds of the problem that the recorded system's machine was timed with. Not kept: it is of this
    machine as it is now. {}: there is no such program or problem."""
    program, problem = args.bin / "turbomap-ceres-bundle", args.data / "synthetic-lba/30-20-6000"
    if not program.exists() or not problem.exists():
        return {}
    return found_by(program, [str(problem), "--repeat", "3"], replays.unfinished(args.work / "results/ceres/clock.json"))


def runs(results, case, policy):
    """JSONs of the replays that times are taken from."""
    return [found for (name, by, what), found in results.items()
            if (name, by) == (case.name, policy) and what.startswith("run ") and "stages" in found]


def times_of_run(found):
    """[{stage: ms}] by keyframe, of one replay."""
    with open(found["growth_file"], newline="") as file:
        return [{stage: float(row[stage]) for stage in STAGES[:-1]} for row in csv.DictReader(file)]


def keyframe_times(results, case, policy):
    """[{stage: ms}] by keyframe, of each keyframe and stage the fastest run: all runs do the same work, and what else a machine
    does only adds to it."""
    tables = [times_of_run(found) for found in runs(results, case, policy)]
    fastest = [{stage: min(row[stage] for row in rows) for stage in STAGES[:-1]} for rows in zip(*tables)]
    return [{**row, "total": sum(row.values())} for row in fastest]


def mean_times(rows):
    """{stage: (mean, standard deviation)}"""
    return {s: (statistics.mean(r[s] for r in rows), statistics.pstdev(r[s] for r in rows)) for s in STAGES} if rows else {}


def shown_times(times):
    return {stage: f"{show(mean)} +- {show(deviation)}" for stage, (mean, deviation) in times.items()}


def found_by(program, command, new, read=None, environment=None):
    """The JSON that a program writes to `new`, or what `read` makes of what it prints. {'failed': why}: it did not end well."""
    new.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run([str(program), *command, *([] if read else ["--json", str(new)])], capture_output=True, text=True,
                          env={**os.environ, **(environment or {})})
    found = None
    if done.returncode == 0:
        found = read(done.stdout) if read else json.loads(new.read_text()) if new.exists() else None
    new.unlink(missing_ok=True)
    return {"failed": done.stderr.strip() or f"exit status {done.returncode}, no result"} if found is None else found


def kept(args, program, name, command, **more):
    """What found_by() gives, of this run or of one before; what failed is not kept."""
    result = args.work / "results" / replays.digest(str(program)) / (name + ".json")
    if result.exists():
        found = json.loads(result.read_text())
        args.seconds.append(found.get("wall_s", 0))
        return found
    new, begin = replays.unfinished(result), time.monotonic()
    found = found_by(program, command, new, **more)
    if "failed" not in found:
        found["wall_s"] = time.monotonic() - begin
        args.seconds.append(found["wall_s"])
        new.write_text(json.dumps(found))
        new.rename(result)
    return found


def bundle(args, problem, policy):
    """What turbomap-ceres-bundle says of a BAL file with one thread, or turbomap-bundle where Ceres is not, or with policy cuda; {}: there is
    no such program."""
    programs = ("turbomap-bundle",) if policy == "cuda" else ("turbomap-ceres-bundle", "turbomap-bundle")
    program = next((p for p in (args.bin / name for name in programs) if p.exists()), None)
    more = ["--policy", "cuda"] if policy == "cuda" else []
    name = f"{problem.stem}_{replays.mark_of(problem)}" + "".join(more)
    return kept(args, program, name, [str(problem), "--iterations", "50", "--repeat", "3", *more]) if program else {}


def generated(args, size):
    """What turbomap-bundle says of a problem that it makes, on a device: of ten iterations, and as 'short' of so many as come within 1 % of
    the best cost of those."""
    def run(name, more):
        return kept(args, args.bin / "turbomap-bundle", f"generated_{size}_{name}".replace(",", "_"),
                    [size, *"--format generated --policy cuda --solver pcg --precision mixed --iterations".split(), *more])
    long = run("ten", ["10"])
    if "failed" in long:
        return long
    costs = [math.inf if cost is None else cost for cost in long["costs"]]
    enough = next((i + 1 for i, cost in enumerate(costs) if cost <= 1.01 * min(costs)), None)
    if enough is None or not math.isfinite(min(costs)):
        return {"failed": "no cost that is a number"}
    short = run(f"{enough}", [str(enough), "--repeat", "3"])
    return short if "failed" in short else {**long, "short": short, "best": min(costs)}


def table_generated(found_by_name):
    t = table("Bundle adjustment of generated problems on a device", "About as large as three problems of BAL, but made: a street, from small errors, "
              "without outliers. Mixed precision, conjugate gradients. ms of the adjustment to within 1 % of the best cost of ten iterations, "
              "median of two, after the set-up.", ["as"])
    for name, found in found_by_name.items():
        short = found["short"]
        t.add([name], {"cameras": found["frames"], "points": found["landmarks"], "observations": found["observations"],
                       "cost at the start": found["cost_initial"], "after those": short["cost_final"], "best of ten": found["best"],
                       "iterations to within 1 %": short["iterations"], "ms to within 1 %": short["ms_adjust"],
                       "ms, set-up": short["ms_setup"], "ms, all ten": found["ms_adjust"], "device memory, MB": found["peak_bytes"] / 1e6})
    return t


def stages_alone(args, case, policy, take):
    """The job that gives {stage: {'ms_median': ..., 'oracle_ms_median': ...}} of turbomap-bench on a recording's snapshots, or its
    fault, to take(); None: there are no snapshots, or there is no program."""
    program, repetitions = args.bin / "turbomap-bench", "3" if args.quick else "5"
    if not program.exists() or not meta_of(case.folder).get("snapshots"):
        return None

    def work():
        found = kept(args, program, f"stages_{case.folder.name}_{replays.mark_of(case.folder)}_{policy}_{repetitions}",
                     ["--recording", str(case.folder), "--policy", policy, "--repetitions", repetitions])
        take(found if "failed" in found else found.get("stages", {}))
    return SECONDS_OF_BENCH * int(repetitions), f"{case.name}, {policy}, stages alone", work


def device_parts(args, case, centres):
    """{stage: (ms of kernels, ms of transfers) per keyframe, the first ones too} of creation and fusion on a device, by a replay of which
    CUPTI records each kernel and copy. `centres`: the option that says where pixels are, without which the program would replay twice.
    Programs without TURBOMAP_WITH_NVTX=1 do not name stages: {}."""
    cupti = next((str(p) for p in map(pathlib.Path, CUPTI) if p.exists()), "")
    library = args.bin / KERNEL_TIMES
    options = ["--policy", "cuda", *args.options.split(), *(case.options or ["--no-imu"]), *centres]

    def read(said):
        _, heading, lines = said.partition("sums over the run")
        sums = {}
        for line in lines.split("\n")[2:]:
            cells = line.split("|")
            stage = next((s for s in cells[6].split()[-1].split("/") if s in STAGES), None) if len(cells) == 7 else None
            if stage:
                kernels, copies = sums.get(stage, (0, 0))
                sums[stage] = (kernels + float(cells[1].split()[1]), copies + float(cells[2].split()[1]))
        count = keyframe_count(args, case)
        return {stage: (a / count, b / count) for stage, (a, b) in sums.items()} if heading else None

    name = replays.file_name_of(["kernels", replays.digest(str(library)), case.folder.name, replays.mark_of(case.folder), *options])
    return kept(args, args.bin / "turbomap-replay", name, [str(case.folder), *options], read=read,
                environment={"CUDA_INJECTION64_PATH": str(library), "NVTX_INJECTION64_PATH": cupti})


def table_ablation(found):
    t = table("Ablation, composed of stages that were timed alone",
              "No run of the whole mapper: sums of the stages that turbomap-bench times on the snapshots of a recording, one by its fast path "
              "and the others by their sequential oracles. ms per snapshot. An oracle is the plain implementation that the tests compare "
              "with, not the recorded system; that of adjustment solves for all unknowns at once, by Eigen's sparse factorisation, with numerical "
              "derivatives. What a stage takes to read and change the map is left out.", ["recording", "policy", "fast path"])
    for (name, policy), stages in found.items():
        both = {shown: (stages[stage]["oracle_ms_median"], stages[stage]["ms_median"])
                for stage, shown in ABLATION.items() if "oracle_ms_median" in stages.get(stage, {})}
        oracles, fast = sum(a for a, _ in both.values()), sum(b for _, b in both.values())
        if not both or fast <= 0:
            continue
        t.add([name, policy, "none"], {"sum": oracles, "sum of the oracles / this": 1})
        for stage, (oracle, ours) in both.items():
            total = oracles - oracle + ours
            t.add([name, policy, stage], {"sum": total, "sum of the oracles / this": oracles / total, "stage: oracle": oracle,
                                          "stage: fast": ours, "oracle / fast": ratio(oracle, ours)})
        t.add([name, policy, "all"], {"sum": fast, "sum of the oracles / this": oracles / fast})
    return t


def costs_over_time(found, who="turbomap"):
    """[(ms, cost)] of ours or of Ceres; the start at 0."""
    run = found.get(who, found if who == "turbomap" else {})
    costs = run.get("costs", [])
    times = run.get("ms") or [(i + 1) * run["ms_per_iteration"] for i in range(len(costs))]
    return [(0, run["cost_initial"]), *zip(times, costs)] if costs else []


def best_cost(*founds):
    """The lowest final cost of ours or of Ceres; None: none is a number."""
    return min((cost for found in founds for cost in (get(found.get("turbomap", found), "cost_final"), get(found, "ceres", "cost_final"))
                if cost is not None), default=None)


def time_to(best, found, who="turbomap"):
    """ms to within 1 % of the best cost."""
    line = costs_over_time(found, who)
    return next((ms for ms, cost in line if None not in (cost, best) and cost <= 1.01 * best), "not reached") if line else None


def table_bundle(adjusted):
    t = table("Bundle adjustment of BAL files", "At most 50 iterations, of 3 runs that of the median time; ms without the set-up. The best cost: "
              "the lowest that ours or Ceres reached. Time to within 1 % of it: of ours so many iterations of mean time, of Ceres what it says "
              "of each.", ["problem", "who"])
    for (name, policy), found in adjusted.items():
        best = best_cost(*(other for (problem, _), other in adjusted.items() if problem == name))
        for who, run in ((ONE_THREAD if policy == "-" else policy, found.get("turbomap", found)), ("Ceres", found.get("ceres", {}))):
            t.add([name, who], {"cost at the start": get(run, "cost_initial"), "final cost": get(run, "cost_final"),
                                "iterations": get(run, "iterations") or len(run.get("costs", [])) or None,
                                "ms per iteration": get(run, "ms_per_iteration"),
                                "ms to within 1 % of the best cost": time_to(best, found, "ceres" if who == "Ceres" else "turbomap")
                                if run else None})
    return t


def gain_of_paper(name):
    return next((gain for family, gain in PAPER.items() if name.startswith(family)), None)


def table_one(made, names, results):
    t = table("Local mapping: times and errors",
              "ms per keyframe, mean +- standard deviation over the keyframes, without the first 11; of each keyframe and stage the fastest "
              "run. Peer: the recorded system, one thread, at the time and on the machine of the recording, not beside these runs.",
              ["recording", "who"])
    g = table("Speed-ups over the peer",
              "The peer's mean over ours. TurboMap (theirs): the average gain over its own baseline, of whole mapping with a GPU, "
              "that its abstract states; other machine, other runs. Its gains per stage are not compared.", ["recording", "who"])
    below = []
    for case in made:
        peer = mean_times([row for row in peer_rows(case.folder) if row["told"]])
        paper = gain_of_paper(case.name)
        if peer:
            errors = [e for p in names for e in [get(found, "peer_ate_rmse_m", scale=1000) for found in runs(results, case, p)] if e]
            t.add([case.name, "peer"], {**shown_times(peer), "ATE, mm": errors[0] if errors else None})
        for policy in names:
            times = mean_times(keyframe_times(results, case, policy)[WARM_UP:])
            if not times:
                continue
            t.add([case.name, policy], {**shown_times(times), "ATE, mm": get(runs(results, case, policy)[0], "ate_rmse_m", scale=1000)})
            if peer:
                gains = {stage: ratio(peer[stage][0], times[stage][0]) for stage in STAGES}
                g.add([case.name, policy], {**gains, "TurboMap (theirs), whole mapping": paper})
                below += [f"{case.name}, {policy}, {s}: {show(x)}" for s, x in gains.items() if x is not None and paper and x < paper]
    for family, paper in PAPER.items():
        for policy in names:
            rows = [values for (name, who), values in g.rows if name.startswith(family) and who == policy]
            if rows:
                told = [s for s in STAGES if all(s in values for values in rows)]
                g.add([f"mean of {family}", policy], {**{s: statistics.mean(number(values[s]) for values in rows) for s in told},
                                                      "TurboMap (theirs), whole mapping": paper})
    if below:
        sentence = "Below the gain that TurboMap states for whole mapping: " + "; ".join(below) + "."
    elif g.rows:
        sentence = "No speed-up over the peer, of any stage, is below the gain that TurboMap states for whole mapping."
    else:
        sentence = "No recording has times of a peer."
    return t, g, sentence


def errors_of(times):
    t = table("Local mapping: errors", "Absolute trajectory error of the keyframes after alignment. Peer: the recorded system.", times.names)
    for key, values in times.rows:
        t.add(key, {c: v for c, v in values.items() if c.startswith("ATE")})
    return t


def scaled(gains, clock):
    """Speed-ups at the peer's clock: as if the peer's machine were as fast as this one, by Ceres."""
    if not clock or not gains.rows:
        return None
    t = table("Speed-ups at the peer's clock", f"The same times {show(clock / CERES_MS)}: Ceres takes {show(clock)} ms per iteration "
              f"here, {CERES_MS} where the peer was timed.", gains.names)
    for key, values in gains.rows:
        t.add(key, {c: number(v) * clock / CERES_MS for c, v in values.items() if "theirs" not in c})
    return t


def below_at_clock(table_at_clock):
    """The sentence of the summary on speed-ups at the peer's clock; '' where there are none."""
    if not table_at_clock:
        return ""
    judged = [(gain_of_paper(key[0]), values) for key, values in table_at_clock.rows if gain_of_paper(key[0])]
    counts = {s: sum(number(values[s]) < paper for paper, values in judged if s in values) for s in STAGES}
    cells = ", ".join(f"{stage} in {count}" for stage, count in counts.items() if count)
    return f" At the peer's clock, of {len(judged)} rows: {cells or 'none'}." if judged else ""


def stage_parts(found, stage):
    """(ms, ms that the map's guard was held, ms of these to commit) per keyframe of one replay, without the first ones; None for what it does
    not tell. All three are of the same keyframes: the mean in the replay's JSON leaves out those whose stage was skipped, so it is not used."""
    rows = times_of_run(found)[WARM_UP:]
    mean_held, commit = (get(found, "guard_held", stage, key) for key in ("ms_mean", "ms_commit"))
    held = get(found, "guard_held", stage, "times", scale=mean_held or 0)
    if not rows:
        return None, None, None
    ms = statistics.mean(row[stage] for row in rows)
    return (ms, None, None) if None in (held, commit) else (ms, held / len(rows), commit / len(rows))


def table_breakdown(made, names, results, device):
    """The table, and faults: parts of a stage that are more than the whole are not shown."""
    t = table("Creation and fusion: where the time goes", "ms per keyframe; of each stage all of one run, that whose mean of it is least, so not "
              "quite the times above. Reading: the map's guard is held to copy what is searched. "
              "Commit: it is held to apply what was found. The rest computes on copies, with appearances of the new points, and under cuda with "
              "the transfers; kernels and transfers alone: of a second replay that a profiler recorded, with programs that name their stages, "
              "over all keyframes; the other columns leave out the first 11.",
              ["recording", "policy"])
    faults = []
    for case in made:
        for policy in names:
            values = {}
            for stage in ("search", "creation", "fusion"):
                parts = [stage_parts(found, stage) for found in runs(results, case, policy)]
                ms, guard, commit = min((p for p in parts if p[0] is not None), key=lambda p: p[0], default=(None, None, None))
                values[stage] = ms
                if guard is None:
                    continue
                rest = ms - guard
                if rest < -1e-5 * ms:  # times of keyframes are written with six digits
                    faults.append((case.name, policy, f"the rest of {stage}",
                                   f"the guard was held for {show(guard)} ms of {show(ms)} ms per keyframe"))
                    continue
                if stage != "creation":
                    values[f"{stage}: reading"] = guard - commit
                values[f"{stage}: the rest"] = max(rest, 0)
                if stage != "search":
                    values[f"{stage}: commit"] = commit
                if policy == "cuda" and stage in device.get(case.name, {}):
                    values[f"{stage}: kernels"], values[f"{stage}: transfers"] = device[case.name][stage]
            t.add([case.name, policy], values)
    return t, faults


def table_stress(made, names, results):
    t = table("Keyframes that come faster", "Keyframes come at so many times the recorded rate, by the clock of the stages' own "
              "times; fusion, adjustment and keyframe culling of a keyframe are skipped while the next one waits. Latency: from "
              "its arrival to its end, ms. Map: whether it is that of the recorded rate to the last bit. Peer: the same rule on its recorded times.",
              ["recording", "rate", "who"])
    for case in made:
        peer = peer_rows(case.folder)
        for rate in RATES:
            for policy in names:
                found = results.get((case.name, policy, "rate " + rate))
                if not found or "latency" not in found:
                    continue
                skipped = found.get("skipped_stages", {})
                digests = [get(results, (case.name, policy, "rate " + r), "map_digest") for r in (RATES[0], rate)]
                t.add([case.name, rate + "x", policy],
                      {"skipped adjustments": skipped.get("adjustment", 0), "skipped cullings": skipped.get("keyframe_culling", 0),
                       "skipped fusions": skipped.get("fusion", 0), "keyframes": get(found, "keyframes"),
                       "latency, median": get(found, "latency", "ms_median"), "latency, most": get(found, "latency", "ms_max"),
                       "ATE, mm": get(found, "ate_rmse_m", scale=1000),
                       "map": None if None in digests else "the same" if digests[0] == digests[1] else "another"})
            if peer and any((case.name, policy, "rate " + rate) in results for policy in names):
                skipped, median, most = peer_under_load(peer, float(rate))
                t.add([case.name, rate + "x", "peer"],
                      {"skipped adjustments": skipped["adjustment"], "skipped cullings": skipped["keyframe_culling"],
                       "skipped fusions": skipped["fusion"], "keyframes": len(peer), "latency, median": median, "latency, most": most})
    return t


def first_skips(rows, arrivals):
    """{stage: the rate from which on it is skipped for some keyframe}, to 5 %, by peer_under_load; None: not up to 100."""
    rows, first = [{**row, "arrival": arrival} for row, arrival in zip(rows, arrivals)], {}
    rate = 0.1
    while rate < 100 and len(first) < 3:
        for stage, count in peer_under_load(rows, rate)[0].items():
            if count:
                first.setdefault(stage, rate)
        rate *= 1.05
    return first


def table_first_skips(made, names, results):
    t = table("From which rate on keyframes are skipped", "Times the recorded rate at which a stage is first skipped for some keyframe, to 5 %: "
              "computed from the times per keyframe at the recorded rate, by the rule of the table above. seq is one core.",
              ["recording", "who"])
    for case in made:
        peer = peer_rows(case.folder)
        if not peer or case.options:
            continue
        arrivals = [row["arrival"] for row in peer]
        for who in (*names, "peer"):
            rows = peer if who == "peer" else keyframe_times(results, case, who)
            if len(rows) == len(peer):
                first = first_skips(rows, arrivals)
                t.add([case.name, who], {stage: first.get(stage, "not up to 100") for stage in ("keyframe_culling", "adjustment", "fusion")})
    return t


def table_determinism(made, results):
    t = table("The same map every time", "Digests of the final map, to the last bit, over runs, policies and numbers of threads.",
              ["recording"])
    for case in made:
        digests = {f"{policy}, {what}": found["map_digest"] for (name, policy, what), found in results.items()
                   if name == case.name and not what.startswith("rate") and "map_digest" in found}
        if len(digests) > 1:
            first = next(iter(digests.values()))
            other = [run for run, digest in digests.items() if digest != first]
            t.add([case.name], {"runs": len(digests), "different": "; ".join(other) or "none"})
    return t


# --- plots --------------------------------------------------------------------------------------------------------------

def plot(title, x_label, y_label, lines):
    """SVG of {name: [(x, y)]}."""
    lines = {name: points for name, points in lines.items() if len(points) > 1}
    if not lines:
        return ""
    left, right, top, bottom = 55, 560, 30, 270
    x_most = max(x for points in lines.values() for x, _ in points) or 1
    y_most = max(y for points in lines.values() for _, y in points) or 1
    text = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 700 310" width="700" font-family="sans-serif" font-size="12">',
            '<rect width="700" height="310" fill="#fff"/>', f'<text x="{left}" y="18" font-size="14">{html.escape(title)}</text>',
            f'<path d="M{left} {top}V{bottom}H{right}" fill="none" stroke="#444"/>',
            f'<text x="{right}" y="{bottom + 32}" text-anchor="end">{html.escape(x_label)}</text>',
            f'<text x="{left + 4}" y="{top + 2}">{html.escape(y_label)}</text>']
    for part in range(5):
        x, y = left + (right - left) * part / 4, bottom - (bottom - top) * part / 4
        text.append(f'<text x="{x:.0f}" y="{bottom + 16}" text-anchor="middle">{show(round(x_most * part / 4, 2))}</text>')
        text.append(f'<text x="{left - 6}" y="{y + 4:.0f}" text-anchor="end">{show(round(y_most * part / 4, 2))}</text>')
    for i, (name, points) in enumerate(lines.items()):
        at = " ".join(f"{left + (right - left) * x / x_most:.1f},{bottom - (bottom - top) * y / y_most:.1f}" for x, y in points)
        colour = COLOURS[i % len(COLOURS)]
        text.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.5" points="{at}"/>')
        text.append(f'<text x="{right + 8}" y="{top + 16 * (i + 1)}" fill="{colour}">{html.escape(name)}</text>')
    return "\n".join(text) + "\n</svg>\n"


def running_median(values, half=5):
    return [(i, statistics.median(values[max(0, i - half):i + half + 1])) for i in range(len(values))]


def plot_of_costs(name, lines, best):
    """`lines`: {who: [(ms, cost)]}; no plot of a best cost that has no logarithm."""
    if not best:
        return ""
    above = {who: [(ms, max(math.log10(cost / best), 0)) for ms, cost in line if cost is not None] for who, line in lines.items()}
    return plot(f"{name}: cost over time", "ms", "log10 of cost / best cost", above)


def plots(made, names, results, adjusted, made_problems):
    """{file name: SVG}"""
    drawn = {}
    for name in dict.fromkeys(problem for problem, _ in adjusted):
        founds = {policy: found for (problem, policy), found in adjusted.items() if problem == name}
        lines = {ONE_THREAD if policy == "-" else policy: costs_over_time(found) for policy, found in founds.items()}
        lines["Ceres"] = costs_over_time(founds.get("-", {}), "ceres")
        drawn[file_name("cost " + name)] = plot_of_costs(name, lines, best_cost(*founds.values()))
    for name, found in made_problems.items():
        drawn[file_name("cost generated as " + name)] = plot_of_costs(f"generated, as {name}", {"cuda": costs_over_time(found)}, found["best"])
    for case in made:
        lines = {}
        for policy in names:
            lines[policy] = running_median([row["total"] for row in keyframe_times(results, case, policy)])
        peer = peer_rows(case.folder)
        if peer:
            lines["peer"] = running_median([row["total"] for row in peer])
        drawn[file_name("time " + case.name)] = plot(f"{case.name}: time per keyframe", "keyframe", "ms, running median of 11", lines)
        lines = {}
        for policy in names:
            points = [(float(rate), (results[case.name, policy, "rate " + rate].get("skipped_stages") or {}).get("adjustment", 0))
                      for rate in RATES if "latency" in results.get((case.name, policy, "rate " + rate), {})]
            lines[policy] = points
        if peer and any(lines.values()):
            lines["peer"] = [(float(rate), peer_under_load(peer, float(rate))[0]["adjustment"]) for rate in RATES]
        drawn[file_name("stress " + case.name)] = plot(f"{case.name}: skipped adjustments", "times the recorded rate", "keyframes", lines)
    return {name: svg for name, svg in drawn.items() if svg}


def file_name(text):
    return "_".join("".join(c if c.isalnum() else " " for c in text).split())


def digest_of(text):
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def table_plots(made, drawn, prefix):
    """The plots that a page shows: time per keyframe of recordings, and costs of problems."""
    t = table("Plots", "Time per keyframe over the run, while the map grows; costs over time of the problems above.", ["of"])
    shown = {file_name("time " + case.name): case.name for case in made if not case.command}
    shown.update({name: name.partition("_")[2] for name in drawn if name.startswith("cost_")})
    for name, caption in shown.items():
        if name in drawn:
            t.add([caption], {"plot": f"![{caption}]({prefix}{name}.svg)", "SHA-256 begins with": digest_of(drawn[name])})
    return t


# --- output -------------------------------------------------------------------------------------------------------------

def block(tables):
    """What stands between the marks of a page; the first table's note is its first paragraph."""
    return "\n\n".join([BEGIN, *(t.markdown() for t in tables), END])


def with_block(page, tables):
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"it lacks the lines {BEGIN} and {END}")
    return before + block(tables) + after


def page(tables, drawn):
    style = ("body{font:15px/1.5 sans-serif;margin:2em auto;max-width:75em;padding:0 1em}table{border-collapse:collapse;display:block;"
             "overflow-x:auto}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:right;white-space:nowrap}"
             "td:first-child,th:first-child{text-align:left}svg{max-width:100%;height:auto}")
    return (f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>TurboMap: evaluation</title><style>{style}</style>'
            "</head><body>\n<h1>Evaluation of local mapping</h1>\n" + "".join(t.html() for t in tables) + "".join(drawn.values()) +
            "</body></html>\n")


def write_docs(path, tables, made, drawn):
    """The page, the CSV beside it, and its plots in the folder figures/."""
    prefix = f"figures/{path.stem}_"
    shown = table_plots(made, drawn, prefix)
    for _, values in shown.rows:
        file = re.search(r"\(([^)]+)\)", values["plot"]).group(1)
        (path.parent / file).parent.mkdir(exist_ok=True)
        (path.parent / file).write_text(drawn[file[len(prefix):-len(".svg")]])
    tables = [*tables, *([shown] if shown.rows else [])]
    path.write_text(with_block(path.read_text(), tables))
    write_csv(path.with_suffix(".csv"), tables)


def check(path):
    text = path.read_text()
    try:
        wanted = with_block(text, read_csv(path.with_suffix(".csv")))
    except (OSError, ValueError) as fault:
        sys.exit(f"evaluate: {path}: {fault}")
    for line, (has, should) in enumerate(zip(text.split("\n"), wanted.split("\n")), 1):
        if has != should:
            sys.exit(f"evaluate: {path}:{line}: not what {path.with_suffix('.csv').name} says:\n  {has}\n  {should}")
    if text != wanted:
        sys.exit(f"evaluate: {path}: not what {path.with_suffix('.csv').name} says")
    for plot_file in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        if not (path.parent / plot_file).exists():
            sys.exit(f"evaluate: {path}: there is no {plot_file}")
    for plot_file, digest in re.findall(rf"!\[[^]]*\]\((figures/{re.escape(path.stem)}_[^)]+)\) \| (\w*)", text):
        file = path.parent / plot_file
        if not file.exists() or digest_of(file.read_text()) != digest:
            sys.exit(f"evaluate: {path}: {plot_file} is not there, or is not the plot that the run drew")
    summary = next((t.note for t in read_csv(path.with_suffix(".csv")) if t.title == "Summary"), "")
    first = re.search(r"^# .*\n+((?:.+\n)+)", text, re.MULTILINE)
    said = " ".join(first.group(1).split()) if first else ""
    for stage in STAGES:
        name = "(?:total|the whole)" if stage == "total" else stage.replace("_", " ")
        if re.search(rf"\b{stage}\b", summary) and not re.search(rf"\b{name}\b", said):
            sys.exit(f"evaluate: {path}: {stage} is below the paper's gain somewhere, and the first paragraph does not say so")
    return 0


def main():
    args = parse_arguments()
    if args.check:
        return check(args.check)
    if args.docs:  # now, not when all has been run
        try:
            with_block(args.docs.read_text(), [])
        except (OSError, ValueError) as fault:
            sys.exit(f"evaluate: {args.docs}: {fault}")
    simulates = [] if args.no_simulated else [args.bin / "turbomap-simulate"]
    for needed in (args.bin / "turbomap-replay", *simulates):
        if not needed.exists():
            sys.exit(f"evaluate: {needed} is not there: ./quickstart build, or --bin")
    names, made = policies(args), all_cases(args)
    if not names or not made:
        sys.exit("evaluate: there is nothing to replay: no policy or no recording")
    for folder in (args.work / "recordings", args.out):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as fault:
            sys.exit(f"evaluate: {folder} cannot be made: {fault.strerror}")
    replays.sweep(args.work)
    try:
        results, clock, adjusted, made_problems, alone, device, others = run_all(args, made, names)
    except KeyboardInterrupt:
        sys.exit(f"\nevaluate: stopped. What is done is kept in {args.work}: the same command goes on from there")
    times, gains, sentence = table_one(made, names, results)
    at_clock = scaled(gains, clock)
    sentence += below_at_clock(at_clock)
    if args.no_times:
        sentence = "Errors and determinism only; times were left out."
    summary = table("Summary", sentence, ["what"])
    faults = [(name, policy, what, found["failed"]) for (name, policy, what), found in results.items() if "failed" in found]
    faults += others
    breakdown, more = (None, []) if args.no_times else table_breakdown(made, names, results, device)
    faults += more
    summary.add(["recordings and set-ups"], {"count": len(made)})
    summary.add(["replays"], {"count": len(results)})
    summary.add(["failed"], {"count": len(faults)})
    tables = [summary, machine(args, names, clock, results)]
    if args.no_times:
        tables += [errors_of(times), table_determinism(made, results)]
    else:
        tables += [times, gains, at_clock, breakdown,
                   table_stress(made, names, results), table_first_skips(made, names, results), table_ablation(alone),
                   table_determinism(made, results), table_bundle(adjusted), table_generated(made_problems)]
    if faults:
        failed = table("Failed", "What went wrong.", ["recording", "policy", "what"])
        for name, policy, what, fault in faults:
            failed.add([name, policy, what], {"fault": fault.split("\n")[-1]})
        tables.append(failed)
    tables = [t for t in tables if t and t.rows]
    drawn = {} if args.no_times else plots(made, names, results, adjusted, made_problems)
    write_csv(args.out / "evaluation.csv", tables)
    shown = [*tables, *([table_plots(made, drawn, "")] if drawn else [])]
    (args.out / "evaluation.md").write_text("# Evaluation of local mapping\n\n" + block(shown) + "\n")
    (args.out / "evaluation.html").write_text(page(tables, drawn))
    for name, svg in drawn.items():
        (args.out / (name + ".svg")).write_text(svg)
    if args.docs:
        write_docs(args.docs, tables, made, drawn)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{sentence}\n{args.out}: evaluation.html, .md, .csv and {len(drawn)} plots; "
          f"the programs took {minutes(used.ru_utime + used.ru_stime)} of processor time in this run")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
