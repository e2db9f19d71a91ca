"""Laws that are a function of one quantity: over what each is drawn, and how it enters the residual."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.pictures.fitted_law import FittedRows, law_at
from hil.diagnosis.pictures.view import View, label_of_channel, unit_of_channel
from hil.identification.residual_scales import inertia
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.twin.parameter import Role
from hil.twin.picture import Picture

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

Of = Callable[["Diagnosis", View], FloatArray]
ZERO_ROWS = 2000  # that tell the zero of a residual
SLOW_HZ, LEAST_ROWS = 20.0, 300  # a torque that the observer passes; of so many rows, else all count
LEAST_SHARE = 0.1  # of the largest carrier: rows below say nothing of a law that is multiplied by it


@dataclass(frozen=True)
class Abscissa:
    """A quantity (n,) of a run in SI units, its label, and that of its inverse: how often something repeats."""

    of: Of
    label: str
    unit: Callable[[Diagnosis], str]
    per: str = ""  # label of an order: what repeats over this quantity
    per_unit: float = 1.0  # of the quantity to which an order refers


@dataclass(frozen=True)
class DrawnLaw:
    """How a law is drawn: over which quantity, in which channel, and by which factor it enters the residual there.

    `value(term, diagnosis, x)` is the law (n,) in the unit `unit`. `bare` is what it is without the mechanism.
    """

    over: Abscissa
    value: Callable[[Term, Diagnosis, FloatArray], FloatArray]
    label: str = ""  # without: that of the channel
    unit: str = ""  # without: that of the channel
    channel: Callable[[View], str] = lambda view: "motor"
    carrier: Callable[[Diagnosis, View], FloatArray] = lambda diagnosis, view: np.ones(view.run.motor.size)
    period: Callable[[Term], float | None] = lambda term: None
    bare: Callable[[FloatArray], FloatArray] = np.zeros_like

    def rows(self, diagnosis: Diagnosis, view: View) -> FittedRows:
        """The rows of a run in which the axis slides and the law enters."""
        before, after = view.residuals(self.channel(view))
        carrier = self.carrier(diagnosis, view)
        used = view.torque.sliding & (np.abs(carrier) > LEAST_SHARE * float(np.abs(carrier).max()))
        used[: view.run.evaluated.start] = False
        x, period = self.over.of(diagnosis, view), self.period(view.term)
        slow = np.abs(np.gradient(x, view.run.period_s)) < SLOW_HZ * (period or np.inf)
        if self.channel(view) == "motor" and np.count_nonzero(used & slow) >= LEAST_ROWS:
            used &= slow  # the observer attenuates a quicker torque
        if self.channel(view) == "table" and used.any():  # the zeros of both encoders are arbitrary
            some = np.flatnonzero(used)[:: max(np.count_nonzero(used) // ZERO_ROWS, 1)]
            law = carrier[some] * self.value(view.term, diagnosis, x[some])
            before = before - float(np.mean((before - after)[some] - law))
        return FittedRows(x, carrier, before, after, used)

    def labelled(self, diagnosis: Diagnosis, view: View) -> tuple[str, str]:
        """Label and SI unit of what is drawn."""
        channel = self.channel(view)
        label = self.label or label_of_channel(diagnosis, channel)
        unit = {"": unit_of_channel(diagnosis, channel), "force": "N"}.get(self.unit, self.unit)
        return label, unit


def _length(diagnosis: Diagnosis) -> str:
    return "rad" if diagnosis.given_bench.axis.turns else "m"


def _drive(diagnosis: Diagnosis) -> str:
    return diagnosis.given_bench.axis.drive_unit


def _angle(diagnosis: Diagnosis, view: View) -> FloatArray:
    return view.run.motor * diagnosis.given_bench.axis.physics().angle_per_unit


def _position(diagnosis: Diagnosis, view: View) -> FloatArray:
    return diagnosis.given_bench.axis.ratio_m_rad * view.run.motor


ANGLE = Abscissa(_angle, "motor angle", lambda d: "rad", "per motor turn", 2.0 * np.pi)
WAY = Abscissa(_position, "position", _length, "per metre", 1.0)
# the place by the twin: finer than a count
SCALE = Abscissa(lambda d, view: view.run.table_m - view.before["table"], "position", _length, "per metre", 1.0)
TIME = Abscissa(lambda d, view: view.run.time_s, "time", lambda d: "s", "frequency [Hz]", 1.0)
COMMAND = Abscissa(lambda d, view: view.run.torque_command, "torque command", _drive)

LOAD = Abscissa(lambda d, view: _load(d, view), "load that is carried", _drive)


def _load(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Torque (n,) that is carried: that of the motor less all friction, of which the load makes a share."""
    without = view.run.torque + _friction(diagnosis, view)
    driven = np.sign(without) * np.sign(view.torque.velocity)
    return without / (1.0 + driven * view.term.values[BY_ID[view.term.effect].strength])


