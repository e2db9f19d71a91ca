"""The simulated nodes as a process of their own, over UDP multicast; and the contract of the package."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from processes import DEADLINE_S

from drivers.bus import BusConfig, PythonCanPort, open_bus
from drivers.canopen_drive import CanopenDrive, DriveSettings
from drivers.canopen_encoder import CanopenEncoder, EncoderSettings
from drivers.canopen_master import CanopenMaster
from drivers.port import Condition, DriveGoal

GROUP = "239.74.163.77"
ROOT = Path(__file__).parents[2]


def multicast_trouble() -> str:
    """Why a datagram does not come back from the group, if it does not."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        receiver.bind(("", 0))
        receiver.settimeout(1.0)
        receiver.setsockopt(
            socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP,
            struct.pack("4sI", socket.inet_aton(GROUP), socket.INADDR_ANY),
        )  # fmt: skip
        sender.sendto(b"x", (GROUP, receiver.getsockname()[1]))
        receiver.recv(1)
    except OSError as error:
        return f"no IPv4 multicast on this machine: {error}"
    finally:
        receiver.close()
        sender.close()
    return ""


@pytest.fixture
def nodes() -> Iterator[subprocess.Popen[str]]:
    if trouble := multicast_trouble():
        pytest.skip(trouble)
    command = [sys.executable, "-m", "drivers.sim.node", "--bus", "udp_multicast", "--channel", GROUP]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == f"drive node 5 and encoder node 6 on udp_multicast:{GROUP}\n"
        yield process
        process.terminate()


def test_a_drive_in_another_process_runs_in_wall_clock_time(nodes: subprocess.Popen[str]) -> None:
    port = PythonCanPort(open_bus(BusConfig("udp_multicast", GROUP)))
    master = CanopenMaster(port, heartbeat_s=1.0)
    # A busy machine may hold the other process up: what is tested is that the frames are right, not how fast they are.
    drive = CanopenDrive(
        master,
        DriveSettings(period_s=0.005, heartbeat_s=5.0, missed_answers_allowed=200, command_deadline_s=5.0),
    )
    encoder = CanopenEncoder(master, EncoderSettings(heartbeat_s=5.0, missed_answers_allowed=200))
    drive.set_up()
    assert drive.info.watches_master  # by the clock of the other process
    encoder.set_up()
    start_s = time.monotonic()
    master.start(0.0)
    drive.goal = DriveGoal.ENABLED
    torques: list[float] = []
    moved = False
    while len(torques) < 100 or not moved:  # the devices' time is the wall clock, this loop is as fast as its answers
        master.sync(time.monotonic() - start_s)
        deadline_s = time.monotonic() + DEADLINE_S
        while True:
            now_s = time.monotonic() - start_s
            master.poll(now_s, 0.005)
            sample, table = drive.read(now_s), encoder.read(now_s)
            if sample.age_cycles == table.age_cycles == 0:
                break
            assert time.monotonic() < deadline_s
        drive.command(now_s, 3.0)
        if sample.enabled:
            torques.append(sample.torque_n_m)
            moved = table.position_m > 1e-3
            assert len(torques) < 20_000
    assert sample.enabled
    assert not sample.condition & ~Condition.LATE
    assert torques[-1] == pytest.approx(3.0, abs=0.1)  # the plant's torque noise is 0.01 N m rms
    assert table.position_m == pytest.approx(sample.motor_position_rad * 0.01 / 6.283185307179586, abs=20e-6)
    drive.goal = DriveGoal.DISABLED
    drive.command(now_s, 0.0)
    port.close()


def test_the_loop_imports_nothing_heavy_and_nothing_of_hil() -> None:
    code = (
        "import sys, drivers.canopen_drive, drivers.canopen_encoder, drivers.serial_encoder, "
        "drivers.modelled_bus, drivers.sim.drive_node, drivers.sim.encoder_node, drivers.sim.serial_line;"
        "print([m for m in ('scipy', 'matplotlib', 'bokeh', 'pyarrow', 'pydantic', 'hil') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert out.stdout == "[]\n"
