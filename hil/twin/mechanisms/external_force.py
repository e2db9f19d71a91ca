"""External force: something pushes the table during a window of time."""

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, Stage, Variant
from hil.twin.parameter import Dimension, Parameter, Role


@njit
def _push(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    force_n, start_s, end_s = parameters[0], parameters[1], parameters[2]
    if at.step_s <= 0.0:
        return value + force_n if start_s <= at.time_s < end_s else value
    # the mean over this step, so that the answer is continuous in start and end
    overlap_s = min(end_s, at.time_s + at.step_s) - max(start_s, at.time_s)
    return value + force_n * max(overlap_s, 0.0) / at.step_s


MECHANISM = Mechanism(
    id="external_force",
    block=Block.TABLE,
    element="surroundings of the table",
    sentence="From {start_s} to {end_s} a force of {force_n} pushes the table in positive direction.",
    equation="F_table = F for start <= t < end, else 0",
    source="Newton's second law; such as the pneumatic cylinder that loads the table of the source's test bench",
    parameters=(
        Parameter("force_n", Dimension.FORCE, -1e5, 1e5, role=Role.STRENGTH),
        Parameter("start_s", Dimension.TIME, 0.0, 1e5, role=Role.EDGE),
        Parameter("end_s", Dimension.TIME, 0.0, 1e5, role=Role.EDGE),
    ),
    variants=(Variant(Stage.TABLE_FORCE, _push),),
    starts=lambda s: [(s.window[2] / s.ratio or 1.0, s.window[0], s.window[1])],
    typical=lambda a: (0.2 * a.friction / a.ratio, 0.5 * a.duration_s, 0.5 * a.duration_s + 1.0),
    transient=True,
)
