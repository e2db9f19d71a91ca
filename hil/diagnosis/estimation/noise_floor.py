"""The noise floor of a residual: from repeated laps where there are any, else white sensor noise.

Where the same set-points come again after a lag p, what the axis does again is repeatable, and no noise:

    sigma^2 = mean (r_k - r_{k+p})^2 / 2        over all rows k whose set-points repeat

sigma is the non-repeatable part of the residual r, the rest of its energy repeats lap by lap and is physics that a
better twin would explain. In closed loop the axis itself moves with the noise of its encoders: see `shaken`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import Fit
from hil.diagnosis.estimation.hypothesis import scales
from hil.identification.dataset import Measured

Rows = NDArray[np.intp]

# A term that makes neighbouring laps differ by more than they do, in energy, is refuted. Most terms repeat with the
# motion and leave this at 1; refitting the others moves it by less.
REPEATS = 0.95
_LAGS = 6  # strongest lags of the set-points that are tried
_NEAR = 30  # rows about a peak of the correlation in which the lag is sought
_SAME_M = 2e-6  # set-points closer than this are the same: printed ones are rounded
_SETTLED_S = 0.3  # set-points must have been the same for so long: the axis remembers what came before
_ENOUGH_S = 1.0  # of repeated motion, to call a floor measured
# A channel that moves by less than this share of its sensor's noise may do so as it likes. One axis with coarse counts
# was measured to move by three times its noise; a loop that is chaotic moves by tens and more. The torque is no measure
# of that: one coarse count, and a loop of high gain, make many times the noise of a good current sensor.
_LITTLE, _LARGE = 0.3, 5.0
_HALF = 0.75  # of what all of the noise does: half of it does 0.5 in a linear loop, 1 in a chaotic one


@dataclass(frozen=True, eq=False)
class Laps:
    """Rows whose set-points come again, and the rows where they do, each (m,)."""

    first: Rows
    again: Rows
    lag_s: float  # the lag that repeats most

    def noise(self, residual: FloatArray) -> float:
        """Standard deviation of what does not repeat of a residual (n,)."""
        return float(np.sqrt(np.mean((residual[self.first] - residual[self.again]) ** 2) / 2.0))


@dataclass(frozen=True)
class Floor:
    """Noise floor of one channel in its unit, and how it is known."""

    rms: float
    source: Literal["repeated_laps", "white_noise"]


def floor(residual: FloatArray, white: float, laps: Laps | None) -> Floor:
    """Floor of a residual (n,): what does not repeat, never below the sensor's `white` noise."""
    if laps is None:
        return Floor(white, "white_noise")
    return Floor(max(laps.noise(residual), white), "repeated_laps")


def shaken(found: Fit, run: Measured) -> dict[str, float]:
    """By how much the axis moves, rms of motor, table and torque, because its encoders count and are noisy.

    The twin in closed loop with encoders that are right and with some that are not: what they differ by no twin
    foretells, since nobody knows where between two counts the axis began. Only a little of it is noise: where half as
    much does not move the axis by about half, or motor or table move by several times their sensor's noise, the loop
    is chaotic, and 0 is returned.
    """
    twin, bench = found.model.twin(found.x), found.model.bench
    quiet = found.model.respond(found.x, run)
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
        other = twin.simulate(run.position_command_m, run.velocity_command_m_s, run.start, run.table_m, share * misread)
        return {
            name: rms((a - b)[run.judged])
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
    """Noise of the sensors of motor, table and torque over a run, rms."""
    return {"motor": rms(run.motor_noise[run.judged]), "table": run.noise.table_m, "torque": run.noise.torque}


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def _misread(values: FloatArray, count: float, noise: FloatArray | float, rng: np.random.Generator) -> FloatArray:
    """What an encoder says beside the truth (n,): its counting, and white noise for what is more than that."""
    counted = count * np.round(values / count) - values if count else np.zeros_like(values)
    more = np.sqrt(np.maximum(np.square(noise) - count**2 / 12.0, 0.0))
    return np.asarray(counted + more * rng.standard_normal(values.size))


def laps(run: Measured) -> Laps | None:
    """The repeated motion in a run; None where nothing moves in the same way twice."""
    position, velocity = run.position_command_m, run.velocity_command_m_s
    matched = np.zeros(position.size, dtype=bool)
    settled = max(round(_SETTLED_S / run.period_s), 1)
    first, again, best, longest = list[Rows](), list[Rows](), 0.0, 0
    # neighbouring laps first, and each row once: laps far apart also differ by what drifts, which is no noise
    for lag in sorted(_lags(position, velocity)):
        same = np.abs(position[:-lag] - position[lag:]) < _SAME_M
        # the same for a while before: a running count since the last difference
        different = np.flatnonzero(~same)
        since = np.full(same.size, -1)
        since[different] = different
        since = np.arange(same.size) - np.maximum.accumulate(since)
        moving = np.abs(velocity[:-lag]) > 1e-3 * np.max(np.abs(velocity))
        rows = np.flatnonzero((since > settled) & moving & ~matched[:-lag])
        matched[rows] = True
        first.append(rows)
        again.append(rows + lag)
        if rows.size > longest:
            best, longest = lag * run.period_s, rows.size
    if longest * run.period_s < _ENOUGH_S:
        return None
    return Laps(np.concatenate(first), np.concatenate(again), best)


def _lags(position: FloatArray, velocity: FloatArray) -> list[int]:
    """Lags [rows] at which the set-points resemble themselves most, best first."""
    n = velocity.size
    size = 1 << (2 * n - 1).bit_length()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(velocity, size)) ** 2, size)[:n]
    peaks = (
        np.flatnonzero(
            (correlation[1:-1] > correlation[:-2])
            & (correlation[1:-1] >= correlation[2:])
            & (correlation[1:-1] > 0.05 * correlation[0])
        )
        + 1
    )
    # the shorter the overlap, the smaller the sum: its peaks stand a few rows too early
    found = (
        min(
            range(max(peak - _NEAR, 1), min(peak + _NEAR, n - 1)),
            key=lambda lag: float(np.mean(np.abs(position[: n - lag : 7] - position[lag::7]))),
        )
        for peak in peaks[np.argsort(correlation[peaks])[::-1][:_LAGS]].tolist()
    )
    return list(dict.fromkeys(found))


def all_laps(runs: Sequence[Measured]) -> list[tuple[Measured, Laps]]:
    """The runs in which something repeats, with their laps."""
    return [(run, found) for run in runs if (found := laps(run)) is not None]


def unrepeated(found: Fit, repeated: Sequence[tuple[Measured, Laps]]) -> float:
    """Energy of what differs from lap to lap, in units of noise; 0 without laps."""
    total = 0.0
    for run, known in repeated:
        scale = scales(run, found.model.bench, found.model.observer_s)
        total += sum(
            (known.noise(values / scale[name])) ** 2 * known.first.size
            for name, values in found.model.blocks(found.x, run).items()
        )
    return total
