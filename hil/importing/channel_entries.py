"""Entries of a drafted map: unit, sign and scale of each channel, with how it was found."""

from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AXIS_CHANNELS, SPEED_SET_POINT, AxisKind
from hil.errors import InputError
from hil.identification.derivatives import Motion, motion, smoothed
from hil.importing.column_names import Label
from hil.importing.effort import effort_entry, signs_of
from hil.importing.encoder_counts import CountSize, assumed, from_length, from_speed
from hil.importing.header_values import Constant
from hil.importing.map_draft import DraftedChannel, MapDraft
from hil.importing.relations import derivative_of, driven, explained, lateness_s, proportional
from hil.importing.roles import SAME_POSITION, Roles
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
    velocity_unit,
)
from hil.importing.usual_values import LEADS_M, ROTARY_LEAD_M, mixed_up, screw_units, usual_lead
from hil.quantities import UNITS

SAME_COUNTS = 1e-3  # deviation of the factor between motor and set-point, both in counts: following errors are below
LATE_ROWS = 0.5  # by which a set-point may seem late: its rounding and the sampling of the encoder
# Shares of a speed set-point: what the velocity of the position set-point must leave, and the most of this that the
# following error may leave, if it is the output of the position loop.
LEAST_LEFT, LOOP_LEAVES = 1e-4, 0.25


