"""Size of one unit of weighted residual: noise of the sensors, open inputs, model discrepancy; block by block.

A command that is held over many rows changes at single instants, and each answer of the motor tells its own. If all
changes stand at one place between the rows, a delay common to all describes them, and little of the variance that
`Measured.torque_gap` assumes is real:

    x[k+1] - 2 x[k] + x[k-1] = sum_j b_j u[k-j] + c v + d sign(v) + e + r,    var r = s^2 (T^2 / J)^2 g^2 + const

with g the standard deviation of the unknown mean torque of the two periods about row k. The share s is estimated from
the squared r over g^2; what the model lacks only makes it larger.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.identification.measured import Measured
from hil.identification.sensor_noise import is_held
from hil.identification.standstill import creeping, resting
from hil.twin.axis import Response, Start
from hil.twin.stepping.loops import LEAST_TICKS

# Torque resolved by the motor channel over the noise of the torque channel. A fine encoder resolves less, but there lie
# details below the material size too: friction at zero speed, the side force of a lead error.
TORQUE_ACCURACY = 1.0
# Model discrepancy (Kennedy and O'Hagan 2001): correct simulations of one axis differ by this share of the deflection
# of the transmission. Calibrated on simulated axes with nothing but wrong parameters, where the refitted twin leaves
# 0.1 to 0.6 % in accelerations. On the motor, TORQUE_ACCURACY stands for it.
DISCREPANCY = 0.005

_FASTEST = 1.0 + 1e-9  # of the fastest observer: rounding
_NEAR_ROWS = 21  # within which a motor that is not at rest passes more than a step
_REMEMBERED_S = 0.3  # of an impulse: elastic modes of a machine axis have decayed
_LAGS = 9  # rows of the command from one ahead on: the answer of a second inertia to a step begins within them
_LEAST_ROWS = 200  # a slope over squared residuals needs many more rows than the regression has columns
_MARGIN = 2.0  # standard errors added to the estimated variance: the share is an upper bound


def inertia(bench: Bench) -> float:
    """Inertia of the whole axis in motor units."""
    modes = bench.twin().modal
    return float(modes.shape[modes.motor, 0] ** -2)


def with_masses(bench: Bench, factor: float) -> Bench:
    """The bench with its masses, but for those held, times a factor."""
    axis = bench.axis
    scaled = {name: factor * getattr(axis, name) for name in axis.MASSES if name not in axis.held}
    return bench.model_copy(update={"axis": axis.model_copy(update=scaled)})


def factor_of_masses(bench: Bench, wanted: float) -> float:
    """Factor of `with_masses` that gives the axis an inertia [motor unit]; 1 if all masses are held."""
    light, heavy = inertia(bench), inertia(with_masses(bench, 2.0))
    return 1.0 + (wanted - light) / (heavy - light) if heavy > light else 1.0


def follows(run: Measured, springs: bool, observer_s: float) -> bool:
    """True where the second encoder is judged behind the measured motor.

    An axis with springs is driven by a torque with noise, and its motor's encoder is finer: even the fastest observer
    takes more noise from the torque.
    """
    fine = observer_s <= _FASTEST * LEAST_TICKS * run.period_s
    return springs and fine and bool(run.table_m.size) and run.observability.noisy_torque_input


def scales(
    run: Measured, bench: Bench, observer_s: float, torque_accuracy: float, discrepancy: float
) -> dict[str, FloatArray]:
    """Size of one unit of weighted residual at each row (n,), per channel: noise and model discrepancy.

    A torque d that the twin misses moves its motor by d tau^2 / J before the correction takes hold, with tau the
    observer's time constant: the motor counts from the torque that the torque channel can still see.
    """
    sizes = {
        name: np.hypot(noise, left)
        for (name, noise), left in zip(
            block_noise(run, bench, observer_s).items(), unknown_input(run, bench, observer_s).values(), strict=True
        )
    }
    sizes["motor"] = np.hypot(sizes["motor"], torque_accuracy * run.noise.torque * observer_s**2 / inertia(bench))
    if run.table_m.size and discrepancy:
        sizes["table"] = np.hypot(sizes["table"], discrepancy * _deflection(run, bench, observer_s))
    return sizes


def _deflection(run: Measured, bench: Bench, observer_s: float) -> FloatArray:
    """Deflection (n,) of the transmission [m] as the bench gives it for the measured motion, its median taken off.

    The measured difference of the encoders is more than that: it has their lateness and errors of the lead, which a
    simulation reproduces exactly.
    """
    twin = bench.twin()
    twin = replace(twin, observer_s=observer_s)
    rest = resting(run, twin.slow_velocity)
    with np.errstate(invalid="ignore", over="ignore"):  # the twin of a bench may be unstable
        held = twin.observe(run.position_command_m, run.velocity_command_m_s, run.response, run.start, rest)
        apart = held.table_position_m - bench.axis.ratio_m_rad * held.motor_position
        return np.asarray(apart - np.median(apart), dtype=np.float64)


def block_noise(run: Measured, bench: Bench, observer_s: float) -> dict[str, FloatArray]:
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
    noise = {"motor": run.motor_noise * np.linalg.norm(passed), "table": table, "torque": torque, "command": torque}
    if run.observability.noisy_torque_input:  # its noise drives the twin too, but for what follows the motor
        for name, response in impulse_responses(run, bench, observer_s).items():
            noise[name] = np.hypot(noise[name], run.noise.torque * np.linalg.norm(response))
    return noise


def unknown_input(run: Measured, bench: Bench, observer_s: float) -> dict[str, FloatArray]:
    """Largest effect at each row (n,), per channel, of what samples leave open: torque between rows, friction at creep.

    These are standard deviations where nothing else is known, so upper bounds: most of a torque that is smooth, or of
    friction in a reversal, follows from the rows about it.
    """
    rows = run.motor.shape
    effects = {name: np.zeros(rows) for name in ("motor", "table", "torque", "command")}
    if run.observability.torque_between_rows_unknown:
        unknown = unknown_torque(run, bench)
        for name, response in impulse_responses(run, bench, observer_s).items():
            effects[name] = np.sqrt(np.convolve(unknown**2, response**2)[: rows[0]])
    if run.noise.coarse:
        held = bench.axis.physics().coulomb_n_m * observer_s**2 / inertia(bench)
        effects["motor"] = np.hypot(effects["motor"], np.where(creeping(run), held, 0.0))
    return effects


def unknown_torque(run: Measured, bench: Bench) -> FloatArray:
    """Standard deviation (n,) of the torque from row to row that samples of it leave open [motor unit].

    It is `Measured.torque_gap`, and that of Coulomb friction, whose sign is not known where the direction of motion
    changes between neighbouring rows. Of a command that is held over many rows the motion tells the share of
    the two that is real (`unknown_share`).
    """
    direction = np.sign(np.diff(run.motor, append=run.motor[-1]))
    turning = maximum_filter1d(np.diff(direction, prepend=direction[0]) != 0.0, 3)
    step = np.sqrt(12.0) * run.noise.motor
    moved = maximum_filter1d(run.motor, _NEAR_ROWS) - minimum_filter1d(run.motor, _NEAR_ROWS)
    unsure = turning & (moved > 1.5 * step)  # not at rest
    unknown = np.hypot(run.torque_gap, np.where(unsure, bench.axis.physics().coulomb_n_m, 0.0))
    return unknown_share(run.torque_command, run.motor, unknown, run.period_s, inertia(bench)) * unknown


def unknown_share(
    command: FloatArray, motor: FloatArray, unknown: FloatArray, period_s: float, inertia: float
) -> float:
    """Upper bound, at most 1, of the share of the `unknown` torque (n,) that the motion shows; 1 if it cannot tell.

    `command`, `motor` (n,) and `inertia` in motor units; `unknown` is the standard deviation of the mean torque from a
    row to the next one.
    """
    rows = np.arange(_LAGS, motor.size - 2)
    if rows.size < _LEAST_ROWS or not is_held(command, motor):
        return 1.0
    curvature = motor[rows + 1] - 2.0 * motor[rows] + motor[rows - 1]
    velocity = 0.5 * (motor[rows + 1] - motor[rows - 1])
    lagged = [command[rows + 1 - lag] for lag in range(_LAGS)]
    columns = np.column_stack([*lagged, velocity, np.sign(velocity), np.ones(rows.size)])
    left = curvature - columns @ np.linalg.lstsq(columns, curvature, rcond=None)[0]
    # half of each period's mean torque acts on a second difference
    variance = (period_s**2 / inertia) ** 2 * 0.25 * (unknown[rows] ** 2 + unknown[rows - 1] ** 2)
    spread = variance - variance.mean()
    size = float(spread @ spread)
    if size == 0.0:
        return 1.0
    slope = float(spread @ left**2) / size
    scatter = left**2 - np.mean(left**2) - slope * spread
    error = float(np.sqrt(np.sum((spread * scatter) ** 2))) / size  # of rows of unequal scatter (White 1980)
    return float(np.sqrt(np.clip(slope + _MARGIN * error, 0.0, 1.0)))


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
    responses = {"motor": moved[1:]}
    if run.table_m.size and not follows(run, bool(bench.axis.SPRINGS), observer_s):
        responses["table"] = (kicked.table_position_m - quiet.table_position_m - ratio * moved)[1:]
    return responses
