"""The guide as a newcomer uses it: its files are written, its commands and programs run, in their order."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from command_line import process
from foreign_axis import axis
from processes import DEADLINE_S

from hil.manual.topics import GUIDE, guide_page

ROOT = Path(__file__).parents[2]
NEEDS_HARDWARE = "at the drive"  # comment behind a command
MAY_FAIL = {"doctor": 1}  # exit code of a PC on which something has to be changed


class Step(NamedTuple):
    """A part of a page that can be executed: a file to write, or a command line; and its line in the page."""

    line: int
    name: str
    text: str


def steps(topic: str) -> list[Step]:
    """Files (fenced, their name in the first line), programs, and commands (indented) of a page, in order."""
    page = guide_page(topic)
    found = list[Step]()
    for block in re.finditer(r"^```(?:yaml|python)\n# (\S+)\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        found.append(Step(page.count("\n", 0, block.start()) + 1, block[1], block[2]))
    for command in re.finditer(r"^ {4,}((?:hil|sed|echo) .*)$", page, re.MULTILINE):
        found.append(Step(page.count("\n", 0, command.start()) + 1, "", command[1]))
    return sorted(found)


def prepared(folder: Path) -> Path:
    """A folder with what a reader has: profiles (a link), own recordings, and the files of all pages."""
    (folder / "profiles").symlink_to(ROOT / "profiles")
    for topic in GUIDE:
        for step in steps(topic):
            if step.name.endswith(".yaml"):
                (folder / step.name).write_text(step.text)
    columns, rows = axis(4000), slice(0, 2500)
    time_s, angle, torque = (columns[name][rows] for name in ("t", "angle", "torque"))
    header = "time [s],angle [rad],torque [Nm]"
    _write(folder / "my-axis.csv", header, time_s, angle, torque)
    _write(folder / "my-axis-fast.csv", header, time_s, columns["angle"][-2500:], columns["torque"][-2500:])
    both = "time [s],angle 1 [rad],torque 1 [Nm],angle 2 [rad],torque 2 [Nm]"
    _write(folder / "all-axes.csv", both, time_s, np.roll(angle, 300), np.roll(torque, 300), angle, torque)
    _write(folder / "no-time.csv", "angle [rad],torque [Nm]", angle, torque)
    return folder


def _write(path: Path, header: str, *columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g")


def run(step: Step, folder: Path) -> str:
    """Execute a step; return what it printed. Raises AssertionError where it does not end as the reader expects."""
    if step.name.endswith(".yaml"):
        ran, expected = process(folder, "validate", step.name), 0
    elif step.name:
        (folder / step.name).write_text(step.text)
        ran, expected = _program(folder, sys.executable, step.name), 0
    else:
        words = shlex.split(step.text, comments=True)
        expected = MAY_FAIL.get(words[1], 0)
        command = step.text.replace("hil ", f"{sys.executable} -m hil.cli ", 1) if words[0] == "hil" else step.text
        ran = _program(folder, "sh", "-c", command)
    assert ran.returncode in (0, expected), f"line {step.line}: {step.text or step.name}\n{ran.stderr}"
    return ran.stdout + ran.stderr


def _program(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
