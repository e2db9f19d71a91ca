"""The CAN interfaces of this machine, as Linux sees them, and what to change on them.

From /sys/class/net, and from `ip` (iproute2) what stands only in netlink: bit rate, state, restart after bus-off.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hil.loop.machine import Level, MachineFinding

_ARPHRD_CAN = "280"  # linux/if_arp.h
_IFF_UP = 1  # linux/if.h
# SYNC, RPDO, heartbeat and an SDO request of two cycles must fit in, and the kernel's default of 10 holds them. What
# waits in the queue while the bus is disturbed is sent afterwards, too late: 32 set-points at 1 Mbit/s take 4 ms.
QUEUE_FRAMES = (8, 32)
FRAME_S = 130e-6  # of 8 bytes at 1 Mbit/s with bit stuffing
RESTART_MS = 100  # as in `hil install-service`


def can_findings(root: Path = Path("/"), details: dict[str, Any] | None = None) -> Iterator[MachineFinding]:
    """Yield the findings of every CAN interface.

    root: of /sys. details: what `ip -details -json link show NAME` says by name, None to ask it.
    """
    names = [path.name for path in sorted((root / "sys/class/net").glob("*"))
             if _read(path / "type") == _ARPHRD_CAN]  # fmt: skip
    if not names:
        yield MachineFinding(
            Level.FINE, "CAN", "no interface", "only a bench with interface: socketcan needs one"
        )  # fmt: skip
    for name in names:
        yield from _interface(
            name, root / "sys/class/net" / name, {name: _details(name)} if details is None else details
        )


def _interface(name: str, folder: Path, details: dict[str, Any]) -> Iterator[MachineFinding]:
    info = (details.get(name) or {}).get("linkinfo", {})
    data = info.get("info_data", {})
    virtual = info.get("info_kind") == "vcan" or not (folder / "device").exists()
    bitrate = data.get("bittiming", {}).get("bitrate", 0)
    up = int(_read(folder / "flags") or "0", 16) & _IFF_UP
    subject = f"CAN {name}"
    if not up:
        set_up = "" if virtual else f" type can bitrate 1000000 restart-ms {RESTART_MS}"
        yield MachineFinding(
            Level.CHANGE, subject, "down", "no frame is sent or heard",
            f"sudo ip link set {name} up{set_up}  # lasting: hil install-service",
        )  # fmt: skip
    elif virtual:
        yield MachineFinding(
            Level.FINE, subject, "up, virtual: no bit rate, no bus-off", "it carries simulated devices"
        )
    elif not data:
        yield MachineFinding(
            Level.ADVICE, subject, "up; bit rate and state unknown", "`ip` of iproute2 tells them",
            "sudo apt install iproute2",
        )  # fmt: skip
    else:
        state = data.get("state", "unknown")
        yield MachineFinding(
            Level.FINE if state == "ERROR-ACTIVE" else Level.CHANGE, subject, f"up, {bitrate} bit/s, {state}",
            "in any other state than ERROR-ACTIVE frames were damaged: bit rate, termination, wiring",
            "" if state == "ERROR-ACTIVE" else f"measure 60 ohm between CAN_H and CAN_L; ip -details -statistics "
            f"link show {name}",
        )  # fmt: skip
        restart_ms = data.get("restart_ms", 0)
        yield MachineFinding(
            Level.FINE if restart_ms else Level.CHANGE, f"{subject} restart-ms", str(restart_ms),
            "with 0 the interface is silent after bus-off until somebody restarts it: no stop command gets out",
            "" if restart_ms else f"sudo ip link set {name} down && sudo ip link set {name} type can "
            f"restart-ms {RESTART_MS} && sudo ip link set {name} up",
        )  # fmt: skip
    queue = int(_read(folder / "tx_queue_len") or "0")
    low, high = QUEUE_FRAMES
    fits = virtual or low <= queue <= high
    yield MachineFinding(
        Level.FINE if fits else Level.ADVICE, f"{subject} txqueuelen", str(queue),
        "too short: a cycle's frames are refused (ENOBUFS)" if queue < low else
        f"set-points that waited are sent late: {queue} frames take {1e3 * queue * FRAME_S:.0f} ms at 1 Mbit/s",
        "" if fits else f"sudo ip link set {name} txqueuelen 10",
    )  # fmt: skip


def _details(name: str) -> dict[str, Any]:
    """Return what `ip` says of an interface; {} without it."""
    program = shutil.which("ip") or shutil.which("ip", path="/usr/sbin:/sbin")
    if program is None:
        return {}
    asked = [program, "-details", "-json", "link", "show", "dev", name]
    said = subprocess.run(asked, capture_output=True, text=True, check=False, timeout=10)
    try:
        found: dict[str, Any] = json.loads(said.stdout)[0]
    except (ValueError, LookupError):
        return {}
    return found


def _read(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
