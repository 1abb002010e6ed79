# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""tools/evaluate.py with a turbomap-replay that replays nothing: its tables and plots, that it goes on where it was, also when it was
killed, that results are of the recording that is there, that a page with another figure is found."""

import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import unittest.mock

TOOLS = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(TOOLS))
import evaluate  # noqa: E402
import evaluate_creation as replays  # noqa: E402

# 10 +- 1 ms per stage, 70 in all; under omp half of that; later runs are slower, and hold the guard for less. STUB_SWING: so many ms instead of
# 1, and the fast keyframes of the first run are the slow ones of later runs. Keyframes that come at 8 times the rate lose 5 adjustments.
STUB = """#!{python}
import json, os, pathlib, sys, time
words = sys.argv[1:]
if "--help" in words: sys.exit(0)
option = lambda name, other: words[words.index(name) + 1] if name in words else other
policy, rate = option("--policy", "seq"), float(option("--rate", "0"))
if policy == "tbb" or policy == "cuda" and "STUB_DEVICE" not in os.environ:
    print("turbomap-replay: --policy " + policy + ": this program was built without it", file=sys.stderr); sys.exit(2)
if not pathlib.Path(words[0]).is_dir():
    print("turbomap-replay: " + words[0] + ": is not a directory with a recording", file=sys.stderr); sys.exit(2)
with open({log!r}, "a") as file: file.write(" ".join(words) + "\\n")
if "CUDA_INJECTION64_PATH" in os.environ:
    times = 1 if "--pixel-centres" in words else 2  # without it, it replays once more to find it out
    if "STUB_FAILS" in os.environ: sys.exit("out of order")
    print("sums over the run, in ms; a range without the ranges in it\\n the titles of the columns")
    rest = "| 4 0.1 | 3 0.1 | 1 0.1 | 0 0.0 "
    print(" 2.00 31 | 12 " + str(6.2 * times) + " | 3 3.10 0.20 " + rest + " keyframe/fusion")
    print(" 1.00 31 | 2 3.10 | 0 0.00 0.00 " + rest + " keyframe/fusion/search_by_projection")
    print(" 9.00 1 | 1 9.00 | 1 9.00 9.00 " + rest + " outside")
    sys.exit(0)
if "STUB_WAITS" in os.environ and rate: time.sleep(20)
ms = 10 if policy == "seq" else 5
stages = {stages!r}
later = "run_1" not in option("--growth-file", "run_1")
swing = float(os.environ.get("STUB_SWING", "1")) * (-1 if later and "STUB_SWING" in os.environ else 1)
held = float(os.environ.get("STUB_HELD", "0.5")) - (0.1 if later else 0)
found = {{"keyframes": 31, "map_digest": "ab" if policy == "seq" else "{digest}", "ate_rmse_m": 0.012, "peer_ate_rmse_m": 0.034,
         "stages": {{}}, "compiled": "g++ 1.2, host_abc",
         "guard_held": {{"fusion": {{"times": 40, "ms_mean": held, "ms_commit": 3 if later else 4}}}}}}
if "--pixel-centres" not in words: found.update(keypoint_offset={{}}, pixel_centres=True)
if rate:
    found["latency"] = {{"ms_median": 20.0, "ms_max": 30.0}}
    if rate == 8: found.update(map_digest="ef", skipped_stages={{"adjustment": 5, "keyframe_culling": 7, "fusion": 0}})
if "--growth-file" in words:
    rows = [[str(i)] + [str(ms + (3 if later else 0) + swing * (-1) ** i)] * len(stages) for i in range(31)]  # the total is not looked at
    text = "\\n".join(",".join(row) for row in [["keyframe"] + stages] + rows)
    pathlib.Path(option("--growth-file", "")).write_text(text + "\\n")
pathlib.Path(option("--json", "")).write_text(json.dumps(found))
"""


# Costs 100, 50, 10.05, 10 after 0, 1, 2, 3 iterations of 4 ms. Ceres: 20 after 30 ms, 10 after 70.
BUNDLE_STUB = """#!{python}
import json, pathlib, sys
iterations = int(sys.argv[sys.argv.index("--iterations") + 1]) if "--iterations" in sys.argv else 10
found = {{"cost_initial": 100, "costs": [50, 10.05, 10], "cost_final": 10, "iterations": min(iterations, 3), "ms_per_iteration": 4.0,
         "frames": 3, "landmarks": 4, "observations": 5, "ms_setup": 7, "ms_adjust": 4.0 * iterations, "peak_bytes": 2e6}}
