"""Recordings of one axis prepared for a fit: observer, noise and model discrepancy of each residual."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.errors import InputError
from hil.identification.command_timing import unknown_share
from hil.identification.measured import Measured
from hil.identification.noise import Laps
from hil.identification.observability import Observability, common
from hil.identification.rest import creeping, resting
from hil.twin.axis import Response, Start
from hil.twin.stepping.loops import LEAST_TICKS

# Torque resolved by the motor channel over the noise of the torque channel. A fine encoder resolves less, but there lie
# details below the material size too: friction at zero speed, the side force of a lead error.
TORQUE_ACCURACY = 1.0
# Model discrepancy (Kennedy and O'Hagan 2001): correct simulations of one axis differ by this share of the deflection
# of the transmission. Calibrated on simulated axes with nothing but wrong parameters, where the refitted twin leaves
# 0.1 to 0.6 % in accelerations. On the motor, TORQUE_ACCURACY stands for it.
DISCREPANCY = 0.005
# Bounds of the time constant of the motor's observer. Fast: stick-slip decays within a few ticks, so that even a poor
# start converges; below two ticks the sampled observer is unstable on an elastic axis. Slow: a coarse encoder still
# resolves the torque.
FASTEST_OBSERVER_TICKS, FASTEST_OBSERVER_S, SLOWEST_OBSERVER_S = LEAST_TICKS, 0.002, 0.008

_NEAR_ROWS = 21  # within which a motor that is not at rest passes more than a step
_REMEMBERED_S = 0.3  # of an impulse: elastic modes of a machine axis have decayed


@dataclass(frozen=True, eq=False)
class Dataset:
    """Recordings of one axis prepared for a fit, with everything that does not depend on the hypothesis.

    `observer_s` is the time constant of the motor's observer in the block residuals, `travel_m` the largest range of
    the position set-points.
    """

    runs: tuple[Measured, ...]
    bench: Bench
    observer_s: float = FASTEST_OBSERVER_S
    travel_m: float = 0.1
    _scales: dict[tuple[float, float], tuple[dict[str, FloatArray], ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def observability(self) -> Observability:
        """Inputs and outputs of the axis that all recordings make known."""
        return common(run.observability for run in self.runs)

    def over(self, runs: Sequence[Measured]) -> "Dataset":
        """Other recordings of the same axis with the same observer and travel."""
        return Dataset(tuple(runs), self.bench, self.observer_s, self.travel_m)

    @property
    def duration_s(self) -> float:
        """Time at the end of the last recording [s]; 0 without recordings."""
        return max((float(run.time_s[-1]) for run in self.runs), default=0.0)

    def scales(
        self, torque_accuracy: float = TORQUE_ACCURACY, discrepancy: float = DISCREPANCY
    ) -> tuple[dict[str, FloatArray], ...]:
        """Size of one unit of weighted residual at each row, (n,) per channel, for each run."""
        key = torque_accuracy, discrepancy
        if key not in self._scales:
            self._scales[key] = tuple(
                scales(run, self.bench, self.observer_s, torque_accuracy, discrepancy) for run in self.runs
            )
        return self._scales[key]

    @property
    def noise(self) -> tuple[dict[str, FloatArray], ...]:
        """Noise of the residuals at each row, (n,) per channel, for each run: scales without model discrepancy."""
        return self.scales(discrepancy=0.0)

    @property
    def rows(self) -> int:
        """Number of evaluated rows of all runs."""
        return sum(run.motor[run.evaluated].size for run in self.runs)

    @property
    def laps(self) -> list[tuple[int, Laps]]:
        """Index and laps of the runs in which motion repeats."""
        return [(index, run.laps) for index, run in enumerate(self.runs) if run.laps is not None]


def prepare_dataset(runs: Sequence[Measured], bench: Bench) -> Dataset:
    """Build the data set of recordings.

    With the observer's time constant the noise of the motor encoder makes as much observed torque as the noise of the
    torque channel, within the bounds of the observer. Without a torque the fastest one moves the motor as measured.
    Raises InputError for a torque that is 0 throughout.
    """
    for run in runs:
        if run.noise.torque <= 0.0 and run.observability.torque_measured:
            raise InputError(
                f"{run.name}: torque: given 0 throughout, allowed a recorded torque; leave the channel out"
            )
    wanted = max(np.sqrt(run.noise.motor * inertia(bench) / (TORQUE_ACCURACY * run.noise.torque)) for run in runs)
    fastest_s = FASTEST_OBSERVER_TICKS * runs[0].period_s
    wanted = wanted if all(run.observability.torque_measured for run in runs) else fastest_s
    observer_s = float(np.clip(wanted, fastest_s, max(SLOWEST_OBSERVER_S, fastest_s)))
    return Dataset(tuple(runs), bench, observer_s, max(float(np.ptp(run.position_command_m)) for run in runs))


def inertia(bench: Bench) -> float:
    """Inertia of the whole axis in motor units."""
    modes = bench.twin().modal
    return float(modes.shape[modes.motor, 0] ** -2)


def scales(
    run: Measured, bench: Bench, observer_s: float, torque_accuracy: float, discrepancy: float
) -> dict[str, FloatArray]:
    """Size of one unit of weighted residual at each row (n,), per channel: noise and model discrepancy.

    A torque d that the twin misses moves its motor by d tau^2 / J before the correction takes hold, with tau the
    observer's time constant: the motor counts from the torque that the torque channel can still see.
    """
    found = {
        name: np.hypot(noise, left)
        for (name, noise), left in zip(
            sensor_noise(run, bench, observer_s).items(), unknown_input(run, bench, observer_s).values(), strict=True
        )
    }
    found["motor"] = np.hypot(found["motor"], torque_accuracy * run.noise.torque * observer_s**2 / inertia(bench))
    if run.table_m.size and discrepancy:
        found["table"] = np.hypot(found["table"], discrepancy * _deflection(run, bench, observer_s))
    return found


def _deflection(run: Measured, bench: Bench, observer_s: float) -> FloatArray:
    """Deflection (n,) of the transmission [m] as the bench gives it for the measured motion, its median taken off.

    The measured difference of the encoders is more than that: it has their lateness and errors of the lead, which a
    simulation reproduces exactly.
    """
    twin = bench.twin()
    twin = replace(twin, observer_s=observer_s)
    rest = resting(run, twin.slow_velocity)
    with np.errstate(invalid="ignore", over="ignore"):  # the twin of a bench may be unstable
        found = twin.observe(run.position_command_m, run.velocity_command_m_s, run.response, run.start, rest)
        apart = found.table_position_m - bench.axis.ratio_m_rad * found.motor_position
        return np.asarray(apart - np.median(apart), dtype=np.float64)


def sensor_noise(run: Measured, bench: Bench, observer_s: float) -> dict[str, FloatArray]:
    """Noise of the sensors at each row (n,) in the residual of each channel, block by block.

    White noise e of the motor's encoder comes back through the observer as (1 - z^-1)^2 / (1 - a z^-1)^2 e,
    a = 1 - T / tau. That of a velocity v, whose trapezoidal sum is the position, comes back as
    (1 - z^-2) / 2 / (1 - a z^-1)^2 T v.
    """
    a = 1.0 - run.period_s / observer_s
    impulse = np.zeros(round(20.0 * observer_s / run.period_s) + 3)
    impulse[0] = 1.0
    numerator = [1.0, -2.0, 1.0] if run.observability.position_measured else [0.5, 0.0, -0.5]
    passed = lfilter(numerator, [1.0, -2.0 * a, a * a], impulse)
    table, torque = (np.full(run.motor.shape, noise) for noise in (run.noise.table_m, run.noise.torque))
    found = {"motor": run.motor_noise * np.linalg.norm(passed), "table": table, "torque": torque, "command": torque}
    if run.observability.noisy_torque_input:  # its noise drives the twin too
        for name, response in impulse_responses(run, bench, observer_s).items():
            found[name] = np.hypot(found[name], run.noise.torque * np.linalg.norm(response))
    return found


def unknown_input(run: Measured, bench: Bench, observer_s: float) -> dict[str, FloatArray]:
    """Largest effect at each row (n,), per channel, of what samples leave open: torque between rows, friction at creep.

    These are standard deviations where nothing else is known, so upper bounds: most of a torque that is smooth, or of
    friction in a reversal, follows from the rows about it.
    """
    rows = run.motor.shape
    found = {name: np.zeros(rows) for name in ("motor", "table", "torque", "command")}
    if run.observability.torque_between_rows_unknown:
        unknown = unknown_torque(run, bench)
        for name, response in impulse_responses(run, bench, observer_s).items():
            found[name] = np.sqrt(np.convolve(unknown**2, response**2)[: rows[0]])
    if run.noise.coarse:
        held = bench.axis.physics().coulomb_n_m * observer_s**2 / inertia(bench)
        found["motor"] = np.hypot(found["motor"], np.where(creeping(run), held, 0.0))
    return found


def unknown_torque(run: Measured, bench: Bench) -> FloatArray:
    """Standard deviation (n,) of the torque from row to row that samples of it leave open [motor unit].

    It is `Measured.torque_gap`, and that of Coulomb friction, whose sign is not known where the direction of motion
    changes between neighbouring rows. Of a command that is held over many rows the motion tells the share of
    the two that is real (`command_timing`).
    """
    direction = np.sign(np.diff(run.motor, append=run.motor[-1]))
    turning = maximum_filter1d(np.diff(direction, prepend=direction[0]) != 0.0, 3)
    step = np.sqrt(12.0) * run.noise.motor
    moved = maximum_filter1d(run.motor, _NEAR_ROWS) - minimum_filter1d(run.motor, _NEAR_ROWS)
    unsure = turning & (moved > 1.5 * step)  # not at rest
    found = np.hypot(run.torque_gap, np.where(unsure, bench.axis.physics().coulomb_n_m, 0.0))
    return unknown_share(run.torque_command, run.motor, found, run.period_s, inertia(bench)) * found


def impulse_responses(run: Measured, bench: Bench, observer_s: float) -> dict[str, FloatArray]:
    """Change of the block residuals (m,) from the tick on at which the torque is 1 more than recorded for one tick.

    It is that of the axis of the bench without friction, in motion.
    """
    twin = bench.twin()
    twin = replace(
        twin, physics=replace(twin.physics, coulomb_n_m=0.0, viscous_n_m_s_rad=0.0), active=(), observer_s=observer_s
    )
    ticks = round(_REMEMBERED_S / run.period_s) + 3
    ratio, speed = bench.axis.ratio_m_rad, float(np.max(np.abs(np.diff(run.motor)), initial=1e-9)) / run.period_s
    motor = speed * run.period_s * np.arange(ticks, dtype=np.float64)
    command = np.zeros(ticks)
    table = ratio * motor if run.table_m.size else np.zeros(0)
    measured = Response(motor, table, command, command)
    start = Start(velocity_m_s=ratio * speed)
    still = np.zeros(ticks)
    quiet = twin.observe(still, still, measured, start)
    kicked = twin.observe(still, still, measured._replace(torque_command=np.eye(1, ticks, 1)[0]), start)
    moved = kicked.motor_position - quiet.motor_position
    found = {"motor": moved[1:]}
    if run.table_m.size:
        found["table"] = (kicked.table_position_m - quiet.table_position_m - ratio * moved)[1:]
    return found
