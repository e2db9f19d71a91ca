"""Speed of the simulated bench and of the twin relative to real time, at 1 kHz."""

import tempfile
from time import perf_counter

from drivers.sim.kernel import advance_period
from hil.bench.bench_file import Bench
from hil.loop.bounds import make_cycle
from hil.loop.clock import VirtualClock
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.loop.simulated_bench import make_plant
from hil.loop.virtual import compiled_ticks
from hil.motion.trajectory import Trajectory
from hil.recording.writer import Recorder
from hil.twin.axis import Steps, Twin
from hil.validation.benchmarks.axis import MOVES, trajectory, twenty_modes, two_mass
from hil.validation.benchmarks.figure import Figure, Reference, ReferenceKind, best_of

REPEATS = 5
ALONE_TICKS = 4000
TWIN_REPEATS = 15


def whole_bench(*, compiled: bool) -> float:
    """Times real time: the reference bench in virtual time, twin and recorder included."""
    bench = two_mass()
    motion = trajectory(bench.gains.period_s)
    return motion.duration_s / min(_one_run(bench, motion, compiled) for _ in range(REPEATS))


def _one_run(bench: Bench, motion: Trajectory, compiled: bool) -> float:
    """Duration [s] of one run. Nothing of a run is left for the next: freeing a ring of rows takes 1.4 ms."""
    limits = MOVES.motion_limits
    with Rig(bench) as rig, tempfile.TemporaryDirectory() as folder:
        rig.set_up()
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, limits)
        with Recorder(folder, "bench", cycle.channels, bench.gains.period_s, {}, lossless=True) as recorder:
            start = perf_counter()
            ticks = compiled_ticks(rig, recorder) if compiled else None
            Session(rig, cycle, motion, limits, VirtualClock(), recorder, ticks).run()
            return perf_counter() - start


def offline_twin(twin: Twin) -> float:
    """Times real time: a twin in closed loop over the moves."""
    motion = trajectory(twin.gains.period_s)
    seconds = best_of(lambda: twin.simulate(motion.position_m, motion.velocity_m_s), TWIN_REPEATS)
    return motion.duration_s / seconds


def axis_alone() -> float:
    """Times real time: the simulated axis of the reference bench under constant torque, without loop, twin and rows."""
    bench = two_mass()
    plant, period_s = make_plant(bench), bench.gains.period_s
    steps = ALONE_TICKS * plant.steps_in(period_s)

    def advance() -> None:
        advance_period(plant.parameters, plant.state, plant.lines, 0.0, steps)

    return ALONE_TICKS * period_s / best_of(advance, REPEATS)


def figures() -> list[Figure]:
    """Speeds of the whole bench in virtual time and of the twin."""
    bench = twenty_modes()
    whole = Twin(bench.axis.physics(), bench.gains)
    tick_s = bench.gains.period_s
    plain = Twin(bench.axis.physics(), bench.gains, steps=Steps(tick_s, tick_s))
    real = "x real time"
    alone = (Reference("axis alone", ReferenceKind.LIMIT, axis_alone()),)
    return [
        Figure(
            "whole bench in virtual time",
            "virtual bench",
            whole_bench(compiled=True),
            real,
            200.0,
            detail="2-dof reality at 10 us steps, live twin, recorder; same rows bit for bit as over the bus",
            beside=alone,
        ),
        Figure(
            "whole bench in virtual time, every frame",
            "virtual bench, frames",
            whole_bench(compiled=False),
            real,
            detail="the same, each tick over CANopen frames",
            beside=alone,
        ),
        Figure(
            "twin offline, closed loop, 20 modes",
            "twin, 20 modes",
            offline_twin(plain),
            real,
            10_000.0,
            detail="closed loop, one exact step per tick",
        ),
        Figure(
            "twin offline, closed loop, 20 modes, fine at reversals",
            "twin, 20 modes, fine",
            offline_twin(whole),
            real,
            detail="default steps: 50 per tick while the motor may reverse",
        ),
    ]
