"""Noise floor of residuals: from repeated laps if there are any, else white sensor noise.

If the same set-points repeat after a lag p, the repeatable motion cancels:

    sigma^2 = mean (r_k - r_{k+p})^2 / 2        over all rows k whose set-points repeat

sigma is the non-repeatable part of the residual r; the repeatable part is physics that the twin lacks. The mean is the
median over blocks of rows: an event in one lap does not repeat either, but is no noise. In closed loop
the noise of the encoders moves the axis: see `noise_response`.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.laps import Laps
from hil.identification.measured import Measured

# Mean square of a channel over its noise up to which it is explained: 25 % above the noise in rms. An unmodelled effect
# as large as the noise makes 41 %. An encoder at rest has a constant error of up to half a count, whose square is three
# times that of counting noise.
FLOOR = 1.25**2
# The same where a measured torque drives the twin with its noise, which may be coloured: three times the rms of the
# white noise, if what is left depends on nothing. No sealed draw tells this factor.
COLOURED = 9.0
# Least ratio of the non-repeating energy without a term to that with it; a term below it is refuted. Most terms repeat
# with the motion and have 1; the refit of the other parameters changes it by less than 5 %.
REPEATS = 0.95
# Closed-loop response in units of its sensor's noise: below the first it needs no check for chaos, above the second the
# loop is chaotic. A regular axis with coarse counts moved by 3, chaotic loops by tens. The torque has no upper limit:
# one coarse count in a loop of high gain makes many times the noise of a good current sensor.
_LITTLE, _LARGE = 0.3, 5.0
_NEAR_S = 0.05  # time between two counts of a table that creeps to its rest
_READINGS = 4  # of the table's encoder: the steps at rest are few, and their places decide
_HALF = 0.75  # response to half the noise over that to all of it: 0.5 in a linear loop, 1 in a chaotic one


def floor(residual: FloatArray, white: float, laps: Laps | None) -> float:
    """Noise floor (rms) of a residual (n,): its non-repeatable part, at least the sensor's `white` noise."""
    return white if laps is None else max(laps.noise(residual), white)


def noise_response(hypothesis: Hypothesis, run: Measured) -> dict[str, float]:
    """Closed-loop rms of motor, table and torque caused by encoder quantisation and noise.

    It is the difference between a twin with exact encoders and one with real ones; the sub-count initial position is
    unknown. Returns 0 for all if the response to half the noise is not about half, or that of motor or table is several
    times their sensor's noise: the loop is chaotic.
    """
    twin, bench = hypothesis.twin(run=run), hypothesis.bench
    quiet = hypothesis.respond(run)
    table = bench.encoders.table
    own_m = max(run.noise.table_m**2 - (bench.axis.ratio_m_rad * run.noise.motor) ** 2, 0.0) ** 0.5
    rng = np.random.default_rng(0)
    misread = np.array(
        [
            _misread(quiet.motor_position, bench.motor_count, run.motor_noise, rng),
            _misread(quiet.table_position_m, table.resolution_m if table else 0.0, own_m, rng),
        ]
    )

    def moved(share: float) -> dict[str, float]:
        other = twin.simulate(
            run.position_command_m, run.velocity_command_m_s, run.start, run.table_m, share * misread, run.feedforward
        )
        return {
            name: rms((a - b)[run.evaluated])
            for name, a, b in (
                ("motor", other.motor_position, quiet.motor_position),
                ("table", other.table_position_m, quiet.table_position_m),
                ("torque", other.torque, quiet.torque),
            )
        }

    noise = sensor_noise(run)
    full, half = moved(1.0), moved(0.5)
    known = [name for name in full if noise[name] > 0.0]
    calm = all(
        full[name] < _LITTLE * noise[name]
        or ((name == "torque" or full[name] < _LARGE * noise[name]) and half[name] < _HALF * full[name])
        for name in known
    )
    return full if calm else dict.fromkeys(full, 0.0)


def sensor_noise(run: Measured) -> dict[str, float]:
    """rms noise of the sensors of motor, table and torque over a run."""
    return {"motor": rms(run.motor_noise[run.evaluated]), "table": run.noise.table_m, "torque": run.noise.torque}


