"""Assign columns to roles (motor, table, set-points, torque): by their names, else by relations between the columns."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from hil.arrays import FloatArray
from hil.errors import InputError, PartOfAxis, listed
from hil.identification.derivatives import MeasuredMotion, motion
from hil.importing.column_names import Label
from hil.importing.computed_position import computed_one, unanswered_one
from hil.importing.effort_roles import EXPLAINED, better_speed, choose_efforts
from hil.importing.lexicon import Constant, Quantity
from hil.importing.monitor_outputs import monitor_outputs
from hil.importing.one_axis import one_axis
from hil.importing.relations import IS_DERIVATIVE, SAME_POSITION, derivative_of, driven, lateness_s, proportional
from hil.importing.row_counters import COUNTER, rises_evenly
from hil.importing.two_encoders import follows_steps, motors_encoder, named_encoders
from hil.importing.unnamed_columns import quantities_by_relations
from hil.quantities import UNITS
from hil.recording.quantum import SINGLE, count_of

_EVEN = 0.1  # deviation of a constant speed over its mean, at most: the noise of both is all that differs
FOLLOWED = 0.5  # share of a set-point that a controlled motion follows: less is another axis or no loop
_ALONE = "a set-point of the velocity; the control law is read from set-points of the position"
_NO_ROLE = {
    Quantity.OTHER: "by its name an error, a limit, a temperature or a state",
    Quantity.ACCELERATION: "an acceleration follows from the position",
    Quantity.TIME: "another time",
    Quantity.UNKNOWN: "its name says nothing, and no relation to the motion is found",
}
SAME_COLUMN = 1e-6  # of the travel: a copy in another unit deviates by printed digits, a second sensor by more


@dataclass
class Roles:
    """Name of the column of each role (None: not recorded), and notes on ignored columns and uncertain choices."""

    motor: str | None = None
    motor_velocity: str | None = None
    table: str | None = None
    command: str | None = None
    velocity_command: str | None = None
    unfollowed: str | None = None  # a set-point that the motion does not follow
    effort: str | None = None
    effort_command: str | None = None
    axis: str = ""
    left_out: dict[str, str] = field(default_factory=dict)
    unsure: list[str] = field(default_factory=list)
    how: dict[str, str] = field(default_factory=dict)

    @property
    def used(self) -> list[str]:
        """Columns with a role."""
        positions = (self.motor, self.motor_velocity, self.table, self.command, self.unfollowed, self.velocity_command)
        return [name for name in (*positions, self.effort, self.effort_command) if name]


def find_roles(
    where: str,
    columns: dict[str, FloatArray],
    labels: dict[str, Label],
    period_s: float,
    axis: str | None,
    constants: Collection[Constant] = (),
) -> Roles:
    """Find the columns of one axis among `columns` (n,) without the clock, finite, on a regular clock.

    `axis` is the number of the axis in the names; the file gives `constants`. Raises InputError: no motion, columns
    interchanged.
    """
    roles = Roles()
    one = one_axis(where, labels, columns, axis)
    labels, roles.axis, roles.left_out = one.labels, one.axis, dict(one.left_out)
    roles.unsure += one.unsure
    frozen = [name for name in columns if name in labels and np.ptp(columns[name]) == 0.0]
    roles.left_out |= {name: f"constant at {columns[name][0]:g}" for name in frozen}
    labels = {name: label for name, label in labels.items() if name not in frozen}
    live = {name: columns[name] for name in columns if name in labels}
    counters = [name for name in live if _may_count(labels[name]) and rises_evenly(live[name])]
    roles.left_out |= dict.fromkeys(counters, COUNTER)
    labels |= {name: replace(labels[name], quantity=Quantity.OTHER) for name in counters}
    labels, roles.how = quantities_by_relations(live, labels, period_s)
    roles.unsure += [f"{name}: its name says nothing; {how}" for name, how in roles.how.items()]
    if outputs := monitor_outputs(live, labels, period_s):
        labels |= outputs.labels
        roles.unsure.append(outputs.note)
    of = {kind: [name for name in live if labels[name].quantity is kind] for kind in Quantity}
    for kind, why in _NO_ROLE.items():
        roles.left_out |= {name: roles.left_out.get(name, why) for name in of[kind]}
    _positions(live, labels, of[Quantity.POSITION], of[Quantity.EFFORT], roles, period_s)
    moved = motion(live[roles.motor], period_s) if roles.motor else None
    speeds = {name: live[name] for name in of[Quantity.VELOCITY] if not labels[name].command}
    speed = better_speed(speeds, [live[name] for name in of[Quantity.EFFORT]], moved, period_s) if moved else None
    if speed is not None:
        name, why = speed
        roles.unsure.append(f"{roles.motor}: {why}; {name} is taken for the motion")
        roles.left_out |= dict.fromkeys(of[Quantity.POSITION], f"no position whose derivative is {name}")
        roles.motor = roles.table = roles.command = roles.unfollowed = moved = None
    _velocities(where, live, labels, of[Quantity.VELOCITY], moved, period_s, roles)
    if moved is None and roles.motor_velocity:
        moved = motion(np.cumsum(live[roles.motor_velocity]) * period_s, period_s)
    if moved is not None:
        found = choose_efforts(live, labels, of[Quantity.EFFORT], moved, period_s, constants)
        roles.effort, roles.effort_command = found.measured, found.command
        roles.left_out |= found.left_out
        roles.unsure += found.unsure
        roles.unsure += _of_two_axes(live, labels, moved, period_s, roles)
    if roles.motor is None and roles.motor_velocity is None and len(may_be_asked(columns, labels)) < 2:
        told = f"; constant are {listed(frozen)}" if frozen else ""
        raise PartOfAxis(
            f"{where}: no column is the measured position of the axis (columns: {listed(columns)}{told}); record "
            "it with the torque"
        )
    return roles


def _may_count(label: Label) -> bool:
    """True unless name and unit say that a column is a position, which rises evenly at constant speed."""
    return label.quantity is not Quantity.TIME and (
        label.quantity is not Quantity.POSITION or label.unit in (None, "", "counts")
    )


def may_be_asked(columns: dict[str, FloatArray], labels: dict[str, Label], used: Collection[str] = ()) -> list[str]:
    """Columns (n,) that move, are not `used` and no counters, and whose names do not say that they are no channel."""
    none = (Quantity.OTHER, Quantity.ACCELERATION, Quantity.TIME)
    open_ones = [name for name in columns if name in labels and name not in used and labels[name].quantity not in none]
    moving = [name for name in open_ones if np.ptp(columns[name]) > 0.0]
    return [name for name in moving if not (_may_count(labels[name]) and rises_evenly(columns[name]))]


def _of_two_axes(
    live: dict[str, FloatArray], labels: dict[str, Label], moved: MeasuredMotion, period_s: float, roles: Roles
) -> list[str]:
    """Note on an effort that the motion hardly explains, and whose name tells another axis; empty without."""
    moving, driving = roles.motor or roles.motor_velocity, roles.effort or roles.effort_command
    if not moving or not driving or driven(live[driving], moved, period_s).share > EXPLAINED:
        return []
    one, other = labels[moving].number, labels[driving].number
    if not one or not other or one == other:
        return []
    return [f"{driving}: by its name of axis {other}, {moving} of axis {one}; check that it drives this axis"]


def _positions(
    live: dict[str, FloatArray],
    labels: dict[str, Label],
    names: list[str],
    efforts: list[str],
    roles: Roles,
    period_s: float,
) -> None:
    """Tell set-point, motor and second encoder.

    Where no effort is recorded, a set-point tells nothing: two positions are two encoders.
    """
    names = list(names)
    for name in names[1:]:
        alike = [one for one in names[: names.index(name)] if _copies(live[one], live[name])]
        label, first = labels[name], labels[alike[0]] if alike else None
        if first is not None and (label.command, label.table) == (first.command, first.table):
            roles.left_out[name] = f"a copy of {alike[0]}"
            names.remove(name)
    commands = [name for name in names if labels[name].command]
    measured = [name for name in names if name not in commands]
    alone = not efforts and len(commands) == 1 == len(measured)
    if alone and follows_steps(live[commands[0]], live[measured[0]], labels[commands[0]].steps):
        (roles.motor,), (roles.table,) = commands, measured
        roles.unsure.append(
            f"{roles.motor}: set-point in steps, which {roles.table} follows by one ratio; without a torque it stands "
            "for the motor's position: what lies between the two is the transmission with the motor's load angle"
        )
        return
    if efforts and not commands and len(measured) > 1:
        encoders = named_encoders(measured, labels)
        told = [name for name in measured if labels[name].motor or labels[name].table or labels[name].measured]
        named = encoders | {name for name in measured if labels[name].motor or labels[name].table}
        plain = [name for name in measured if name not in (*told, *encoders) and not _turns(name, measured, labels)]
        commands, why = computed_one({name: live[name] for name in measured}, plain)
        if not commands and len(measured) == 2 and plain and not named:
            driving = [live[name] for name in efforts]
            commands, why = unanswered_one({name: live[name] for name in measured}, driving, period_s)
            commands = [name for name in commands if name in plain]  # an encoder is none
            if commands and told:  # a load behind a spring explains the torque worse too, and does not come before
                late_s = lateness_s(live[commands[0]], motion(live[told[0]], period_s))
                commands = commands if late_s < -period_s else []
        roles.unsure += [f"{name}: taken for the set-point, because {why}" for name in commands]
        measured = [name for name in measured if name not in commands]
    if not measured:
        roles.left_out |= dict.fromkeys(commands, "a set-point beside no measured position")
        return
    far = [name for name in measured if labels[name].table]
    near = [name for name in measured if not labels[name].table] or far
    roles.motor = next((name for name in near if labels[name].motor), None) or min(
        near, key=lambda name: (not labels[name].measured, labels[name].number.zfill(9), near.index(name))
    )
    why = ""
    if len(near) == 2 and not any(labels[name].motor or labels[name].table for name in near):
        speeds = [n for n in live if labels[n].quantity is Quantity.VELOCITY and not labels[n].command]
        told_by = motors_encoder(near, live, speeds, efforts, period_s)
        roles.motor, why = (told_by.name, f" ({told_by.why})") if told_by else (roles.motor, "")
    rest = [name for name in (*far, *near) if name != roles.motor]
    for name in [one for one in rest if not labels[one].table]:
        share = proportional(live[name], live[roles.motor]).share
        if share < FOLLOWED:
            rest.remove(name)
            roles.left_out[name] = f"a position that does not follow {roles.motor} (share {share:.2f})"
            roles.unsure.append(f"{name}: does not follow {roles.motor} (share {share:.2f}): of another axis, not used")
    if rest:
        roles.table = rest[0]
        if not labels[rest[0]].table:
            roles.unsure.append(
                f"{rest[0]}: taken for the second encoder and {roles.motor} for the motor's{why}; exchange them if not"
            )
    for name in rest[1:]:
        roles.left_out[name] = "a third position"
    if commands:
        shares = {name: proportional(live[name], live[roles.motor]).share for name in commands}
        best = max(commands, key=lambda name: shares[name])
        for name in commands:
            roles.left_out[name] = "another set-point"
        if shares[best] < FOLLOWED:
            roles.unfollowed = best
            roles.left_out[best] = f"a set-point that {roles.motor} does not follow (share {shares[best]:.2f})"
            roles.unsure.append(f"{best}: {roles.motor} does not follow it (share {shares[best]:.2f}); it is not used")
        else:
            roles.command = roles.left_out.pop(best, None) and best


def _turns(name: str, positions: list[str], labels: dict[str, Label]) -> bool:
    """True of an angle beside lengths: a set-point is in the unit of the axis, the motor's encoder turns."""
    kinds = {one: UNITS[labels[one].unit or ""][0] for one in positions if labels[one].unit in UNITS}
    others = [kinds.get(one) for one in positions if one != name]
    return kinds.get(name) == "rad" and all(one == "m" for one in others)


