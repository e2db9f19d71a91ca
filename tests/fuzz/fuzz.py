"""Fuzz everything that is read: `make fuzz`, or `python tests/fuzz/fuzz.py --inputs 20000 --seed 1 --jobs 2`.

An input is a failure if the code that reads it raises anything but an error raised on purpose, takes more than 5 s of
processor time, lets the process grow by more than 500 MB, or ends it. Prints a table with counts; a failure prints its
seed, and `--only TARGET --one SEED` repeats it with its trace. Exit code 1 with failures.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
sys.path.insert(0, str(Path(__file__).parent))

from targets import EXPECTED, TARGETS, WEIGHTS, rehearse_all

LONGEST_S = 5.0
MOST_GROWTH_MB = 500.0
BATCH = 250
ENDED = "the process ended"


class TooSlow(BaseException):
    """An input took longer than LONGEST_S; no `except Exception` catches it."""


class Tried(NamedTuple):
    """Result of an input: its seed, "" or what failed, whether it was accepted, seconds and growth of the process."""

    seed: str
    failure: str
    accepted: bool
    seconds: float
    growth_mb: float


def attempt(target: str, seed: str, folder: Path) -> Tried:
    """Give one input to its target."""
    failure, accepted, before_mb, start_s = "", False, _peak_mb(), time.process_time()
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            TARGETS[target](random.Random(f"{target} {seed}"), folder)
        accepted = True
    except EXPECTED:
        pass
    except TooSlow:
        failure = f"longer than {LONGEST_S:g} s"
    except (Exception, SystemExit) as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        failure = f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''} "
        failure = f"{failure[:160]} ({Path(frame.filename).name}:{frame.lineno})"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    seconds, growth_mb = time.process_time() - start_s, _peak_mb() - before_mb
    if not failure and seconds > LONGEST_S:
        failure = f"longer than {LONGEST_S:g} s"
    if not failure and growth_mb > MOST_GROWTH_MB:
        failure = f"grew by {growth_mb:.0f} MB"
    return Tried(seed, failure, accepted, seconds, growth_mb)


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def too_slow(number: int, frame: FrameType | None) -> None:
    """Handler of the alarm."""
    raise TooSlow


def work(target: str, seeds: list[str]) -> None:
    """Try inputs in this process; print a line for each: its seed before, its result after."""
    signal.signal(signal.SIGPROF, too_slow)
    with tempfile.TemporaryDirectory() as name:
        for k in range(4):  # imports, parsed files and loaded kernels belong to no input
            attempt(target, f"first {k}", Path(name))
        for seed in seeds:
            print(json.dumps(seed), flush=True)
            print(json.dumps(attempt(target, seed, Path(name))), flush=True)


def batch(target: str, seeds: list[str]) -> list[Tried]:
    """Try inputs in a process of their own, which one that ends it does not take the others along."""
    results: list[Tried] = []
    while seeds:
        command = [sys.executable, __file__, "--only", target, "--work", json.dumps(seeds)]
        limit_s = 60.0 + 2.0 * LONGEST_S * len(seeds)
        ran = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, timeout=limit_s)
        lines = [json.loads(line) for line in ran.stdout.splitlines() if line.startswith(("[", '"'))]
        done = [Tried(*line) for line in lines if isinstance(line, list)]
        results += done
        begun = [line for line in lines if isinstance(line, str)]
        if len(begun) > len(done):
            results.append(Tried(begun[-1], f"{ENDED} ({ran.returncode})", False, 0.0, 0.0))
        elif not begun:
            results += [Tried(seed, f"{ENDED} ({ran.returncode})", False, 0.0, 0.0) for seed in seeds]
            break
        seeds = seeds[len(begun) :]
    return results


def batches(inputs: int, seed: int, only: str | None) -> Iterator[tuple[str, list[str]]]:
    """Targets with the seeds of a batch each."""
    total = sum(WEIGHTS[target] for target in TARGETS if only in (None, target))
    for target in TARGETS:
        if only in (None, target):
            seeds = [f"{seed}.{k}" for k in range(round(inputs * WEIGHTS[target] / total))]
            yield from ((target, seeds[at : at + BATCH]) for at in range(0, len(seeds), BATCH))


def table(results: dict[str, list[Tried]]) -> str:
    """The counts as a Markdown table."""
    lines = [
        "| target | inputs | accepted | refused | failures | slowest s | growth MB |",
        "|---|---|---|---|---|---|---|",
    ]
    for target, tried in results.items():
        failed, accepted = sum(bool(one.failure) for one in tried), sum(one.accepted for one in tried)
        lines.append(
            f"| {target} | {len(tried)} | {accepted} | {len(tried) - accepted - failed} | {failed} | "
            f"{max(one.seconds for one in tried):.2f} | {max(one.growth_mb for one in tried):.0f} |"
        )
    lines.append(f"| all | {sum(map(len, results.values()))} | | | | | |")
    return "\n".join(lines)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--only", choices=list(TARGETS))
    parser.add_argument("--one", help="seed of a failure, to repeat it with its trace")
    parser.add_argument("--work", help=argparse.SUPPRESS)
    given: Any = parser.parse_args()
    if given.work:
        work(given.only, json.loads(given.work))
        return 0
    if given.one:
        with tempfile.TemporaryDirectory() as name:
            TARGETS[given.only](random.Random(f"{given.only} {given.one}"), Path(name))
        return 0
    rehearse_all()  # compiles kernels
    results: dict[str, list[Tried]] = {}
    tasks = list(batches(given.inputs, given.seed, given.only))
    with ThreadPoolExecutor(given.jobs) as pool:
        for (target, _), tried in zip(tasks, pool.map(lambda task: batch(*task), tasks), strict=True):
            results.setdefault(target, []).extend(tried)
            for one in tried:
                if one.failure:
                    print(f"{target}: {one.failure}; --only '{target}' --one {one.seed}", flush=True)
    print(table(results))
    return int(any(one.failure for tried in results.values() for one in tried))


if __name__ == "__main__":
    sys.exit(main())
