"""Tests of each module of the live axis: drivers, loop and supervision, set-up included."""

from __future__ import annotations

from typing import NamedTuple


class Suite(NamedTuple):
    """Tests of a module, those that end soonest first. compiled: with numba; else the module runs as plain Python.
    test_s: processor time that a test may take; it includes compiling where the module is part of a kernel."""

    tests: tuple[str, ...]
    compiled: bool = True
    test_s: int = 20  # the slowest takes 3 s


def _drivers(*names: str) -> tuple[str, ...]:
    return tuple(f"tests/drivers/test_{name}.py" for name in names)


def _loop(*names: str) -> tuple[str, ...]:
    return tuple(f"tests/hil/loop/test_{name}.py" for name in names)


_EDS_OF_A_BENCH = ("tests/hil/commands/test_eds_of_a_bench.py",)
_BUS_LOG = ("tests/hil/exchange/test_bus_log.py",)
_DOCTOR = ("tests/hil/commands/test_doctor.py",)
_EDS = _drivers("eds_types", "eds", "eds_dialects") + _EDS_OF_A_BENCH
_SERIAL = _drivers("serial")
_FAULTS = _drivers("faults_devices", "faults_watchdogs", "faults_frames")
_DRIVE = _drivers("cia402", "faults_devices", "faults_watchdogs", "acting_setpoint", "faults_frames", "stop_answered",
                  "canopen_drive")  # fmt: skip
_SET_UP = _drivers("drive_reactions", "canopen_setup", "heartbeats", "eds_types") + _loop("odd_drives")
_SESSION = _loop("session", "session_times", "session_arming", "session_power_off", "supervision", "late_ticks",
                 "interrupted")  # fmt: skip

MODULES = {
    "drivers/acting_setpoint.py": Suite(_drivers("acting_setpoint")),
    "drivers/bus.py": Suite(_drivers("bus", "foreign_frames")),
    "drivers/bus_logger.py": Suite(_BUS_LOG),
    "drivers/canopen_drive.py": Suite(_DRIVE),
    "drivers/canopen_encoder.py": Suite(_drivers("encoders", "faults_devices", "faults_frames")),
    "drivers/canopen_master.py": Suite(_drivers("heartbeats", "faults_watchdogs")),
    "drivers/canopen_node.py": Suite(_drivers("heartbeats", "faults_watchdogs", "faults_frames", "encoders")),
    "drivers/cia402.py": Suite(_drivers("cia402")),
    "drivers/cia402_arming.py": Suite(_drivers("arming", "stop_answered")),
    "drivers/cia402_setup.py": Suite(_SET_UP + _drivers("canopen_drive", "eds")),
    "drivers/cia402_watchdogs.py": Suite(_drivers("drive_reactions")),
    "drivers/counting.py": Suite(_drivers("encoders", "serial")),
    "drivers/eds_file.py": Suite(_EDS),
    "drivers/eds_plain.py": Suite(_EDS),
    "drivers/eds_text.py": Suite(_EDS),
    "drivers/emcy.py": Suite(_drivers("emcy")),
    "drivers/fault_reset.py": Suite(_drivers("drive_reactions", "heartbeats")),
    "drivers/heartbeat_trial.py": Suite(_drivers("heartbeats")),
    "drivers/homing.py": Suite(_drivers("stop_answered", "canopen_drive")),
    "drivers/inprocess.py": Suite(_drivers("bus", "foreign_frames", "canopen_client", "heartbeats")),
    "drivers/loopback_bus.py": Suite(_drivers("bus", "foreign_frames", "processes")),
    "drivers/modelled_bus.py": Suite(_drivers("bus") + _FAULTS),
    "drivers/object_index.py": Suite(_drivers("object_index")),
    "drivers/object_types.py": Suite(_drivers("eds_types", "eds")),
    "drivers/pdo.py": Suite(_drivers("pdo", "canopen_setup", "canopen_drive")),
    "drivers/port.py": Suite(_drivers("port_members", "cia402", "canopen_setup", "canopen_drive") + _FAULTS),
    "drivers/sdo_client.py": Suite(_drivers("sdo_client", "canopen_setup", "eds_types")),
    "drivers/sdo_setup.py": Suite(_SET_UP),
    "drivers/serial_encoder.py": Suite(_SERIAL),
    "drivers/serial_frames.py": Suite(_SERIAL),
    "drivers/stop_watch.py": Suite(_drivers("stop_watch", "stop_answered")),
    "hil/loop/bounds.py": Suite(_loop("bounds")),
    "hil/loop/can_interfaces.py": Suite(_DOCTOR),
    "hil/loop/bus_log.py": Suite(_BUS_LOG),
    "hil/loop/certificate.py": Suite(_loop("certificate")),
    "hil/loop/checks.py": Suite(_loop("checks", "encoder_checks"), compiled=False),
    "hil/loop/clock.py": Suite(_loop("clock", "late_ticks")),
    "hil/loop/columns.py": Suite(_loop("session", "virtual"), test_s=240),
    "hil/loop/cycle.py": Suite(_loop("session_times", "virtual", "session"), test_s=240),
    "hil/loop/devices.py": Suite(_loop("devices", "run_bus", "session_arming")),
    "hil/loop/disturbances.py": Suite(_loop("realtime", "latency")),
    "hil/loop/eds_files.py": Suite(_EDS_OF_A_BENCH),
    "hil/loop/latency.py": Suite(_loop("latency") + _DOCTOR),
    "hil/loop/limits.py": Suite(_loop("limits", "checks", "encoder_checks", "sign_check"), test_s=60),
    "hil/loop/machine.py": Suite(_DOCTOR),
    "hil/loop/notify.py": Suite(_loop("notify")),
    "hil/loop/outcome.py": Suite(_loop("session_power_off", "session_times")),
    "hil/loop/realtime.py": Suite(_loop("realtime") + _DOCTOR),
    "hil/loop/run.py": Suite(_loop("run_checks", "session_arming", "certificate", "run_bus", "interrupted")),
    "hil/loop/session.py": Suite(_SESSION),
    "hil/loop/sign_check.py": Suite(_loop("sign_check"), test_s=60),
    "hil/loop/simulated_bench.py": Suite(_loop("simulated_bench", "session_times")),
    "hil/loop/stall.py": Suite(_loop("stall")),
    "hil/loop/stopping.py": Suite(_loop("bounds")),
    "hil/loop/suitability.py": Suite(_loop("latency")),
    "hil/loop/supervision.py": Suite(_loop("supervision_rules", "stall")),
    "hil/loop/virtual.py": Suite(_loop("virtual"), test_s=240),
}
