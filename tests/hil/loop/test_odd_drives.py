"""Drives that take their time, refuse what they need not have, or are not ready: each is run to its end or refused
with the cause in words. The drive is durand's slave on a python-can virtual bus, the code that of `hil run`."""

from __future__ import annotations

import itertools
import math
import re
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from bench_runs import bench_with
from cia402_slave import (
    BAD_VALUE,
    COUNTS_PER_REV,
    DISABLED,
    ENABLED,
    FAULT,
    GENERAL,
    INITIALISING,
    NOT_NOW,
    READ_ONLY,
    READY,
    SWITCHED_ON,
    Manners,
    Slave,
)
from command_line import hil

from drivers.bus import BusConfig, CanPort, PumpedPort, PythonCanPort, open_bus
from drivers.inprocess import InProcessBus
from drivers.port import Condition
from hil.bench.bench_file import Bench
from hil.errors import HilError
from hil.loop.devices import Rig
from hil.loop.run import RunResult, run_profile
from hil.motion.profile import Profile
from hil.recording.recording import read_recording

MOVE = Profile.model_validate(
    {
        "schema_version": 1,
        "limits": {"velocity_m_s": 0.2, "acceleration_m_s2": 2.0, "jerk_m_s3": 100.0},
        "segments": [{"kind": "sine_squared", "to_m": 0.01, "feed_m_s": 0.05}, {"kind": "dwell", "duration_s": 0.1}],
    }
)
BACK = MOVE.model_copy(update={"segments": (MOVE.segments[1],)})
START_RAD = 1.0
END_RAD = 2 * math.pi  # 10 mm
CHANNELS = (f"odd_{k}" for k in itertools.count())


class SlaveRig(Rig):
    """The rig of a real bench whose bus has the slave at its other end, polled by the loop."""

    def __init__(self, bench: Bench, manners: Manners, folder: Path) -> None:
        self._config = BusConfig("virtual", next(CHANNELS))
        node_id = bench.drive.node_id
        self.slave = Slave(open_bus(self._config), manners, node_id=node_id)
        eds = folder / "slave.eds"
        eds.write_text(self.slave.eds)
        super().__init__(bench.model_copy(update={"drive": bench.drive.model_copy(update={"eds": str(eds)})}))

    def _connect(self, bus: InProcessBus | None, simulate: Callable[[CanPort], Any]) -> CanPort:
        port = PythonCanPort(open_bus(self._config))
        self.ports += [port, PythonCanPort(self.slave.network.bus)]
        return PumpedPort(port, self.slave)


