"""Gains of both loops, and a notch, for the identified axis, with the margins that they leave.

    velocity loop   L(z) = N C V P D      notch, PI law, velocity from positions, sampled plant, delays of the torque
    position loop   its samples see the closed velocity loop (`hil.twin.structure.frequency.position_loop`)

PI law: the most integral gain Kp / Ti whose sensitivity |1 / (1 + L)| nowhere exceeds `MOST_SENSITIVE` (MIGO design: K.
J. Åström, H. Panagopoulos, T. Hägglund, Automatica 34 (1998) 585); a P law: the most gain. Position loop: the most gain
without a peak, so that a contour is not overshot. Both hold for the diagnosed axis and for each draw of it within its
standard errors. A notch takes a mode out of the velocity loop; it is proposed where the law gains by it. Noise of the
encoders and limits of the torque are not in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isnan, pi

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.control.cascade import Gains
from hil.frequency.margins import StabilityMargins, stability_margins
from hil.frequency.twin_curves import LOWEST_HZ, POINTS, sampled_plant
from hil.twin.axis import Twin
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage
from hil.twin.parameter import Dimension
from hil.twin.picture import Picture
from hil.twin.structure.frequency import ComplexArray, laplace, position_loop, velocity_law

MOST_SENSITIVE = 2.0  # a phase margin of at least 29 degrees and a gain margin of 2 (Åström, Murray 2008, ch. 9)
PEAK = 1.06  # of the closed position loop: half a decibel
WORTH = 1.2  # gain by a notch from which it is proposed
HEADERS = ("gains", "loop", "law", "crossover", "gain margin", "phase margin", "modulus (worst)")
UNCHANGED = "Tables go by set-points alone, so that margins with them are those without."
_CROSSOVERS = np.geomspace(1e-3, 1.0, 120)  # of the velocity loop, in radians per period: 6 % apart
_TIMES = np.geomspace(4.0, 4000.0, 49)  # integral time in periods
_POSITION_GAINS = np.geomspace(0.1, 2000.0, 170)  # [1/s]: 6 % apart
_NARROW, _WIDE, _AROUND = 5.0, 0.5, 101  # widths of a mode that the frequencies cover densely; damping of a notch


@dataclass(frozen=True)
class Notch:
    """(s^2 + 2 z w s + w^2) / (s^2 + 2 d w s + w^2) with the damping ratios z of the mode and d of the filter."""

    frequency_hz: float
    damping_ratio: float
    filter_damping_ratio: float = _WIDE

    def response(self, z: ComplexArray, period_s: float) -> ComplexArray:
        """Response (k,) by the bilinear transform that keeps the notch's frequency."""
        w = 2.0 * pi * self.frequency_hz
        s = w / np.tan(0.5 * w * period_s) * (z - 1.0) / (z + 1.0)
        passed, filtered = (s**2 + 2.0 * d * w * s + w**2 for d in (self.damping_ratio, self.filter_damping_ratio))
        return np.asarray(passed / filtered, dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class LoopMargins:
    """Gains and notch with the margins of the loops; `least`: modulus margins of both in the worst of all draws."""

    gains: Gains
    notch: Notch | None
    velocity: StabilityMargins
    position: StabilityMargins
    least: tuple[float, float]


class _Axis:
    """Plant and loops of one bench at frequencies that cover its modes."""

    def __init__(self, bench: Bench, gains: Gains) -> None:
        twin = bench.twin()
        self.period_s, self.twin = gains.period_s, twin
        self.filter_coefficient = twin.loop_gains.filter_coefficient
        highest = 0.499 / self.period_s
        modes = twin.modal.frequency_rad_s / (2.0 * pi)
        self.modes = [(f, z) for f, z in zip(modes, twin.modal.damping_ratio, strict=True) if LOWEST_HZ < f < highest]
        near = [f * (1.0 + np.linspace(-1.0, 1.0, _AROUND) * min(_NARROW * max(z, 1e-4), 0.5)) for f, z in self.modes]
        grid = np.unique(np.concatenate([np.geomspace(LOWEST_HZ, highest, POINTS), *near]))
        self.hz = grid[(grid >= LOWEST_HZ) & (grid <= highest)]
        self.z = np.exp(laplace(self.hz) * self.period_s)

    def plant(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Held torque command to motor and table angle at z."""
        late = delays(self.twin, np.asarray(np.log(z) / self.period_s, dtype=np.complex128))
        motor, table = sampled_plant(self.twin, self.period_s)(z)
        return motor * late, table * late

    @cached_property
    def motor(self) -> ComplexArray:
        """Held torque command to the motor's angle at all frequencies."""
        return self.plant(self.z)[0]

    def velocity_loop(self, gains: Gains, notch: Notch | None) -> ComplexArray:
        """Open velocity loop (k,)."""
        law, velocity = velocity_law(self._filtered(gains), self.z)
        opened = law * velocity * self.motor
        return opened if notch is None else opened * notch.response(self.z, self.period_s)

    def position_loop(self, gains: Gains, notch: Notch | None) -> tuple[FloatArray, ComplexArray]:
        """Frequencies and open position loop below half of its rate."""

        def plant(z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
            motor, table = self.plant(z)
            filtered = 1.0 if notch is None else notch.response(z, self.period_s)
            return motor * filtered, table * filtered

        hz = self.hz[self.hz < 0.499 / (self.period_s * gains.position_ticks)]
        return hz, position_loop(plant, self._filtered(gains), hz)[0]

    def _filtered(self, gains: Gains) -> Gains:
        """The gains with the velocity filter of the twin."""
        return gains._replace(filter_coefficient=self.filter_coefficient)


def delays(twin: Twin, s: ComplexArray) -> ComplexArray:
    """Torque over its command (k,) at s: e^-st of dead times, 1 / (1 + st) of lags."""
    found = np.ones_like(s)
    for active in twin.active:
        mechanism = BY_ID[active.effect]
        if active.form.stage in (Stage.CURRENT, Stage.TORQUE) and mechanism.text.picture is Picture.DELAY:
            for one, time_s in zip(mechanism.parameters, active.values, strict=True):
                if one.dimension is Dimension.TIME:
                    found = found * (np.exp(-s * time_s) if mechanism.search.shifts_time else 1.0 / (1.0 + s * time_s))
    return found


def is_stable(loop: ComplexArray) -> bool:
    """True for an open loop (k,) from low frequencies to half its rate that is stable when closed.

    Nyquist's criterion for a loop without poles outside the unit circle, with at most two integrators: 1 + L ends real
    and positive, and its angle there has turned by less than a turn from the integrators' -90 or -180 degrees.
    """
    distance = 1.0 + loop
    angle = np.unwrap(np.angle(distance[::-1]))
    return bool(distance[-1].real > 0.0 and -1.5 * pi < angle[-1] < 0.5 * pi)


def margins_of(bench: Bench, draws: Sequence[Bench], gains: Gains, notch: Notch | None = None) -> LoopMargins:
    """Margins of the loops of a bench with gains, and the least of the `draws` of it."""
    return _margins([_Axis(one, gains) for one in (bench, *draws)], gains, notch)


def tune(bench: Bench, draws: Sequence[Bench]) -> list[LoopMargins]:
    """Margins with the gains as they are, with those proposed, and with a notch beside them where the law gains by it.

    Only the first where no gain keeps the margins. Raises FieldError without a control law.
    """
    gains = bench.known_control.gains(bench.axis.ratio_m_rad)
    axes = [_Axis(one, gains) for one in (bench, *draws)]
    found = [_margins(axes, gains, None)]
    notches = [None, *(Notch(float(hz), min(float(ratio), _WIDE)) for hz, ratio in axes[0].modes)]
    best, *others = [(_velocity_gains(axes, gains, notch), notch) for notch in notches]
    if best[0] is None:
        return found
    options, top = [best], max(others, key=lambda pair: _worth(pair[0]), default=best)
    if _worth(top[0]) > WORTH * _worth(best[0]):
        options.append(top)
    for velocity, notch in options:
        tuned = None if velocity is None else _with_position_gain(axes, _rounded(velocity), notch)
        if tuned is not None and min((one := _margins(axes, tuned, notch)).least) > 0.0:
            found.append(one)
    return found


def _worth(gains: Gains | None) -> float:
    return 0.0 if gains is None else gains.integral_gain_n_m_rad or gains.velocity_gain_n_m_s_rad


def _velocity_gains(axes: Sequence[_Axis], gains: Gains, notch: Notch | None) -> Gains | None:
    """The gains with the velocity law of most worth that is stable and not too sensitive on each axis."""
    period_s, inertia = gains.period_s, float(axes[0].twin.chain.inertia_kg_m2.sum())
    proportional = inertia / period_s * _CROSSOVERS
    times_s = _TIMES * period_s if gains.integral_gain_n_m_rad > 0.0 else (np.inf,)
    tried = list[Gains]()
    for time_s in times_s:
        unit = gains._replace(velocity_gain_n_m_s_rad=1.0, integral_gain_n_m_rad=1.0 / time_s)
        loop = axes[0].velocity_loop(unit, notch)
        least = np.array([float(np.min(np.abs(1.0 + kp * loop))) for kp in proportional])
        for kp in proportional[least * MOST_SENSITIVE >= 1.0].tolist():
            tried.append(unit._replace(velocity_gain_n_m_s_rad=kp, integral_gain_n_m_rad=kp / time_s))
    for one in sorted(tried, key=_worth, reverse=True):
        loops = [axis.velocity_loop(one, notch) for axis in axes]
        if all(np.min(np.abs(1.0 + loop)) * MOST_SENSITIVE >= 1.0 and is_stable(loop) for loop in loops):
            return one
    return None


def _with_position_gain(axes: Sequence[_Axis], gains: Gains, notch: Notch | None) -> Gains | None:
    """The gains with the largest position gain whose closed loop has no peak on any axis; None if none has."""
    loops = [axis.position_loop(gains._replace(position_gain_1_s=1.0), notch)[1] for axis in axes]
    for gain in _POSITION_GAINS[::-1].tolist():
        tried = [gain * loop for loop in loops]
        if all(float(np.max(np.abs(one / (1.0 + one)))) <= PEAK and is_stable(one) for one in tried):
            return gains._replace(position_gain_1_s=_two_digits(gain))
    return None


def _rounded(gains: Gains) -> Gains:
    """The gains with two digits, to the careful side."""
    kp, ki = gains.velocity_gain_n_m_s_rad, gains.integral_gain_n_m_rad
    time_s = _two_digits(kp / ki, up=True) if ki else np.inf
    return gains._replace(velocity_gain_n_m_s_rad=_two_digits(kp), integral_gain_n_m_rad=_two_digits(kp) / time_s)


def _two_digits(value: float, up: bool = False) -> float:
    """The value with two digits, rounded down or up."""
    step = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    whole = np.ceil(value / step - 1e-9) if up else np.floor(value / step + 1e-9)
    return float(f"{whole * step:.2g}")


def _margins(axes: Sequence[_Axis], gains: Gains, notch: Notch | None) -> LoopMargins:
    loops = [(axis.velocity_loop(gains, notch), axis.position_loop(gains, notch)) for axis in axes]
    velocity, position = loops[0]
    inner = min(_modulus(one) for one, _ in loops)
    outer = min(_modulus(one) for _, (_, one) in loops) if inner else 0.0  # it stands on a stable inner loop
    margins = stability_margins(axes[0].hz, velocity), stability_margins(*position)
    return LoopMargins(gains, notch, *margins, (inner, outer))


def _modulus(loop: ComplexArray) -> float:
    """Modulus margin of a loop (k,); 0 if it is unstable."""
    return float(np.min(np.abs(1.0 + loop))) if is_stable(loop) else 0.0


def margin_rows(found: Sequence[LoopMargins], drive_unit: str) -> list[tuple[str, ...]]:
    """A row of texts for each loop of each entry: gains, crossover, margins. First entry: the gains as they are."""
    rows, per = list[tuple[str, ...]](), f"{drive_unit} s/{'m' if drive_unit == 'N' else 'rad'}"
    for number, one in enumerate(found):
        title = "proposed" if one.notch is None else f"notch at {one.notch.frequency_hz:.4g} Hz"
        kp, ki = one.gains.velocity_gain_n_m_s_rad, one.gains.integral_gain_n_m_rad
        law = f"Kp {kp:.3g} {per}" + (f", Ti {1e3 * kp / ki:.3g} ms" if ki else "")
        loops = (
            ("velocity", law, one.velocity),
            ("position", f"Kv {one.gains.position_gain_1_s:.3g} 1/s", one.position),
        )
        for (loop, gains, margins), least in zip(loops, one.least, strict=True):
            told = ["unstable", "–", "–", "–"]
            if least > 0.0:
                values = (margins.crossover_hz, margins.gain_db, margins.phase_deg)
                texts = (f"{values[0]:.3g} Hz", f"{values[1]:.1f} dB", f"{values[2]:.0f} deg")
                told = ["–" if isnan(value) else text for value, text in zip(values, texts, strict=True)]
                told.append(f"{margins.modulus:.2f} ({least:.2f})")
            rows.append((title if number else "as it is", loop, gains, *told))
    return rows
