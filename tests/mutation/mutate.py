#!/usr/bin/env python3
# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""Plants the faults of faults.txt into the headers, one at a time, and says which of them the tests catch.

    tests/mutation/mutate.py [--compiler g++] [--include DIR]... [--only TEXT] [--jobs N] [--list]

Each fault is one replacement of text in a header. The test that is to catch it is compiled against a copy of the headers
with the fault, and run: it must fail. Before that each test is compiled and run with the headers as they are: it must
pass, else its failure would say nothing about a fault. A fault that does not compile proves nothing and ends the run. So
does one whose text is not in the header exactly once, and a test that is skipped. A test that does not end in time with
the fault counts as one that missed it: a busy machine may be the reason. Exit status 1 when less than 95 % are caught.
"""
import argparse
import concurrent.futures
import os
import shutil
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
FLAGS = ["-std=c++17", "-O1", "-w", "-DTHRUST_DEVICE_SYSTEM=THRUST_DEVICE_SYSTEM_CPP", "-DTURBOMAP_WITH_OPENMP=1", "-fopenmp"]
LEAST_CAUGHT = 0.95
SECONDS = 300  # for one test
SKIPPED = 77   # exit status of a test that cannot run here (tests/support/main.cpp)


def read_faults(path):
    """Blocks of 'name', 'file', 'test', '-' (old text) and '+' (new text), separated by empty lines."""
    faults, fault = [], {}
    with open(path, encoding="utf-8") as text:
        for number, line in enumerate(list(text) + ["\n"], 1):
            line = line.rstrip("\n")
            if line.startswith("#"):
                continue
            if not line:
                if fault:
                    missing = {"name", "file", "test", "-", "+"} - set(fault)
                    if missing:
                        sys.exit(f"{path}:{number}: the fault above lacks {sorted(missing)}")
                    faults.append(fault)
                fault = {}
                continue
            key, _, value = line.partition(" ")
            key = key.rstrip(":")
            fault[key] = fault[key] + "\n" + value if key in fault else value
    return faults


def compile_and_run(test, include, work, program, arguments):
    """'passed', 'failed', 'was skipped', 'timed out', or 'does not compile'; the compiler's errors go to stderr."""
    command = [arguments.compiler, *FLAGS, f"-I{include}", f"-I{ROOT}/tests"]
    for folder in arguments.include:
        command += ["-isystem", folder]
    command += [os.path.join(ROOT, test), os.path.join(work, "main.o"), "-o", program, *arguments.libraries]
    compiler = subprocess.run(command, stderr=subprocess.PIPE, encoding="utf-8", errors="replace")
    if compiler.returncode != 0:
        sys.stderr.write(compiler.stderr)
        return "does not compile"
    try:
        status = subprocess.run([program], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=SECONDS).returncode
    except subprocess.TimeoutExpired:
        return "timed out"
    return {0: "passed", SKIPPED: "was skipped"}.get(status, "failed")


def run_with_fault(fault, work, arguments):
    """What compile_and_run() says of the fault's test where the headers have the fault."""
    with tempfile.TemporaryDirectory(dir=work) as folder:
        shutil.copytree(os.path.join(ROOT, "include"), os.path.join(folder, "include"))
        header = os.path.join(folder, fault["file"])
        with open(header, encoding="utf-8") as file:
            text = file.read()
        with open(header, "w", encoding="utf-8") as file:
            file.write(text.replace(fault["-"], fault["+"]))
        return compile_and_run(fault["test"], os.path.join(folder, "include"), work, os.path.join(folder, "test"), arguments)


def libraries_of(compiler):
    """TBB where it is there: its headers make the standard library's need it."""
    tbb = ["-ltbb"]
    linked = subprocess.run([compiler, "-x", "c++", "-", "-o", os.devnull, *tbb], input="int main() {}", encoding="utf-8",
                            stderr=subprocess.DEVNULL)
    return (tbb if linked.returncode == 0 else []) + ["-lpthread"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--compiler", default="g++")
    parser.add_argument("--include", action="append", default=["/usr/include/eigen3"], help="system folder of headers")
    parser.add_argument("--only", default="", help="faults whose name, header or test contains this")
    parser.add_argument("--jobs", type=int, default=1, help="tests that are compiled and run at a time")
    parser.add_argument("--list", action="store_true", help="check that the faults can be planted, compile nothing")
    arguments = parser.parse_args()

    faults = read_faults(os.path.join(HERE, "faults.txt"))
    faults = [f for f in faults if arguments.only in f["name"] + f["file"] + f["test"]]
    for f in faults:
        with open(os.path.join(ROOT, f["file"]), encoding="utf-8") as header:
            times = header.read().count(f["-"])
        if times != 1:
            sys.exit(f"{f['name']}: its text is {times} times in {f['file']}, must be there once")
        if not os.path.exists(os.path.join(ROOT, f["test"])):
            sys.exit(f"{f['name']}: no test {f['test']}")
    if arguments.list:
        print(f"{len(faults)} faults can be planted")
        return

    arguments.libraries = libraries_of(arguments.compiler)
    caught = 0
    with tempfile.TemporaryDirectory() as work, concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        subprocess.run([arguments.compiler, *FLAGS, f"-I{ROOT}/include", f"-I{ROOT}/tests", "-c",
                        os.path.join(ROOT, "tests/support/main.cpp"), "-o", os.path.join(work, "main.o")], check=True)
        tests = sorted({f["test"] for f in faults})
        without = [pool.submit(compile_and_run, test, os.path.join(ROOT, "include"), work,
                               os.path.join(work, f"test{i}"), arguments) for i, test in enumerate(tests)]
        with_fault = [pool.submit(run_with_fault, f, work, arguments) for f in faults]
        try:
            for test, run in zip(tests, without):
                if run.result() != "passed":
                    sys.exit(f"{test} {run.result()} without any fault")
            for f, run in zip(faults, with_fault):
                result = run.result()
                if result in ("does not compile", "was skipped"):
                    sys.exit(f"{f['name']}: {f['test']} {result}")
                caught += 1 if result == "failed" else 0
                verdict = {"failed": "caught", "passed": "MISSED", "timed out": "MISSED, timed out"}[result]
                print(f"{verdict}  {f['name']}  ({f['test']})", flush=True)
        finally:  # what has not begun is not worth waiting for
            for run in without + with_fault:
                run.cancel()
    print(f"{caught} of {len(faults)} caught")
    sys.exit(0 if caught >= LEAST_CAUGHT * len(faults) else 1)


if __name__ == "__main__":
    main()