def _against_motion(diagnosis: Diagnosis, view: View) -> FloatArray:
    return -np.sign(view.torque.velocity)


def _friction(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Friction (n,) of the axis against the motion, as a torque."""
    return _coulomb(diagnosis, view) + _viscous(diagnosis, view)


def _viscous(diagnosis: Diagnosis, view: View) -> FloatArray:
    return -diagnosis.final.bench.axis.physics().viscous_n_m_s_rad * view.torque.velocity


def _coulomb(diagnosis: Diagnosis, view: View) -> FloatArray:
    return -diagnosis.final.bench.axis.physics().coulomb_n_m * np.sign(view.torque.velocity)


def _ratio(diagnosis: Diagnosis, view: View) -> FloatArray:
    return np.full(view.run.motor.size, diagnosis.given_bench.axis.ratio_m_rad)


def _driving(diagnosis: Diagnosis, view: View) -> FloatArray:
    return view.run.torque


def _per_metre(term: Term, diagnosis: Diagnosis, time_s: FloatArray) -> FloatArray:
    """Growth (n,) of a metre of the screw at times (n,)."""
    ends = (_at(term, diagnosis, time_s=time_s, table_m=np.array(place)) for place in (1.0, 0.0))
    return np.asarray(np.subtract(*ends))


def _from_bearing(diagnosis: Diagnosis, view: View) -> FloatArray:
    """Distance (n,) from the place that does not move: the last parameter."""
    return _position(diagnosis, view) - view.term.values[-1]


def _in_proportion(diagnosis: Diagnosis, view: View) -> FloatArray:
    """What the twin makes of one unit of the law (n,): the part that the term models, over the law."""
    before, after = view.residuals("table")
    law = law_at(view.term, diagnosis.final.bench, 1.0, table_m=_position(diagnosis, view)) - 1.0
    return np.where(np.abs(law) > LEAST_SHARE * np.abs(law).max(), before - after, 0.0) / np.where(law, law, 1.0)


def _reading_of_motor(diagnosis: Diagnosis, view: View) -> FloatArray:
    """A motor that reads too much makes the table read too little; without a table, its error is an acceleration."""
    if view.has_table:
        return np.full(view.run.motor.size, -diagnosis.given_bench.axis.ratio_m_rad)
    return -inertia(diagnosis.final.bench) * view.torque.velocity**2


def _table(view: View) -> str:
    return "table"


def _table_or_motor(view: View) -> str:
    return "table" if view.has_table else "motor"


def _torque(view: View) -> str:
    return view.strongest if view.strongest in ("torque", "motor") else "motor"


def _per_order(term: Term) -> float | None:
    order = BY_ID[term.effect].named(Role.ORDER, term.values)
    return 2.0 * np.pi / order if order else 2.0 * np.pi


def _per_line(term: Term) -> float | None:
    line = BY_ID[term.effect].named(Role.LINE, term.values)
    return 1.0 / line if line else None


def _period(term: Term) -> float | None:
    return BY_ID[term.effect].named(Role.PERIOD, term.values)


def _at(term: Term, diagnosis: Diagnosis, value: float | FloatArray = 0.0, **state: FloatArray) -> FloatArray:
    return law_at(term, diagnosis.final.bench, value, **state)


def _metres(diagnosis: Diagnosis) -> float:
    return float(diagnosis.given_bench.axis.ratio_m_rad)


LAWS: dict[Picture, DrawnLaw] = {
    Picture.COGGING: DrawnLaw(ANGLE, lambda term, d, x: _at(term, d, angle_rad=x), period=_per_order),
    Picture.RIPPLE: DrawnLaw(
        ANGLE,
        lambda term, d, x: _at(term, d, 1.0, angle_rad=x) - 1.0,
        "torque per ampere, change",
        "1",
        carrier=_driving,
        period=_per_order,
    ),
    Picture.CONSTANT_OVER_TRAVEL: DrawnLaw(
        WAY,
        lambda term, d, x: _at(term, d, 1.0, table_m=x) - 1.0,
        "torque per ampere, change",
        "1",
        carrier=_driving,
    ),
    Picture.CONSTANT_OVER_TIME: DrawnLaw(
        TIME, lambda term, d, x: _at(term, d, 1.0, time_s=x) - 1.0, "torque per ampere, change", "1", carrier=_driving
    ),
    Picture.LEAD_OVER_TURN: DrawnLaw(
        ANGLE,
        lambda term, d, x: _metres(d) * _at(term, d, angle_rad=x),
        "lead error",
        channel=_table,
        period=_per_order,
    ),
    Picture.LEAD_OVER_TRAVEL: DrawnLaw(
        WAY, lambda term, d, x: _metres(d) * _at(term, d, table_m=x), "lead error", channel=_table
    ),
    Picture.GROWTH: DrawnLaw(
        TIME,
        lambda term, d, x: _metres(d) * _per_metre(term, d, x),
        "growth of the screw",
        "m/m",
        channel=_table,
        carrier=_from_bearing,
    ),
    Picture.MOTOR_READING: DrawnLaw(
        ANGLE,
        lambda term, d, x: _at(term, d, angle_rad=x),
        "error of the motor encoder",
        "rad",
        channel=_table_or_motor,
        carrier=_reading_of_motor,
        period=_per_order,
    ),
    Picture.LOAD_READING: DrawnLaw(
        WAY, lambda term, d, x: _at(term, d, table_m=x), "error of the load encoder", channel=_table
    ),
    Picture.SCALE_READING: DrawnLaw(
        SCALE, lambda term, d, x: _at(term, d, table_m=x), "error of the linear encoder", channel=_table, period=_period
    ),
    Picture.FRICTION_OVER_TRAVEL: DrawnLaw(
        WAY,
        lambda term, d, x: _at(term, d, 1.0, table_m=x) - 1.0,
        "Coulomb friction, change",
        "1",
        carrier=_coulomb,
        period=_period,
    ),
    Picture.FRICTION_OVER_LOAD: DrawnLaw(
        LOAD, lambda term, d, x: term.values[0] * np.abs(x), "friction, change", carrier=_against_motion
    ),
    Picture.FRICTION_OVER_TIME: DrawnLaw(
        TIME, lambda term, d, x: _at(term, d, 1.0, time_s=x) - 1.0, "friction, change", "1", carrier=_friction
    ),
    Picture.VISCOUS_OVER_TIME: DrawnLaw(
        TIME, lambda term, d, x: _at(term, d, 1.0, time_s=x) - 1.0, "viscous friction, change", "1", carrier=_viscous
    ),
    Picture.FORCE_OVER_TRAVEL: DrawnLaw(
        WAY, lambda term, d, x: _at(term, d, table_m=x), "force on the table", "force", carrier=_ratio
    ),
    Picture.FORCE_OVER_TIME: DrawnLaw(
        TIME, lambda term, d, x: _at(term, d, time_s=x), "force on the table", "force", carrier=_ratio, period=_per_line
    ),
    Picture.STIFFNESS: DrawnLaw(
        WAY,
        lambda term, d, x: _at(term, d, 1.0, table_m=x) - 1.0,
        "stiffness of the screw, change",
        "1",
        channel=_table,
        carrier=_in_proportion,
    ),
    Picture.CHARACTERISTIC: DrawnLaw(
        COMMAND, lambda term, d, x: _at(term, d, x), "torque", channel=_torque, bare=lambda x: x
    ),
}


def of_axis(law: DrawnLaw, diagnosis: Diagnosis) -> DrawnLaw:
    """The law; that over the angle of a motor, for a linear one, over its way."""
    axis = diagnosis.given_bench.axis
    if law.over is not ANGLE or not axis.linear:
        return law
    per_m = axis.physics().angle_per_unit

    def period_m(term: Term) -> float | None:
        period = law.period(term)
        return None if period is None else period / per_m

    return replace(law, over=WAY, period=period_m, value=lambda term, d, x: law.value(term, d, per_m * x))
