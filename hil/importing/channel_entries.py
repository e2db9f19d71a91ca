"""Entries of a drafted map: unit, sign and scale of each channel, with how it was found."""

from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AXIS_CHANNELS, AxisKind
from hil.errors import InputError, PartOfAxis
from hil.identification.derivatives import MeasuredMotion, motion
from hil.importing.column_names import Label
from hil.importing.effort_entry import effort_entry, signs_of
from hil.importing.encoder_counts import CountSize, assumed, counts_ratio, from_length, from_speed, scale_count
from hil.importing.lexicon import Constant, Quantity
from hil.importing.map_draft import Asked, DraftedChannel, MapDraft, ask_column
from hil.importing.map_file import ChannelSource
from hil.importing.position_units import PositionUnits, effort_si
from hil.importing.questions import counts_like, counts_of_scale, effort_unit, position_unit, speed_unit
from hil.importing.relations import SAME_POSITION, derivative_of, driven, lateness_s, proportional
from hil.importing.roles import Roles, may_be_asked
from hil.importing.speed_unit import speed_entry
from hil.importing.unit_choice import MATCH, is_length, misfit, travel_per_unit
from hil.importing.usual_values import LEADS_M, mixed_up, usual_lead
from hil.quantities import ROTARY_LEAD_M, UNITS

SAME_COUNTS = 1e-3  # deviation of the factor between motor and set-point, both in counts: following errors are below
LATE_ROWS = 0.5  # by which a set-point may seem late: its rounding and the sampling of the encoder


