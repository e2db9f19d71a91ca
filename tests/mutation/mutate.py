"""Mutants of the safety rules, the session and the CiA 402 machine: how many do the tests notice?

    python tests/mutation/mutate.py [--sample N] [--seed S] [--only PART]     from the root; as make mutation does

cosmic-ray changes an operator, a number, a keyword or a condition of a copy of the project, one at a time, and runs the
tests of that module there. A mutant is killed if a test fails or takes too long. `--sample` draws so many of each
module. It prints the diff of each survivor, then a line for each module.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
LOOP = ("session", "supervision", "stall", "arming", "power_off", "encoder_checks")
DRIVE = ("cia402", "canopen_drive", "acting_setpoint", "faults_watchdogs", "faults_devices", "faults_frames")
MODULES = {
    "drivers/cia402.py": ("drivers", DRIVE),
    "drivers/canopen_drive.py": ("drivers", DRIVE),
    "hil/loop/stall.py": ("hil", ("stall", "supervision")),
    "hil/loop/stopping.py": ("hil", ("session", "supervision")),
    "hil/loop/bounds.py": ("hil", ("supervision", "encoder_checks", "stall")),
    "hil/loop/supervision.py": ("hil", ("supervision", "encoder_checks", "stall", "session")),
    "hil/loop/session.py": ("hil", LOOP),
}
TIMEOUT_S = 300.0


def main() -> None:
    """Mutate each module and print what survived."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=0, help="mutants of each module; 0: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="only modules whose path contains this")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="hil-mutants-") as folder:
        copy = Path(folder) / "project"
        ignored = shutil.ignore_patterns(".git", ".venv", "build", "runs", "__pycache__", ".*_cache", "*.egg-info")
        shutil.copytree(ROOT, copy, ignore=ignored)
        lines = [mutate(copy, module, options.sample, options.seed) for module in MODULES if options.only in module]
    print("\n".join(["| module | mutants | run | killed | survived |", "|---|---|---|---|---|", *lines]))


def mutate(copy: Path, module: str, sample: int, seed: int) -> str:
    """Run the mutants of one module; returns its line of the table."""
    place, names = MODULES[module]
    tests = " ".join(f"tests/{place}/test_{name}.py" for name in names)
    config, session = copy.parent / "config.toml", copy.parent / f"{Path(module).stem}.sqlite"
    command = f"{sys.executable} -m pytest -q -x -p no:cacheprovider {tests}"
    config.write_text(
        f'[cosmic-ray]\nmodule-path = "{module}"\ntimeout = {TIMEOUT_S}\nexcluded-modules = []\n'
        f'test-command = "{command}"\n[cosmic-ray.distributor]\nname = "local"\n'
    )
    run(copy, "init", str(config), str(session))
    made = drawn(session, sample, seed)
    run(copy, "exec", str(config), str(session))
    killed, survivors = 0, []
    for line in run(copy, "dump", str(session)).splitlines():
        _, result = json.loads(line)
        if result is None:
            continue
        if result["test_outcome"] == "survived":
            survivors.append(result["diff"])
        else:
            killed += 1
    for diff in survivors:
        print(f"survived:\n{diff}\n", flush=True)
    return f"| `{module}` | {made} | {killed + len(survivors)} | {killed} | {len(survivors)} |"


def drawn(session: Path, sample: int, seed: int) -> int:
    """Keep a random sample of the mutants of a session; returns how many there were."""
    with sqlite3.connect(session) as database:
        jobs = [job for (job,) in database.execute("SELECT job_id FROM work_items ORDER BY job_id")]
        kept = set(random.Random(seed).sample(jobs, min(sample or len(jobs), len(jobs))))
        for job in jobs:
            if job not in kept:
                database.execute("DELETE FROM mutation_specs WHERE job_id = ?", (job,))
                database.execute("DELETE FROM work_items WHERE job_id = ?", (job,))
    return len(jobs)


def run(copy: Path, *arguments: str) -> str:
    """Run cosmic-ray in the copy; returns what it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "cosmic_ray.cli", *arguments], cwd=copy, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"cosmic-ray {arguments[0]} failed:\n{done.stderr.strip()}")
    return done.stdout


if __name__ == "__main__":
    main()