def rms(values: FloatArray) -> float:
    """Root mean square; infinite where a twin that diverges exceeds the range of numbers."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(values**2)))


def _misread(values: FloatArray, count: float, noise: FloatArray | float, rng: np.random.Generator) -> FloatArray:
    """Error (n,) of an encoder with a noise (n,) or (): its counting, and white noise for the remaining variance."""
    counted = count * np.round(values / count) - values if count else np.zeros_like(values)
    more = np.sqrt(np.maximum(np.square(noise) - count**2 / 12.0, 0.0))
    return np.asarray(counted + more * rng.standard_normal(values.size))


def unrepeated(hypothesis: Hypothesis, data: Dataset) -> float:
    """Energy of the differences between laps in units of noise^2; 0 without laps.

    Without a control law it is at least that of the noise: the measured torque is an input then, and the share of its
    noise that reaches the motion depends on the parameters.
    """
    residuals = hypothesis.residuals(data)
    least = 0.0 if data.observability.closed_loop else 1.0
    return sum(
        max(laps.difference(values) ** 2, least) * laps.first.size
        for run, laps in data.laps
        for values in residuals.over_noise(run).values()
    )


def noise_ratios(hypothesis: Hypothesis, data: Dataset) -> tuple[dict[str, float], ...]:
    """Mean square over noise of each channel block by block, for each run.

    The input of a block is measured: the ratio of the table is corrected for the noise of the motor encoder that the
    transmission amplifies, that of the motor for the counts of the table encoder that the transmission returns to it.
    """
    residuals = hypothesis.residuals(data)
    of_runs = []
    for index, (run, channels) in enumerate(zip(data.runs, residuals.channels, strict=True)):
        ratios = {name: float(part @ part) / part.size for (of, name), part in residuals.parts.items() if of == index}
        if data.apart:  # no more of it goes through this hypothesis
            of_runs.append(ratios)
            continue
        if ratios.get("table", 0.0) > 1.0:
            added = _amplified_by_transmission(hypothesis, run, channels["table"], data)
            ratios["table"] /= max(1.0, 1.0 + added / run.noise.table_m**2)
        if ratios["motor"] > 1.0 and "table" in ratios:
            scale, part = data.scales()[index]["motor"][run.evaluated], residuals.parts[index, "motor"]
            noise = 1.0 + _returned_to_motor(hypothesis, run, channels, data, scale)
            ratios["motor"] = float(np.mean(part**2 / noise))
        of_runs.append(ratios)
    return tuple(of_runs)


def _amplified_by_transmission(hypothesis: Hypothesis, run: Measured, table: FloatArray, data: Dataset) -> float:
    """Variance [m^2] that noise of the motor encoder adds to the block residual `table` (n,) beyond its direct part.

    The input of the table block is the measured motion of the motor: a lightly damped resonance amplifies its noise.
    """
    noise = run.motor_noise * np.random.default_rng(0).standard_normal(run.motor.size)
    noisy = hypothesis.blocks(replace(run, motor=run.motor + noise), data.observer_s, data.steps, run)["table"]
    added = float(np.var((noisy - table)[run.evaluated]))
    return added - float(np.mean((hypothesis.bench.axis.ratio_m_rad * run.motor_noise[run.evaluated]) ** 2))


def _returned_to_motor(
    hypothesis: Hypothesis, run: Measured, channels: dict[str, FloatArray], data: Dataset, scale: FloatArray
) -> FloatArray:
    """Mean square (n,) that counts of the table add to the block residual of the motor, in units of `scale` (n,).

    While the motor rests the twin holds its table where the encoder reads it. One count of a stiff transmission is a
    torque that moves the motor. Counts that change slowly are no white noise: the table is read again, at other
    places of the counts within the first. All rows near returned noise get its mean, the others none. Other errors of
    the reading are not known to be there at rest.
    """
    axis, table = hypothesis.bench.axis, hypothesis.bench.encoders.table
    added = np.zeros(scale.size)
    place = run.table_m - channels["table"] - axis.ratio_m_rad * channels["motor"]
    if not np.isfinite(place).all():
        return added
    count = min(table.resolution_m if table else 0.0, np.sqrt(12.0) * run.noise.table_m)
    quiet = hypothesis.blocks(replace(run, table_m=place), data.observer_s, data.steps, run)["motor"]
    rng = np.random.default_rng(0)
    for _ in range(_READINGS):
        offset = count * rng.random()
        read = place + _misread(place + offset, count, 0.0, rng)
        other = hypothesis.blocks(replace(run, table_m=read), data.observer_s, data.steps, run)["motor"]
        added += ((other - quiet)[run.evaluated] / scale) ** 2 / _READINGS
    near = maximum_filter1d(added, 2 * round(_NEAR_S / run.period_s) + 1) > 1.0
    if not near.any() or not np.isfinite(added).all():
        return np.zeros(scale.size)
    return np.where(near, np.mean(added[near]), 0.0)
