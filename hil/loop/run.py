"""Run a profile on a bench: open, set up, prepare for real time, arm, move, record."""

import contextlib
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveSection
from hil.errors import FieldError
from hil.loop import certificate
from hil.loop.bounds import make_cycle
from hil.loop.clock import Clock, VirtualClock
from hil.loop.devices import Devices, Rig, driver_errors, open_devices
from hil.loop.disturbances import Disturbances
from hil.loop.notify import Notifier, NotifyingClock
from hil.loop.outcome import Outcome
from hil.loop.realtime import Jitter, NotArmed, check_punctual, measure_jitter, now_text, real_time, report
from hil.loop.session import Session
from hil.loop.simulated_bench import make_plant, simulated_copy
from hil.loop.supervision import Ending
from hil.loop.virtual import compiled_ticks
from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan
from hil.recording.writer import Recorder, run_metadata

REHEARSED_TICKS = 50
VIRTUAL_START = "virtual time"  # where a recording names the start of a run


@dataclass(frozen=True)
class RunResult:
    """Result of a run. recording: the Parquet file; jitter: of its ticks; doubts: refusals that were overridden."""

    outcome: Outcome
    recording: Path | None
    jitter: Jitter
    notes: tuple[str, ...]
    doubts: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """True if the profile was run to its end."""
        return self.outcome.ending is Ending.COMPLETE


def run_profile(
    bench: Bench,
    profile: Profile,
    folder: str | Path,
    name: str,
    *,
    virtual: bool = False,
    force: bool = False,
    reset_fault: bool = False,
    seed: int | None = None,
    planned: Callable[[Trajectory], None] | None = None,
    rig: Devices | None = None,
) -> RunResult:
    """Run a profile on a bench and record it as `folder`/`name`.parquet.

    virtual: as fast as the machine allows, by a clock that is always on time; simulated benches only. force: arm
    although jitter or bus load exceed the budget, or the drive did not report a missing heartbeat. reset_fault: first
    reset a fault that the drive has latched. seed: of the simulated sensors, instead of the bench's. planned: told the
    trajectory before the axis moves. rig: an opened one, left open.

    Raises InputError for what cannot be run, NotArmed for what `force` overrides, HilError for devices that fail,
    StillPowered if the drive does not confirm at the end that its power is off.
    """
    section = bench.drive or DriveSection()
    if virtual and bench.drive is not None and bench.simulation is None:  # before any device is opened
        raise FieldError(("drive",), "given a real bench in virtual time, allowed the wall clock; leave --virtual")
    if seed is None and bench.simulation is not None:
        seed = bench.simulation.seed
    with contextlib.ExitStack() as stack:
        if rig is None:
            rig = stack.enter_context(open_devices(bench, seed))
        if reset_fault:
            with driver_errors():
                rig.drive.clear_fault()
        rig.set_up()
        sample = rig.drive.read(0.0)
        encoder = rig.encoder.read(0.0) if rig.encoder is not None else None
        gains = bench.gains
        start_m = (
            encoder.position_m
            if encoder is not None and gains.position_from_table
            else gains.ratio_m_rad * sample.motor_position_rad
        )
        trajectory = plan(profile, gains.period_s, start_m)
        _check_set_points(trajectory, section)
        if planned is not None:
            planned(trajectory)
        rehearse(bench, trajectory, profile)
        cycle = make_cycle(rig, sample.motor_position_rad, profile.motion_limits)
        force = force or section.over_budget == "arm"
        doubts = [_refused(force, lambda: _check_bus_load(rig, section)), _refused(force, lambda: _check_missed(rig))]
        conditions: dict[str, Any] | None = None
        notifier = Notifier()
        stack.callback(notifier.close)
        clock: Clock = VirtualClock()
        if not virtual:
            grants = stack.enter_context(real_time())
            jitter = measure_jitter(gains.period_s)
            doubts.append(_refused(force, lambda: check_punctual(jitter, section.jitter_p99 * gains.period_s)))
            conditions = report(grants, jitter)
            clock = NotifyingClock(gains.period_s, notifier)
        metadata = run_metadata(
            bench=bench.model_dump(mode="json"),
            profile=profile.model_dump(mode="json"),
            seed=seed,
            commands=sys.argv,
            start_time=VIRTUAL_START if virtual else now_text(),
        )
        metadata |= {
            certificate.KEY: (certified := certificate.before_run(gains.period_s, rig.bus_load(), section, conditions)),
            "overridden": [doubt for doubt in doubts if doubt],
            "segments": [run._asdict() for run in trajectory.runs],
            "notes": [*trajectory.notes, *rig.notes, *rig.drive.notes],
        }
        recorder = Recorder(folder, name, cycle.channels, gains.period_s, metadata, lossless=virtual)
        ended = "failed"
        ticks = compiled_ticks(rig, recorder) if virtual else None
        session = Session(rig, cycle, trajectory, profile.motion_limits, clock, recorder, ticks)
        before = Disturbances.now()
        try:
            with _interruptible(session):
                outcome = session.run()
            ended = f"{outcome.ending}: {outcome.reason}"
        except BaseException as error:
            ended = f"{type(error).__name__}: {error}"
            raise
        finally:
            rig.release()
            disturbances = None if virtual else Disturbances.now().since(before)
            notifier.stopping(ended)
            run = certificate.of_run(session.late.values, session.skipped, gains.period_s, disturbances)
            recording = recorder.close(ended, {certificate.KEY: certified | run})
        notes = (*trajectory.notes, *rig.notes, *rig.drive.notes, *rig.take_notes())
    if recorder.path.stem != name:
        notes += (
            f"{name}.parquet or {name}.arrows of an earlier run is in {folder} and stays; this run is "
            f"{recorder.path.name}",
        )
    if recorder.rows_lost:
        notes += (
            f"{recorder.rows_lost} rows are missing in {len(recorder.gaps)} gaps: the disk took none for longer than "
            "the memory lasts; use another disk",
        )
    return RunResult(
        outcome,
        recording,
        Jitter.of(outcome.lateness_s, gains.period_s),
        notes,
        tuple(doubt for doubt in doubts if doubt),
    )


