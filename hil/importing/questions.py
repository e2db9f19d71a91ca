"""Questions beside keys of a drafted map that the file does not tell, with the lines that the user writes."""

from collections.abc import Iterable

from hil.channels import AXIS_CHANNELS, AxisKind
from hil.errors import listed

_SIDE = ("motor_position", "motor_velocity", "torque", "torque_command")  # channels that each kind of axis has
_OR_SCREW = (
    "or a length such as mm, and above the line 'channels:' the line lead_m: VALUE, the metres per revolution of the "
    "motor, such as 0.010"
)
_COUNTS = "or counts, and below it the line counts_per_rev: VALUE"


def position_unit(kind: AxisKind, channels: Iterable[str], nameless: bool) -> str:
    """Question for the unit of a position among `channels`; `nameless`: that it is one was found by relations."""
    if kind is AxisKind.ROTARY:
        return (
            f"its unit is not in the file; write rad, deg, rev; {_COUNTS}; {_OR_SCREW}; or of a linear motor m or mm, "
            f"and {_renamed(kind, channels)}"
        )
    speed = (
        " If it is a velocity, write motor_velocity_m_s in place of motor_position_m and here m/s, mm/s or m/min; of a "
        "motor that turns motor_velocity_rad_s and rpm, rad/s or deg/s"
    )
    return (
        f"its unit is not in the file; write m, mm, um or in. If the motor turns, write {_renamed(kind, channels)}, "
        f"and here rad, deg or rev, {_COUNTS}.{speed if nameless else ''}"
    )


def speed_unit(length: bool) -> str:
    """Question for the unit of a velocity."""
    return f"its unit is not in the file; write {'m/s, mm/s or m/min' if length else 'rad/s, deg/s, rpm or rev/s'}"


def effort_unit(kind: AxisKind) -> str:
    """Question for the unit of a torque or force."""
    units, si, key = (
        ("N", "N", "force_constant_n_a") if kind is AxisKind.LINEAR else ("N m, mN m", "N m", "torque_constant_n_m_a")
    )
    return (
        f"its unit is not in the file; write {units}; or A, and below it the line {key}: VALUE; or %, and below it the "
        f"line rated: VALUE, the {si} at 100 %"
    )


def counts_of_scale() -> str:
    """Question for the counts of a second encoder on an axis whose lead is known."""
    return "write the counts per metre of the scale; of an encoder that turns counts_per_rev, and remove lead_m"


def counts_like(encoder: str, channel: str, ratio: float | None) -> str:
    """Question for the counts of a channel beside those of `encoder`, by its counts over them; None: the same."""
    size = f"the same as for {encoder}" if ratio is None else f"{ratio:.6g} times that of {encoder}"
    if channel == "table_position_m":
        far = "" if ratio is None else "those per revolution of the load; on the motor's shaft "
        return f"write {far}{size}; of a linear scale counts_per_m, and lead_m above the line 'channels:'"
    gear = "; behind a gear times its ratio" if channel == "position_command_m" and ratio is None else ""
    return f"write {size}{gear}"


def missing_column(what: str, columns: Iterable[str], channel: str) -> str:
    """Question for the column of `channel`, which none was found to be."""
    other = {
        "motor_position_rad": "; if it is a velocity, write motor_velocity_rad_s in place of motor_position_rad; on a "
        "linear axis motor_position_m or motor_velocity_m_s, and force_n in place of torque_n_m"
    }.get(channel, "")
    return f"no column is known to be {what}; write the name of one of: {listed(columns)}{other}"


def _renamed(kind: AxisKind, channels: Iterable[str]) -> str:
    """Names of channels on the other kind of axis: motor_position_rad in place of motor_position_m."""
    (other,) = set(AxisKind) - {kind}
    pairs = [(getattr(AXIS_CHANNELS[kind], side), getattr(AXIS_CHANNELS[other], side)) for side in _SIDE]
    names = AXIS_CHANNELS[kind]
    given = set(channels) & {old for old, _ in pairs} or {names.motor_position, names.torque}
    return " and ".join(f"{new} in place of {old}" for old, new in pairs if old in given)