class ChannelEntries:
    """Fills a draft with the channels of the roles `roles`; `live` are the columns (n,) on an even clock."""

    def __init__(
        self, draft: MapDraft, labels: dict[str, Label], roles: Roles, live: dict[str, FloatArray], period_s: float
    ) -> None:
        self.draft, self.labels, self.roles, self.live, self.period_s = draft, labels, roles, live, period_s
        self.positions = PositionUnits(draft, labels, roles, live, period_s)
        self.units, self.asked = self.positions.units, self.positions.asked
        self.effort_si = effort_si(self.positions.effort, draft)
        self.kind, self.motor_sign = AxisKind.ROTARY, 1
        self.per_count = 1.0  # SI units of the motor per count, if it is in counts
        self.unsized: dict[str, float] = {}  # keys of the size of its count that are asked, with what stands for them
        self.ratio = 1.0  # turns of the motor for each of its position, which is that of the load

    def fill(self) -> None:
        """Add the entries. Raises InputError: no column can go with the motion, or two units contradict each other."""
        if (roles := self.roles).motor is None:
            self._velocity_only()
        else:
            self.positions.choose()
            self._positions(roles.motor)
            self._velocity_command()
            self._efforts(self.positions.motion(roles.motor))
        if not (roles.effort or roles.effort_command or roles.table):
            self._ask_effort()

    def _ask_effort(self) -> None:
        """Ask for the column of the torque. Raises InputError: none can be it."""
        roles, names = self.roles, AXIS_CHANNELS[self.kind]
        said = {name for name, one in self.labels.items() if one.sure and not one.letter}
        known = [name for name in said if self.labels[name].quantity is not Quantity.EFFORT]
        left = may_be_asked(self.live, self.labels, [*roles.used, *known])
        if left:
            what = "the torque, force, current or voltage"
            ask_column(self.draft, names.torque, what, effort_unit(self.kind), left)
            return
        motion_of = f"position {roles.motor}" if roles.motor else f"speed {roles.motor_velocity}"
        told = "".join(f"{name}: {why}; " for name, why in roles.left_out.items() if "explain" in why)
        raise PartOfAxis(
            f"{self.draft.table.path}: {told}beside the {motion_of} no torque, force, current, voltage or second "
            "encoder is found; record one"
        )

    def _unit_question(self, name: str) -> str:
        names, roles = AXIS_CHANNELS[self.kind], self.roles
        channels = [names.motor_position]
        channels += [names.torque] if roles.effort else []
        channels += [names.torque_command] if roles.effort_command else []
        return position_unit(self.kind, channels, name in roles.how)

    def _add(self, channel: str, column: str, what: str, keys: dict[str, object]) -> None:
        how = f"{what}; {self.roles.how[column]}" if column in self.roles.how else what
        self.draft.channels.append(DraftedChannel(channel, {"column": column, **keys}, how))

    def _kind(self, length: bool, screw: bool = False) -> AxisKind:
        """Kind of the axis, whose motor is recorded in a `length` or an angle: a torque, or turns, tell a screw."""
        if not length:
            return AxisKind.ROTARY
        far = self.roles.table is not None and is_length(self.units[self.roles.table])
        screw = screw or self.effort_si == "N m" or Constant.LEAD in self.draft.table.constants or far
        return AxisKind.ROTARY if screw and self.effort_si != "N" else AxisKind.LINEAR

    def _positions(self, name: str) -> None:
        """Add the motor's position `name`, the lead, and the other positions."""
        draft, roles, live, motor = self.draft, self.roles, self.live, self.units[name]
        keys, told = dict[str, object](unit=motor), draft.table.constants.get(Constant.LEAD)
        far = [other for other in (roles.table, roles.command) if other]
        relations = {other: proportional(live[other], live[name]) for other in far}
        trusted = [other for other in far if relations[other].share > 0.9]
        reference = roles.command if roles.command in trusted else (trusted[0] if trusted else None)
        if reference and relations[reference].factor < 0.0:
            self.motor_sign = -1
            draft.unsure.append(f"{name}: falls while {reference} grows; its sign is turned")
        length = next((other for other in trusted if is_length(self.units[other])), None)
        counted = motor == "counts"
        if counted:
            size = self._count_size(name, length, relations[length].factor if length else 0.0)
            keys |= size.entry
            draft.unsure += [size.note] if size.note else []
            motor, self.per_count = size.unit, size.per_count
            self.unsized = {key: size.entry[key] for key in size.asked}
        screw = not counted and name not in self.asked and self.positions.lead_by_speed(name) is not None
        self.kind = self._kind(is_length(motor), screw)
        channel = AXIS_CHANNELS[self.kind].motor_position
        for key, what in size.asked.items() if counted else {}:
            draft.asked.append(Asked(channel, key, f"{name}: {what}"))
        if name in self.asked:
            draft.asked.append(Asked(channel, "unit", f"{name}: {self._unit_question(name)}"))
        elif self.kind is AxisKind.ROTARY:
            if is_length(motor):
                self._lead(name, counted)
            elif length is not None:
                per_turn = abs(relations[length].factor) * UNITS[self.units[length]][1] / self.per_count
                lead_m = 2.0 * pi * per_turn / UNITS[motor][1]
                nominal = told is not None and abs(told.value / lead_m - 1.0) < MATCH
                draft.lead_m = told.value if told and nominal else float(f"{usual_lead(lead_m):.6g}")
                draft.lead_how = f"travel of {length} per turn of {name}"
            elif told and (not roles.table or self.units[roles.table] == "counts"):
                draft.lead_m, draft.lead_how = told.value, f"header of the file: {told.text}"
            else:
                draft.lead_m = ROTARY_LEAD_M
                draft.lead_how = "an axis that turns: leave it. Of a screw, belt or rack write the travel per turn"
                keys |= {} if counted else self._gear(name)
        keys |= {"sign": -1} if self.motor_sign < 0 else {}
        self._add(channel, name, "steps of the motor" if self.labels[name].command else "the motor's encoder", keys)
        for other, channel, what in (
            (roles.table, "table_position_m", "the second encoder"),
            (roles.command, "position_command_m", "the set-point"),
        ):
            if other is not None:
                factor, share = relations[other].factor * self.motor_sign, relations[other].share
                self._far(other, channel, what, factor, share, motor)

    def _gear(self, name: str) -> dict[str, object]:
        """Scale of an angle of the load, by a speed of the motor; its torque is then beside its own angle."""
        geared = self.positions.gear_by_speed(name)
        if geared is None:
            return {}
        self.ratio, speed = geared
        self.draft.unsure.append(
            f"{name}: is an angle of the load; the motor turns {self.ratio:g} times as far (from column {speed}): "
            "scale, so that position, inertia and friction are those of the motor"
        )
        return {"scale": self.ratio}

    def _lead(self, name: str, counted: bool = False) -> None:
        """Lead of a motor whose motion `name` is told in a length: of the header, by a speed in turns, else asked."""
        draft, told = self.draft, self.draft.table.constants.get(Constant.LEAD)
        by_speed = None if counted or self.roles.motor is None else self.positions.lead_by_speed(name)
        if told is not None:
            draft.lead_m, draft.lead_how = told.value, f"header of the file: {told.text}"
        elif by_speed is not None:
            draft.lead_m = float(f"{usual_lead(by_speed[0]):.6g}")
            draft.lead_how = f"travel of {name} per turn of {by_speed[1]}"
        else:
            draft.lead_m = LEADS_M[0]
            what = "counts along a length" if counted else "is a length"
            draft.asked.append(Asked("", "lead_m", f"{name} {what}: the metres per revolution of the motor, as 0.010"))
            return
        draft.unsure.append(f"{name}: is a length; {1e3 * draft.lead_m:g} mm per turn are taken ({draft.lead_how})")

    def _far(self, name: str, channel: str, what: str, factor: float, share: float, motor: str) -> None:
        """Set-point or second encoder: check sign and scale against the motor."""
        unsure, encoder, unit = self.draft.unsure, str(self.roles.motor), self.units[name]
        keys: dict[str, object] = {"unit": unit}
        unknown = bool({name, encoder} & self.asked)
        if name in self.asked:
            self.draft.asked.append(Asked(channel, "unit", f"{name}: {self._unit_question(name)}"))
        if share < 0.5:
            unsure.append(f"{name}: does not follow {encoder} (share {share:.2f}); check that it is {what}")
        elif factor < 0.0:
            keys["sign"] = -1
            unsure.append(f"{name}: falls while {encoder} grows; its sign is turned")
        if share >= 0.5 and "counts" not in (unit, self.units[encoder]) and not unknown:
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
            late_s = lateness_s(self.live[name], self.positions.motion(encoder))
            if late_s > LATE_ROWS * self.period_s:
                unsure.append(
                    f"{name}: comes {1e3 * late_s:.3g} ms after {encoder}, a set-point comes before: its "
                    "stamps are late, or the drive leads it; the control law cannot be judged with it as it is"
                )
        keys |= {"scale": self.ratio} if self.ratio != 1.0 and channel != "table_position_m" else {}
        same = abs(abs(factor) - 1.0) < SAME_COUNTS
        if unit == "counts" and self.unsized:  # its counts are told when those of the encoder are
            ratio = 1.0 if same else counts_ratio(abs(factor))
            sizes = {key: size * ratio for key, size in self.unsized.items()}
            question = counts_like(encoder, channel, None if same else ratio)
            scale = channel == "table_position_m" and Constant.LEAD in self.draft.table.constants
            if scale and self.draft.lead_m and (per_rev := sizes.get("counts_per_rev")):
                sizes, question = {"counts_per_m": per_rev / self.draft.lead_m}, counts_of_scale()
            keys |= sizes
            self.draft.asked += [Asked(channel, key, f"{name}: is in counts; {question}") for key in sizes]
        elif unit == "counts" and channel == "table_position_m" and (count := self.positions.count_by_command(name)):
            keys |= count
        elif unit == "counts":  # of the motor's encoder, as in the set-points of a drive
            per_count = self.per_count / (1.0 if same else abs(factor))
            lever = travel_per_unit(motor, self.draft.lead_m or 0.0)
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
        moved = self.positions.motion(motor)
        for one in self.positions.speeds():
            relation = derivative_of(self.live[one.column], moved, self.period_s)
            if relation.share > SAME_POSITION:
                return from_speed(1.0 / relation.factor, str(one.unit))
        if length:
            return from_length(motor, 1.0 / factor, self.units[length], length, self.effort_si == "N")
        return assumed(self.effort_si != "N")

    def _velocity_command(self) -> None:
        name, command = self.roles.velocity_command, self.roles.command
        if name is None:
            return
        if command is None or command in self.asked or (self.unsized and self.units[command] == "counts"):
            self.draft.left_out[name] = "a velocity set-point without a position set-point of known unit"
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
            entry = effort_entry(self.labels[column], self.kind, self.draft.table, cause, sign * self.motor_sign)
            self.draft.unsure += entry.notes
            self.draft.asked += [Asked(channel, key, f"{column}: {what}") for key, what in entry.asked.items()]
            self._add(
                channel, column, f"inertia and friction explain {100 * max(cause.share, 0):.0f} % of it", entry.keys
            )

    def _velocity_only(self) -> None:
        """A recording with velocity in place of position."""
        name = self.roles.motor_velocity
        assert name
        unit = self.labels[name].unit
        volts = unit in ("V", "mV")
        given, unit = unit, None if volts else unit
        keys: dict[str, object] = {"unit": unit or "rad/s"} | ({"scale": 1.0} if volts else {})
        length = is_length(unit or "") or (unit is None and self.effort_si == "N")
        asked = {} if unit else {"unit": speed_unit(length)}
        asked |= {"scale": f"is in {given}; write how many of this unit are 1 {given}"} if volts else {}
        if unit == "counts/s":
            size = self._count_size(name, None, 0.0)
            keys |= size.entry
            asked, length = size.asked, size.unit == "m"
        self.kind = self._kind(length)
        if self.kind is AxisKind.ROTARY and length:
            self._lead(name)
        channel = AXIS_CHANNELS[self.kind].motor_velocity
        self.draft.asked += [Asked(channel, key, f"{name}: {what}") for key, what in asked.items()]
        self._add(channel, name, "no position is recorded", keys)
        self._efforts(motion(np.cumsum(self.live[name]) * self.period_s, self.period_s))
