"""Entries of a drafted map: unit, sign and scale of each channel, with how it was found."""

from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.errors import InputError
from hil.identification.derivatives import MeasuredMotion, motion
from hil.importing.column_names import Label
from hil.importing.effort_entry import effort_entry, signs_of
from hil.importing.encoder_counts import CountSize, angle_unit, assumed, from_length, from_speed, scale_count
from hil.importing.header_rows import NAMELESS
from hil.importing.lexicon import Constant, Quantity
from hil.importing.map_draft import DraftedChannel, MapDraft
from hil.importing.map_file import ChannelSource
from hil.importing.relations import derivative_of, driven, lateness_s, proportional
from hil.importing.roles import SAME_POSITION, Roles
from hil.importing.speed_unit import speed_entry
from hil.importing.unit_choice import (
    MATCH,
    UnitChoice,
    are_counts,
    gives_force,
    is_length,
    misfit,
    position_unit,
    prefers_length,
    unit_by_convention,
    unit_of_nameless,
)
from hil.importing.units import unit_named
from hil.importing.usual_values import LEADS_M, improbable, mixed_up, screw_units, usual_lead
from hil.quantities import ROTARY_LEAD_M, UNITS

SAME_COUNTS = 1e-3  # deviation of the factor between motor and set-point, both in counts: following errors are below
_LEAD_NOT_TOLD = "not told; masses at the table scale with it"
LATE_ROWS = 0.5  # by which a set-point may seem late: its rounding and the sampling of the encoder


