"""Constants of an axis, such as its inertia: fitted once over a few recordings, then the same for all.

The inertia is that of the plain model over all of them; the masses of the bench file are scaled to it. The lead is the
bench's where no table is measured. Recordings whose own inertia is far from the median of the first ones are of another
axis and left out, so that one in the wrong folder changes nothing.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.bench.bench_file import Bench
from hil.errors import InputError
from hil.identification.intended_motion import measured_motion
from hil.identification.measured import Measured
from hil.identification.plain_model import fit_plain_model
from hil.identification.residual_scales import factor_of_masses, with_masses

_LIGHTEST = 1e-3  # factor on masses, where held ones have more inertia than the axis
ALIKE = 1.3  # factor on the inertia up to which a recording is of the axis; a heavy workpiece adds less
FITTED, LOOKED_AT = 4, 12  # recordings that are fitted, of the first ones of an axis


@dataclass(frozen=True)
class Constants:
    """Bench of an axis with its measured inertia; inertia [kg m^2, kg] with its standard error; period of its rows [s].

    `fitted` are the names of the recordings.
    """

    bench: Bench
    inertia: float
    inertia_error: float
    period_s: float
    fitted: tuple[str, ...]

    def why_not(self, value: float) -> str:
        """Why a recording with this inertia of its own is of another axis; empty if it is of this one."""
        if _alike(value, self.inertia):
            return ""
        return (
            f"is of another axis: it moves {value / self.inertia:.2g} times the inertia of this one; put it into the "
            "folder of its axis"
        )


def fit_constants(runs: Sequence[Measured], bench: Bench) -> Constants:
    """Fit what is constant to recordings of one axis, in order of their moments; the first of them that agree count.

    Raises InputError if none tells an inertia.
    """
    period_s, _ = Counter(run.period_s for run in runs).most_common(1)[0]
    own = [(run, own_inertia(run)) for run in runs if run.period_s == period_s]
    known = [(run, value) for run, value in own if value is not None]
    if not known:
        raise InputError(
            f"{bench.name}: no recording moves both ways fast enough to tell the inertia; allowed sliding motion with "
            "accelerations; record a check motion"
        )
    middle = float(np.median([value for _, value in known]))
    chosen = [run for run, value in known if _alike(value, middle)][:FITTED]
    model = fit_plain_model([measured_motion(run) for run in chosen])
    assert model is not None  # each of them told one
    told = model["inertia"]
    return Constants(
        with_inertia(bench, told.value), told.value, told.std_error, period_s, tuple(run.name for run in chosen)
    )


def own_inertia(run: Measured) -> float | None:
    """Inertia that one recording tells [kg m^2, kg]; None if it tells none."""
    model = fit_plain_model([measured_motion(run)])
    value = model["inertia"].value if model is not None and model["inertia"].significant else 0.0
    return value if value > 0.0 else None


def with_inertia(bench: Bench, value: float) -> Bench:
    """The bench with its masses, but for those held, scaled to an inertia of the whole axis [kg m^2, kg]."""
    return with_masses(bench, max(factor_of_masses(bench, value), _LIGHTEST))


def _alike(value: float, other: float) -> bool:
    return other / ALIKE <= value <= other * ALIKE
