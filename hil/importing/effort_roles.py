"""Choose the torque or force of an axis among several columns: measured and commanded, by name, unit and motion."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from hil.arrays import FloatArray
from hil.identification.derivatives import MeasuredMotion, motion
from hil.importing.column_names import Label
from hil.importing.lexicon import Constant
from hil.importing.relations import derivative_of, driven, proportional
from hil.quantities import UNITS

NOTHING = 0.02  # share of a column that the motion explains, below which it is no torque of this axis
EXPLAINED = 0.4  # share of a torque that one mass with friction explains: gravity and springs may be more
_DERIVED = 0.5  # share of a velocity that is the derivative of its position: less is another motion
_FOLLOWING = 0.9  # share of a column that its velocity explains, above which it is a following error, no position
_PLACE = 0.99  # share of a column without a word for torque that is the position, above which it is no torque
_WEAK = 0.5  # of the share of the best column: a column of less is another axis, or a part of the torque


@dataclass
class Efforts:
    """Measured and commanded effort (None: not recorded), the other columns with the reason, and notes."""

    measured: str | None = None
    command: str | None = None
    left_out: dict[str, str] = field(default_factory=dict)
    unsure: list[str] = field(default_factory=list)


def choose_efforts(
    live: dict[str, FloatArray],
    labels: dict[str, Label],
    names: list[str],
    moved: MeasuredMotion,
    period_s: float,
    constants: Collection[Constant],
) -> Efforts:
    """Choose among the columns `names` (n,); `constants` are those that the file gives.

    A column that the motion explains hardly or far less than another one is none. Of the others a torque or force comes
    before a current, a whole one before a part such as friction, then the one that the motion explains better. A motor
    that turns makes a torque: where one is named, a force beside its speed is measured elsewhere.
    """
    found = Efforts()
    makes_torque = any(labels[name].si == "N m" for name in names) and _turns(live, labels, moved, period_s)
    shares = {name: max(driven(live[name], moved, period_s).share, 0.0) for name in names}
    for name in list(names):
        one = labels[name]
        if (one.unit in ("%", "permille") and not (one.si or one.electric)) and _is_place(live[name], moved):
            found.left_out[name] = "a position in %, of a travel that the file does not tell"
            names = [other for other in names if other != name]
            del shares[name]
    best = max(shares.values(), default=0.0)
    for name in list(names):
        if (best > NOTHING > shares[name]) or (best > EXPLAINED and shares[name] < _WEAK * best):
            found.left_out[name] = f"inertia and friction of the motion explain {shares[name]:.0%} of it"
            names = [one for one in names if one != name]

    def rank(name: str) -> tuple[bool, int, bool, float]:
        one = labels[name]
        elsewhere = makes_torque and UNITS.get(one.unit or "", ("",))[0] == "N"
        return one.table or elsewhere, _told(one, constants), one.part, -round(shares[name], 2)

    voltage = [name for name in names if (labels[name].unit or labels[name].electric) in ("V", "mV")]
    commands = [name for name in names if labels[name].command or name in voltage]
    measured = [name for name in names if name not in commands]
    commands = [name for name in commands if name not in voltage] or commands
    found.measured = min(measured, key=rank, default=None)
    found.command = min(commands, key=rank, default=None)
    if found.measured and found.command:
        one, other = labels[found.measured], labels[found.command]
        if (one.unit or one.electric) != (other.unit or other.electric):
            found.left_out[found.command] = f"in another unit than {found.measured}"
            found.command = None
    alike = [
        name for name in measured if name != found.measured and found.measured and not labels[found.measured].measured
    ]
    if found.measured and alike:
        others = ", ".join(f"{name} {shares[name]:.0%}" for name in alike)
        found.unsure.append(
            f"{found.measured}: taken for the measured torque: the motion explains {shares[found.measured]:.0%} of it, "
            f"{others}"
        )
    for name in names:
        if name not in (found.measured, found.command):
            found.left_out.setdefault(name, "another torque, force, current or voltage")
    return found


def _is_place(values: FloatArray, moved: MeasuredMotion) -> bool:
    """True if values (n,) are the position of a motion: a torque has friction and inertia of its own."""
    return proportional(moved.position, values).share > _PLACE


def _turns(live: dict[str, FloatArray], labels: dict[str, Label], moved: MeasuredMotion, period_s: float) -> bool:
    """True if a column is the speed of this motion as that of a motor that turns."""
    speeds = [name for name, one in labels.items() if UNITS.get(one.unit or "", ("",))[0] == "rad/s" and name in live]
    return any(derivative_of(live[name], moved, period_s).share > _DERIVED for name in speeds)


def better_speed(
    speeds: dict[str, FloatArray], efforts: list[FloatArray], moved: MeasuredMotion, period_s: float
) -> tuple[str, str] | None:
    """A measured velocity (n,) that tells the motion, with why the position, whose derivative it is not, does not.

    A position that grows with the velocity itself is the following error of a loop without feed-forward. None without
    such a velocity, and where position and velocity are interchanged.
    """
    shares = [derivative_of(values, moved, period_s).share for values in speeds.values()]
    if not speeds or max(shares) >= _DERIVED:
        return None
    for name, values in speeds.items():
        if proportional(moved.position, values).share > _FOLLOWING:
            return name, f"it grows with {name} itself, as a following error does"

    def explained(one: MeasuredMotion) -> float:
        return max(driven(effort, one, period_s).share for effort in efforts)

    if not efforts:
        return None
    by_speed = {name: motion(np.cumsum(values) * period_s, period_s) for name, values in speeds.items()}
    answered = {name: explained(one) for name, one in by_speed.items()}
    name = max(answered, key=lambda one: answered[one])
    interchanged = proportional(moved.position, by_speed[name].acceleration).share > _DERIVED
    if answered[name] <= max(explained(moved), 0.0) + EXPLAINED or interchanged:
        return None
    return name, f"its derivative is not {name}, with which inertia and friction explain the torque better"


def _told(one: Label, constants: Collection[Constant]) -> int:
    """Rank of a column by what the file says of its size: torque or force, by a constant of the file, and others."""
    unit = one.unit or one.electric
    electric = unit in ("A", "mA", "V", "mV")
    constant = {"A": (Constant.TORQUE, Constant.FORCE), "%": (Constant.RATED_TORQUE, Constant.RATED_FORCE)}
    known = {"mA": "A", "permille": "%"}.get(unit or "", unit or "")
    if UNITS.get(unit or "", ("",))[0] in ("N m", "N"):
        return 0 if UNITS[str(unit)][0] == "N m" else 1
    if not electric and known != "%":
        return 2
    if any(one in constants for one in constant.get(known, ())):
        return 3
    return {"%": 4, "A": 5}.get(known, 6)