class ChannelEntries:
    """Fills a draft with the channels of the roles `roles`; `live` are the columns (n,) on an even clock."""

    def __init__(
        self, draft: MapDraft, labels: dict[str, Label], roles: Roles, live: dict[str, FloatArray], period_s: float
    ) -> None:
        self.draft, self.labels, self.roles, self.live, self.period_s = draft, labels, roles, live, period_s
        effort = roles.effort or roles.effort_command
        self.effort = labels[effort] if effort else None
        self.units: dict[str, str] = {}
        self.kind = AxisKind.ROTARY
        self.motor_sign = 1
        self.per_count = 1.0  # SI units of the motor per count, if it is in counts

    def fill(self) -> None:
        """Add the entries. Raises InputError: no column goes with the motion, or two units contradict each other."""
        roles = self.roles
        if roles.motor is None:
            self._velocity_only()
            return
        self._units_of_positions()
        # the transmission to a second encoder is judged, and a lead turns a length into an angle
        table = roles.table and is_length(self.units[roles.table])
        screw = table or Constant.LEAD in self.draft.table.constants
        linear = is_length(self.units[roles.motor]) and (gives_force(self.effort) or not screw)
        self.kind = AxisKind.LINEAR if linear else AxisKind.ROTARY
        self._positions(roles.motor)
        self._velocity_command()
        self._efforts(self._motion(roles.motor))
        if not (roles.effort or roles.effort_command or roles.table):
            told = "".join(f"{name}: {why}; " for name, why in roles.left_out.items() if "explain" in why)
            raise InputError(
                f"{self.draft.table.path}: {told}beside the position {roles.motor} no torque, force, current, voltage "
                "or second encoder is found; record one, or write its column into a map: hil import FILE --map MAP.yaml"
            )

    def _motion(self, column: str) -> MeasuredMotion:
        return motion(self.live[column], self.period_s)

    def _choose(self, column: str, choice: UnitChoice) -> str:
        self.units[column] = choice.unit
        self.draft.unsure += [choice.note] if choice.note else []
        return choice.unit

    def _add(self, channel: str, column: str, what: str, keys: dict[str, object]) -> None:
        how = f"{what}; {self.roles.how[column]}" if column in self.roles.how else what
        self.draft.channels.append(DraftedChannel(channel, {"column": column, **keys}, how))

    def _units_of_positions(self) -> None:
        roles, labels, live = self.roles, self.labels, self.live
        positions = [name for name in (roles.command, roles.table, roles.motor) if name]
        far, motor = roles.table or roles.command, roles.motor
        prefers, by_convention = prefers_length(positions, self.effort), unit_by_convention(self.effort)
        if prefers is None and by_convention is None and motor and self._says_nothing(motor):
            by_convention = unit_of_nameless(motor, live[motor])
        self.draft.unsure += [by_convention.note] if by_convention else []
        in_counts = "counts" in [labels[name].unit for name in (far, motor) if name]
        geared = far is not None and labels[far].unit is None and prefers_length([far], None) is False
        if far and motor and not geared and not by_convention and not in_counts and not are_counts(live[motor]):
            relation = proportional(live[far], live[motor])
            pair = screw_units(relation.factor, labels[far].unit, labels[motor].unit)
            if pair and relation.share > SAME_POSITION and None in (labels[far].unit, labels[motor].unit):
                note = f"{far} in {pair[0]} and {motor} in {pair[1]}: with them the travel per turn is a usual lead"
                self._choose(far, UnitChoice(pair[0], note))
                self._choose(motor, UnitChoice(pair[1]))
        speeds = [one for one in self._speeds() if one.column in live]
        untold = (
            prefers is False and not by_convention and not speeds and all(labels[n].unit is None for n in positions)
        )
        for column in [name for name in (motor, roles.table) if name and untold and name not in self.units]:
            if choice := angle_unit(column, live[column], self._unnamed_speeds(column)):
                self._choose(column, choice)
                break
        # columns with a unit first: they are the hints for the others
        open_ones = [name for name in positions if name not in self.units]
        for column in sorted(open_ones, key=lambda name: labels[name].unit is None):
            others = [(proportional(live[column], live[other]), other) for other in positions if other in self.units]
            hints = [(one.factor, self.units[other]) for one, other in others if one.share > SAME_POSITION]
            for speed in speeds:
                relation = proportional(self._motion(column).velocity, live[speed.column])
                if relation.share > SAME_POSITION:
                    si, factor = UNITS[str(speed.unit)]
                    hints.append((relation.factor / factor, si.removesuffix("/s")))
            told = labels[column].unit or (by_convention.unit if by_convention else None)
            told = told or ("rev" if unit_named(column) == "rev" else None)  # U
            self._choose(column, position_unit(column, live[column], told, hints, prefers))
        for column, unit in self.units.items():
            self.draft.unsure += improbable(column, live[column], unit, self.period_s)

    def _says_nothing(self, motor: str) -> bool:
        """True if no column has a unit, and the file has no names, or a velocity that is the derivative as it is."""
        if any(one.unit for name, one in self.labels.items() if name in self.live):
            return False
        same = [abs(factor - 1.0) < MATCH for _, factor in self._unnamed_speeds(motor)]
        return motor in self.roles.how and (motor.startswith(NAMELESS) or any(same))

    def _unnamed_speeds(self, column: str) -> list[tuple[str, float]]:
        """Measured velocities without a unit that are the derivative of `column`, with the derivative over them."""
        speed = self._motion(column).velocity
        names = [one.column for one in self.labels.values() if one.quantity is Quantity.VELOCITY and not one.command]
        found = [(name, proportional(speed, self.live[name])) for name in names if name in self.live]
        return [(name, relation.factor) for name, relation in found if relation.share > SAME_POSITION]

    def _speeds(self) -> list[Label]:
        """Measured velocities with a unit."""
        labels = self.labels.values()
        return [one for one in labels if one.quantity is Quantity.VELOCITY and one.unit in UNITS and not one.command]

    def _positions(self, name: str) -> None:
        """Add the motor's position `name`, the lead, and the other positions."""
        draft, roles, live, motor = self.draft, self.roles, self.live, self.units[name]
        keys: dict[str, object] = {"unit": motor}
        far = [other for other in (roles.table, roles.command) if other]
        relations = {other: proportional(live[other], live[name]) for other in far}
        trusted = [other for other in far if relations[other].share > 0.9]
        reference = roles.command if roles.command in trusted else (trusted[0] if trusted else None)
        if reference and relations[reference].factor < 0.0:
            self.motor_sign = -1
            draft.unsure.append(f"{name}: falls while {reference} grows; its sign is turned")
        length = next((other for other in trusted if is_length(self.units[other])), None)
        if motor == "counts":
            size = self._count_size(name, length, relations[length].factor if length else 0.0)
            keys |= size.entry
            draft.unsure += [size.note] if size.note else []
            motor, self.per_count = size.unit, size.per_count
            self.kind = AxisKind.ROTARY if motor == "rad" else AxisKind.LINEAR
        if self.kind is AxisKind.ROTARY:
            told = draft.table.constants.get(Constant.LEAD)
            if is_length(motor):
                draft.lead_m = told.value if told else LEADS_M[0]
                draft.lead_how = f"header of the file: {told.text}" if told else _LEAD_NOT_TOLD
                keys |= {"unit": "rad", "scale": UNITS[motor][1] * 2.0 * pi / draft.lead_m}
                advice = f" ({draft.lead_how})" if told else ": correct scale and lead"
                draft.unsure.append(f"{name}: is in a length; {1e3 * draft.lead_m:g} mm per turn are taken{advice}")
            elif length is not None:
                per_turn = abs(relations[length].factor) * UNITS[self.units[length]][1] / self.per_count
                lead_m = 2.0 * pi * per_turn / UNITS[motor][1]
                nominal = told is not None and abs(told.value / lead_m - 1.0) < MATCH
                draft.lead_m = told.value if told and nominal else float(f"{usual_lead(lead_m):.6g}")
                draft.lead_how = f"travel of {length} per turn of {name}"
            else:
                draft.lead_m = ROTARY_LEAD_M
                draft.lead_how = "a rotary axis: one metre of the load stands for one radian"
        keys |= {"sign": -1} if self.motor_sign < 0 else {}
        self._add(AXIS_CHANNELS[self.kind].motor_position, name, "the motor's encoder", keys)
        for other, channel, what in (
            (roles.table, "table_position_m", "the second encoder"),
            (roles.command, "position_command_m", "the set-point"),
        ):
            if other is not None:
                factor, share = relations[other].factor * self.motor_sign, relations[other].share
                self._far(other, channel, what, factor, share, motor)

    def _far(self, name: str, channel: str, what: str, factor: float, share: float, motor: str) -> None:
        """Set-point or second encoder: check sign and scale against the motor."""
        unsure, encoder, unit = self.draft.unsure, str(self.roles.motor), self.units[name]
        keys: dict[str, object] = {"unit": unit}
        if share < 0.5:
            unsure.append(f"{name}: does not follow {encoder} (share {share:.2f}); check that it is {what}")
        elif factor < 0.0:
            keys["sign"] = -1
            unsure.append(f"{name}: falls while {encoder} grows; its sign is turned")
        if share >= 0.5 and "counts" not in (unit, self.units[encoder]):
            ratio = misfit(factor, unit, motor) if UNITS[unit][0] == UNITS[motor][0] else 1.0
            mixed = mixed_up(ratio)
            if mixed:
                raise InputError(
                    f"{self.draft.table.path}: {name} in {unit} moves {ratio:.4g} times as far as {encoder} "
                    f"in {motor}: one of the two units is wrong ({mixed}?); correct it in the header, or write a map"
                )
            if abs(ratio - 1.0) > 2.0 * MATCH and share > 0.9:
                unsure.append(f"{name}: moves {ratio:.6g} times as far as {encoder}: a gear, or a wrong unit")
        if channel == "position_command_m" and share > SAME_POSITION:
            late_s = lateness_s(self.live[name], self._motion(encoder))
            if late_s > LATE_ROWS * self.period_s:
                unsure.append(
                    f"{name}: comes {1e3 * late_s:.3g} ms after {encoder}, a set-point comes before: its "
                    "stamps are late, or the drive leads it; the control law cannot be judged with it as it is"
                )
        if unit == "counts":  # of the motor's encoder, as in the set-points of a drive
            same = abs(abs(factor) - 1.0) < SAME_COUNTS
            per_count = self.per_count / (1.0 if same else abs(factor))
            lever = (self.draft.lead_m or 0.0) / (2.0 * pi) if motor == "rad" else 1.0
            per_m = scale_count(1.0 / (per_count * lever)) if lever and channel == "table_position_m" else None
            if per_m is not None and not same:
                keys |= {"counts_per_m": per_m}
                unsure.append(
                    f"{name}: counts of {1e6 / per_m:g} um are taken: measured {1e6 * per_count * lever:.6g} um"
                )
            elif motor == "m":
                keys |= {"counts_per_m": float(f"{1.0 / per_count:.8g}")}
            else:  # a screw's angle beside its lead is a length
                length = channel == "table_position_m" and lever not in (0.0, 1.0)
                unit, size = ("m", per_count * lever) if length else (motor, per_count)
                keys |= {"unit": unit, "scale": float(f"{size:.8g}")}
        self._add(channel, name, what, keys)

    def _count_size(self, motor: str, length: str | None, factor: float) -> CountSize:
        """Size of a count of the motor's encoder; `factor` is length over counts."""
        for constant in (Constant.COUNTS, Constant.COUNTS_PER_M):
            if (told := self.draft.table.constants.get(constant)) is not None:
                note = f"{motor}: its counts are taken from the header of the file: {told.text}"
                return CountSize({constant.value: told.value}, note)
        moved = self._motion(motor)
        for one in self._speeds():
            relation = derivative_of(self.live[one.column], moved, self.period_s) if one.column in self.live else None
            if relation and relation.share > SAME_POSITION:
                return from_speed(1.0 / relation.factor, str(one.unit))
        if length:
            return from_length(motor, 1.0 / factor, self.units[length], length, gives_force(self.effort))
        return assumed(motor)

    def _velocity_command(self) -> None:
        name, command = self.roles.velocity_command, self.roles.command
        if name is None:
            return
        if command is None:
            self.draft.left_out[name] = "a velocity set-point without a position set-point"
            return
        entry = next(one.entry for one in self.draft.channels if one.channel == "position_command_m")
        source, live = ChannelSource.model_validate(entry), self.live
        motor = live[str(self.roles.motor)]
        found = speed_entry(
            self.labels[name], live[name], live[command], motor, self.period_s, source, self.draft.lead_m
        )
        self.draft.unsure += [found.note] if found.note else []
        if found.channel:
            self.draft.channels.append(DraftedChannel(found.channel, {"column": name, **found.keys}, found.how))
        else:
            self.draft.left_out[name] = found.how

    def _efforts(self, moved: MeasuredMotion) -> None:
        names = AXIS_CHANNELS[self.kind]
        pairs = ((self.roles.effort, names.torque), (self.roles.effort_command, names.torque_command))
        given = [(column, channel) for column, channel in pairs if column is not None]
        efforts = [self.live[column] for column, _ in given]
        causes = [driven(values, moved, self.period_s) for values in efforts]
        for (column, channel), cause, sign in zip(given, causes, signs_of(efforts, causes, moved), strict=True):
            keys, notes = effort_entry(self.labels[column], self.kind, self.draft.table, cause, sign * self.motor_sign)
            self.draft.unsure += notes
            self._add(channel, column, f"inertia and friction explain {100 * max(cause.share, 0):.0f} % of it", keys)

    def _velocity_only(self) -> None:
        """A recording with velocity in place of position."""
        name = self.roles.motor_velocity
        assert name
        unit = self.labels[name].unit or "rad/s"
        self.draft.unsure += [] if self.labels[name].unit else [f"{name}: no unit is given; rad/s is taken"]
        self.kind = AxisKind.LINEAR if is_length(unit) else AxisKind.ROTARY
        self._add(AXIS_CHANNELS[self.kind].motor_velocity, name, "no position is recorded", {"unit": unit})
        self._efforts(motion(np.cumsum(self.live[name]) * self.period_s, self.period_s))