class ChannelEntries:
    """Fills a draft with the channels of the roles `roles`; `live` are the columns (n,) on an even clock."""

    def __init__(
        self, draft: MapDraft, labels: dict[str, Label], roles: Roles, live: dict[str, FloatArray], period_s: float
    ) -> None:
        self.draft, self.labels, self.roles, self.live, self.period_s = draft, labels, roles, live, period_s
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
        moved = motion(self.live[roles.motor], self.period_s)
        self._units_of_positions()
        linear = is_length(self.units[roles.motor]) and not self._drives_a_table()
        self.kind = AxisKind.LINEAR if linear else AxisKind.ROTARY
        names = AXIS_CHANNELS[self.kind]
        self._positions(names.motor_position)
        self._velocity_command()
        self._efforts(moved)
        if not (roles.effort or roles.effort_command or roles.table):
            raise InputError(
                f"{self.draft.table.path}: beside the position {roles.motor} no torque, force, current, voltage or "
                "second encoder is found; record one, or write its column into a map: hil import FILE --map MAP.yaml"
            )

    def _choose(self, column: str, choice: UnitChoice) -> None:
        self.units[column] = choice.unit
        if choice.note:
            self.draft.unsure.append(choice.note)

    def _units_of_positions(self) -> None:
        roles, labels, live = self.roles, self.labels, self.live
        positions = [name for name in (roles.command, roles.table, roles.motor) if name]
        prefers, by_convention = prefers_length(positions, self._effort), unit_by_convention(self._effort)
        self.draft.unsure += [by_convention.note] if by_convention else []
        guessed = () if by_convention else (roles.table, roles.command)
        far, motor = next((name for name in guessed if name), None), roles.motor
        if far and motor and "counts" not in (labels[far].unit, labels[motor].unit) and not are_counts(live[motor]):
            relation = proportional(live[far], live[motor])
            pair = screw_units(relation.factor, labels[far].unit, labels[motor].unit)
            if pair and relation.share > SAME_POSITION and None in (labels[far].unit, labels[motor].unit):
                note = f"{far} in {pair[0]} and {motor} in {pair[1]}: with them the travel per turn is a usual lead"
                self._choose(far, UnitChoice(pair[0], note))
                self._choose(motor, UnitChoice(pair[1]))
        # columns with a unit first: they are the hints for the others
        for column in sorted(set(positions) - set(self.units), key=lambda name: labels[name].unit is None):
            hints = [
                (proportional(live[column], live[other]).factor, self.units[other])
                for other in positions
                if other in self.units and proportional(live[column], live[other]).share > SAME_POSITION
            ]
            for name, one in labels.items():
                if one.quantity == "velocity" and one.unit and name in live and not one.command:
                    relation = proportional(motion(live[column], self.period_s).velocity, live[name])
                    if relation.share > SAME_POSITION:
                        hints.append((relation.factor / UNITS[one.unit][1], UNITS[one.unit][0].removesuffix("/s")))
            told = labels[column].unit or (by_convention.unit if by_convention else None)
            self._choose(column, position_unit(column, live[column], told, hints, prefers))

    @property
    def _effort(self) -> Label | None:
        name = self.roles.effort or self.roles.effort_command
        return self.labels[name] if name else None

    def _drives_a_table(self) -> bool:
        """True with a second encoder, unless the motor gives a force: the transmission between them is then judged."""
        return (
            self.roles.table in self.units and is_length(self.units[str(self.roles.table)]) and not self._gives_force()
        )

    def _gives_force(self) -> bool:
        return gives_force(self._effort)

    def _positions(self, channel: str) -> None:
        roles, live = self.roles, self.live
        assert roles.motor is not None
        motor = self.units[roles.motor]
        entry: dict[str, object] = {"column": roles.motor, "unit": motor}
        far = [name for name in (roles.table, roles.command) if name]
        relations = {name: proportional(live[name], live[roles.motor]) for name in far}
        trusted = [name for name in far if relations[name].share > 0.9]
        reference = roles.command if roles.command in trusted else (trusted[0] if trusted else None)
        if reference and relations[reference].factor < 0.0:
            self.motor_sign = -1
            self.draft.unsure.append(f"{roles.motor}: falls while {reference} grows; its sign is turned")
        length = next((name for name in trusted if is_length(self.units[name])), None)
        if motor == "counts":
            size = self._count_size(length, relations[length].factor if length else 0.0)
            entry |= size.entry
            self.draft.unsure += [size.note] if size.note else []
            motor, self.per_count = size.unit, size.per_count
            self.kind = AxisKind.ROTARY if motor == "rad" else AxisKind.LINEAR
            channel = AXIS_CHANNELS[self.kind].motor_position
        if self.kind is AxisKind.ROTARY:
            told = self.draft.table.constants.get(Constant.LEAD)
            if is_length(motor):
                lead_m = told.value if told else LEADS_M[0]
                entry |= {"unit": "rad", "scale": UNITS[motor][1] * 2.0 * pi / lead_m}
                how = f"header of the file: {told.text}" if told else "not told; masses at the table scale with it"
                self.draft.lead_m, self.draft.lead_how = lead_m, how
                self.draft.unsure.append(
                    f"{roles.motor}: is in a length; {1e3 * lead_m:g} mm per turn are taken"
                    + (f" ({how})" if told else ": correct scale and lead")
                )
            elif length is not None:
                per_turn = abs(relations[length].factor) * UNITS[self.units[length]][1] / self.per_count
                lead_m = 2.0 * pi * per_turn / UNITS[motor][1]
                nominal = told is not None and abs(told.value / lead_m - 1.0) < MATCH
                self.draft.lead_m = told.value if told and nominal else float(f"{usual_lead(lead_m):.6g}")
                self.draft.lead_how = f"travel of {length} per turn of {roles.motor}"
            else:
                self.draft.lead_m = ROTARY_LEAD_M
                self.draft.lead_how = "a rotary axis: one metre of the load stands for one radian"
        if self.motor_sign < 0:
            entry["sign"] = -1
        self.draft.channels.append(DraftedChannel(channel, entry, self._how(roles.motor, "the motor's encoder")))
        for name, target, what in (
            (roles.table, "table_position_m", "the second encoder"),
            (roles.command, "position_command_m", "the set-point"),
        ):
            if name is not None:
                self._far(name, target, what, relations[name].factor * self.motor_sign, relations[name].share, motor)

    def _far(self, name: str, channel: str, what: str, factor: float, share: float, motor: str) -> None:
        """Set-point or second encoder: check sign and scale against the motor."""
        unit = self.units[name]
        entry: dict[str, object] = {"column": name, "unit": unit}
        if share < 0.5:
            self.draft.unsure.append(
                f"{name}: does not follow {self.roles.motor} (share {share:.2f}); check that it is {what}"
            )
        elif factor < 0.0:
            entry["sign"] = -1
            self.draft.unsure.append(f"{name}: falls while {self.roles.motor} grows; its sign is turned")
        if share >= 0.5 and "counts" not in (unit, self.units[str(self.roles.motor)]):
            same = UNITS[unit][0] == UNITS[motor][0]
            ratio = misfit(factor, unit, motor) if same else 1.0
            mixed = mixed_up(ratio)
            if mixed:
                raise InputError(
                    f"{self.draft.table.path}: {name} in {unit} moves {ratio:.4g} times as far as {self.roles.motor} "
                    f"in {motor}: one of the two units is wrong ({mixed}?); correct it in the header, or write a map"
                )
            if abs(ratio - 1.0) > 2.0 * MATCH and share > 0.9:
                self.draft.unsure.append(
                    f"{name}: moves {ratio:.6g} times as far as {self.roles.motor}: a gear, or a wrong unit"
                )
        if channel == "position_command_m" and share > SAME_POSITION:
            late_s = lateness_s(self.live[name], motion(self.live[str(self.roles.motor)], self.period_s))
            if late_s > LATE_ROWS * self.period_s:
                self.draft.unsure.append(
                    f"{name}: comes {1e3 * late_s:.3g} ms after {self.roles.motor}, a set-point comes before: its "
                    "stamps are late, or the drive leads it; the control law cannot be judged with it as it is"
                )
        if unit == "counts":  # of the motor's encoder, as in the set-points of a drive
            same = abs(abs(factor) - 1.0) < SAME_COUNTS
            per_count = self.per_count / (1.0 if same else abs(factor))
            if motor == "m":
                entry |= {"counts_per_m": float(f"{1.0 / per_count:.8g}")}
            else:
                entry |= {"unit": motor, "scale": float(f"{per_count:.8g}")}
        self.draft.channels.append(DraftedChannel(channel, entry, self._how(name, what)))

    def _count_size(self, length: str | None, factor: float) -> CountSize:
        """Size of a count of the motor's encoder; `factor` is length over counts."""
        told = self.draft.table.constants.get(Constant.COUNTS)
        if told is not None:
            note = f"{self.roles.motor}: its counts are taken from the header of the file: {told.text}"
            return CountSize({"counts_per_rev": told.value}, note)
        motor, live = str(self.roles.motor), self.live
        speeds = [one for one in self.labels.values() if one.quantity == "velocity" and one.unit and not one.command]
        moved = motion(live[motor], self.period_s)
        for one in speeds:
            relation = derivative_of(live[one.column], moved, self.period_s) if one.column in live else None
            if relation and relation.share > SAME_POSITION:
                return from_speed(1.0 / relation.factor, str(one.unit))
        if length:
            return from_length(motor, 1.0 / factor, self.units[length], length, self._gives_force())
        return assumed(motor)

    def _velocity_command(self) -> None:
        name, command = self.roles.velocity_command, self.roles.command
        if name is None or command is None:
            if name is not None:
                self.draft.left_out[name] = "a velocity set-point without a position set-point"
            return
        relation = derivative_of(self.live[name], motion(self.live[command], self.period_s), self.period_s)
        channel, how = "velocity_command_m_s", f"the derivative of {command}"
        if self._holds_following_error(name, command):
            channel, how = SPEED_SET_POINT, "output of the position loop: it holds the following error"
        elif relation.share < 0.9:
            self.draft.left_out[name] = f"no derivative of {command} (share {relation.share:.2f})"
            return
        choice = velocity_unit(name, self.labels[name].unit, relation.factor, self.units[command])
        self._choose(name, choice)
        of_command = next(one.entry for one in self.draft.channels if one.channel == "position_command_m")
        sign = int(np.sign(relation.factor)) * int(str(of_command.get("sign", 1)))
        entry: dict[str, object] = {"column": name, "unit": choice.unit}
        if sign < 0:
            entry["sign"] = -1
        self.draft.channels.append(DraftedChannel(channel, entry, how))

    def _holds_following_error(self, name: str, command: str) -> bool:
        """True if the following error explains most of what the velocity of the set-point leaves of a speed."""
        motor, moved = self.live[str(self.roles.motor)], motion(self.live[command], self.period_s)
        error = self.live[command] - proportional(self.live[command], motor).factor * motor
        speed = smoothed(self.live[name], self.period_s)
        alone, both = explained(speed, moved.velocity), explained(speed, moved.velocity, smoothed(error, self.period_s))
        return 1.0 - alone > LEAST_LEFT and 1.0 - both < LOOP_LEAVES * (1.0 - alone)

    def _efforts(self, moved: Motion) -> None:
        names = AXIS_CHANNELS[self.kind]
        pairs = ((self.roles.effort, names.torque), (self.roles.effort_command, names.torque_command))
        given = [(column, channel) for column, channel in pairs if column is not None]
        efforts = [self.live[column] for column, _ in given]
        causes = [driven(values, moved, self.period_s) for values in efforts]
        for (column, channel), cause, sign in zip(given, causes, signs_of(efforts, causes, moved), strict=True):
            entry, notes = effort_entry(self.labels[column], self.kind, self.draft.table, cause, sign * self.motor_sign)
            self.draft.unsure += notes
            how = self._how(column, f"inertia and friction explain {100 * max(cause.share, 0):.0f} % of it")
            self.draft.channels.append(DraftedChannel(channel, entry, how))

    def _velocity_only(self) -> None:
        """A recording with velocity in place of position."""
        name = self.roles.motor_velocity
        assert name
        choice = velocity_unit(name, self.labels[name].unit, 1.0, "rad")
        self._choose(name, choice)
        self.kind = AxisKind.LINEAR if is_length(choice.unit) else AxisKind.ROTARY
        channel = AXIS_CHANNELS[self.kind].motor_velocity
        self.draft.channels.append(
            DraftedChannel(channel, {"column": name, "unit": choice.unit}, self._how(name, "no position is recorded"))
        )
        self._efforts(motion(np.cumsum(self.live[name]) * self.period_s, self.period_s))

    def _how(self, column: str, what: str) -> str:
        return f"{what}; {self.roles.how[column]}" if column in self.roles.how else what
