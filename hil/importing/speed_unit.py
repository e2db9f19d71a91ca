"""Map entry of a speed set-point: its unit or scale, by its factor to the derivative of the position set-point."""

from dataclasses import dataclass, field

from hil.arrays import FloatArray
from hil.channels import SPEED_SET_POINT
from hil.identification.derivatives import motion, smoothed
from hil.importing.column_names import Label
from hil.importing.map_file import ChannelSource
from hil.importing.relations import Relation, derivative_of, explained, proportional
from hil.importing.unit_choice import ANGULAR_SPEEDS, LINEAR_SPEEDS
from hil.quantities import si_factor

FOLLOWS = 0.9  # share from which a speed is the derivative of the set-point
_SAME = 0.1  # deviation of a speed from that derivative: a following error is below, other units are far
# Shares of a speed set-point: what the velocity of the position set-point must leave, and the most of this that the
# following error may leave, if it is the output of the position loop.
LEAST_LEFT, LOOP_LEAVES = 1e-4, 0.25


@dataclass(frozen=True)
class SpeedEntry:
    """Channel of a speed set-point (None: it is not used), its keys, how it was found, and a note ("" without one)."""

    channel: str | None
    how: str
    keys: dict[str, object] = field(default_factory=dict)
    note: str = ""


def speed_entry(
    told: Label,
    speed: FloatArray,
    command: FloatArray,
    motor: FloatArray,
    period_s: float,
    position: ChannelSource,
    lead_m: float | None,
) -> SpeedEntry:
    """Entry of a `speed` (n,) beside the position set-point `command` (n,), whose entry is `position`."""
    name = told.column
    moved = motion(command, period_s)
    relation = derivative_of(speed, moved, period_s)
    channel, how = "velocity_command_m_s", f"the derivative of {position.column}"
    error = command - proportional(command, motor).factor * motor
    if _holds(smoothed(speed, period_s), moved.velocity, smoothed(error, period_s)):
        channel, how = SPEED_SET_POINT, "output of the position loop: it holds the following error"
    elif relation.share < FOLLOWS:
        return SpeedEntry(None, f"no derivative of {position.column} (share {relation.share:.2f})")
    unit = speed_unit(told.unit, relation, position, lead_m)
    sign: dict[str, object] = {"sign": -1} if (relation.factor < 0.0) != (position.sign < 0) else {}
    if unit is not None:
        return SpeedEntry(channel, how, {"unit": unit, **sign})
    if told.unit is None:
        si, size = _size(position)
        scale = float(f"{abs(size / relation.factor):.8g}")
        note = f"{name}: no unit is given; {scale:.6g} is its scale to the derivative of {position.column}"
        return SpeedEntry(channel, f"{how}, which gives its scale", {"unit": f"{si}/s", "scale": scale, **sign}, note)
    why = f"in {told.unit} no velocity: {abs(relation.factor):.4g} x the derivative of {position.column}"
    return SpeedEntry(None, why, note=f"{name}: {why} in {position.unit}, which no unit explains; it is not used")


def speed_unit(told: str | None, relation: Relation, position: ChannelSource, lead_m: float | None) -> str | None:
    """Unit of a speed = `relation` x the derivative of a `position`; None if none, or not the `told` one, fits."""
    si, size = _size(position)
    own, others = (LINEAR_SPEEDS, ANGULAR_SPEEDS) if si == "m" else (ANGULAR_SPEEDS, LINEAR_SPEEDS)
    for unit in [told] if told else [*own, *others]:
        factor = si_factor(unit, f"{si}/s", lead_m)
        fits = factor is not None and abs(abs(factor * relation.factor / size) - 1.0) < _SAME
        if fits or (factor is not None and told and relation.share < FOLLOWS):
            return unit
    return None


def _size(position: ChannelSource) -> tuple[str, float]:
    """SI unit of a position, and its factor to it."""
    return next((si, size) for si in ("m", "rad") if (size := position.factor_to(si, None)) is not None)


def _holds(speed: FloatArray, velocity: FloatArray, error: FloatArray) -> bool:
    """True if the following error explains most of what the velocity of the set-point leaves of a speed (n,)."""
    alone, both = explained(speed, velocity), explained(speed, velocity, error)
    return 1.0 - alone > LEAST_LEFT and 1.0 - both < LOOP_LEAVES * (1.0 - alone)
