"""Real recordings, each from its raw file to a diagnosis by the three commands of the README.

What a file does not tell, and its map asks for, is written there from `OWNER`; nothing else is corrected.

    python tests/net/real_recordings.py OUT [--only PART]     from the root of the repository, recordings beside it

It prints for each the wall and processor seconds of `hil import`, `hil identify` and `hil diagnose`, the verdict with
names and confidences, and the torque left on held-out motion beside that of plain least squares. Reports are kept in
OUT; a recording that has one is not diagnosed again.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

RECORDINGS = Path(__file__).parents[3] / "shared" / "recordings"
PENDULUM = ("joint1_open_loop", "swingup_a", "swingup_b", "pendubot_friction_compensated")
FILES = {
    "emps": ("emps/DATA_EMPS.mat", ""),
    **{f"kuka {name}": (f"kuka/axis{name}.csv", "") for name in ("1_a", "1_b", "1_c", "2_a", "3_c")},
    **{f"laas {name}": (f"laas/{name}.csv", "") for name in ("speed", "acceleration", "map")},
    **{f"sinumerik {name}": (f"sinumerik/axis{name}.csv", "") for name in ("1_part2", "2_part1", "2_part2")},
    **{f"bar {name}": (f"flexible-bar/{name}.csv", "") for name in ("prbs", "square", "staircase_up")},
    **{f"pendulum {name} {axis}": (f"double-pendulum/{name}.csv", axis) for axis in ("1", "2") for name in PENDULUM},
    **{f"rig {name}": (f"rig/{name}/train_1.csv", "") for name in ("null", "stribeck", "backlash", "lead")},
}
OWNER = {  # what the map asks of the owner; the lead of the machine tool and the torque constant are not known
    "emps": {"unit": "m"},
    "laas": {"torque_constant_n_m_a": "1"},
    "sinumerik": {"lead_m": "0.010"},
}
FROZEN = "pendulum joint1_open_loop 2"  # a joint that does not move


def main() -> None:
    """Run the commands for each recording and print its line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for maps, benches and reports")
    parser.add_argument("--only", default="", help="only recordings whose name contains this")
    options = parser.parse_args()
    for name, (file, axis) in FILES.items():
        if options.only in name and name != FROZEN:
            print(f"{name}: {answer(options.out / name.replace(' ', '_'), RECORDINGS / file, axis)}", flush=True)


def answer(place: Path, source: Path, axis: str) -> str:
    """Seconds and result of the three commands on one file, as a line."""
    place.mkdir(parents=True, exist_ok=True)
    run, bench, report = (str(place / name) for name in ("run.parquet", "axis.yaml", "report"))
    told = place / "report" / "diagnosis.json"
    commands = (
        []
        if told.exists()
        else [
            imported(source, run, axis),
            ["identify", run, "--out", bench],
            ["diagnose", run, "--bench", bench, "--out", report],
        ]
    )
    seconds = []
    for command in commands:
        begin, used = time.monotonic(), os.times()
        done = subprocess.run([sys.executable, "-m", "hil.cli", *command], capture_output=True, text=True, check=False)
        now = os.times()
        cpu_s = now.children_user + now.children_system - used.children_user - used.children_system
        seconds.append(f"{command[0]} {time.monotonic() - begin:.1f} s (processor {cpu_s:.1f} s)")
        if done.returncode:
            return f"{', '.join(seconds)}: {done.stderr.strip().splitlines()[-1]}"
    result = json.loads(told.read_text(encoding="utf-8"))
    found = [f"{one['effect']} {one['confidence']:.2f}" for one in (*result["missing"], *result["partial"])]
    left = result["torque_left"] or {}
    shares = [f"{name} {100.0 * left[name]:.1f} %" for name in ("final", "plain") if left.get(name) is not None]
    return f"{', '.join(seconds)}: {result['verdict']} [{', '.join(found)}] torque left {', '.join(shares)}"


def imported(source: Path, run: str, axis: str = "") -> list[str]:
    """The command that imports a file; its map is drafted and completed before, where the file does not tell enough."""
    command = ["import", str(source), "--out", run, *(["--axis", axis] if axis else [])]
    known = OWNER.get(source.parent.name)
    if known is None:
        return command
    written, place = Path(run).with_name("owner.yaml"), Path(run).with_name("run-map.yaml")
    subprocess.run([sys.executable, "-m", "hil.cli", *command], capture_output=True, check=False)
    text = place.read_text(encoding="utf-8")
    for key, value in known.items():
        text = re.sub(rf"^( *{key}:) *# <-- write.*$", rf"\1 {value}", text, flags=re.MULTILINE)
    written.write_text(text, encoding="utf-8")
    Path(run).unlink(missing_ok=True)
    return [*command, "--map", str(written)]


if __name__ == "__main__":
    sys.exit(main())