class Odd:
    """Runs of a bench with one rigid mass, one encoder and the slave."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.rig = folder, None

    def bench(self, **drive: Any) -> Bench:
        data = bench_with().model_dump()
        data["axis"] = {"model": "rigid", "lead_m": 0.01, "mass_kg": 719.0, "coulomb_torque_n_m": 0.0,
                        "viscous_torque_n_m_s_rad": 0.0}  # fmt: skip
        data["encoders"] = {"motor": {"counts_per_rev": COUNTS_PER_REV}, "table": None}
        data["control"]["position_feedback"] = "motor"
        data["drive"] |= {"interface": "virtual", "encoder": {"interface": "none"}} | drive
        return Bench.model_validate(data)

    def run(self, manners: Manners, *, reset_fault: bool = False, **drive: Any) -> RunResult:
        bench = self.bench(**drive)
        if self.rig is not None:
            self.rig.close()
        self.rig = SlaveRig(bench, manners, self.folder)
        return run_profile(bench, MOVE, self.folder, "run", virtual=True, rig=self.rig, reset_fault=reset_fault)


@pytest.fixture
def odd(tmp_path: Path) -> Iterator[Odd]:
    odd = Odd(tmp_path)
    yield odd
    if odd.rig is not None:
        odd.rig.close()


def test_an_ideal_drive_moves_to_the_end(odd: Odd) -> None:
    ran = odd.run(Manners())
    assert ran.complete, ran.outcome
    assert read_recording(ran.recording)["motor_position_rad"][-1] == pytest.approx(END_RAD, abs=0.01)
    assert odd.rig.slave.seen == [DISABLED, READY, SWITCHED_ON, ENABLED, READY]


OPTIONAL = (0x1006, 0x1019, 0x1029, 0x6007, 0x605A, 0x605E, 0x6072, 0x6074, 0x6085, 0x60C2, 0x6502)
COMPLETE = {
    "mode display late": Manners(mode_s=0.4),
    "mode display only when enabled": Manners(shows_mode_enabled=True),
    "mode display only when enabled, left over": Manners(shows_mode_enabled=True, values={(0x60FF, 0): 9000}),
    "mode 0 refused": Manners(refuses_mode_0=True),
    "transitions of 200 ms": Manners(transition_s=0.2),
    "transitions of 300 ms": Manners(transition_s=0.3),
    "transitions of 600 ms": Manners(transition_s=0.6),
    "transitions and mode display slow": Manners(transition_s=0.2, shows_mode_enabled=True, mode_s=0.3),
    "main voltage after 500 ms": Manners(voltage_s=0.5),
    "halt left over in the controlword": Manners(values={(0x6040, 0): 0x0100}),
    "enabled already": Manners(begins=ENABLED),
    "enabled already, slow to switch off": Manners(begins=ENABLED, transition_s=0.15),
    "still initialising": Manners(begins=INITIALISING, initialises_s=0.6),
    "reserved bits of the statusword": Manners(status_bits=0xC100),
    "boots late": Manners(boots_s=2.2),
    "answers SDO after 150 ms": Manners(answers_sdo_s=0.15),
    "operational after 80 ms": Manners(operational_s=0.08),
    "reactions refused": Manners(refuses={(0x605A, 0): GENERAL, (0x605E, 0): READ_ONLY, (0x1029, 1): GENERAL}),
    "abort connection fixed at quick stop": Manners(refuses={(0x6007, 0): READ_ONLY}, values={(0x6007, 0): 3}),
    "heartbeat time read-only": Manners(refuses={(0x1017, 0): READ_ONLY}, values={(0x1017, 0): 100}),
    "no heartbeat": Manners(refuses={(0x1017, 0): READ_ONLY}),
    "heartbeat of the master not awaited": Manners(refuses={(0x1016, 1): GENERAL}),
    "no deadline of the RPDO": Manners(refuses={(0x1400, 5): GENERAL}),
    "interpolation time refused": Manners(refuses={(0x60C2, 1): BAD_VALUE, (0x60C2, 2): BAD_VALUE}),
    "cycle period read-only": Manners(refuses={(0x1006, 0): READ_ONLY}),
    "at rest beside its zero": Manners(stands_at_rad=-3.0),
    "SYNC counter": Manners(values={(0x1019, 0): 10, (0x1006, 0): 1000}),
    "SYNC of its own": Manners(values={(0x1005, 0): 0x40000080}),
    "demand cannot be mapped": Manners(refuses={(0x1A01, 1): 0x06040041}),
    "second PDOs cannot be disabled": Manners(refuses={(0x1401, 1): READ_ONLY, (0x1801, 1): READ_ONLY}),
    "mapping fixed, as wanted": Manners(fixed_mapping=True),
    "only what is mandatory": Manners(lacks=OPTIONAL),
}


@pytest.mark.parametrize("name", COMPLETE)
def test_an_odd_drive_is_run_to_its_end(odd: Odd, name: str) -> None:
    ran = odd.run(COMPLETE[name])
    assert ran.complete, ran.outcome
    assert read_recording(ran.recording)["motor_position_rad"][-1] == pytest.approx(END_RAD, abs=0.01)
    assert odd.rig.slave.state in (DISABLED, READY)


@pytest.mark.parametrize("name", ["mode display only when enabled", "transitions of 200 ms", "no heartbeat"])
def test_the_position_is_held_until_the_drive_shows_its_mode(odd: Odd, name: str) -> None:
    """In CSP a target of zero before would be a jump."""
    ran = odd.run(COMPLETE[name], mode="csp")
    assert ran.complete, ran.outcome
    assert odd.rig.slave.position_rad == pytest.approx(END_RAD, abs=0.01)
    assert odd.rig.slave.largest_step_rad < 0.05 < START_RAD


REFUSED = {
    "mode display of another mode": (Manners(keeps_mode=1), r"0x6060 and 0x6061: the drive does not take the mode; "
        r"given: 10 \(CYCLIC_SYNC_TORQUE\); allowed: the drive holds 1 and displays 1, waited 1 s"),
    "mode display never": (Manners(mode_s=math.inf), r"did not enable within 2 s: it is OPERATION_ENABLED, statusword "
        r"0x\w{4}: the mode display \(object 0x6061\) reads 0 \(NONE\), commanded is 10 \(CYCLIC_SYNC_TORQUE\)"),
    "mode refused": (Manners(refuses={(0x6060, 0): BAD_VALUE}), r"0x6060:00 .*the device refuses.*0x06090030.*10"),
    "mode not offered": (Manners(values={(0x6502, 0): 0x180}), r"does not have this mode.*CYCLIC_SYNC_TORQUE"),
    "never boots": (Manners(boots_s=1e9), r"no SDO answer; given: waited 5\.\d s.*powered"),
    "no main voltage": (Manners(voltage_s=1e9), r"READY_TO_SWITCH_ON, statusword 0x0221: "
        r"no main voltage \(statusword bit 4 is 0\)"),
    "remote": (Manners(remote=False), r"SWITCH_ON_DISABLED.*remote \(statusword bit 9\) is 0: the drive does not obey"),
    "RPDO without effect": (Manners(ignores_rpdo=True), r"holds controlword 0x0000, sent is 0x0006: its RPDO does not"),
    "quick stop by an input": (Manners(quick_stop_input=True), r"quick stop \(statusword bit 5 is 0\), by an input"),
    "halted by another": (Manners(second_master_halts=True), r"halt \(controlword bit 8\) is set in the drive"),
    "warning and limit": (Manners(voltage_s=1e9, status_bits=0x0880),
        r"warning is active \(statusword bit 7\); an internal limit is active \(statusword bit 11\)"),
    "initialises for ever": (Manners(begins=INITIALISING), r"NOT_READY_TO_SWITCH_ON.*still initialises"),
    "stays on": (Manners(begins=ENABLED, transition_s=1e9), r"power stage is still on.*OPERATION_ENABLED.*waited 1 s"),
    "fault of before": (Manners(begins=FAULT, error_code=0x7305),
        r"tripped: FAULT; given: error code \(object 0x603F\) 0x7305 incremental sensor 1 fault"),
    "never operational": (Manners(operational_s=1e9), r"it has answered no SYNC since its set-up"),
    "quick stop coasts": (Manners(refuses={(0x605A, 0): GENERAL}, values={(0x605A, 0): 0}),
        r"would not brake at a quick stop.*0x605A|0x605A.*would not brake at a quick stop"),
    "lost master ignored": (Manners(refuses={(0x6007, 0): GENERAL}), r"0x6007.*nothing when its master is lost"),
    "no watchdog": (Manners(refuses={(0x1016, 1): GENERAL, (0x1400, 5): GENERAL}),
        r"would not notice that its commands stop.*0x1016:01 .*instead of 65596.*0x1400:05"),
    "mapping refused": (Manners(refuses={(0x1A00, 2): NOT_NOW}), r"0x1A00:02.*the device refuses.*0x08000022"),
    "mapping fixed, another": (Manners(fixed_mapping=True, values={(0x1A00, 2): 0x606C0020}),
        r"0x1A00:0\d.*the device refuses"),
    "SYNC counter fixed": (Manners(values={(0x1019, 0): 10}, refuses={(0x1019, 0): READ_ONLY}),
        r"0x1019:00.*the device refuses.*0x06010002"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_drive_that_cannot_be_run_is_refused_with_the_cause_in_words(odd: Odd, name: str) -> None:
    manners, message = REFUSED[name]
    with pytest.raises(HilError, match=message):
        odd.run(manners)
    assert odd.rig.slave.position_rad == START_RAD


def test_a_period_is_needed_where_the_drive_interpolates(odd: Odd) -> None:
    with pytest.raises(HilError, match=r"0x60C2:0\d.*the device refuses.*0x06090030"):
        odd.run(COMPLETE["interpolation time refused"], mode="csp")
    held = {(0x60C2, 1): 1, (0x60C2, 2): -3}
    assert odd.run(replace(COMPLETE["interpolation time refused"], values=held), mode="csp").complete


@pytest.mark.parametrize("name", ["reactions refused", "heartbeat time read-only", "interpolation time refused"])
def test_settings_that_the_drive_keeps_are_told(odd: Odd, name: str) -> None:
    ran = odd.run(COMPLETE[name])
    notes = read_recording(ran.recording).metadata["notes"]
    told = [note for note in ran.notes if "keeps its own settings" in note]
    assert told
    assert told[0] in notes
    words = {
        "reactions refused": r"0x605E:00 \(.*\) 2 instead|0x1029:01 \(.*\) 0 instead of 1",
        "heartbeat time read-only": r"0x1017:00 \(.*\) 100 instead of 20",
        "interpolation time refused": r"0x60C2 \(interpolation time\) 0.01 s instead of 0.001 s",
    }
    assert re.search(words[name], told[0]), told


@pytest.mark.parametrize("reset_s", [0.0, 0.3])
def test_a_fault_is_reset_in_the_time_it_takes(odd: Odd, reset_s: float) -> None:
    assert odd.run(Manners(begins=FAULT, error_code=0x3220, reset_s=reset_s), reset_fault=True).complete
    assert odd.rig.slave.seen[:3] == [FAULT, DISABLED, READY]


def test_a_fault_whose_cause_lasts_is_named_by_its_code(odd: Odd) -> None:
    message = r"remains after its reset.*FAULT, error code \(object 0x603F\) 0x3220 DC link under-voltage, waited 3 s"
    with pytest.raises(HilError, match=message):
        odd.run(Manners(begins=FAULT, error_code=0x3220, reset_s=math.inf), reset_fault=True)


@pytest.mark.parametrize("node_id", [1 + 1, 17, 127])
def test_another_node_id_and_the_defaults_of_its_eds(odd: Odd, node_id: int) -> None:
    """The EDS of durand has COB-IDs as "$NodeID+0x200"."""
    assert odd.run(Manners(), node_id=node_id).complete


def test_sync_has_no_counter_and_one_source(odd: Odd) -> None:
    values = {(0x1005, 0): 0x40000080, (0x1006, 0): 4000, (0x1019, 0): 10}
    assert odd.run(Manners(values=values)).complete
    assert [odd.rig.slave.od.read(index, 0) for index in (0x1005, 0x1006, 0x1019)] == [0x80, 1000, 0]


@pytest.mark.parametrize(("name", "after_s"), [("heartbeat time read-only", 0.3), ("no heartbeat", math.inf)])
def test_a_heartbeat_is_awaited_as_the_drive_sends_it(odd: Odd, name: str, after_s: float) -> None:
    """Not as it was asked for, which the drive refused."""
    assert odd.run(COMPLETE[name]).complete
    drive = odd.rig.drive
    assert 3 * drive.settings.heartbeat_s == pytest.approx(after_s)
    heard_s = drive._heartbeat_deadline_s - after_s if after_s < math.inf else 0.0
    assert bool(drive.read(heard_s + 0.4).condition & Condition.HEARTBEAT_LOST) is (after_s < math.inf)


def test_a_drive_does_not_trip_when_a_run_has_ended(odd: Odd) -> None:
    """It must not miss the heartbeats and set-points of a master that has left: the next run would find a fault."""
    assert odd.run(Manners(trips_when_off=True)).complete
    slave = odd.rig.slave
    for k in range(1000):
        slave.poll(10.0 + 0.001 * k)
    assert slave.state == READY
    assert slave.od.read(0x1016, 1) == 0


def test_a_drive_that_is_set_up_again_does_not_miss_its_master_meanwhile(odd: Odd) -> None:
    assert odd.run(Manners(trips_when_off=True, answers_sdo_s=0.03)).complete
    assert run_profile(odd.rig.bench, BACK, odd.folder, "again", virtual=True, rig=odd.rig).complete


@pytest.mark.long  # a PC that stalls for 20 ms stops the axis, as it should
def test_hil_run_by_the_wall_clock(tmp_path: Path) -> None:
    """The command against a drive that boots, answers and switches in its own time, in another thread."""
    odd = Odd(tmp_path)
    bench = odd.bench(
        channel="odd_wall_clock", eds=str(tmp_path / "slave.eds"), command_deadline_s=5.0, overrun_s=5.0,
        heartbeat_s=5.0, missed_answers=100, following_error_m=10.0, travel_m=(-10.0, 10.0),
        supervision={"velocity_m_s": 100.0, "torque": 100.0, "torque_difference": 100.0},
    )  # fmt: skip
    slave = Slave(
        open_bus(BusConfig("virtual", "odd_wall_clock")),
        Manners(boots_s=0.2, mode_s=0.1, transition_s=0.05, trips_when_off=True),
    )
    Path(bench.drive.eds).write_text(slave.eds)
    data = bench.model_dump(mode="json", exclude_none=True, exclude={"simulation"})
    (tmp_path / "bench.yaml").write_text(yaml.safe_dump(data | {"encoders": data["encoders"] | {"table": None}}))
    (tmp_path / "move.yaml").write_text(yaml.safe_dump(MOVE.model_dump(mode="json")))
    stop = threading.Event()

    def serve() -> None:
        while not stop.wait(0.0002):
            slave.poll(time.monotonic())

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        ran = hil(tmp_path, "run", "move.yaml", "--bench", "bench.yaml", "--force", "--out", "out")
    finally:
        stop.set()
        thread.join()
        slave.network.bus.shutdown()
    assert ran.returncode == 0, ran.stderr
    assert slave.seen[:4] == [DISABLED, READY, SWITCHED_ON, ENABLED]
    assert FAULT not in slave.seen
