"""Units of the positions of an axis: by their names, by other columns, else asked."""

from math import pi

from hil.arrays import FloatArray
from hil.identification.derivatives import MeasuredMotion, motion
from hil.importing.column_names import Label, effort_of_words
from hil.importing.encoder_counts import angle_count, angle_unit
from hil.importing.lexicon import Constant, Quantity
from hil.importing.listed_names import NAMELESS
from hil.importing.map_draft import MapDraft
from hil.importing.relations import SAME_POSITION, proportional
from hil.importing.roles import Roles
from hil.importing.unit_choice import (
    MATCH,
    UnitChoice,
    are_counts,
    is_length,
    position_unit,
    prefers_length,
    unit_by_convention,
    unit_of_nameless,
)
from hil.importing.units import unit_named
from hil.importing.usual_values import USUAL, improbable, screw_units
from hil.quantities import UNITS

_TOLD = {
    "N m": (Constant.TORQUE, Constant.TORQUE_GAIN, Constant.RATED_TORQUE),
    "N": (Constant.FORCE, Constant.FORCE_GAIN, Constant.RATED_FORCE),
}


def effort_si(effort: Label | None, draft: MapDraft) -> str | None:
    """N m or N, as the effort is in by its unit or words, or by the constants of the file; None if nothing tells.

    Of a current the constant says it: that which produces torque makes the force of a linear motor.
    """
    if effort is None or (effort.si and effort.unit not in ("A", "mA")):
        return effort.si if effort else None
    told = {si for si, known in _TOLD.items() if set(known) & set(draft.table.constants)}
    told |= {si for name in draft.table.scalars if "constant" in name.lower() and (si := effort_of_words(name))}
    return told.pop() if len(told) == 1 else effort.si


