"""What Windows and macOS lack is imported by the loop, the recorder and the scope only.

A new interpreter in which these modules and functions are missing imports all others: what `hil import`, `explain`,
`diagnose` and `compare` need. Libraries are imported before, because theirs differ by system.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from processes import DEADLINE_S

ROOT = Path(__file__).parents[2]
OF_LINUX = ("hil.loop", "hil.recording", "hil.scope", "hil.investigation", "hil.validation.benchmarks")
WITHOUT = r'''
import importlib, json, os, pkgutil, signal, sys
from importlib.abc import MetaPathFinder

for name in """can.interfaces.virtual can.interfaces.udp_multicast.utils canopen serial numba pyarrow.csv
        pyarrow.parquet scipy.signal scipy.stats scipy.optimize scipy.io matplotlib.figure bokeh.plotting bokeh.layouts
        jinja2 pydantic typer rich.table rich.console ruckig threadpoolctl yaml uvicorn starlette.staticfiles subprocess
        multiprocessing asyncio concurrent.futures.process tempfile shutil""".split():
    importlib.import_module(name)

class Missing(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in ("fcntl", "resource", "termios", "tty", "pty", "pwd", "grp"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Missing())
for name in ("fcntl", "resource", "termios", "tty", "pty", "pwd", "grp"):
    sys.modules.pop(name, None)
for name in ("sched_getaffinity", "sched_setaffinity", "sched_setscheduler", "sched_param", "SCHED_FIFO", "getuid",
             "geteuid", "uname", "posix_fallocate", "nice"):
    delattr(os, name)
for name in ("setitimer", "getitimer", "SIGVTALRM", "ITIMER_VIRTUAL"):
    delattr(signal, name)
sys.platform = "win32"
import hil, drivers, hil.cli
failed = {}
names = [one.name for root in (hil, drivers) for one in pkgutil.walk_packages(root.__path__, root.__name__ + ".")]
for name in names:
    try:
        importlib.import_module(name)
    except Exception as error:
        failed[name] = f"{type(error).__name__}: {error}"
print(json.dumps([len(names), failed, len(hil.read_recording(sys.argv[1]))]))
'''


def test_all_but_loop_recorder_and_scope_imports_without_the_modules_of_linux() -> None:
    recording = ROOT / "tests" / "recordings" / "clean.parquet"
    command = [sys.executable, "-c", WITHOUT, str(recording)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=DEADLINE_S, check=True)
    imported, failed, rows = json.loads(ran.stdout)
    assert imported > 400
    assert rows > 1000
    assert {name: why for name, why in failed.items() if not name.startswith(OF_LINUX)} == {}
    assert set(failed.values()) <= {"ModuleNotFoundError: No module named 'fcntl'"}
    assert "hil.recording.recording" not in failed  # of the recorder's package, what a diagnosis reads with
    assert "hil.loop.session" not in failed  # kernels are compiled by a simulation
