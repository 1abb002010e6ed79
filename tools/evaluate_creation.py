#!/usr/bin/env python3
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""Replays recordings under several options and prints what became of their maps, as Markdown.

Recordings: those of DATA/recordings, with the IMU where there is one, --perturbed times each (figures are means over these
replays), and simulated ones (rigs x trajectories x noise x seeds; figures are medians over the seeds). Variants: every
combination of --creation and --associate that this turbomap-replay knows, or the options that --variants names. Simulated
recordings and results are kept in the work folder: a run that was cut off goes on where it was, and results are made anew when
the program or the recording has changed. Stage times are those of replays that ran side by side: use --jobs 1 for times to be quoted.

    tools/evaluate_creation.py --jobs 16 --out creation.md
    tools/evaluate_creation.py --jobs 16 --variants "as it is: ; global at the end: --global-adjustment end"
"""

import argparse
import concurrent.futures
import hashlib
import itertools
import json
import math
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
RIGS = {"mono": ["--camera", "euroc", "--mono"], "stereo": ["--camera", "euroc"], "fisheye": ["--camera", "tum-vi"],
        "stereo-inertial": ["--camera", "euroc", "--imu"], "fisheye-inertial": ["--camera", "tum-vi", "--imu"]}
VARIED = {"--creation": ["pairs", "tracks"], "--associate": ["recorded", "projected"]}  # values, the baseline first
BOUND = 1.5  # the trajectory error that is asked for, times that of the batch adjustment


def words(text):
    return [w for w in text.split(",") if w]


def positive(text):
    if int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a positive number")
    return int(text)


def not_negative(text):
    if int(text) < 0:
        raise argparse.ArgumentTypeError(f"'{text}' is negative")
    return int(text)


def checked(pattern, what):
    """The type of an option whose text must match."""
    def parse(text):
        if not re.fullmatch(pattern, text):
            raise argparse.ArgumentTypeError(f"'{text}' is not {what}")
        return text
    return parse


def each(one):
    """The type of an option of several words."""
    return lambda text: [one(word) for word in words(text)]


rig = checked("|".join(RIGS), "one of " + ", ".join(RIGS))
seed = checked("[0-9]+", "a whole number")
amount = checked(r"([0-9]+\.?[0-9]*|\.[0-9]+)(e[-+]?[0-9]+)?", "a number from 0 on")


def common_arguments(description, examples=None):
    p = argparse.ArgumentParser(description=description, epilog=examples, allow_abbrev=False,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/release/bin", help="folder of the programs; default: build/release/bin")
    p.add_argument("--data", type=pathlib.Path, default=os.environ.get("TURBOMAP_DATA_DIR") or ROOT / "../shared/data",
                   help="folder of recordings/ and trajectories/, either of which may be missing; default: TURBOMAP_DATA_DIR, or ../shared/data")
    p.add_argument("--work", type=pathlib.Path, default=ROOT / "build/evaluation",
                   help="folder for what is made, and kept: a run that was cut off goes on where it was; default: build/evaluation")
    return p


def parse_arguments():
    p = common_arguments(__doc__.split("\n\n")[0])
    p.add_argument("--jobs", type=positive, default=1, help="replays at a time")
    p.add_argument("--rigs", type=each(rig), default=["mono", "stereo", "fisheye"], help="of simulated recordings: " + ",".join(RIGS))
    p.add_argument("--trajectories", type=words, default=None, help="'builtin' and names of DATA/trajectories; default: all")
    p.add_argument("--seeds", type=each(seed), default=list("12345"))
    p.add_argument("--noise", type=each(amount), default=["0.25", "0.5", "1"], help="px at the finest level")
    p.add_argument("--keyframes", type=not_negative, default=100, help="per simulated recording, at most; 0: all the way")
    p.add_argument("--drift", type=amount, default="0.01", help="of the poses that come in, m per m; less would tell mapping what it has to find")
    p.add_argument("--no-recorded", action="store_true", help="simulated recordings only")
    p.add_argument("--no-simulated", action="store_true", help="recorded ones only")
    p.add_argument("--perturbed", type=positive, default=1,
                   help="replays of each recorded one and variant; all but the first begin with guesses moved by 1e-6 m")
    p.add_argument("--policy", default="seq")
    p.add_argument("--variants", default="", help="'NAME: OPTIONS; NAME: OPTIONS', the baseline first; instead of the usual ones")
    p.add_argument("--options", default="", help="for every replay, e.g. '--candidates exhaustive'")
    p.add_argument("--out", type=pathlib.Path, help="file of the tables; default: stdout")
    return p.parse_args()


# --- recordings ---------------------------------------------------------------------------------------------------------

def trajectories(args):
    folder = args.data / "trajectories"
    known = {"builtin": "builtin", **{f.stem: str(f) for f in sorted(folder.glob("*.txt"))}}
    for name in args.trajectories or []:
        if name not in known:
            sys.exit(f"evaluate_creation: --trajectories: '{name}' is not one of {', '.join(known)}")
    return {name: path for name, path in known.items() if not args.trajectories or name in args.trajectories}


def recorded(args):
    """Rows of the table of recorded data: (name, folder)."""
    return [] if args.no_recorded else [(f.parent.name, f.parent) for f in sorted((args.data / "recordings").glob("*/meta.json"))]


def simulated(args):
    """(rig, trajectory, noise, seed, folder, command that makes it)"""
    made = []
    if args.no_simulated:
        return made
    for rig, (name, path), noise, seed in itertools.product(args.rigs, trajectories(args).items(), args.noise, args.seeds):
        folder = args.work / "recordings" / f"{rig}-{name}-k{args.keyframes}-d{args.drift}-n{noise}-s{seed}"
        command = [str(args.bin / "turbomap-simulate"), path, *RIGS[rig], "--noise", noise, "--seed", seed,
                   "--keyframes", str(args.keyframes), "--drift", args.drift]
        made.append((rig, name, noise, seed, folder, command))
    return made


def unfinished(path):
    """Where what becomes `path` is written. A run that was killed may leave a program behind that still writes to its own."""
    return path.with_name(f"{path.name}.{os.getpid()}.new")


def sweep(work):
    """Removes what runs that were killed left unfinished."""
    for left in [*work.glob("recordings/*.new"), *work.glob("results/*/*.new")]:
        pid = left.name.split(".")[-2]
        if not pid.isdigit() or not pathlib.Path("/proc", pid).exists():
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(missing_ok=True)


def mark_of(place):
    """Tells a recording, or a file, from another of its name and from what it was: by where it is, the sizes and times of its files,
    and the text of meta.json."""
    place = place.resolve()
    said = [str(place)]
    for file in sorted(f for f in place.rglob("*") if f.is_file()) if place.is_dir() else [place]:
        said.append(f"{file} {file.stat().st_size} {file.stat().st_mtime_ns}")
        if file.name == "meta.json":
            said.append(file.read_text())
    return hashlib.sha256("\n".join(said).encode()).hexdigest()[:12]


def simulate(folder, command):
    """None, or what went wrong. A recording of another simulator or trajectory is made anew."""
    made_by = folder / "made_by.txt"
    trajectory = pathlib.Path(command[1])
    mark = " ".join([digest(command[0]), *command[1:], *([mark_of(trajectory)] if trajectory.is_file() else [])])
    if made_by.exists() and made_by.read_text() == mark:
        return None
    new = unfinished(folder)
    shutil.rmtree(new, ignore_errors=True)
    done = subprocess.run([*command, "--out", str(new)], capture_output=True, text=True)
    if done.returncode != 0:
        return done.stderr.strip() or f"exit status {done.returncode}"
    (new / "made_by.txt").write_text(mark)
    shutil.rmtree(folder, ignore_errors=True)
    new.rename(folder)
    return None


# --- replays ------------------------------------------------------------------------------------------------------------

def digest(program, cache={}):
    if program not in cache:
        cache[program] = hashlib.sha256(pathlib.Path(program).read_bytes()).hexdigest()[:12]
    return cache[program]


def variants(replay, given):
    """{name: options}: as given, or of the options that the program has."""
    text = subprocess.run([replay, "--help"], capture_output=True, text=True, check=True).stdout
    if given:
        made = {}
        for one in given.split(";"):
            name, colon, options = one.partition(":")
            name = name.strip()
            if not colon or not name or name in made:
                sys.exit(f"evaluate_creation: --variants: '{one.strip()}' is not 'NAME: OPTIONS' with a name of its own")
            made[name] = options.split()
    else:
        known = {option: values for option, values in VARIED.items() if re.search(rf"{option}\b", text)}
        combined = itertools.product(*known.values())
        made = {", ".join(values) or "as it is": [w for pair in zip(known, values) for w in pair] for values in combined}
    for options in list(made.values())[1:]:
        if "--no-bound" in text:  # that of the first variant holds for all
            options.append("--no-bound")
    return made


def file_name_of(words):
    """A file name that tells what was run; where that is too long for one, its beginning and a digest of all of it."""
    text = " ".join(words)
    name = re.sub(r"[^\w.-]+", "_", text)
    return name if len(os.fsencode(name)) <= 200 else f"{re.sub('[^!-~]', '_', name)[:150]}_{hashlib.sha256(text.encode()).hexdigest()[:12]}"


def replay(args, folder, options, policy=None, run="", growth=False, environment=None, visual=True):
    """The JSON of a replay, with 'failed' where it did not end well. `run` tells replays with the same options apart. With
    `growth`, 'growth_file' names a CSV of times per keyframe. `visual`: without the IMU unless the options ask for it."""
    program = str(args.bin / "turbomap-replay")
    options = ["--policy", policy or args.policy, *args.options.split(), *options]
    if visual and "--imu" not in options:
        options.append("--no-imu")
    name = file_name_of([folder.name, mark_of(folder), *options, *([run] if run else [])])
    result = args.work / "results" / digest(program) / (name + ".json")
    if result.exists():
        return json.loads(result.read_text())
    result.parent.mkdir(parents=True, exist_ok=True)
    new, growth_file = unfinished(result), result.with_suffix(".csv")
    new_growth = unfinished(growth_file)
    if growth:
        options = [*options, "--growth-file", str(new_growth)]
    begin = time.monotonic()
    done = subprocess.run([program, str(folder), *options, "--json", str(new)], capture_output=True, text=True,
                          env={**os.environ, **(environment or {})})
    if not new.exists():
        return {"failed": done.stderr.strip() or f"exit status {done.returncode}"}
    found = {**json.loads(new.read_text()), "wall_s": time.monotonic() - begin}
    if done.returncode != 0:
        found["failed"] = f"exit status {done.returncode}"
    if growth and new_growth.exists():
        new_growth.rename(growth_file)
        found["growth_file"] = str(growth_file)
    new.write_text(json.dumps(found))
    new.rename(result)
    return found


# --- figures of one replay ----------------------------------------------------------------------------------------------

def get(found, *path, scale=1):
    for key in path:
        found = found.get(key) if isinstance(found, dict) else None
    return None if found is None or isinstance(found, dict) else scale * found


def ratio(a, b, scale=1):
    return None if a is None or not b else scale * a / b


def figures(found):
    """{column: number}; None: the replay does not tell."""
    mm = lambda key: get(found, key, scale=1000)
    values = {
        "input, mm": mm("ate_input_rmse_m"),
        "bound, mm": mm("ate_batch_rmse_m"),
        "peer, mm": mm("peer_ate_rmse_m"),
        "before the whole map was adjusted, mm": mm("ate_before_global_rmse_m"),
        "ATE, mm": mm("ate_rmse_m"),
        "ATE / bound": ratio(mm("ate_rmse_m"), mm("ate_batch_rmse_m")),
        "ATE / peer": ratio(mm("ate_rmse_m"), mm("peer_ate_rmse_m")),
        "created": get(found, "points_created"),
        "merges": get(found, "duplicates_merged"),
        "dropped": get(found, "points_culled"),
        "points left": get(found, "map_points"),
        "keyframes left": get(found, "keyframes_left"),
        "obs. / point": get(found, "observations_per_point"),
        "associations": get(found, "associations"),
        "kept, %": ratio(get(found, "associations_kept"), get(found, "associations"), 100),
        "projected": get(found, "associations_projected"),
        "projected kept, %": ratio(get(found, "associations_projected_kept"), get(found, "associations_projected"), 100),
        "right of those, %": ratio(get(found, "associations_projected_kept_right"), get(found, "associations_projected_kept"), 100),
    }
    judged = found.get("true_points") or {}
    values["duplicates, %"] = ratio(judged.get("points_duplicate"), judged.get("points"), 100)
    for key in judged:  # counts of what is wrong, each beside the count of all
        if key.endswith("_wrong") and key[:-len("_wrong")] in judged:
            values[f"wrong of {key[:-len('_wrong')].replace('_', ' ')}, %"] = ratio(judged[key], judged[key[:-len("_wrong")]], 100)
            values[f"wrong {key[:-len('_wrong')].replace('_', ' ')}"] = judged[key]
    values["whole map, ms"] = get(found, "global_adjustment", "ms_last")
    for stage in ("search", "creation", "fusion", "adjustment", "total"):
        values[f"{stage}, ms"] = get(found, "stages", stage, "ms_mean")
    return values


def told(all_figures, column):
    return [one[column] for one in all_figures if one.get(column) is not None]


def spread(values):
    """'mean +- standard deviation'"""
    if len(values) < 2:
        return values[0] if values else None
    return f"{show(statistics.mean(values))} +- {show(statistics.stdev(values))}"


def both(of, first, column):
    """The figures of a column where both variants have one, of the same recordings."""
    pairs = [(a[column], b[column]) for a, b in zip(of, first) if a.get(column) is not None and b.get(column) is not None]
    return [a for a, _ in pairs], [b for _, b in pairs]


def compared(of, first, column):
    """How the same recordings fare under another variant: 'geometric mean of the ratios +- its standard error'."""
    logs = [math.log(a / b) for a, b in zip(*both(of, first, column)) if a and b]
    if len(logs) < 2:
        return None
    mean, error = statistics.mean(logs), statistics.stdev(logs) / math.sqrt(len(logs))
    return f"{math.exp(mean):.3f} +- {math.exp(mean) * error:.3f}"


def medians(all_figures):
    columns = dict.fromkeys(column for one in all_figures for column in one)
    return {c: statistics.median(told(all_figures, c)) for c in columns if told(all_figures, c)}


# --- tables -------------------------------------------------------------------------------------------------------------

def show(value):
    if isinstance(value, str):
        return value
    if value is None:
        return "-"
    if float(value).is_integer() or abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"


def table(names, rows):
    """rows: (values of `names`, {column: number})"""
    columns = dict.fromkeys(column for _, values in rows for column in values)
    columns = [c for c in columns if told([values for _, values in rows], c)]
    line = lambda cells: "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"
    lines = [line([*names, *columns]), "|" + "---|" * (len(names) + len(columns))]
    lines += [line([*key, *(show(values.get(c)) for c in columns)]) for key, values in rows]
    return "\n".join(lines)


def recorded_row(runs, first):
    """Means over the replays of one recording; of the errors also the standard deviation, and how many more they are than those of
    the first variant, with the standard error of that mean."""
    values = {column: statistics.mean(told(runs, column)) for column in runs[0] if told(runs, column)}
    if len(runs) > 1:
        for column in ("ATE, mm", "ATE / peer"):
            values[column] = spread(told(runs, column))
        ours, theirs = both(runs, first, "ATE, mm")
        if runs is not first and len(ours) > 1:
            more = [a - b for a, b in zip(ours, theirs)]
            error = statistics.stdev(more) / math.sqrt(len(more))
            values["mm more than the first variant"] = f"{statistics.mean(more):.3f} +- {error:.3f}"
    return values


def summary_row(of, first, first_name):
    values = {"recordings": len(of)}
    ratios = told(of, "ATE / bound")
    if ratios:
        values["ATE / bound, median"] = statistics.median(ratios)
        values["worst"] = max(ratios)
        values[f"above {BOUND}"] = sum(r > BOUND for r in ratios)
    if of is not first:
        values[f"ATE / {first_name}"] = compared(of, first, "ATE, mm")
    for what in ("created", "merged", "observations"):
        wrong = told(of, f"wrong of {what}, %")
        if wrong:
            values[f"wrong of {what}, %"] = statistics.mean(wrong)
    for column in ("created", "wrong created", "merges", "wrong merged", "points left", "keyframes left", "obs. / point",
                   "search, ms", "creation, ms", "fusion, ms", "adjustment, ms", "total, ms"):
        total, before = (sum(some) for some in both(of, first, column))
        if before and of is not first:
            values[f"{column} / {first_name}"] = total / before
    return values


def summary(groups, variant_names):
    """What is asked of each rig: a row per rig, noise and variant, over all trajectories and seeds; then over all noises, all rigs."""
    kinds = list(dict.fromkeys((rig, noise) for rig, _, noise in groups))
    kinds += [(rig, "all") for rig in dict.fromkeys(rig for rig, _ in kinds)] + [("all", "all")]
    rows = []
    for rig, noise in kinds:
        of = {v: [f for (r, _, n), by in groups.items() if rig in (r, "all") and noise in (n, "all") for f in by.get(v, [])]
              for v in variant_names}
        rows += [((rig, noise, v), summary_row(of[v], of[variant_names[0]], variant_names[0])) for v in variant_names if of[v]]
    return table(["rig", "noise", "variant"], rows)


def main():
    args = parse_arguments()
    if args.out and (args.out.is_dir() or not args.out.absolute().parent.is_dir()):  # now, not when all has been run
        sys.exit(f"evaluate_creation: --out: {args.out} cannot be written")
    program = args.bin / "turbomap-replay"
    for needed in (program, args.bin / "turbomap-simulate"):
        if not needed.exists():
            sys.exit(f"evaluate_creation: {needed} is not there: ./quickstart build, or --bin")
    (args.work / "recordings").mkdir(parents=True, exist_ok=True)
    by_variant = variants(program, args.variants)
    faults, results = [], {}
    real, made = recorded(args), simulated(args)

    def work(folder, command):
        fault = simulate(folder, command)
        if fault:
            return [(folder, variant, {"failed": fault}) for variant in by_variant]
        done = [(folder, variant, replay(args, folder, options)) for variant, options in by_variant.items()]
        for *_, found in done:
            found.setdefault("ate_batch_rmse_m", done[0][2].get("ate_batch_rmse_m"))
        return done

    def work_recorded(folder, variant, n):
        moved = ["--perturb", str(n)] if n > 0 else []
        return [(folder, (variant, n), replay(args, folder, [*by_variant[variant], *moved], visual=False))]

    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        jobs = [pool.submit(work_recorded, folder, v, n) for n in range(args.perturbed) for _, folder in real for v in by_variant]
        jobs += [pool.submit(work, folder, command) for *_, folder, command in made]
        for count, job in enumerate(concurrent.futures.as_completed(jobs), 1):
            for folder, variant, found in job.result():
                if "failed" in found:
                    name = variant if isinstance(variant, str) else f"{variant[0]}, replay {variant[1]}"
                    faults.append(f"- {folder.name}, {name}: {found['failed']}")
                results[folder, variant] = figures(found)
            if sys.stderr.isatty():
                print(f"\r{count} of {len(jobs)} jobs", end="" if count < len(jobs) else "\n", file=sys.stderr, flush=True)
            elif count % max(1, len(jobs) // 20) == 0:
                print(f"{count} of {len(jobs)} jobs", file=sys.stderr, flush=True)

    text = [f"Replays under policy {args.policy} {args.options}, {args.jobs} at a time."]
    if real:
        rows = []
        for name, folder in real:
            runs = {v: [results[folder, (v, n)] for n in range(args.perturbed)] for v in by_variant}
            rows += [((name, v), recorded_row(runs[v], runs[next(iter(by_variant))])) for v in by_variant]
        text += [f"## Recorded, {args.perturbed} replays each", table(["recording", "variant"], rows)]
    if made:
        groups = {}
        for rig, name, noise, _, folder, _ in made:
            for v in by_variant:
                groups.setdefault((rig, name, noise), {}).setdefault(v, []).append(results[folder, v])
        text += ["## Simulated: what is asked for", summary(groups, list(by_variant)), "## Simulated: medians over seeds",
                 table(["rig", "trajectory", "noise", "variant"], [((*key, v), medians(f)) for key, by in groups.items() for v, f in by.items()])]
    if faults:
        text += [f"## Failed: {len(faults)}", "\n".join(faults)]
    text = "\n\n".join(text) + "\n"
    if args.out:
        args.out.write_text(text)
    else:
        print(text)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