class PositionUnits:
    """Chooses the unit of each position; `live` are the columns (n,) on an even clock.

    `units` are the units by column, those of `asked` taken only until the user has told them.
    """

    def __init__(
        self, draft: MapDraft, labels: dict[str, Label], roles: Roles, live: dict[str, FloatArray], period_s: float
    ) -> None:
        self.draft, self.labels, self.roles, self.live, self.period_s = draft, labels, roles, live, period_s
        effort = roles.effort or roles.effort_command
        self.effort = labels[effort] if effort else None
        self.units: dict[str, str] = {}
        self.asked: set[str] = set()

    def motion(self, column: str) -> MeasuredMotion:
        """Motion of a column."""
        return motion(self.live[column], self.period_s)

    def speeds(self) -> list[Label]:
        """Measured velocities with a unit."""
        labels = [one for name, one in self.labels.items() if name in self.live]
        return [one for one in labels if one.quantity is Quantity.VELOCITY and one.unit in UNITS and not one.command]

    def choose(self) -> None:
        """Choose the units of all positions."""
        roles, labels, live = self.roles, self.labels, self.live
        positions = [name for name in (roles.command, roles.table, roles.motor) if name]
        far, motor = roles.table or roles.command, roles.motor
        turns = None if self.effort is None else effort_si(self.effort, self.draft) == "N m" or self.effort.electric
        prefers = prefers_length(positions, self.effort, bool(turns))
        by_convention = unit_by_convention(self.effort)
        if prefers is None and by_convention is None and motor and self._says_nothing(motor):
            by_convention = unit_of_nameless(motor, live[motor])
        self.draft.unsure += [by_convention.note] if by_convention and by_convention.note else []
        in_counts = "counts" in [labels[name].unit for name in (far, motor) if name]
        geared = far is not None and labels[far].unit is None and prefers_length([far], None) is False
        if far and motor and not geared and not by_convention and not in_counts and not are_counts(live[motor]):
            relation = proportional(live[far], live[motor])
            pair = screw_units(relation.factor, labels[far].unit, labels[motor].unit)
            if pair and relation.share > SAME_POSITION and None in (labels[far].unit, labels[motor].unit):
                note = f"{far} in {pair[0]} and {motor} in {pair[1]}: with them the travel per turn is a usual lead"
                self._take(far, UnitChoice(pair[0], note))
                self._take(motor, UnitChoice(pair[1]))
        speeds = self.speeds()
        untold = (
            prefers is False and not by_convention and not speeds and all(labels[n].unit is None for n in positions)
        )
        for column in [name for name in (motor, roles.table) if name and untold and name not in self.units]:
            if choice := angle_unit(column, live[column], self._unnamed_speeds(column)):
                self._take(column, choice)
                break
        # columns with a unit first: they are the hints for the others
        open_ones = [name for name in positions if name not in self.units]
        for column in sorted(open_ones, key=lambda name: labels[name].unit is None):
            others = [(proportional(live[column], live[other]), other) for other in positions if other in self.units]
            hints = [(one.factor, self.units[other]) for one, other in others if one.share > SAME_POSITION]
            guessed = any(other in self.asked for _, other in others)
            for speed in speeds:
                relation = proportional(self.motion(column).velocity, live[speed.column])
                if relation.share > SAME_POSITION:
                    si, factor = UNITS[str(speed.unit)]
                    hints.append((relation.factor / factor, si.removesuffix("/s")))
            told = labels[column].unit
            if told is None and by_convention:
                self._take(column, UnitChoice(by_convention.unit, asked=by_convention.asked))
                continue
            told = told or ("rev" if unit_named(column) == "rev" else None)  # U
            choice = position_unit(column, live[column], told, hints, prefers)
            self._take(column, UnitChoice(choice.unit, choice.note, choice.asked or (guessed and told is None)))
        for column, unit in self.units.items():
            self.draft.unsure += (
                improbable(column, live[column], unit, self.period_s) if column not in self.asked else []
            )

    def lead_by_speed(self, motor: str) -> tuple[float, str] | None:
        """Travel per turn of the length `motor` [m], with the speed in turns that tells it; None without one."""
        for speed in self.speeds():
            si, factor = UNITS[str(speed.unit)]
            relation = proportional(self.motion(motor).velocity, self.live[speed.column])
            if si == "rad/s" and is_length(self.units[motor]) and relation.share > SAME_POSITION:
                return 2.0 * pi * abs(relation.factor) * UNITS[self.units[motor]][1] / factor, speed.column
        return None

    def gear_by_speed(self, motor: str) -> tuple[float, str] | None:
        """Turns of the motor's speed for each turn of the angle `motor`, and this speed; None where they are the same.

        A ratio that is nearly whole is whole: teeth are.
        """
        for speed in self.speeds():
            si, factor = UNITS[str(speed.unit)]
            moved, size = self.motion(motor).velocity, UNITS.get(self.units[motor], ("", 1.0))
            relation = proportional(self.live[speed.column], moved)
            if si != "rad/s" or size[0] != "rad" or speed.table or relation.share <= SAME_POSITION:
                continue
            ratio = abs(relation.factor) * factor / size[1]
            if ratio > 1.0 + MATCH and not self.labels[motor].motor:
                whole = round(ratio)
                return (float(whole) if abs(ratio / whole - 1.0) < USUAL else float(f"{ratio:.6g}")), speed.column
        return None

    def count_by_command(self, name: str) -> dict[str, object]:
        """Unit and size of a count of the second encoder by the set-point that it follows; {} if that is no angle."""
        command = self.roles.command
        told = self.labels[command].unit if command else None
        if command is None or told not in UNITS or UNITS[told][0] != "rad" or command in self.asked:
            return {}
        relation = proportional(self.live[command], self.live[name])
        if relation.share <= SAME_POSITION:
            return {}
        size = angle_count(abs(relation.factor), told)
        self.draft.unsure.append(f"{name}: counts of {size:g} {told} are taken, by the set-point {command}")
        return {"unit": told, "scale": size}

    def _take(self, column: str, choice: UnitChoice) -> None:
        self.units[column] = choice.unit
        if choice.asked:
            self.asked.add(column)
        elif choice.note:
            self.draft.unsure.append(choice.note)

    def _says_nothing(self, motor: str) -> bool:
        """True if no column has a unit, and the file has no names, or a velocity that is the derivative as it is."""
        if any(one.unit for name, one in self.labels.items() if name in self.live):
            return False
        same = [abs(factor - 1.0) < MATCH for _, factor in self._unnamed_speeds(motor)]
        return motor in self.roles.how and (motor.startswith(NAMELESS) or any(same))

    def _unnamed_speeds(self, column: str) -> list[tuple[str, float]]:
        """Measured velocities without a unit that are the derivative of `column`, with the derivative over them."""
        speed = self.motion(column).velocity
        names = [one.column for one in self.labels.values() if one.quantity is Quantity.VELOCITY and not one.command]
        found = [(name, proportional(speed, self.live[name])) for name in names if name in self.live]
        return [(name, relation.factor) for name, relation in found if relation.share > SAME_POSITION]
