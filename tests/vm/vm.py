"""Run the bench in a virtual machine with a PREEMPT_RT kernel over SocketCAN, disturb it, and judge what it did.

    make vm-test                       the scenarios of tests/vm/guest/scenarios.py
    python tests/vm/vm.py --only TEXT  those whose name contains the text
    python tests/vm/vm.py --rates      250 Hz and 1 kHz beside cyclictest under load

Everything is kept in build/vm: the disks, and results/ with recordings, journals and results.json. Returns 1 if
something does not hold, 2 if this computer lacks a program.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time

from image import ROOT, kernel, missing_programs, prepared, task_disk
from qemu import Machine
from table import rates_table, scenario_table

FOLDER = ROOT / "build/vm"


def say(text: str) -> None:
    """Print a line at once."""
    print(text, flush=True)


def main() -> int:
    """Make the machine, run the task in it, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="scenarios whose name contains this text")
    parser.add_argument("--rates", action="store_true", help="measure 250 Hz and 1 kHz beside cyclictest instead")
    parser.add_argument("--seconds", type=float, nargs=2, default=(600.0, 180.0), help="at 250 Hz and at 1 kHz")
    parser.add_argument("--minutes", type=float, default=600.0, help="after these no scenario begins")
    given = parser.parse_args()
    if missing := missing_programs():
        print(missing, file=sys.stderr)
        return 2
    FOLDER.mkdir(parents=True, exist_ok=True)
    machine = Machine(FOLDER, lambda: kernel(FOLDER), say)
    say(f"virtual machine by {machine.text}")
    disk = prepared(FOLDER, machine, say)
    options = FOLDER / "options.json"
    options.write_text(json.dumps({"only": given.only, "seconds": list(given.seconds), "minutes": given.minutes}))
    task = "rates.py" if given.rates else "scenarios.py"
    before = os.getloadavg()
    began_s = time.monotonic()
    results = machine.run(disk, task_disk(FOLDER / "task.tar", task, [options]), limit_s=sum(given.seconds) + 3600.0)
    found = json.loads((results / "results.json").read_text())
    found["host"] = {
        "accelerator": machine.text,
        "cores": os.cpu_count(),
        "load_before": before,
        "load_after": os.getloadavg(),
        "nice": os.nice(0),
        "seconds": round(time.monotonic() - began_s),
    }
    (results / "results.json").write_text(json.dumps(found, indent=1))
    text, holds = rates_table(found) if given.rates else scenario_table(found)
    say(text)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
