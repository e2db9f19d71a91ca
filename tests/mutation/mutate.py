"""Mutants of the live axis, from the set-up of its devices to the supervision: how many do the tests notice?

    python tests/mutation/mutate.py [--sample N] [--seed S] [--only PART] [--from MODULE]     from the root

The operators of cosmic-ray change one operator, number, keyword or condition of a module in a copy of the project, and
the tests of that module (`modules.py`) run there. A mutant is killed if a test fails, or if one takes `Suite.test_s` of
processor time, which a busy machine does not change. The tests run without a mutant before and after those of each
module and must pass. It prints each mutant, then a line for each module. `mutants.py` says which mutants are left out.

Each run is a fork of this process, which has imported the libraries but nothing of the project.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import NamedTuple

import pytest
from modules import MODULES, Suite
from mutants import mutants_of

ROOT = Path(__file__).parents[2]
LIBRARIES = ("hypothesis", "numba", "pyarrow.parquet", "pydantic", "canopen", "serial", "ruckig", "scipy.signal",
             "scipy.optimize", "typer.testing", "rich.console", "msgpack", "yaml")  # fmt: skip


BROKEN = 70  # exit code where pytest itself failed, as by an exception in a thread after the last test
HANG_S = 300.0  # of all tests by the wall clock: one waits for something that does not come


class Run(NamedTuple):
    """End of a run of the tests: exit code of pytest, negative: the signal, None: it hung; the first failed test."""

    code: int | None
    failed: str
    processor_s: float


def main() -> None:
    """Mutate each module and print what survived."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=0, help="mutants of each module; 0: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only modules whose path contains this")
    parser.add_argument("--from", dest="first", default="", help="begin with this module, as after an interruption")
    options = parser.parse_args()
    for name in LIBRARIES:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory(prefix="hil-mutants-") as folder:
        copy = Path(folder) / "project"
        ignored = shutil.ignore_patterns(".git", ".venv", "build", "runs", ".*_cache", "*.egg-info")
        shutil.copytree(ROOT, copy, ignore=ignored)
        modules = [module for module in MODULES if options.only in module and module >= options.first]
        lines = [mutate(copy, module, options.sample, options.seed) for module in modules]
    print("\n".join(["| module | mutants | run | killed | of those by time | survived |", "|---|---|---|---|---|---|",
                     *lines]))  # fmt: skip


def mutate(copy: Path, module: str, sample: int, seed: int) -> str:
    """Run mutants of one module; returns its line of the table."""
    suite, source = MODULES[module], copy / module
    text, status = source.read_text(encoding="utf-8"), source.stat()
    if not unmutated(copy, suite):
        return f"| `{module}` | the tests fail without a mutant | | | | |"
    mutants = mutants_of(text)
    drawn = random.Random(seed).sample(mutants, min(sample or len(mutants), len(mutants)))
    killed = by_time = 0
    for mutant in drawn:
        source.write_text(mutant.text(text), encoding="utf-8")
        run = run_tests(copy, suite)
        by_time += run.code is None or run.code < 0
        killed += run.code != 0
        print(f"{'survived' if run.code == 0 else 'killed'} {module} {mutant.change(text)} [{run.failed}, "
              f"{run.processor_s:.0f} s]", flush=True)  # fmt: skip
    source.write_text(text, encoding="utf-8")
    os.utime(source, ns=(status.st_atime_ns, status.st_mtime_ns))
    if not unmutated(copy, suite):
        return f"| `{module}` | the tests fail without a mutant | | | | |"
    return f"| `{module}` | {len(mutants)} | {len(drawn)} | {killed} | {by_time} | {len(drawn) - killed} |"


def unmutated(copy: Path, suite: Suite) -> bool:
    """Run the tests without a mutant, the first time with what must be compiled; returns whether all pass."""
    run = run_tests(copy, suite, mutated=False)
    print(f"without a mutant: exit code {run.code}, {run.processor_s:.0f} s {run.failed}", flush=True)
    return run.code == 0


def run_tests(copy: Path, suite: Suite, *, mutated: bool = True) -> Run:
    """Run the tests in a fork until the first one fails."""
    output, began_s = copy.parent / "output.txt", time.monotonic()
    if (pid := os.fork()) == 0:
        code = BROKEN
        try:
            os.setpgid(0, 0)
            code = in_fork(copy, suite, output, mutated)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)
    while True:
        ended, status, usage = os.wait4(pid, os.WNOHANG)
        if ended or time.monotonic() - began_s > HANG_S:
            break
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)  # also processes that the tests left
    if not ended:
        _, _, usage = os.wait4(pid, 0)
    lines = output.read_text(encoding="utf-8", errors="replace").splitlines()
    failed = next((line.split()[1].split("::")[-1] for line in lines if line.startswith(("FAILED ", "ERROR "))), "")
    return Run(os.waitstatus_to_exitcode(status) if ended else None, failed, usage.ru_utime + usage.ru_stime)


class Limit:
    """Plugin of pytest: each test may take test_s of processor time."""

    def __init__(self, test_s: int) -> None:
        self._test_s = test_s

    def pytest_runtest_setup(self) -> None:
        used = resource.getrusage(resource.RUSAGE_SELF)
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (round(used.ru_utime + used.ru_stime) + self._test_s, hard))


def in_fork(copy: Path, suite: Suite, output: Path, mutated: bool) -> int:
    """Run pytest in the copy; its output goes to a file."""
    with output.open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    os.chdir(copy)
    os.environ["PYTHONPATH"] = str(copy)  # of the processes that tests start
    sys.dont_write_bytecode = mutated
    options = ["-q", "-x", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]  # of a library
    if not suite.compiled:
        os.environ["NUMBA_DISABLE_JIT"] = "1"
        sys.modules["numba"].config.DISABLE_JIT = 1
        options.append("--noconftest")  # which compiles kernels
    return int(pytest.main([*options, *suite.tests], plugins=[Limit(suite.test_s)] if mutated else []))


if __name__ == "__main__":
    main()
