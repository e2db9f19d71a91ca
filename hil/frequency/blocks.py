"""Blocks of a recording whose spectra are averaged: laps of a periodic excitation, or segments (Welch).

Only rows in which the axis is commanded to move count: at rest its friction holds it. Laps are found in the set-points
themselves, so that a recording needs no profile beside it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate, get_window

from hil.arrays import FloatArray
from hil.errors import InputError

REST_S = 0.02  # shorter rests are reversals of an excitation
SAME = 1e-3  # of the largest change of the set velocity: laps that differ by less are equal
LEAST_LAPS = 2
SEGMENT_S = 2.0  # of Welch: 0.75 Hz between independent lines, a sixth of the width of a mode at 60 Hz with 3 % damping
SHORTEST_SEGMENT_S, LEAST_SEGMENTS = 0.5, 8
# Welch (IEEE Trans. Audio 15, 1967): Hann segments that overlap by a half have the correlation 1/6 of their spectra
WELCH_OVERLAP = 1.0 + 2.0 / 36.0

SLIDING = 0.998  # share of the rows of a block with the speed of its feed: single rows are the noise of an encoder

RECORD = (
    "record a multisine or a chirp on a slow feed: hil run profiles/frequency_response.yaml --bench BENCH "
    "(hil guide frequency-response)"
)


@dataclass(frozen=True, eq=False)
class Blocks:
    """First rows (b,) of blocks of `rows` rows. `periodic`: they are laps; else segments, with the variance of their
    mean relative to independent ones in `overlap`."""

    first: NDArray[np.intp]
    rows: int
    periodic: bool
    overlap: float = 1.0

    def sliding(self, motor: FloatArray) -> NDArray[np.bool_]:
        """Blocks (b,) in which the motor, at positions (n,), neither rests nor turns back: constant friction."""
        speed = np.gradient(motor)[self.first[:, None] + np.arange(self.rows)]
        forwards = np.sign(speed.mean(axis=1, keepdims=True)) * speed > 0.0
        return np.asarray(forwards.mean(axis=1) >= SLIDING)

    def only(self, chosen: NDArray[np.bool_]) -> "Blocks":
        """Some of the blocks (b,)."""
        return replace(self, first=self.first[chosen])

    @property
    def enough(self) -> bool:
        """True if their noise can be told."""
        return self.first.size >= (LEAST_LAPS if self.periodic else LEAST_SEGMENTS)

    def spectra(self, position: FloatArray, step: int = 1, difference: bool = True) -> NDArray[np.complex128]:
        """Spectra (b, k) of a channel (n,) at multiples of 1 / (rows T), of every `step`-th row.

        A position is taken as its difference from sample to sample, which has no ramp.
        """
        at = self.first[:, None] + np.arange(0, self.rows, step)
        values = position[at] - position[at - step] if difference else position[at]
        values = values - values.mean(axis=1, keepdims=True)
        if not self.periodic:
            values = values * get_window("hann", values.shape[1])
        return np.asarray(np.fft.rfft(values, axis=1)[:, 1:], dtype=np.complex128)


def find_blocks(name: str, position_m: FloatArray, velocity_m_s: FloatArray, period_s: float, ticks: int) -> Blocks:
    """Find laps, else segments, in set-points (n,). Blocks begin at multiples of `ticks` rows and last such multiples.

    Raises InputError, with what to record, where nothing moves or not for long enough.
    """
    stretches = moving_stretches(velocity_m_s, period_s)
    if not stretches:
        raise InputError(f"{name}: given set-points that rest throughout, allowed an excitation; {RECORD}")
    laps = [lap for stretch in stretches if (lap := _laps(position_m, stretch, ticks)) is not None]
    if laps:
        return _joined(laps, position_m)
    return _segments(name, stretches, period_s, ticks)


def moving_stretches(velocity_m_s: FloatArray, period_s: float) -> list[tuple[int, int]]:
    """First row and row behind the last one of each stretch of motion of set velocities (n,)."""
    moves = np.flatnonzero(velocity_m_s != 0.0)
    if moves.size == 0:
        return []
    cut = np.flatnonzero(np.diff(moves) > max(round(REST_S / period_s), 1))
    begins, ends = np.r_[moves[0], moves[cut + 1]], np.r_[moves[cut], moves[-1]] + 1
    return [(int(begin), int(end)) for begin, end in zip(begins, ends, strict=True)]


def _laps(position_m: FloatArray, stretch: tuple[int, int], ticks: int) -> tuple[NDArray[np.intp], int] | None:
    """First rows and length of the laps of a stretch; None where its motion does not repeat."""
    begin, end = max(stretch[0], ticks), stretch[1]
    step = np.diff(position_m[begin - 1 : end])
    step = step - step.mean()
    largest, count = float(np.abs(step).max(initial=0.0)), step.size
    if largest == 0.0 or count < 4 * ticks:
        return None
    likeness = correlate(step, step, method="fft")[count - 1 :] / np.arange(count, 0, -1)
    zero = int(np.argmax(likeness <= 0.0))  # behind the peak at no lag
    lag = zero + int(np.argmax(likeness[zero : count // 2])) if zero else 0
    if lag == 0:
        return None
    lag = math.lcm(lag, ticks)
    same = np.abs(step[lag:] - step[:-lag]) <= SAME * largest
    edges = np.flatnonzero(np.diff(np.r_[0, same.astype(np.int8), 0]))
    if edges.size == 0:
        return None
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    first, last = begin + int(edges[2 * longest]), begin + int(edges[2 * longest + 1]) + lag
    first = -(-first // ticks) * ticks
    laps = (last - first) // lag
    changes = np.std(step[first - begin : last - begin]) > 0.2 * np.std(step)  # no stretch of constant feed
    return (first + lag * np.arange(laps), lag) if laps >= LEAST_LAPS and changes else None


def _joined(laps: list[tuple[NDArray[np.intp], int]], position_m: FloatArray) -> Blocks:
    """The laps of all stretches that have the excitation of the longest one."""
    longest = max(laps, key=lambda one: one[0].size)

    def shape(first: NDArray[np.intp], rows: int) -> FloatArray:
        step = np.diff(position_m[first[0] - 1 : first[0] + rows])
        return np.asarray(step - step.mean())

    like = shape(*longest)
    alike = [
        first
        for first, rows in laps
        if rows == longest[1] and np.abs(shape(first, rows) - like).max() <= SAME * np.abs(like).max()
    ]
    return Blocks(np.concatenate(alike), longest[1], periodic=True)


def _segments(name: str, stretches: list[tuple[int, int]], period_s: float, ticks: int) -> Blocks:
    """Segments that overlap by a half, as long as `SEGMENT_S` if enough of them fit."""
    lengths = [end - begin - ticks for begin, end in stretches]
    rows = round(SEGMENT_S / period_s)
    while True:
        rows = rows // (2 * ticks) * 2 * ticks
        half = rows // 2
        if rows * period_s < SHORTEST_SEGMENT_S:
            raise InputError(
                f"{name}: given {sum(lengths) * period_s:.3g} s of motion, of which no {LEAST_SEGMENTS} segments of "
                f"{SHORTEST_SEGMENT_S:g} s can be made, allowed an excitation that repeats or lasts longer; {RECORD}"
            )
        counts = [max((length - rows) // half + 1, 0) if length >= rows else 0 for length in lengths]
        if sum(counts) >= LEAST_SEGMENTS:
            break
        rows = round(0.8 * rows)
    first = np.concatenate(
        [
            -(-(begin + ticks) // ticks) * ticks + half * np.arange(count)
            for (begin, _), count in zip(stretches, counts, strict=True)
        ]
    )
    first = first[first + rows <= max(end for _, end in stretches)]
    return Blocks(first.astype(np.intp), rows, periodic=False, overlap=WELCH_OVERLAP)
