"""Benches that cannot be run over CANopen, each at its field; what the devices of a bench are given."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from bench_runs import bench_with

from drivers.canopen_encoder import CanopenEncoder
from drivers.serial_encoder import SerialEncoder
from hil.bench.bench_file import Bench
from hil.errors import FieldError
from hil.loop.devices import Rig, check_runnable, open_devices

REAL = {"interface": "socketcan", "channel": "can0"}


def bench(changes: dict[str, Any], *, simulated: bool = True) -> Bench:
    data = bench_with().model_dump()
    for path, value in changes.items():
        *folders, name = path.split(".")
        section = data
        for folder in folders:
            section = section[folder]
        section[name] = value
    if not simulated:
        data["simulation"] = None
    return Bench.model_validate(data)


@pytest.mark.parametrize(("changes", "simulated", "field", "message"), [
    ({"control.setpoint_delay_s": 0.001}, True, "control.setpoint_delay_s", "given 0.001, allowed 0 for a run"),
    ({"control.velocity_setpoint": "backward_difference"}, True, "control.velocity_setpoint",
     "allowed for recordings alone"),
    ({"drive": None}, False, "drive", "given nothing, allowed the section `drive`"),
    ({"drive.interface": "inprocess"}, False, "drive.interface", "given inprocess without a section `simulation`"),
    ({"drive.heartbeat_s": 0.0015, "control.velocity_period_s": 0.002}, True, "drive.heartbeat_s", "given 0.0015"),
    ({"encoders.motor.direction": -1}, True, "encoders.motor.direction", "given -1, allowed 1"),
    ({"drive.mode": "csp", "control.position_feedback": "table"}, True, "drive.mode", "given csp with position"),
    ({"drive.encoder.interface": "none"}, True, "drive.encoder.interface", "given none with a table encoder"),
    ({"drive.encoder.interface": "serial", **{f"drive.{key}": value for key, value in REAL.items()}}, False,
     "drive.encoder.device", "given nothing, allowed the serial line"),
])  # fmt: skip
def test_a_bench_that_cannot_be_run_is_refused_at_its_field(
    changes: dict[str, Any], simulated: bool, field: str, message: str
) -> None:
    with pytest.raises(FieldError) as refused:
        check_runnable(bench(changes, simulated=simulated))
    assert ".".join(map(str, refused.value.field)) == field
    assert message in str(refused.value)


@pytest.mark.parametrize(("changes", "simulated"), [
    ({}, True), ({"drive": None}, True), ({"drive.heartbeat_s": 0.001}, True),
    ({"drive.mode": "csp", "control.position_feedback": "motor"}, True),
    ({"drive.mode": "csv", "control.position_feedback": "table"}, True),
    ({"drive.encoder.interface": "none", "encoders.table": None, "control.position_feedback": "motor"}, True),
    ({"drive.encoder.interface": "serial"}, True),
    *(({"drive.interface": interface}, False) for interface in ("socketcan", "virtual", "udp_multicast")),
    ({"drive.encoder.interface": "serial", "drive.encoder.device": "/dev/tty", "drive.interface": "virtual"}, False),
])  # fmt: skip
def test_a_bench_that_can_be_run_is_not(changes: dict[str, Any], simulated: bool) -> None:
    check_runnable(bench(changes, simulated=simulated))


@pytest.mark.parametrize(("direction", "turned"), [(1, False), (-1, True)])
@pytest.mark.parametrize("interface", ["canopen", "serial"])
def test_the_encoder_is_opened_as_the_bench_describes_it(interface: str, direction: int, turned: bool) -> None:
    described = bench({"drive.encoder.interface": interface, "encoders.table.direction": direction,
                       "drive.heartbeat_s": 0.03, "drive.missed_answers": 2})  # fmt: skip
    with Rig(described) as rig:
        assert isinstance(rig.encoder, CanopenEncoder if interface == "canopen" else SerialEncoder)
        assert rig.encoder.settings.reversed is turned
        assert rig.encoder.settings.step_m == described.encoders.table.resolution_m
        if interface == "canopen":
            assert (rig.encoder.settings.heartbeat_s, rig.encoder.settings.missed_answers_allowed) == (0.03, 2)
        assert (rig.drive.settings.heartbeat_s, rig.drive.settings.missed_answers_allowed) == (0.03, 2)
        assert rig.master.heartbeat_s == 0.03


def test_a_bench_without_table_encoder_opens_none() -> None:
    with Rig(bench({"encoders.table": None, "control.position_feedback": "motor"})) as rig:
        assert rig.encoder is None
        rig.set_up()


def test_a_stop_may_be_as_much_faster_as_the_velocity_loop_yields_to_the_load() -> None:
    with Rig(bench_with()) as rig:
        assert rig.drive.stop_margin == 0.0
        rig.set_up()
        assert rig.acting_torque == min(rig.bench.gains.torque_limit_n_m, rig.drive.info.max_torque_n_m)
        assert rig.load_torque == 0.5 * rig.acting_torque
        expected = rig.load_torque / rig.bench.gains.velocity_gain_n_m_s_rad
        assert rig.drive.stop_margin == pytest.approx(expected)
    with Rig(bench({"drive.supervision.load_torque": 0.25})) as rig:
        assert rig.load_torque == 0.25


def test_without_a_velocity_loop_any_speed_may_be_reached() -> None:
    described = bench_with()
    with Rig(described) as rig:
        rig.bench = SimpleNamespace(gains=described.gains._replace(velocity_gain_n_m_s_rad=0.0))
        rig.set_up()
        assert rig.drive.stop_margin == math.inf


def test_the_bus_load_is_that_of_all_frames_of_a_cycle() -> None:
    """Bits with the longest stuffing: SYNC 55, RPDO of 4 bytes 95, TPDOs of 8 and 2 bytes 135 and 75, encoder 95."""
    with Rig(bench({"drive.bitrate": 500_000})) as rig:
        rig.set_up()
        assert rig.bus_load() == pytest.approx((55 + 95 + 135 + 75 + 95) / 500)
    with Rig(bench({"drive.watch_setpoint": False, "drive.mode": "csv", "encoders.table": None,
                    "control.position_feedback": "motor"})) as rig:  # fmt: skip
        rig.set_up()
        assert rig.bus_load() == pytest.approx((55 + 115 + 135) / 1000)


def test_an_unknown_protocol_is_refused_with_those_known() -> None:
    with pytest.raises(FieldError, match="given ethercat, allowed canopen"):
        open_devices(bench({"drive.protocol": "ethercat"}))