if sys.argv[0].endswith("turbomap-ceres-bundle"):
    found = {{"turbomap": found, "ceres": {{"cost_initial": 100, "costs": [20, 10], "ms": [30, 70], "cost_final": 10, "ms_per_iteration": 35}}}}
pathlib.Path(sys.argv[sys.argv.index("--json") + 1]).write_text(json.dumps(found))
"""


# Search: 30 ms by the oracle, 10 ms fast; creation: 10 and 2; a stage without an oracle, and one of another candidate set.
BENCH_STUB = """#!{python}
import json, pathlib, sys
times = lambda fast, oracle: {{"ms_median": fast, "oracle_ms_median": oracle}}
found = {{"stages": {{"search_exact": times(10, 30), "search_grouped": times(1, 2), "creation": times(2, 10), "adjustment": {{"ms_median": 5}}}}}}
pathlib.Path(sys.argv[sys.argv.index("--json") + 1]).write_text(json.dumps(found))
"""


SIMULATE_STUB = """#!{python}
import pathlib, sys
folder = pathlib.Path(sys.argv[sys.argv.index("--out") + 1])
folder.mkdir(parents=True)
(folder / "meta.json").write_text(pathlib.Path(sys.argv[1]).read_text())
"""


class evaluation(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)
        (self.root / "bin").mkdir()
        self.recording = self.root / "data/recordings/euroc_tiny"
        self.recording.mkdir(parents=True)
        (self.recording / "meta.json").write_text(json.dumps({"sensor": "stereo", "snapshots": [3]}))
        # The peer: 20 ms per stage but creation, which takes 5 besides the search; a keyframe every 200 ms.
        columns = ["iter", "timestamp", *evaluate.PEER_COLUMNS.values(), "ms_createnew", "snapshot"]
        with open(self.recording / "timing.csv", "w", newline="") as file:
            out = csv.writer(file)
            out.writerow(columns)
            for i in range(31):
                out.writerow([i, 100 + 0.2 * i, *[20] * len(evaluate.PEER_COLUMNS), 25, 0])
        self.write_stub("ab")
        for program, text in (("bundle", BUNDLE_STUB), ("bench", BENCH_STUB)):
            (self.root / f"bin/turbomap-{program}").write_text(text.format(python=sys.executable))
            (self.root / f"bin/turbomap-{program}").chmod(0o755)
        (self.root / "data/bal-tiny").mkdir()
        (self.root / "data/bal-tiny/problem-1.txt").write_text("")

    def tearDown(self):
        self.folder.cleanup()

    def write_stub(self, digest):
        stub = self.root / "bin/turbomap-replay"
        stub.write_text(STUB.format(python=sys.executable, log=str(self.root / "log"), stages=evaluate.STAGES, digest=digest))
        stub.chmod(0o755)

    def command(self, *more):
        return [sys.executable, str(TOOLS / "evaluate.py"), "--bin", str(self.root / "bin"), "--data", str(self.root / "data"),
                "--work", str(self.root / "work"), "--out", str(self.root / "out"), "--no-simulated", *more]

    def environment(self, **more):
        return {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **more}

    def run_it(self, *more, **environment):
        return subprocess.run(self.command(*more), capture_output=True, text=True, env=self.environment(**environment))

    def replays(self):
        return (self.root / "log").read_text().splitlines()

    def figure(self, title, key, column):
        for t in evaluate.read_csv(self.root / "out/evaluation.csv"):
            if t.title == title:
                return dict(t.rows)[key].get(column)

    def test_tables(self):
        done = self.run_it()
        self.assertEqual(done.returncode, 0, done.stderr)
        times, gains = "Local mapping: times and errors", "Speed-ups over the peer"
        self.assertEqual(self.figure("Machine", ("policies",), "value"), "seq, omp")
        self.assertEqual(self.figure("Machine", ("compiled by, for",), "value"), "g++ 1.2, host_abc")
        self.assertEqual(self.figure(times, ("euroc_tiny", "seq"), "fusion"), "10 +- 1")
        self.assertEqual(self.figure(times, ("euroc_tiny", "peer"), "creation"), "5 +- 0")
        self.assertEqual(self.figure(times, ("euroc_tiny", "seq"), "ATE, mm"), "12")
        self.assertEqual(self.figure(gains, ("euroc_tiny", "seq"), "fusion"), "2")
        self.assertEqual(self.figure(gains, ("euroc_tiny", "omp"), "total"), "3.57")  # 125 / 35
        self.assertEqual(self.figure(gains, ("euroc_tiny", "seq"), "TurboMap (theirs), whole mapping"), "1.3")
        self.assertEqual(self.figure(gains, ("mean of euroc", "omp"), "total"), "3.57")
        self.assertIn(" s", self.figure("Machine", ("wall clock of the programs, one after the other",), "value"))
        self.assertIn("euroc_tiny, seq, creation: 0.5", done.stdout)  # the one cell below 1.3 ...
        self.assertNotIn("fusion", done.stdout)
        self.assertIn("euroc_tiny, omp, creation: 1", done.stdout)
        self.assertEqual(evaluate.below_at_clock(None), "")
        at_clock = evaluate.table("t", "", ["recording", "who"])
        at_clock.rows = [(("euroc_tiny", "seq"), {"search": "1.2", "fusion": "4"}), (("euroc_tiny", "omp"), {"search": "1.1", "fusion": "1.2"}),
                         (("simulated", "seq"), {"search": "1"})]
        self.assertEqual(evaluate.below_at_clock(at_clock), " At the peer's clock, of 2 rows: search in 2, fusion in 1.")
        parts = "Creation and fusion: where the time goes"  # of 10 ms: guard held 20 ms in 20 keyframes, 4 of them to commit
        self.assertEqual(self.figure(parts, ("euroc_tiny", "seq"), "fusion"), "10")
        self.assertEqual(self.figure(parts, ("euroc_tiny", "seq"), "fusion: reading"), "0.8")
        self.assertEqual(self.figure(parts, ("euroc_tiny", "seq"), "fusion: the rest"), "9")
        self.assertEqual(self.figure(parts, ("euroc_tiny", "seq"), "fusion: commit"), "0.2")
        self.assertIsNone(self.figure("Failed", ("euroc_tiny", "seq", "the rest of fusion"), "fault"))
        stress = "Keyframes that come faster"
        self.assertEqual(self.figure(stress, ("euroc_tiny", "8x", "seq"), "skipped adjustments"), "5")
        self.assertEqual(self.figure(stress, ("euroc_tiny", "1x", "seq"), "skipped adjustments"), "0")
        self.assertEqual(self.figure(stress, ("euroc_tiny", "1x", "peer"), "skipped adjustments"), "0")
        self.assertEqual(self.figure(stress, ("euroc_tiny", "1x", "peer"), "latency, median"), "125")
        self.assertEqual(self.figure(stress, ("euroc_tiny", "2x", "seq"), "map"), "the same")
        self.assertEqual(self.figure(stress, ("euroc_tiny", "8x", "seq"), "map"), "another")
        self.assertEqual(self.figure(stress, ("euroc_tiny", "8x", "peer"), "skipped fusions"), "30")  # 65 ms of a 25 ms interval
        # 70 +- 7 ms under seq and half of it under omp, a keyframe every 200 ms: culling waits for all other stages, 66 and 33 ms at most.
        first = "From which rate on keyframes are skipped"
        for who, most in (("seq", 66), ("omp", 36)):
            rate = float(self.figure(first, ("euroc_tiny", who), "keyframe_culling"))
            self.assertLess(abs(rate / (200 / most) - 1), 0.06)
            self.assertGreater(float(self.figure(first, ("euroc_tiny", who), "fusion")), rate)
        fusion = float(self.figure(first, ("euroc_tiny", "peer"), "fusion"))  # once 65 ms and fusion itself do not fit, it comes ever later
        self.assertLess(abs(fusion / (200 / 85) - 1), 0.06)
        self.assertEqual(self.figure("The same map every time", ("euroc_tiny",), "different"), "none")
        bundle = "Bundle adjustment of BAL files"
        self.assertEqual(self.figure(bundle, ("problem-1", "one thread"), "ms to within 1 % of the best cost"), "8")
        self.assertEqual([key for t in evaluate.read_csv(self.root / "out/evaluation.csv") if t.title == bundle for key, _ in t.rows],
                         [("problem-1", "one thread")])
        ablation = "Ablation, composed of stages that were timed alone"
        self.assertEqual(self.figure(ablation, ("euroc_tiny", "seq", "none"), "sum"), "40")
        self.assertEqual(self.figure(ablation, ("euroc_tiny", "seq", "search"), "sum"), "20")
        self.assertEqual(self.figure(ablation, ("euroc_tiny", "seq", "search"), "sum of the oracles / this"), "2")
        self.assertEqual(self.figure(ablation, ("euroc_tiny", "omp", "creation"), "stage: fast"), "2")
        self.assertEqual(self.figure(ablation, ("euroc_tiny", "omp", "all"), "sum"), "12")
        page = (self.root / "out/evaluation.html").read_text()
        self.assertEqual(page.count("<svg"), 3)
        self.assertNotIn("src=", page)  # nothing else is needed

    def test_parts_of_a_stage_are_of_one_run(self):
        """The fastest of each keyframe takes 6.5 ms, less than the 8 ms of a run in which the guard is held; but no run is that fast."""
        done = self.run_it("--policies", "seq", STUB_SWING="5", STUB_HELD="4")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.figure("Local mapping: times and errors", ("euroc_tiny", "seq"), "fusion"), "6.5 +- 1.5")
        parts = "Creation and fusion: where the time goes"
        for column, ms in (("fusion: the rest", "2"), ("fusion", "10"), ("fusion: reading", "7.8"), ("fusion: commit", "0.2")):
            self.assertEqual(self.figure(parts, ("euroc_tiny", "seq"), column), ms)

    def test_a_stage_that_takes_less_than_its_guard_is_a_fault(self):
        self.assertEqual(self.run_it("--policies", "seq", STUB_HELD="6").returncode, 1)  # 12 ms of 10
        self.assertEqual(self.figure("Failed", ("euroc_tiny", "seq", "the rest of fusion"), "fault"),
                         "the guard was held for 12 ms of 10 ms per keyframe")
        self.assertIsNone(self.figure("Creation and fusion: where the time goes", ("euroc_tiny", "seq"), "fusion: the rest"))
        self.assertEqual(self.figure("Summary", ("failed",), "count"), "1")

    def test_a_stage_that_is_all_guard_has_no_rest(self):
        self.assertEqual(self.run_it("--policies", "seq", STUB_HELD="5").returncode, 0)
        self.assertEqual(self.figure("Creation and fusion: where the time goes", ("euroc_tiny", "seq"), "fusion: the rest"), "0")

    def test_goes_on_where_it_was(self):
        self.run_it()
        first = self.replays()
        self.assertEqual(len(first), 6 + 2 + 4)  # three runs under two policies, two numbers of threads, four rates on one core
        self.assertEqual([("--pixel-centres" in line) for line in first], [False] + 11 * [True])  # found out once
        next((self.root / "work/results").rglob("*rate_4*.json")).unlink()
        self.run_it()
        self.assertEqual(len(self.replays()), len(first) + 1)

    def test_results_are_of_this_recording(self):
        """Not of another one of its name, nor of what it was before."""
        for program, text in (("bundle", BUNDLE_STUB), ("bench", BENCH_STUB)):
            text += f"open({str(self.root / 'log')!r}, 'a').write('{program}\\n')\n"
            (self.root / f"bin/turbomap-{program}").write_text(text.format(python=sys.executable))
        (self.root / "bin" / evaluate.KERNEL_TIMES).write_text("")
        run = lambda *more: self.assertEqual(self.run_it("--quick", "--policies", "cuda", *more, STUB_DEVICE="1").returncode, 0)
        run()
        all_of_it = len(self.replays())
        self.assertEqual(all_of_it, 1 + 4 + 1 + 1 + 2)  # replays, that of the profiler; stages alone; a problem under two policies
        meta, text = self.recording / "meta.json", (self.recording / "meta.json").read_text()
        time_of_meta = meta.stat().st_mtime_ns
        meta.write_text(text.replace("3", "4"))
        os.utime(meta, ns=(time_of_meta, time_of_meta))
        run()
        self.assertEqual(len(self.replays()), 2 * all_of_it - 2)  # but the problem
        (self.recording / "keyframes.csv").write_text("")
        (self.root / "data/bal-tiny/problem-1.txt").write_text("1")
        run()
        self.assertEqual(len(self.replays()), 3 * all_of_it - 2)
        shutil.copytree(self.root / "data", self.root / "others")
        run("--data", str(self.root / "others"))
        self.assertEqual(len(self.replays()), 4 * all_of_it - 2)
        run()
        self.assertEqual(len(self.replays()), 4 * all_of_it - 2)  # kept

    def test_options_that_are_too_long_for_a_file_name(self):
        long, longer = ("--options=" + "--known-octaves no " * 20, "--options=" + "--known-octaves no " * 21)
        run = lambda options: self.run_it("--quick", "--policies", "seq", "--no-times", options)
        for times, options in enumerate((long, longer, long), 1):
            done = run(options)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(len(self.replays()), min(times, 2))  # others are another run; the same are kept

    def test_problems_of_one_name(self):
        text = BUNDLE_STUB.replace('"cost_final": 10', '"cost_final": float(pathlib.Path(sys.argv[1]).read_text())')
        (self.root / "bin/turbomap-bundle").write_text(text.format(python=sys.executable))
        (self.root / "data/bal-other").mkdir()
        for folder, name, cost in (("bal-tiny", "problem-1", "11"), ("bal-other", "problem-1", "12"), ("bal-other", "problem-2", "13")):
            (self.root / f"data/{folder}/{name}.txt").write_text(cost)
        self.assertEqual(self.run_it("--quick").returncode, 0)
        for name, cost in (("bal-tiny/problem-1", "11"), ("bal-other/problem-1", "12"), ("problem-2", "13")):
            self.assertEqual(self.figure("Bundle adjustment of BAL files", (name, "one thread"), "final cost"), cost)

    def test_a_simulated_recording_of_a_trajectory_that_changed(self):
        trajectory, made = self.root / "walk.txt", self.root / "recordings/walk"
        made.parent.mkdir()
        program = self.root / "bin/turbomap-simulate"
        program.write_text(SIMULATE_STUB.format(python=sys.executable))
        program.chmod(0o755)
        for text in ("one", "two"):
            trajectory.write_text(text)
            self.assertIsNone(replays.simulate(made, [str(program), str(trajectory)]))
            self.assertEqual((made / "meta.json").read_text(), text)
        program.write_text(f"#!{sys.executable}\nimport sys\nsys.exit(3)\n")
        trajectory.write_text("three")
        self.assertEqual(replays.simulate(made, [str(program), str(trajectory)]), "exit status 3")

    def test_goes_on_when_it_was_killed(self):
        waiting = subprocess.Popen(self.command(), env=self.environment(STUB_WAITS="1"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True)
        said = ""
        deadline = time.monotonic() + 120
        while "about" not in said or "left" not in said:  # how much is done and how long the rest will take
            line = waiting.stderr.readline()
            said += line
            self.assertTrue(line, said)  # it ended
        while not any("--rate" in line for line in self.replays()):
            if waiting.poll() is not None or time.monotonic() > deadline:
                waiting.kill()
                self.fail(said + waiting.communicate()[1])
            time.sleep(0.05)
        waiting.kill()  # in the middle of the first replay with a rate
        waiting.communicate()
        done_before = len(self.replays()) - 1
        self.assertEqual(done_before, 6 + 2)
        left = self.root / "work/results/x/unfinished.json.999999999.new"
        left.parent.mkdir()
        left.write_text("{")
        self.assertEqual(self.run_it().returncode, 0)
        self.assertEqual(len(self.replays()), done_before + 1 + 4)
        self.assertFalse(left.exists())
        self.assertEqual(self.figure("Summary", ("failed",), "count"), "0")
        self.assertEqual(self.figure("The same map every time", ("euroc_tiny",), "runs"), "8")

    def test_on_a_device(self):
        (self.root / "bin" / evaluate.KERNEL_TIMES).write_text("")
        done = self.run_it("--policies", "cuda,seq", STUB_DEVICE="1")
        self.assertEqual(done.returncode, 0, done.stderr)
        parts = "Creation and fusion: where the time goes"
        self.assertEqual(self.figure(parts, ("euroc_tiny", "cuda"), "fusion: kernels"), "0.3")  # 9.3 ms in 31 keyframes
        self.assertEqual(self.figure(parts, ("euroc_tiny", "cuda"), "fusion: transfers"), "0.1")
        self.assertIsNone(self.figure(parts, ("euroc_tiny", "seq"), "fusion: kernels"))
        for policy in ("cuda", "seq"):
            self.assertEqual(self.figure("Keyframes that come faster", ("euroc_tiny", "8x", policy), "skipped adjustments"), "5")
        made = "Bundle adjustment of generated problems on a device"
        self.assertEqual(self.figure(made, ("Venice-1778",), "ms to within 1 %"), "8")  # two of three iterations
        self.assertEqual(self.figure(made, ("Venice-1778",), "ms, all ten"), "40")
        self.assertIn("polyline", (self.root / "out/cost_generated_as_Venice_1778.svg").read_text())
        before = len(self.replays())
        self.assertEqual(self.run_it("--policies", "cuda,seq", STUB_DEVICE="1").returncode, 0)
        self.assertEqual(len(self.replays()), before)  # kept, also what the profiler recorded

    def test_beside_ceres(self):
        (self.root / "bin/turbomap-ceres-bundle").write_text(BUNDLE_STUB.format(python=sys.executable))
        (self.root / "bin/turbomap-ceres-bundle").chmod(0o755)
        self.assertEqual(self.run_it("--quick").returncode, 0)
        bundle = "Bundle adjustment of BAL files"
        self.assertEqual(self.figure(bundle, ("problem-1", "one thread"), "ms to within 1 % of the best cost"), "8")
        self.assertEqual(self.figure(bundle, ("problem-1", "Ceres"), "ms to within 1 % of the best cost"), "70")
        self.assertEqual(self.figure(bundle, ("problem-1", "Ceres"), "iterations"), "2")
        self.assertIn("Ceres</text>", (self.root / "out/cost_problem_1.svg").read_text())

    def test_a_problem_whose_cost_is_no_number_or_0(self):
        """As of a file with a pixel of 1e200, and of one without noise."""
        found = lambda cost, *costs: {("p", "-"): {"cost_initial": cost, "cost_final": cost, "costs": costs, "iterations": len(costs),
                                                   "ms_per_iteration": 2.0}}
        self.assertNotIn("final cost", evaluate.table_bundle(found(None)).rows[0][1])
        self.assertEqual(evaluate.table_bundle(found(None, None)).rows[0][1]["ms to within 1 % of the best cost"], "not reached")
        self.assertEqual(evaluate.table_bundle(found(0.0, 0.0)).rows[0][1]["final cost"], "0")
        for of in (found(None), found(None, None), found(0.0, 0.0)):
            self.assertEqual(evaluate.plots([], [], {}, of, {}), {})

    def test_gains_of_a_thousand(self):
        """Such numbers are shown with a comma."""
        timing = self.recording / "timing.csv"
        timing.write_text(timing.read_text().replace(",20", ",20000"))
        (self.root / "bin/turbomap-ceres-bundle").write_text(BUNDLE_STUB.format(python=sys.executable))
        (self.root / "bin/turbomap-ceres-bundle").chmod(0o755)
        (self.root / "data/synthetic-lba/30-20-6000").mkdir(parents=True)
        done = self.run_it("--quick", "--policies", "seq")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.figure("Speed-ups over the peer", ("euroc_tiny", "seq"), "fusion"), "2,000")
        self.assertEqual(self.figure("Speed-ups over the peer", ("mean of euroc", "seq"), "fusion"), "2,000")
        self.assertEqual(self.figure("Speed-ups at the peer's clock", ("euroc_tiny", "seq"), "fusion"), "778")  # 35 of 90 ms
        at_clock = evaluate.table("t", "", ["recording", "who"])
        at_clock.add(["euroc_tiny", "seq"], {"search": 1234, "fusion": 1})
        self.assertEqual(evaluate.below_at_clock(at_clock), " At the peer's clock, of 1 rows: fusion in 1.")

    def test_options_that_are_refused(self):
        for program, option, value in (("evaluate_creation.py", "--rigs", "mono,foo"), ("evaluate_creation.py", "--jobs", "0"),
                                       ("evaluate_creation.py", "--seeds", "1,x"), ("evaluate_creation.py", "--keyframes", "-1"),
                                       ("evaluate_creation.py", "--noise", "0.5,nan"), ("evaluate_creation.py", "--drift", "-1"),
                                       ("evaluate.py", "--keyframes", "-1"), ("evaluate.py", "--runs", "0")):
            done = subprocess.run([sys.executable, str(TOOLS / program), option, value], capture_output=True, text=True,
                                  env=self.environment())
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertRegex(done.stderr.splitlines()[-1], f"error: argument {option}: .*'{value.split(',')[-1]}'")

    def test_recordings_that_cannot_be_read_are_named(self):
        timing, meta = self.recording / "timing.csv", self.recording / "meta.json"
        good = timing.read_text()
        last = good.splitlines()[-1]
        for file, text, message in ((timing, good.replace("ms_lba", "ms_other"), "there is no column 'ms_lba'"),
                                    (timing, good.replace(last, last[:last.rindex(",25")]), "line 32: a number is missing"),
                                    (timing, good.replace(last, last.replace("20", "x")), "line 32: a number is missing"),
                                    (meta, "{'no': JSON}", "Expecting property name")):
            before = file.read_text()
            file.write_text(text)
            done = self.run_it("--quick")
            file.write_text(before)
            self.assertEqual(done.returncode, 1)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn(f"evaluate: {file}: {message}", done.stderr)

    def test_a_page_without_marks_is_refused_before_anything_is_run(self):
        page = self.root / "page.md"
        for text, message in ((None, "No such file"), ("# Page\n", "it lacks the lines")):
            if text is not None:
                page.write_text(text)
            done = self.run_it("--quick", "--docs", str(page))
            self.assertEqual(done.returncode, 1)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertRegex(done.stderr, f"evaluate: {page}: .*{message}")
            self.assertFalse((self.root / "log").exists() or (self.root / "figures").exists() or (self.root / "out").exists())

    def test_folders_that_cannot_be_made(self):
        (self.root / "file").write_text("")
        for option in ("--out", "--work"):
            done = self.run_it("--quick", option, str(self.root / "file"))
            self.assertEqual(done.returncode, 1)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn("cannot be made", done.stderr)
            self.assertFalse((self.root / "log").exists())  # nothing was run
        for out in (self.root, self.root / "file/table.md"):
            done = subprocess.run([sys.executable, str(TOOLS / "evaluate_creation.py"), "--out", str(out)], capture_output=True, text=True,
                                  env=self.environment())
            self.assertEqual(done.returncode, 1)
            self.assertIn(f"--out: {out} cannot be written", done.stderr)

    def test_options_that_are_taken(self):
        taken = "--rigs stereo,fisheye --seeds 0,12 --noise 0,.5,1e-3 --drift 2. --keyframes 0"
        with unittest.mock.patch.object(sys, "argv", ["evaluate_creation.py", *taken.split()]):
            args = replays.parse_arguments()
        self.assertEqual((args.rigs, args.seeds, args.noise, args.drift, args.keyframes),
                         (["stereo", "fisheye"], ["0", "12"], ["0", ".5", "1e-3"], "2.", 0))

    def test_a_name_with_the_mark_between_cells(self):
        written = evaluate.table("t", "", ["recording", "who"])
        written.add(["a|b", "seq"], {"ms": 1})
        written.add(["a", "b"], {"ms": 2})
        evaluate.write_csv(self.root / "t.csv", [written])
        (read,) = evaluate.read_csv(self.root / "t.csv")
        self.assertEqual(read.rows, written.rows)
        self.assertIn("| a\\|b | seq | 1 |", read.markdown())

    def test_help_tells_how_to_begin(self):
        said = subprocess.run([sys.executable, str(TOOLS / "evaluate.py"), "--help"], capture_output=True, text=True).stdout
        for words in ("goes on where it was", "examples:", "--check docs/evaluation.md"):
            self.assertIn(words, said)

    def test_quick_replays_less(self):
        self.run_it("--quick")
        self.assertEqual(len(self.replays()), 2 + 1 + 4)

    def test_without_times(self):
        self.assertEqual(self.run_it("--no-times").returncode, 0)
        self.assertEqual(len(self.replays()), 2 + 2)
        self.assertEqual(self.figure("Local mapping: errors", ("euroc_tiny", "peer"), "ATE, mm"), "34")
        self.assertNotIn("ms per keyframe", (self.root / "out/evaluation.md").read_text())

    def test_another_map_is_found(self):
        self.write_stub("cd")
        self.assertEqual(self.run_it("--quick", "--runs", "1").returncode, 0)
        self.assertIn("omp, run 1", self.figure("The same map every time", ("euroc_tiny",), "different"))

    def test_a_figure_that_was_not_printed_is_found(self):
        page = self.root / "page.md"
        before = "# Page\n\nAll cells but creation are above.\n\n"
        page.write_text(f"{before}{evaluate.BEGIN}\n{evaluate.END}\nafter\n")
        self.assertEqual(self.run_it("--quick", "--runs", "1", "--docs", str(page)).returncode, 0)
        text = page.read_text()
        self.assertTrue(text.startswith(before) and text.endswith("\nafter\n"))
        self.assertEqual(self.run_it("--check", str(page)).returncode, 0)
        plot = self.root / "figures/page_time_euroc_tiny.svg"
        self.assertIn("![euroc_tiny](figures/page_time_euroc_tiny.svg)", text)
        self.assertIn("peer</text>", plot.read_text())
        drawn = plot.read_text()
        plot.unlink()
        self.assertEqual(self.run_it("--check", str(page)).returncode, 1)
        plot.write_text(drawn.replace("#06c", "#000"))  # not what was drawn
        self.assertEqual(self.run_it("--check", str(page)).returncode, 1)
        plot.write_text(drawn)
        page.write_text(text.replace("but creation ", ""))  # one cell is below the paper's gain
        done = self.run_it("--check", str(page))
        self.assertEqual(done.returncode, 1)
        self.assertIn("creation is below", done.stderr)
        csv_file = page.with_suffix(".csv")
        rows = csv_file.read_text()
        sentence = "euroc_tiny, seq, creation: 0.5"
        self.assertIn(sentence, text)
        csv_file.write_text(rows.replace(sentence, "euroc_tiny, seq, total: 0.5"))
        for shown, status in (("creation", 1), ("creation, totally,", 1), ("creation and the total", 0), ("creation and the whole", 0)):
            page.write_text(text.replace(sentence, "euroc_tiny, seq, total: 0.5").replace("but creation are", f"but {shown} are"))
            done = self.run_it("--check", str(page))
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertEqual("total is below" in done.stderr, status == 1)
        csv_file.write_text(rows)
        page.write_text(text.replace("| 3.57 |", "| 3.58 |"))
        done = self.run_it("--check", str(page))
        self.assertEqual(done.returncode, 1)
        self.assertIn("3.58", done.stderr)
        page.write_text(text.replace(evaluate.END, ""))
        self.assertEqual(self.run_it("--check", str(page)).returncode, 1)

    def test_other_programs_that_fail_are_told_and_run_again(self):
        for program in ("bundle", "bench", "ceres-bundle"):  # each writes its JSON all the same
            text = {"bundle": BUNDLE_STUB, "bench": BENCH_STUB, "ceres-bundle": BUNDLE_STUB}[program].format(python=sys.executable)
            good = self.root / f"bin/turbomap-{program}"
            good.write_text(text + "import os\nif os.environ.get('STUB_FAILS'): sys.exit('out of order')\n")
            good.chmod(0o755)
        (self.root / "data/synthetic-lba/30-20-6000").mkdir(parents=True)
        (self.root / "bin" / evaluate.KERNEL_TIMES).write_text("")
        quick = ("--quick", "--runs", "1", "--policies", "seq,cuda")
        self.assertEqual(self.run_it(*quick, STUB_DEVICE="1", STUB_FAILS="1").returncode, 1)
        self.assertEqual(self.figure("Summary", ("failed",), "count"), "5")
        for key in (("euroc_tiny", "seq", "stages alone"), ("problem-1", "-", "bundle adjustment"), ("problem-1", "cuda", "bundle adjustment"),
                    ("Ceres' clock", "-", "synthetic-lba"), ("euroc_tiny", "cuda", "kernels and transfers")):
            self.assertEqual(self.figure("Failed", key, "fault"), "out of order")
        self.assertEqual(self.run_it(*quick, STUB_DEVICE="1").returncode, 0)
        self.assertEqual(self.figure("Summary", ("failed",), "count"), "0")
        self.assertEqual(self.figure("Machine", ("Ceres' clock",), "value"), "35.0 ms per iteration")
        self.assertEqual(self.figure("Machine", ("options",), "value"), "--quick --runs 1 --policies seq,cuda --no-simulated")
        self.assertEqual(self.figure("Bundle adjustment of BAL files", ("problem-1", "cuda"), "ms to within 1 % of the best cost"), "8")
        self.assertEqual(self.figure("Creation and fusion: where the time goes", ("euroc_tiny", "cuda"), "fusion: transfers"), "0.1")

    def test_a_replay_that_fails_is_told(self):
        (self.root / "bin/turbomap-replay").write_text(f"#!{sys.executable}\nimport sys\nsys.exit('no_recording, broken')\n")
        done = self.run_it("--quick", "--runs", "1")
        self.assertEqual(done.returncode, 1)
        self.assertIn("broken", (self.root / "out/evaluation.md").read_text())


if __name__ == "__main__":
    unittest.main()
