"""Processes beside a run that show it: the line in the terminal, and the scope. The loop knows nothing of them."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path

from hil.commands.scope import SCOPE_PORT
from hil.errors import HilError
from hil.report.console import out

END_S = 5.0  # for the line to vanish


@contextlib.contextmanager
def status_line(folder: Path | None) -> Iterator[None]:
    """Show the run that is recorded in a folder in one line of the terminal while the block runs; None: nothing."""
    if folder is None:
        yield
        return
    # a session of its own: ctrl-C is for the loop alone
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "hil.scope.status_line", str(folder)],
        stdin=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdin is not None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            process.stdin.close()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def scope_beside() -> subprocess.Popen[bytes] | None:
    """Start a scope that outlives this process as long as a page is open, unless one serves already; print its address.

    Returns its process if this call started it. Raises HilError, or what `hil scope` said, if it does not begin.
    """
    own = f"http://127.0.0.1:{SCOPE_PORT}/"
    with contextlib.suppress(OSError), urllib.request.urlopen(own, timeout=1.0) as answer:
        if b"<title>hil scope" in answer.read(2000):
            out.print(f"scope: {own} (it runs already)")
            return None
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "hil.cli", "scope", "--port", str(SCOPE_PORT), "--beside", str(os.getpid())],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdout is not None
    with process.stdout:
        told = process.stdout.readline().decode().strip()
    if not told:
        process.wait()
        raise HilError("the scope did not begin, as said above: mend that, or run without --scope")
    out.print(told)
    return process
