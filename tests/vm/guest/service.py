"""The bench as a service, its simulated devices beside it, and what both leave behind."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq

os.environ["NUMBA_CACHE_DIR"] = "/var/cache/hil"  # of the service; before kernels are imported

from devices import serve_bench, truth

from hil.commands.recover import recover
from hil.errors import HilError
from hil.recording.recording import read_recording

HERE = Path(__file__).parent
RESULTS = HERE / "results"
HIL = Path(sys.executable).parent / "hil"
NAME = "axis1"
UNIT = f"hil-bench@{NAME}.service"
CAN = "vcan0"
LATCH = Path("/var/lib/hil-faults") / NAME
RECORDINGS = Path("/var/lib/hil") / NAME
_SHOWN = ("ActiveState", "Result", "ExecMainCode", "ExecMainStatus", "MainPID", "InvocationID", "ControlGroup")


def call(*command: str | Path, check: bool = False) -> subprocess.CompletedProcess[str]:
    """Run a command and return what it said."""
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=check)


def wait_for(condition: Callable[[], bool], limit_s: float, spacing_s: float = 0.002) -> bool:
    """Wait until the condition holds; False if it does not within limit_s."""
    end_s = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(spacing_s)
    return True


class Devices:
    """The process of the simulated drive and encoder: forked, as importing anew takes a simulated processor minutes."""

    def __init__(self, bench: Path, log: Path) -> None:
        self.log = log
        log.unlink(missing_ok=True)
        heard, told = os.pipe()
        self.pid = os.fork()
        if not self.pid:
            try:
                serve_bench(bench, log, lambda: print(os.write(told, b"r"), end=""))
            finally:
                os._exit(1)
        os.close(told)
        if os.read(heard, 1) != b"r":
            raise SystemExit("the simulated devices did not start")
        os.close(heard)

    def truth(self) -> npt.NDArray[np.float64]:
        """Rows of what the axis did: `devices.COLUMNS`."""
        return truth(self.log)

    def kill(self) -> None:
        """End the process as a power failure would."""
        if self.pid:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
            self.pid = 0


class Service:
    """The unit of the bench."""

    def start(self) -> subprocess.CompletedProcess[str]:
        """Start it; returns when its loop runs or it has failed."""
        return call("systemctl", "start", UNIT)

    def state(self) -> dict[str, str]:
        """Properties of the unit."""
        said = call("systemctl", "show", UNIT, *(f"--property={name}" for name in _SHOWN)).stdout
        return dict(line.split("=", 1) for line in said.splitlines())

    @property
    def pid(self) -> int:
        """Process of the loop."""
        return int(self.state()["MainPID"])

    def ended(self) -> bool:
        """Return True if nothing of the unit runs any more."""
        return self.state()["ActiveState"] in ("inactive", "failed")

    def processes(self) -> dict[int, str]:
        """Command lines of the processes of the unit."""
        found = {}
        for pid in Path(f"/sys/fs/cgroup{self.state()['ControlGroup']}/cgroup.procs").read_text().split():
            found[int(pid)] = Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
        return found

    def journal(self, invocation: str) -> str:
        """What the run and the latch wrote."""
        return call("journalctl", "--no-pager", "--output=short-monotonic", f"_SYSTEMD_INVOCATION_ID={invocation}", "+",
                    f"INVOCATION_ID={invocation}").stdout  # fmt: skip

    def clear(self) -> None:
        """Forget runs before: the latch, the failure, the recordings."""
        call("systemctl", "stop", UNIT)
        LATCH.unlink(missing_ok=True)
        call("systemctl", "reset-failed")
        for path in RECORDINGS.glob("*"):
            path.unlink()
        if not Path(f"/sys/class/net/{CAN}").exists():
            call("systemctl", "restart", "systemd-networkd")
        if not wait_for(lambda: "UP" in call("ip", "link", "show", CAN).stdout, 30.0, 0.1):
            raise SystemExit(f"{CAN} does not come up")


def recorded(into: Path) -> dict[str, Any]:
    """Recover what was not closed, copy the recordings to `into` and describe the last: rows, duration, ending."""
    into.mkdir(parents=True, exist_ok=True)
    closed = sorted(RECORDINGS.glob("*.parquet"))
    said = ""
    for stream in () if closed else sorted(RECORDINGS.glob("*.arrows")):
        try:
            recover(stream, None)
        except HilError as error:
            said = str(error)
    for path in RECORDINGS.glob("*"):
        shutil.copy(path, into)
    files = sorted(RECORDINGS.glob("*.parquet"))
    if not files:
        return {"rows": 0, "duration_s": 0.0, "closed": False, "said": said, "metadata": {}}
    run = read_recording(files[-1])
    time_s = run["time_s"]
    return {
        "rows": pq.read_metadata(files[-1]).num_rows,  # without those that reading interpolates
        "duration_s": float(time_s[-1] - time_s[0]),
        "closed": bool(closed),
        "said": said,
        "metadata": run.metadata,
        "certificate": run.metadata.get("real_time", {}),
        "parts": len(run.parts()),
    }


def guest() -> dict[str, Any]:
    """Kernel and cores of the guest."""
    return {
        "kernel": os.uname().release,
        "preempt_rt": "PREEMPT_RT" in os.uname().version,
        "cores": os.cpu_count(),
        "systemd": call("systemctl", "--version").stdout.split("\n")[0],
        "python": sys.version.split()[0],
    }


def say(text: str) -> None:
    """Write a line to the user of the virtual machine."""
    print(f"vm: {text}", flush=True)


def write(found: dict[str, Any]) -> None:
    """Write the results."""
    (RESULTS / "results.json").write_text(json.dumps({"guest": guest()} | found, indent=1))
