"""What a run says of its bus: frames that were not acted on, and a drive that does not miss this PC."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from bench_runs import MOVE, bench_with
from patient_bench import patient_bench

from drivers.bus import BusConfig, open_bus
from drivers.modelled_bus import Fault, FaultKind, ModelledBus
from hil.loop.devices import Rig, open_devices
from hil.loop.realtime import NotArmed
from hil.loop.run import run_profile
from hil.recording.recording import read_recording

MANY = 1_000_000
MASTER_HEARTBEAT, DRIVE_HEARTBEAT = 0x701, 0x705


@pytest.fixture
def sender() -> Iterator[can.BusABC]:
    bus = open_bus(BusConfig("virtual", "test_run_bus"))
    yield bus
    bus.shutdown()


def test_foreign_frames_are_told_once_and_change_nothing(tmp_path: Path, sender: can.BusABC) -> None:
    bench = patient_bench(interface="virtual", channel="test_run_bus")

    def disturb(_: object) -> None:
        for can_id in (0x185, 0x085, 0x705, 0x186):
            sender.send(can.Message(arbitration_id=can_id, is_extended_id=True, data=b"\xff" * 8))
            sender.send(can.Message(arbitration_id=can_id, is_extended_id=False, is_fd=True, data=b"\xff" * 8))
        for data in (b"", b"\x05\x05"):
            sender.send(can.Message(arbitration_id=DRIVE_HEARTBEAT, is_extended_id=False, data=data))

    with open_devices(bench) as rig:
        ran = run_profile(bench, MOVE, tmp_path, "disturbed", virtual=True, planned=disturb, rig=rig)
        assert ran.complete
        bus, drive = ran.notes
        assert bus == ("bus: frames that CANopen does not have (CiA 301) came and were not acted on: "
                       "4 x 29-bit identifier, 4 x CAN FD")  # fmt: skip
        assert drive == "drive node 5: 2 frames of a wrong length or value were not acted on"
        again = run_profile(bench, MOVE, tmp_path, "quiet", virtual=True, rig=rig)
        assert again.notes == ()
    disturbed = read_recording(ran.recording)
    assert abs(disturbed["table_position_m"] - disturbed["twin_table_position_m"]).max() < 20e-6
    assert set(disturbed["drive_error_code"]) == {0}


@pytest.mark.parametrize("force", [False, True])
def test_a_drive_that_does_not_hear_this_pc_is_armed_by_force_only(tmp_path: Path, force: bool) -> None:
    """Its consumer (0x1016) begins with the first heartbeat, so that it would never miss one."""
    bus, bench = ModelledBus(), bench_with()
    bus.inject(Fault(FaultKind.DROP, MASTER_HEARTBEAT, count=MANY))
    with Rig(bench, bus=bus) as rig:
        if force:
            ran = run_profile(bench, MOVE, tmp_path, "run", virtual=True, rig=rig, force=True)
            assert "does not watch it" in ran.doubts[0]
            assert "does not watch it" in read_recording(ran.recording).metadata["overridden"][0]
            return
        with pytest.raises(NotArmed, match=r"heartbeat of this PC.*The drive was not armed: check.*master_node_id"):
            run_profile(bench, MOVE, tmp_path, "run", virtual=True, rig=rig)
    assert not list(tmp_path.iterdir())
