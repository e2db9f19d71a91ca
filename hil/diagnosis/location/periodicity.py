"""Find the domain in which a residual is periodic: position of the table, angle of the screw, or time.

    share(p) = energy that a sin p + b cos p explains of the residual,   p = 2 pi x / period, n theta, or 2 pi f t

At a single speed the three domains are equal. So rows of all speeds are used, and no period is reported for a single
speed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.location.residual_energy import Energy
from hil.identification.periods import harmonic_share, strongest_periods
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.twin.parameter import Role

CLAIMED = 0.25  # least share of the energy in one harmonic: a line that dominates the residual
APART = 1.5  # least ratio of that share to that of the next domain
LEAST_WAVES = 1.5  # that the motion passes: less is no repetition
_MOST_WAVES = 60.0  # over the motion: shorter periods along the travel are those of encoders
_SHIFTS = np.linspace(-0.5, 0.5, 9)  # of the width of a peak
_CANDIDATES = 12  # peaks of the spectrum: the strongest may be orders of the screw
SPEEDS = 1.5  # least ratio of feeds: with less, domains differ by less than the width of a line
LOWEST_HZ = 4.0  # lowest frequency: the motion itself has its lines below
HIGHEST_ORDER = 48  # slots or pole passings per revolution of usual motors
_MOST_ROWS = 20_000  # rows of a regression, thinned evenly: ample for three coefficients


@dataclass(frozen=True)
class Lock:
    """Reported periods; all None without periodicity."""

    frequency_hz: float | None = None
    period_m: float | None = None
    order_per_rev: float | None = None


def lock(seen: Sequence[Energy], channel: str, bench: Bench, terms: Sequence[Term]) -> Lock:
    """Return the period of the first term, without terms that of the residual of `channel`."""
    lead_m = _lead_m(bench)
    if terms:
        return _named(terms[0], lead_m)
    speeds = [np.abs(energy.run.velocity_command_m_s) for energy in seen]

    def moving(values: Sequence[FloatArray]) -> FloatArray:
        pairs = zip(values, speeds, strict=True)
        return np.concatenate([one[speed > 0.02 * np.max(speed)] for one, speed in pairs])

    low, high = np.percentile(moving(speeds), [10.0, 90.0])
    if high < SPEEDS * low:
        return Lock()
    x = moving([bench.axis.ratio_m_rad * energy.run.motor for energy in seen])
    signal = moving([energy.parts[channel] for energy in seen])
    time = moving([energy.run.time_s for energy in seen])
    period_s = seen[0].run.period_s
    span = float(np.ptp(x))

    def best_of(values: Sequence[float], phases: Callable[[float], FloatArray]) -> tuple[float, float]:
        return max(((_share(phases(value), signal), value) for value in values), default=(0.0, 0.0))

    orders = [float(n) for n in range(1, HIGHEST_ORDER + 1) if lead_m and n * span > LEAST_WAVES * lead_m]
    shortest = span / _MOST_WAVES
    peaks = strongest_periods(x, signal, 0.1 * shortest, shortest, _CANDIDATES, span / LEAST_WAVES)
    # rows are not even over the position: the best harmonic may be half a width of its peak away
    periods = [float(1.0 / (1.0 / p + shift / span)) for p in peaks for shift in _SHIFTS]
    # a period that divides the lead is an order of the screw
    periods = [
        p
        for p in periods
        if p <= span / LEAST_WAVES
        and (not lead_m or lead_m / p < 0.5 or abs(lead_m / p - round(lead_m / p)) > lead_m / span)
    ]
    waves_s = strongest_periods(time, signal, period_s, 2.0 * period_s, 1, 1.0 / LOWEST_HZ)
    found = {
        "order": best_of(orders, lambda n: 2.0 * np.pi * n * x / lead_m),
        "period": best_of(periods, lambda p: 2.0 * np.pi * x / p),
        "frequency": best_of([1.0 / one for one in waves_s], lambda f: 2.0 * np.pi * f * time),
    }
    best = max(found, key=lambda name: found[name][0])
    others = max(found[name][0] for name in found if name != best)
    share, value = found[best]
    if share < CLAIMED or share < APART * others:
        return Lock()
    if best == "order":
        return Lock(period_m=lead_m / value, order_per_rev=value)
    return Lock(period_m=value) if best == "period" else Lock(frequency_hz=value)


def _named(term: Term, lead_m: float) -> Lock:
    mechanism = BY_ID[term.effect]
    order, period_m = (mechanism.named(role, term.values) for role in (Role.ORDER, Role.PERIOD))
    if mechanism.once_per_turn and mechanism.turning:  # of the load
        return Lock(period_m=2.0 * math.pi)
    if mechanism.once_per_turn:  # harmonics of the turn: the strongest
        order = 1.0 + float(np.argmax([term.values[index] for index in mechanism.indices(Role.STRENGTH)]))
    if order is not None:  # without a lead counted per metre
        return Lock(period_m=lead_m / order, order_per_rev=order) if lead_m else Lock(period_m=1.0 / order)
    frequency_hz = next(
        (f for f in (mechanism.named(role, term.values) for role in (Role.FREQUENCY, Role.LINE)) if f), None
    )
    return Lock(frequency_hz=frequency_hz, period_m=period_m)


def _lead_m(bench: Bench) -> float:
    return float(getattr(bench.axis, "lead_m", None) or getattr(bench.axis, "screw_lead_m", None) or 0.0)


def _share(phase: FloatArray, signal: FloatArray) -> float:
    """Share of the energy that one harmonic explains."""
    step = max(phase.size // _MOST_ROWS, 1)
    return harmonic_share(phase[::step], signal[::step])
