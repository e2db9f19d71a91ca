"""Torque dead zone: the drive answers small commands with no torque."""

from collections.abc import Sequence

from numba import njit

from hil.twin.mechanism import Block, Mechanism, Moment, Row, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts


@njit
def _dead_zone(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    half_width = parameters[0]
    if abs(value) <= half_width:
        return 0.0
    return value - half_width if value > 0.0 else value + half_width


@njit
def _gate(value: float, at: Moment, parameters: Row, memory: Row) -> float:
    return 0.0 if abs(value) <= parameters[0] else value


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the drive gives a torque most of the time in which the axis moves."""
    return axis.driven(values[0]) > 0.5


MECHANISM = Mechanism(
    id="torque_dead_zone",
    block=Block.DRIVE,
    element="servo amplifier",
    equation="T = 0 for |u| <= w, else u - w sign(u); as a gate: else u",
    source="Tao and Kokotović, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996)",
    parameters=(Parameter("half_width_n_m", Dimension.TORQUE, 0.0, 1e3, role=Role.STRENGTH),),
    variants=(
        Variant(Stage.CURRENT, _dead_zone, "measured"),
        Variant(Stage.TORQUE, _dead_zone, "hidden"),
        Variant(Stage.CURRENT, _gate, "measured gate"),
        Variant(Stage.TORQUE, _gate, "hidden gate"),
    ),
    text=Text("The drive gives no torque for commands below {half_width_n_m}.", Picture.CHARACTERISTIC),
    search=SearchHints(
        lambda s: [(f * s.coulomb,) for f in (0.03, 0.15)], lambda a: (0.05 * a.friction,), proportional=False
    ),
    can_be=_valid,
)
