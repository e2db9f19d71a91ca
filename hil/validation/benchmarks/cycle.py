"""Duration of one whole cycle of the loop: SYNC, answers, P, PI, live twin of 20 modes, PDO packing, record.

Measured from the deadline to the end of the cycle inside `hil.loop.session`, back to back. The simulated devices
answer; their axis stands still, since its physics is not part of the loop. On the in-process bus their work is
included; on a python-can bus it is excluded, since real devices serve their end of the bus themselves.
"""

import tempfile
from dataclasses import replace
from time import perf_counter_ns

import can

from drivers.bus import BusConfig, open_bus
from hil.bench.bench_file import load_bench
from hil.loop.bounds import make_cycle
from hil.loop.clock import VirtualClock
from hil.loop.cycle import Samples
from hil.loop.devices import Rig
from hil.loop.session import Session
from hil.manual.keys import EXAMPLES
from hil.recording.writer import Recorder
from hil.validation.benchmarks.axis import MOVES, trajectory, twenty_modes
from hil.validation.benchmarks.figure import Figure, Reference, ReferenceKind, percentile

LOOPS = 4
ALONE_CYCLES = 5000  # of frames without a loop; their median is steady to some per cent


class StandingAxis:
    """Plant at rest."""

    motor_position_rad = 0.0
    table_position_m = 0.0
    torque_n_m = 0.0

    def advance(self, torque_command_n_m: float, period_s: float) -> None:
        """Do nothing."""


class Stopwatch(VirtualClock):
    """Clock that is always on time and records the duration of each cycle [ns]."""

    def __init__(self) -> None:
        self.durations_ns: list[int] = []
        self.devices_ns: list[int] = []
        self._start_ns = self._device_ns = 0

    def wait(self, tick: int) -> float:
        self._device_ns = 0
        self._start_ns = perf_counter_ns()
        return 0.0

    def since(self, tick: int) -> float:
        self.durations_ns.append(perf_counter_ns() - self._start_ns - self._device_ns)
        self.devices_ns.append(self._device_ns)
        return 0.0

    def serve_apart(self, rig: Rig) -> None:
        """Exclude the time in which the devices serve their end of a python-can bus."""
        near, far = rig.ports

        def poll(now_s: float, timeout_s: float = 0.0) -> None:
            start_ns = perf_counter_ns()
            far.poll(now_s)
            self._device_ns += perf_counter_ns() - start_ns
            near.poll(now_s)

        rig.master.poll = poll


def whole_cycle(interface: str) -> tuple[list[float], list[float]]:
    """Return durations [s] of the cycles of several runs on a bus, and of the excluded work of the devices."""
    bench, limits = twenty_modes(interface), MOVES.motion_limits
    motion = trajectory(bench.gains.period_s)
    durations: list[float] = []
    devices: list[float] = []
    for run in range(LOOPS + 1):
        watch = Stopwatch()
        with Rig(bench, plant=StandingAxis()) as rig, tempfile.TemporaryDirectory() as folder:
            rig.set_up()
            if rig.ports:
                watch.serve_apart(rig)
            cycle = make_cycle(rig, 0.0, limits)
            with Recorder(folder, "bench", cycle.channels, bench.gains.period_s, {}) as recorder:
                Session(rig, cycle, motion, limits, watch, recorder).run()
        if run:  # the first one compiles
            durations += [1e-9 * duration for duration in watch.durations_ns]
            devices += [1e-9 * duration for duration in watch.devices_ns]
    return durations, devices


def frames_alone() -> tuple[float, float]:
    """Return the median times [s] in which python-can alone carries the frames of a cycle on its virtual bus.

    What the loop's end takes to send SYNC and RPDO and to receive two TPDOs, and both ends together.
    """
    config = BusConfig("virtual", "hil-bench-frames")
    sync = can.Message(arbitration_id=0x080, is_extended_id=False)
    pdo = can.Message(arbitration_id=0x205, data=bytes(8), is_extended_id=False)
    near_s: list[float] = []
    both_s: list[float] = []
    with open_bus(config) as near, open_bus(config) as far:
        for _ in range(ALONE_CYCLES):
            start_ns = perf_counter_ns()
            far.send(pdo)
            far.send(pdo)
            near_ns = perf_counter_ns()
            near.send(sync)
            while near.recv(0.0) is not None:
                pass
            near.send(pdo)
            far_ns = perf_counter_ns()
            while far.recv(0.0) is not None:
                pass
            near_s.append(1e-9 * (far_ns - near_ns))
            both_s.append(1e-9 * (perf_counter_ns() - start_ns))
    return percentile(near_s, 0.5), percentile(both_s, 0.5)


def figures() -> list[Figure]:
    """Return cycle times on the in-process bus and through python-can."""
    inside, _ = whole_cycle("inprocess")
    outside, devices = whole_cycle("virtual")
    both = [sum(pair) for pair in zip(outside, devices, strict=True)]
    near, ends = (Reference("frames alone", ReferenceKind.LIMIT, 1e6 * seconds) for seconds in frames_alone())
    detail = f"{len(inside)} cycles, twin of 20 modes, simulated devices included"
    apart = f"twin of 20 modes; without the {1e6 * percentile(devices, 0.5):.0f} us of the simulated devices"
    bus = "whole cycle, python-can virtual bus"

    plain, compensated = compensated_steps()
    steps = f"compiled step: {1e6 * plain:.1f} us without, {1e6 * compensated:.1f} us with four tables, in turn"

    def figure(name: str, label: str, seconds: list[float], part: float, target: float | None, how: str) -> Figure:
        quantile = f", p{100 * part:.0f}"
        return Figure(name + quantile, label + quantile, 1e6 * percentile(seconds, part), "us", target, True, how)

    return [
        figure("whole cycle, in-process bus", "cycle, in-process", inside, 0.5, 10.0, detail),
        figure("whole cycle, in-process bus", "cycle, in-process", inside, 0.99, 50.0, detail),
        replace(figure(bus, "cycle, python-can", outside, 0.5, 40.0, apart), beside=(near,)),
        figure(bus, "cycle, python-can", outside, 0.99, None, apart),
        replace(
            figure(f"{bus}, devices included", "cycle + devices", both, 0.5, None, "both ends of the python-can bus"),
            beside=(ends,),
        ),
        Figure("compensation, four tables", "compensation", 1e6 * (compensated - plain), "us", 1.0, True, steps),
    ]


def compensated_steps(repeats: int = 20_000) -> tuple[float, float]:
    """Return the median times [s] of the compiled step of a cycle without and with every kind of table, in turn."""
    plain = twenty_modes("inprocess")
    section = load_bench(EXAMPLES / "bench-compensated.yaml").compensation
    limits, motion = MOVES.motion_limits, trajectory(plain.gains.period_s)
    cycles = []
    for bench in (plain, plain.model_copy(update={"compensation": section})):
        with Rig(bench, plant=StandingAxis()) as rig:
            rig.set_up()
            cycles.append(make_cycle(rig, 0.0, limits))
        cycles[-1].follow(motion)
    samples, durations = Samples(0.0, 0.0, 0.0, 0, 0, 0.0, 0.0), ([], [])  # type: ignore[var-annotated]
    for tick in range(repeats):
        for cycle, taken in zip(cycles, durations, strict=True):
            start_ns = perf_counter_ns()
            cycle.step(tick % len(motion), samples)
            taken.append(1e-9 * (perf_counter_ns() - start_ns))
    return percentile(durations[0], 0.5), percentile(durations[1], 0.5)