def _copies(first: FloatArray, second: FloatArray) -> bool:
    """True if two columns (n,) are the same numbers in two units, but for their rounding: a second sensor has noise."""
    factor = proportional(second, first).factor
    steps = abs(factor) * (count_of(first) or 0.0) + (count_of(second) or 0.0)
    rounding = max(2.0 * steps, SINGLE * float(np.max(np.abs(second))))
    left = second - factor * first
    return bool(factor != 0.0 and np.ptp(left) < min(SAME_COLUMN * np.ptp(second), rounding))


def _velocities(
    where: str,
    live: dict[str, FloatArray],
    labels: dict[str, Label],
    names: list[str],
    moved: MeasuredMotion | None,
    period_s: float,
    roles: Roles,
) -> None:
    commands = [name for name in names if labels[name].command]
    measured = [name for name in names if not labels[name].command]
    if moved is None or roles.motor is None:
        roles.left_out |= dict.fromkeys(commands, _ALONE)
        near = [name for name in measured if not labels[name].table]
        roles.motor_velocity = next(iter(near or measured), None)
        others = [name for name in measured if name != roles.motor_velocity]
        roles.left_out |= dict.fromkeys(others, "another velocity")
        return
    roles.velocity_command = commands[0] if commands else None
    roles.left_out |= dict.fromkeys(commands[1:], "another set-point of the velocity")
    for name in measured:
        roles.left_out[name] = "velocity of the motion, follows from the position"
        even = np.std(moved.velocity) < _EVEN * abs(float(np.mean(moved.velocity)))
        share = derivative_of(live[name], moved, period_s, through_zero=bool(even)).share
        if share < 0.5:
            inverse = derivative_of(live[roles.motor], motion(live[name], period_s), period_s).share
            if inverse > IS_DERIVATIVE:
                raise InputError(
                    f"{where}: {roles.motor} is the derivative of {name}: position and velocity are interchanged; "
                    "correct the names of the columns"
                )
            roles.unsure.append(
                f"{name}: named a velocity, but it is not the derivative of {roles.motor} (share {share:.2f})"
            )
            roles.left_out[name] = "no velocity of this motion"
        elif share < SAME_POSITION:
            roles.unsure.append(
                f"{name}: is the derivative of {roles.motor} only in part (share {share:.2f}): filtered or late"
            )
