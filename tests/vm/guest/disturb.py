"""What is done to a moving bench from outside: to its processes, its interface, and the frames on it."""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Callable

import can
from service import CAN, Devices, Service, call

WRITER = "writer_process"  # in the command line of the recorder's writer
_DRIVE_TPDO = 0x185  # node 5 of axis.yaml


def no_disturbance(service: Service, devices: Devices) -> str:
    """Do nothing."""
    return ""


def kill_writer(service: Service, devices: Devices) -> str:
    """Kill the process that writes the recording."""
    found = [pid for pid, command in service.processes().items() if WRITER in command]
    if not found:
        raise RuntimeError(f"no writer among {service.processes()}")
    os.kill(found[0], signal.SIGKILL)
    return f"process {found[0]}"


def interface_down(service: Service, devices: Devices) -> str:
    """Take the CAN interface down and up again."""
    call("ip", "link", "set", CAN, "down", check=True)
    time.sleep(1.0)
    call("ip", "link", "set", CAN, "up", check=True)
    return ""


def remove_interface(service: Service, devices: Devices) -> str:
    """Remove the interface, as pulling a USB adapter does."""
    call("ip", "link", "delete", CAN, check=True)
    return ""


def drops(share: str, seconds: float) -> Callable[[Service, Devices], str]:
    """Return a disturbance that loses a share of all frames for some seconds, 0: to the end of the run."""

    def lose(service: Service, devices: Devices) -> str:
        call("tc", "qdisc", "add", "dev", CAN, "root", "netem", "loss", share, check=True)
        if seconds:
            time.sleep(seconds)
            call("tc", "qdisc", "del", "dev", CAN, "root", check=True)
        return ""

    return lose


def reorders(service: Service, devices: Devices) -> str:
    """Delay each frame by its own time, so that later ones overtake."""
    call("tc", "qdisc", "add", "dev", CAN, "root", "netem", "delay", "3ms", "3ms", check=True)
    return ""


def bad_answers(service: Service, devices: Devices) -> str:
    """Send the drive's TPDO with random content beside the true one, fifty times."""
    chance = random.Random(1)
    bus = can.Bus(interface="socketcan", channel=CAN)
    for _ in range(50):
        data = [chance.randrange(256) for _ in range(8)]
        bus.send(can.Message(arbitration_id=_DRIVE_TPDO, data=data, is_extended_id=False))
        time.sleep(0.003)
    bus.shutdown()
    return ""
