"""The command line, run in a folder without a terminal."""

from __future__ import annotations

import io
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest
from processes import DEADLINE_S

from hil.cli import main


class Ran(NamedTuple):
    """Result of a command."""

    returncode: int
    stdout: str
    stderr: str


def hil(folder: Path, *arguments: str) -> Ran:
    """Run the entry point in a folder, without a terminal."""
    out, err = io.StringIO(), io.StringIO()
    before = sys.argv
    sys.argv = ["hil", *arguments]
    try:
        with chdir(folder), redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main()
    finally:
        sys.argv = before
    return Ran(int(ended.value.code or 0), out.getvalue(), err.getvalue())


def process(folder: Path, *arguments: str) -> Ran:
    """Run `hil` as a process of its own."""
    ran = subprocess.run(
        [sys.executable, "-m", "hil.cli", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    return Ran(ran.returncode, ran.stdout, ran.stderr)


def refused(folder: Path, *arguments: str, code: int = 2) -> str:
    """The message of a command that must fail with `code` and leave nothing behind."""
    before = sorted(folder.rglob("*"))
    ran = hil(folder, *arguments)
    assert ran.returncode == code, ran.stderr
    assert "Traceback" not in ran.stderr
    assert not ran.stdout
    assert sorted(folder.rglob("*")) == before
    return ran.stderr
