"""External force: something pushes the table during a window of time."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from hil.arrays import FloatArray
from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture

_ONE = "From {start_s} to {end_s} a force of {force_n} acts on the table (positive forwards)."
_SEVERAL = (
    "In {count} windows from {start_s} to {end_s} forces of up to {force_n} act on the table (positive forwards)."
)
_PERIODIC = (
    "From {start_s} to {end_s} a force of {force_n} (positive forwards) acts on the table {count} times, for "
    "{width_s} every {period_s}."
)
_AGAINST = (
    "From {start_s} to {end_s} forces of up to {force_n} act on the table in {count} windows, each against its motion: "
    "friction that comes and goes, such as a brake that drags."
)


@njit
def _push(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    force_n, start_s, end_s = parameters[0], parameters[1], parameters[2]
    if at.step_s <= 0.0:
        return value + force_n if start_s <= at.time_s < end_s else value
    # the mean over this step, so that the answer is continuous in start and end
    overlap_s = min(end_s, at.time_s + at.step_s) - max(start_s, at.time_s)
    return value + force_n * max(overlap_s, 0.0) / at.step_s


def _pushes(time_s: FloatArray, period_s: float, values: Sequence[float]) -> FloatArray:
    """Mean force (n,) over each tick."""
    force_n, start_s, end_s = values
    overlap_s = np.minimum(end_s, time_s + period_s) - np.maximum(start_s, time_s)
    return np.asarray(force_n / period_s * np.maximum(overlap_s, 0.0), dtype=np.float64)


def _sentence(windows: int, periodic: bool, against: bool) -> str:
    return _AGAINST if against else _PERIODIC if periodic else _SEVERAL if windows > 1 else _ONE


MECHANISM = Mechanism(
    id="external_force",
    block=Block.TABLE,
    element="surroundings of the table",
    equation="F_table = F for start <= t < end, else 0",
    source="Newton's second law; such as the pneumatic cylinder that loads the table of the source's test bench",
    parameters=(
        Parameter("force_n", Dimension.FORCE, -1e5, 1e5, role=Role.STRENGTH),
        Parameter("start_s", Dimension.TIME, 0.0, 1e5, role=Role.EDGE),
        Parameter("end_s", Dimension.TIME, 0.0, 1e5, role=Role.EDGE),
    ),
    variants=(Variant(Stage.TABLE_FORCE, _push),),
    text=Text(_ONE, Picture.FORCE, of_windows=_sentence),
    search=SearchHints(
        lambda s: [(level / s.ratio or 1.0, start_s, end_s) for start_s, end_s, level in s.windows],
        lambda a: (0.2 * a.friction / a.ratio, 0.5 * a.duration_s, 0.5 * a.duration_s + 1.0),
    ),
    over_time=_pushes,
)
