"""Judge a machine for the rates of a loop by its measured latencies.

good        no period was missed, and 99.9 % of the ticks are late by at most a tenth of the period
limited     99 % of the ticks within the budget at which a bench arms, and no stall that makes the devices' data stale
unsuitable  else

A stall of the processor has a duration, whatever the rate; so latencies measured at one rate are judged for another by
the share of its period that they take. That is exact where the processor sleeps equally deep between the ticks.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from hil.bench.hardware import DriveSection
from hil.loop.latency import Latencies, Series

RATES_HZ = (250.0, 1000.0, 2000.0)
# A delay of d turns the phase of a loop at its crossover f by 360 f d. The velocity loop crosses over at some 1/20 of
# the rate, so a tenth of the period takes 1.8 degrees, beside 27 that sampling, holding and one period of computing
# take anyway: not noticeable.
GOOD_SHARE = 0.1
_BUDGETS = DriveSection()


class Suitability(StrEnum):
    """Suitability of the machine for a rate."""

    GOOD = "good"
    LIMITED = "limited"
    UNSUITABLE = "unsuitable"


class RateJudgement(NamedTuple):
    """Judgement of one rate and its reason in words."""

    rate_hz: float
    suitability: Suitability
    reason: str


def judge(rate_hz: float, series: Series) -> RateJudgement:
    """Judge a rate by the latencies of the ticks of a series."""
    period_s, tick = 1.0 / rate_hz, series.tick
    missed, p999_s, p99_s = tick.missed(period_s), tick.quantile(0.999), tick.quantile(0.99)
    stale_s = _BUDGETS.missed_answers * period_s
    if not missed and p999_s <= GOOD_SHARE * period_s:
        text = (
            f"no period missed in {tick.total} ticks (95 % sure: fewer than 1 in {max(1, tick.total // 3)}); "
            f"p99.9 {us(p999_s)}, at most {us(GOOD_SHARE * period_s)}"
        )
        return RateJudgement(rate_hz, Suitability.GOOD, text)
    if p99_s <= _BUDGETS.jitter_p99 * period_s and tick.largest_s < stale_s:
        text = (
            f"{missed} periods missed in {tick.total} ticks, p99.9 {us(p999_s)} (good: none, at most "
            f"{us(GOOD_SHARE * period_s)}); a bench arms, and no stall outlasts {_BUDGETS.missed_answers} periods"
        )
        return RateJudgement(rate_hz, Suitability.LIMITED, text)
    text = (
        f"{missed} periods missed in {tick.total} ticks; p99 {us(p99_s)}, at most {us(_BUDGETS.jitter_p99 * period_s)} "
        f"(drive.jitter_p99); longest stall {us(tick.largest_s)}, allowed {us(stale_s)} (drive.missed_answers)"
    )
    return RateJudgement(rate_hz, Suitability.UNSUITABLE, text)


def beside(tick: Latencies, reference: Latencies, period_s: float) -> str:
    """Compare the missed periods of the loop with those of cyclictest in the same time."""
    loop, other = tick.missed(period_s), reference.missed(period_s)
    if loop <= 2 * other:  # twice: both counts are small and random
        return f"periods missed: loop {loop}, cyclictest {other}" + (": the machine, not this program" if loop else "")
    return f"periods missed: loop {loop}, cyclictest {other}: more than the machine explains"


def us(duration_s: float) -> str:
    """Format a duration in microseconds."""
    return f"{1e6 * duration_s:.{1 if duration_s < 1e-5 else 0}f} us"
