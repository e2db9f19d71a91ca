"""Which clock rows have, their number or their stamps, is told by the motion, whatever noise and counts are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.recording.row_clock import RowClock, rounded_ticks, row_clock, row_ticks, stamp_share

ROWS = 2500


@dataclass(frozen=True)
class Made:
    """Rows of an axis in motion: stamps [s], position [m], true ticks, parts without gaps."""

    stamps_s: np.ndarray
    position_m: np.ndarray
    ticks: np.ndarray
    kept: list[slice]

    def clock(self, period_s: float) -> tuple[RowClock | None, bool]:
        return row_clock({"time_s": self.stamps_s, "x": self.position_m}, self.kept, period_s)


def motion(time_s: np.ndarray) -> np.ndarray:
    """Strokes of some 0.3 m at up to 1.4 m/s."""
    return 0.3 * np.sin(2 * np.pi * 0.4 * time_s) + 0.06 * np.sin(2 * np.pi * 1.7 * time_s)


def made(
    seed: int,
    *,
    rows_are_ticks: bool,
    period_s: float = 4e-3,
    jitter: float = 0.05,
    noise_m: float = 0.0,
    count_m: float = 0.0,
    missing: int = 0,
    gap: bool = False,
    offset_s: float = 0.0,
    drift: float = 0.0,
) -> Made:
    """Rows whose stamps are uneven by `jitter` periods (rms), taken at equal ticks or at their stamps."""
    rng = np.random.default_rng(seed)
    ticks = np.arange(ROWS)
    uneven_s = (ticks + np.clip(rng.normal(0.0, jitter, ROWS), -0.45, 0.45)) * period_s
    position_m = motion(ticks * period_s if rows_are_ticks else uneven_s) + noise_m * rng.standard_normal(ROWS)
    if count_m:
        position_m = np.round(position_m / count_m) * count_m
    there = np.ones(ROWS, dtype=bool)
    there[rng.integers(20, ROWS - 20, missing)] = False
    if gap:
        there[1200:1500] = False
    edge = int(np.count_nonzero(there[:1200]))
    kept = [slice(0, edge), slice(edge, int(there.sum()))] if gap else [slice(0, int(there.sum()))]
    return Made((offset_s + (1.0 + drift) * uneven_s)[there], position_m[there], ticks[there], kept)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    rows_are_ticks=st.booleans(),
    period_s=st.sampled_from([1e-3, 4e-3, 1e-2]),
    jitter=st.floats(0.03, 0.08),
    measured=st.sampled_from([(0.0, 0.0), (1e-5, 0.0), (0.0, 1e-5), (5e-6, 5e-5)]),
    missing=st.sampled_from([0, 1, 40]),
    gap=st.booleans(),
    clock=st.sampled_from([(0.0, 0.0), (1.7e6, 1e-4), (-30.0, -3e-5)]),
)
def test_both_truths_are_told_with_gaps_noise_counts_and_another_clock(
    seed: int,
    rows_are_ticks: bool,
    period_s: float,
    jitter: float,
    measured: tuple[float, float],
    missing: int,
    gap: bool,
    clock: tuple[float, float],
) -> None:
    noise_m, count_m = measured
    rows = made(
        seed,
        rows_are_ticks=rows_are_ticks,
        period_s=period_s,
        jitter=jitter,
        noise_m=noise_m,
        count_m=count_m,
        missing=missing,
        gap=gap,
        offset_s=clock[0],
        drift=clock[1],
    )
    found, told = rows.clock(period_s)
    assert told
    assert (found is not None) == rows_are_ticks
    if found is not None:
        for piece, ticks in zip(rows.kept, found.ticks, strict=True):
            np.testing.assert_array_equal(ticks, rows.ticks[piece] - rows.ticks[piece.start])
        assert found.period_s == pytest.approx(period_s * (1.0 + clock[1]), rel=1e-5)
        assert found.jitter_s == pytest.approx(jitter * period_s, rel=0.15)


@pytest.mark.parametrize("noise_m", [0.0, 2e-6, 5e-5])
@pytest.mark.parametrize("rows_are_ticks", [True, False])
def test_noise_widens_the_error_of_the_share_and_does_not_bias_it(rows_are_ticks: bool, noise_m: float) -> None:
    shares = []
    for seed in range(20):
        rows = made(seed, rows_are_ticks=rows_are_ticks, noise_m=noise_m)
        shares.append(stamp_share({"time_s": rows.stamps_s, "x": rows.position_m}, rows.kept, [rows.ticks]))
    mean, error = np.mean([one.share for one in shares]), np.median([one.error for one in shares])
    truth = 0.0 if rows_are_ticks else 1.0
    assert mean == pytest.approx(truth, abs=error + 2e-3)
    spread = np.std([one.share for one in shares])
    assert spread < 2.0 * error + 1e-3


@pytest.mark.parametrize("noise_m", [0.0, 1e-6])
def test_rest_does_not_tell(noise_m: float) -> None:
    rows = made(3, rows_are_ticks=True)
    resting = Made(rows.stamps_s, noise_m * np.random.default_rng(4).standard_normal(ROWS), rows.ticks, rows.kept)
    assert resting.clock(4e-3) == (None, False)


def test_rows_in_bursts_leave_no_tick_out() -> None:
    late = np.zeros(600)
    late[100:106], late[300], late[400:402] = np.arange(6, 0, -1) * 0.99, 0.9, (1.5, 0.6)
    np.testing.assert_array_equal(row_ticks((np.arange(600) + late) * 1e-3), np.arange(600))


def test_missing_rows_that_lie_near_are_counted_each() -> None:
    ticks = np.delete(np.arange(600), [100, 102, 105, 106, 107, 300, 590])
    uneven = np.random.default_rng(5).normal(0.0, 0.05, ticks.size)
    np.testing.assert_array_equal(row_ticks((ticks + uneven) * 1e-3), ticks)


def test_stamps_of_whole_milliseconds_of_a_clock_of_2_5_ms_are_counted() -> None:
    ticks = np.arange(ROWS)
    position_m = motion(ticks * 2.5e-3)
    stamps_s = np.floor(ticks * 2.5) * 1e-3
    found, _ = row_clock({"time_s": stamps_s, "x": position_m}, [slice(0, ROWS)], float(np.median(np.diff(stamps_s))))
    assert found is not None
    assert found.period_s == pytest.approx(2.5e-3, rel=1e-5)
    np.testing.assert_array_equal(found.ticks[0], ticks)


def test_rows_are_not_the_clock_where_missing_ones_cannot_be_counted() -> None:
    """One row of twenty is missing, and the stamps jitter by a fifth of a period: a count of all would drift."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        kept = np.sort(rng.choice(20_000, 19_000, replace=False))
        time_s = 1e-3 * kept + rng.normal(0.0, 0.2e-3, kept.size)
        time_s = np.maximum.accumulate(time_s + 1e-9 * np.arange(kept.size))
        columns = {"time_s": time_s, "position_m": motion(1e-3 * kept)}
        clock, _ = row_clock(columns, [slice(0, kept.size)], 1e-3)
        if clock is not None:
            assert np.max(np.abs(clock.ticks[0] - (kept - kept[0]))) <= 1


@pytest.mark.parametrize(
    ("period_s", "digit_s"), [(1.125e-3, 1e-3), (1.125e-3, 1e-4), (0.8e-3, 1e-3), (1.0005e-3, 1e-3)]
)
def test_the_period_of_rounded_stamps_follows_from_all_of_them(period_s: float, digit_s: float) -> None:
    stamps = np.floor(np.arange(20_000) * period_s / digit_s + 1e-9) * digit_s
    found = rounded_ticks([stamps])
    assert found is not None
    assert abs(found.period_s - period_s) <= found.error_s + 1e-12
    assert found.error_s < 1e-4 * period_s


def test_missing_rows_are_no_rounding() -> None:
    rows = np.delete(np.arange(20_000), [300, 301, 4000, 9000, 9500, 9700, 12000])
    assert rounded_ticks([rows * 1e-3]) is None
