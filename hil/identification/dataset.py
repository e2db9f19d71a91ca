"""Recordings of one axis prepared for a fit: observer, noise and model discrepancy of each residual."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.errors import InputError
from hil.identification.derivatives import matched
from hil.identification.laps import Laps
from hil.identification.measured import Measured
from hil.identification.observability import Observability, common
from hil.identification.residual_scales import DISCREPANCY, TORQUE_ACCURACY, inertia, scales
from hil.identification.whitening import filtered
from hil.twin.axis import TWIN_STEPS, Steps
from hil.twin.stepping.loops import LEAST_TICKS

# Bounds of the time constant of the motor's observer. Fast: stick-slip decays within a few ticks, so that even a poor
# start converges; below two ticks the sampled observer is unstable on an elastic axis. Slow: a coarse encoder still
# resolves the torque.
FASTEST_OBSERVER_TICKS, FASTEST_OBSERVER_S, SLOWEST_OBSERVER_S = LEAST_TICKS, 0.002, 0.008

# Internal steps of a search: block by block, residuals differ from those at the twin's own by less than 0.25 of the
# noise (rms) for every mechanism but a chattering nut, in a half to a fifth of the time.
SEARCH_STEPS = Steps(100e-6, 500e-6)


class NoiseApart(NamedTuple):
    """A run without the noise of its motion, the rows (n,) that it tells, and what `hil.identification.noise_apart`
    makes of its residuals (n,) by channel.

    `noise` and `measured` (n,) are of a reference with an inertia [motor unit]: what the noise makes, and all that was
    measured. What a twin makes of the motor without noise passes the mean over `window` rows, as the noise did (0:
    none); the sum is filtered by `taps` (k,) and a gain.
    """

    smooth: Measured
    rows: NDArray[np.bool_]
    noise: dict[str, FloatArray]
    measured: dict[str, FloatArray]
    inertia: float
    taps: FloatArray
    gain: float
    window: int

    def of(self, channel: str, free: FloatArray, inertia: float) -> FloatArray:
        """Residual (n,) of a channel with that of the run without noise, of a twin with an inertia [motor unit]."""
        if channel != "motor":
            return np.where(self.rows, free + self.noise[channel], self.measured[channel])
        found = self.measured[channel].copy()
        with np.errstate(over="ignore", invalid="ignore"):  # a hypothesis may be unstable
            lacking = free * (inertia / self.inertia)
            lacking = matched(lacking, self.window) if self.window else lacking
            torque = (lacking + self.noise[channel])[self.rows]
            found[self.rows] = self.gain * filtered(torque, [self.rows], self.taps)
        return found


@dataclass(frozen=True, eq=False)
class Dataset:
    """Recordings of one axis prepared for a fit, with everything that does not depend on the hypothesis.

    `observer_s` is the time constant of the motor's observer in the block residuals, `travel_m` the largest range of
    the position set-points, `steps` are the internal ones of the twin. What nothing explains of a channel counts as
    noise if the channel is in `set_aside`, with the factor on its noise. `apart`: the noise of each run, if it is kept
    apart (`hil.identification.noise_apart`).
    """

    runs: tuple[Measured, ...]
    bench: Bench
    observer_s: float = FASTEST_OBSERVER_S
    travel_m: float = 0.1
    steps: Steps = TWIN_STEPS
    set_aside: Mapping[str, float] = field(default_factory=dict)
    apart: tuple[NoiseApart, ...] = ()
    _scales: dict[tuple[float, float], tuple[dict[str, FloatArray], ...]] = field(
        default_factory=dict, init=False, repr=False
    )

    @cached_property
    def observability(self) -> Observability:
        """Inputs and outputs of the axis that all recordings make known."""
        return common(run.observability for run in self.runs)

    def over(self, runs: Sequence[Measured]) -> "Dataset":
        """Other recordings of the same axis with the same observer, travel, and channels that are set aside."""
        return replace(self, runs=tuple(runs), apart=())

    def louder(self, factors: Mapping[str, float]) -> "Dataset":
        """The same recordings with channels set aside, each with the factor on its noise."""
        return replace(self, set_aside=factors)

    def steps_of(self, fast: bool) -> Steps:
        """Internal steps of the twin; `fast`: those of a search, if they are longer."""
        return Steps(*map(max, self.steps, SEARCH_STEPS)) if fast else self.steps

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
            sizes = [scales(run, self.bench, self.observer_s, torque_accuracy, discrepancy) for run in self.runs]
            self._scales[key] = tuple(
                {name: self.set_aside.get(name, 1.0) * size for name, size in one.items()} for one in sizes
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


def in_turn(runs: Sequence[Measured]) -> list[Measured]:
    """The runs in order of time; none unless each ends before the next begins, as parts of one recording do."""
    if not all(run.time_s[run.evaluated].size for run in runs):
        return []
    ordered = sorted(runs, key=lambda run: float(run.time_s[run.evaluated][0]))
    apart = all(one.time_s[one.evaluated][-1] <= two.time_s[two.evaluated][0] for one, two in pairwise(ordered))
    return ordered if apart else []