def _check_set_points(trajectory: Trajectory, section: DriveSection) -> None:
    """Raise FieldError for set-points outside the travel or beyond the limits of the bench."""
    if section.travel_m is not None:
        low, high = float(trajectory.position_m.min()), float(trajectory.position_m.max())
        if low < section.travel_m[0] or high > section.travel_m[1]:
            raise FieldError(
                ("segments",),
                f"given set-points from {low:.6g} to {high:.6g} m, allowed "
                f"{section.travel_m[0]:g} to {section.travel_m[1]:g} m (drive.travel_m of the bench); "
                "move less far",
            )
    for name, allowed in section.limits.model_dump().items() if section.limits else ():
        peak = float(np.max(np.abs(getattr(trajectory, name))))
        if peak > allowed * (1.0 + 1e-9):
            raise FieldError(
                ("limits", name),
                f"given set-points up to {peak:.6g}, allowed {allowed:g} (drive.limits.{name} of the bench); lower it",
            )


def _check_bus_load(rig: Devices, section: DriveSection) -> None:
    load = rig.bus_load()
    if load > section.bus_load:
        raise NotArmed(
            f"drive.bus_load: SYNC, RPDO, TPDO and encoder take {100 * load:.0f} % of the bus at "
            f"{section.bitrate} bit/s, allowed {100 * section.bus_load:.0f} %",
            "raise the bit rate or the period, or say drive.watch_setpoint: false",
        )


def _check_missed(rig: Devices) -> None:
    if not rig.misses_this_pc():
        raise NotArmed(
            "the drive does not report that the heartbeat of this PC ended (EMCY 0x8130): it does not watch it",
            "check that drive.master_node_id is no other node's and that frames of this PC reach the drive (object "
            "0x1016), and that it stops by itself when this PC fails (SAFETY.md)",
        )


def _refused(force: bool, check: Callable[[], None]) -> str:
    """Return the text of a refusal that is overridden, "" if there is none."""
    try:
        check()
    except NotArmed as error:
        if not force:
            raise
        return f"{error.what}; the drive was armed all the same, as --force or drive.over_budget asks"
    return ""


class _AlarmClock(VirtualClock):
    """Virtual clock that calls `alarm` at tick REHEARSED_TICKS."""

    alarm: Callable[[], None]

    def wait(self, tick: int) -> float:
        if tick == REHEARSED_TICKS:
            self.alarm()
        return 0.0


class _NoRows:
    """Recorder of a rehearsal."""

    def record(self, row: Sequence[float]) -> None:
        """Discard the row."""


def rehearse(bench: Bench, trajectory: Trajectory, profile: Profile) -> None:
    """Arm, begin and stop the run in virtual time on a simulated copy of the bench, so that all code of the loop is
    compiled and loaded before the real run."""
    copy = simulated_copy(bench)
    plant = make_plant(copy)
    plant.reset(float(trajectory.position_m[0]))
    with Rig(copy, plant=plant) as rig:
        rig.set_up()
        clock = _AlarmClock()
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, profile.motion_limits)
        session = Session(rig, cycle, trajectory, profile.motion_limits, clock, _NoRows())
        clock.alarm = session.ask_stop
        session.run()


@contextlib.contextmanager
def _interruptible(session: Session) -> Iterator[None]:
    """ctrl-C, a request to terminate and the end of the terminal stop the axis instead of the program."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        if (
            number == signal.SIGHUP
        ):  # sent by the kernel and by a shell: one request, also while the recording is closed
            signal.signal(signal.SIGHUP, signal.SIG_IGN)
        session.ask_stop()

    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # nohup: the run goes on without its terminal
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            if signal.getsignal(number) is stop:
                signal.signal(number, handler)
