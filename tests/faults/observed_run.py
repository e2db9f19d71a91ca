"""A run in virtual time whose commands, phases and true motion are observed at every tick."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from drivers.cia402 import ENABLE_OPERATION, POWERED, DriveState
from drivers.modelled_bus import ModelledBus
from drivers.port import DriveGoal
from hil.bench.bench_file import Bench
from hil.errors import StillPowered
from hil.loop.bounds import make_cycle
from hil.loop.clock import VirtualClock
from hil.loop.devices import Rig
from hil.loop.outcome import Outcome
from hil.loop.session import LoopPhase, Session
from hil.loop.simulated_bench import load_simulated
from hil.motion.profile import Profile
from hil.motion.trajectory import plan

PERIOD_S = 1e-3
SPEED_M_S, ACCELERATION_M_S2, JERK_M_S3 = 0.1, 2.2, 100.0
END_M = 0.02  # of the move
MOVE = Profile.model_validate(
    {
        "schema_version": 1,
        "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": ACCELERATION_M_S2, "jerk_m_s3": JERK_M_S3},
        "segments": [
            {"kind": "dwell", "duration_s": 0.02},
            {"kind": "sine_squared", "to_m": END_M, "feed_m_s": SPEED_M_S},
            {"kind": "dwell", "duration_s": 0.05},
        ],
    }
)
LONGEST_TICKS = 6000  # of the clock: no run needs more


def bench_with(**changes: dict[str, Any]) -> Bench:
    """The reference bench with the default deadline of the drive and other values in its sections."""
    data = load_simulated("reference").model_dump()
    data["drive"]["command_deadline_s"] = None
    for section, values in changes.items():
        data[section] |= values
    return Bench.model_validate(data)


@dataclass(frozen=True)
class Tick:
    """What was true when a tick was due; commands: RPDOs with "enable operation" since the tick before."""

    clock: int
    state: DriveState
    phase: LoopPhase
    goal: DriveGoal
    silent: bool
    table_m: float  # of the plant itself
    motor_m: float
    motion_commands: int
    held_torque_n_m: float  # command in force in the drive, CST


@dataclass
class Observed:
    """A run: its ticks, the tick of the fault, and how it ended."""

    ticks: list[Tick] = field(default_factory=list)
    injected: int | None = None
    outcome: Outcome | None = None
    error: BaseException | None = None
    still_powered: bool = False
    powered_at_end: bool = False
    speed_at_end_m_s: float = 0.0
    travel_m: float = 0.0  # after detection, or after injection where nothing is detected
    travel_from_fault_m: float = 0.0
    end_m: float = 0.0  # where the table rests
    rig: Rig | None = None

    @property
    def ended(self) -> str:
        """Ending, or the kind of the exception; where power stayed on, that of the run before."""
        if self.outcome is not None:
            return str(self.outcome.ending)
        if not self.still_powered or self.error is None:
            return type(self.error).__name__
        cause = self.error.__cause__
        ended = str(self.error).rsplit("The run ended by ", 1)[-1].split(":")[0]
        return ended if cause is None else type(cause).__name__

    @property
    def detected(self) -> int | None:
        """Index of the first tick from the fault on at which the loop stops the axis."""
        for index, tick in enumerate(self.ticks):
            if (
                self.injected is not None
                and index > self.injected
                and (tick.phase is not LoopPhase.RUN or tick.goal is DriveGoal.QUICK_STOP)
            ):
                return index
        return None


class Stage:
    """Brings a run to a CiA 402 state and calls the fault there."""

    def __init__(self, state: DriveState, at: int, later: int) -> None:
        self.state, self.at, self.later = state, at, later
        self._provoked: int | None = None

    def due(self, tick: int, rig: Rig, session: Session) -> bool:
        """True at the tick of the fault; provokes the state before."""
        state = rig.nodes.drive.state
        if self.state in (DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON):
            return state is self.state
        if self.state is DriveState.OPERATION_ENABLED:
            return tick >= self.at and state is self.state
        if tick >= self.at and self._provoked is None and state is DriveState.OPERATION_ENABLED:
            self._provoked = tick
            if self.state is DriveState.QUICK_STOP_ACTIVE:
                session.ask_stop()
                session.ask_stop()
            else:
                rig.nodes.drive.trip(0x2310, 0x03, tick * PERIOD_S)
        return (
            self._provoked is not None and tick > self._provoked and (state is self.state or tick > self._provoked + 60)
        )


class _Clock(VirtualClock):
    """Virtual clock that looks at the run at every tick, injects the fault, and may be late."""

    def __init__(self) -> None:
        self.look: Callable[[int], float] = lambda tick: 0.0
        self.stalled_s: Callable[[int], float] = lambda tick: 0.0

    def wait(self, tick: int) -> float:
        return self.look(tick)

    def since(self, tick: int) -> float:
        return self.stalled_s(tick)


class _Rows:
    """Recorder of a run; `fail` stands for one that is dead."""

    fail: BaseException | None = None

    def record(self, row: Any) -> None:
        """Discard the row."""
        if self.fail is not None:
            raise self.fail


@dataclass
class Handles:
    """What a fault may act on. late_s: lateness of ticks from now on, by tick since the fault."""

    rng: random.Random
    bus: ModelledBus
    rig: Rig
    session: Session
    rows: Any  # the recorder
    tick: int
    late_s: dict[int, float] = field(default_factory=dict)
    stalled_s: dict[int, float] = field(default_factory=dict)  # time that passes inside a tick, likewise
    each: list[Callable[[], None]] = field(default_factory=list)  # called at every tick from now on
    undo: list[Callable[[], None]] = field(default_factory=list)  # called after the run

    @property
    def drive(self) -> Any:
        """The simulated drive."""
        return self.rig.nodes.drive


def observe(
    bench: Bench,
    stage: Stage,
    fault: Callable[[Handles], None],
    rng: random.Random,
    make_rows: Callable[[tuple[str, ...]], Any] = lambda channels: _Rows(),
) -> Observed:
    """Run MOVE on the bench with a fault; return what happened, whatever it ended with. make_rows: channels ->
    recorder."""
    bus, seen = ModelledBus(), Observed()
    rig = seen.rig = Rig(bench, bus=bus)
    commands = [0]
    handles: list[Handles] = []

    def on_rpdo(can_id: int, data: bytes, now_s: float) -> None:
        commands[0] += len(data) >= 2 and data[0] & ENABLE_OPERATION == ENABLE_OPERATION

    try:
        rig.set_up()
        send = rig.drive._send

        def counted(can_id: int, data: bytes, now_s: float) -> None:
            on_rpdo(can_id, data, now_s)
            send(can_id, data, now_s)

        rig.drive._send = counted
        limits = MOVE.motion_limits
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, limits)
        clock, rows = _Clock(), make_rows(cycle.channels)
        session = Session(rig, cycle, plan(MOVE, PERIOD_S, 0.0), limits, clock, rows)
        ratio = bench.gains.ratio_m_rad

        def look(tick: int) -> float:
            if tick > LONGEST_TICKS:
                raise AssertionError(f"no end after {LONGEST_TICKS} ticks")
            plant = rig.nodes.plant
            seen.ticks.append(
                Tick(tick, rig.nodes.drive.state, session._phase, rig.drive.goal, rig.master.silent,
                     plant.table_position_m, ratio * plant.motor_position_rad, commands[0],
                     rig.nodes.drive._torque_n_m)
            )  # fmt: skip
            commands[0] = 0
            if seen.injected is None and stage.due(tick, rig, session):
                seen.injected = len(seen.ticks) - 1
                handles.append(Handles(rng, bus, rig, session, rows, tick))
                fault(handles[0])
            if not handles:
                return 0.0
            for action in handles[0].each:
                action()
            return handles[0].late_s.pop(tick - handles[0].tick, 0.0)

        clock.look = look
        clock.stalled_s = lambda tick: handles[0].stalled_s.get(tick - handles[0].tick, 0.0) if handles else 0.0
        try:
            seen.outcome = session.run()
        except StillPowered as error:
            seen.error, seen.still_powered = error, True
        except (Exception, KeyboardInterrupt) as error:  # the third request to stop is one
            seen.error = error
        _settle(seen, rig)
    finally:
        for undo in (undo for handle in handles for undo in handle.undo):
            undo()
        rig.close()
    return seen


def _settle(seen: Observed, rig: Rig) -> None:
    """Let the drive's own clock run on for 300 periods and measure what the axis does."""
    drive, plant = rig.nodes.drive, rig.nodes.plant
    seen.powered_at_end = drive.state in POWERED
    first = seen.detected if seen.detected is not None else seen.injected
    start_m = seen.ticks[first].table_m if first is not None else plant.table_position_m
    end_s = drive._last_s
    for k in range(1, 301):
        drive.tick(end_s + 2 * k * PERIOD_S)
    before_m = plant.table_position_m
    for k in range(301, 351):
        drive.tick(end_s + 2 * k * PERIOD_S)
    seen.speed_at_end_m_s = abs(plant.table_position_m - before_m) / (100 * PERIOD_S)
    seen.travel_m, seen.end_m = abs(plant.table_position_m - start_m), plant.table_position_m
    if seen.injected is not None:
        seen.travel_from_fault_m = abs(plant.table_position_m - seen.ticks[seen.injected].table_m)
