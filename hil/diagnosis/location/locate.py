"""Locate a mismatch: block, channels, time windows, phases of motion, ranges of position and speed, periods.

Rows are weighted by the energy of their residual above the noise floor, block by block, so that energy is located where
it arises. A range is reported only if it is narrow against the motion and significant: blocks of the same energy in
random order (block-permutation test) are as concentrated in at most 1 % of the cases.
"""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.location.periodicity import lock
from hil.diagnosis.location.reaction_torque import acting
from hil.diagnosis.location.residual_energy import Energy, energies, without_terms
from hil.diagnosis.result import Location, Phase, PhaseKind
from hil.diagnosis.wording import channel_names
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.twin.library import BY_ID
from hil.twin.mechanism import Block

# Channel of the twin -> block whose output it is, and the parts of the axis to inspect
BLOCKS = {
    "command": ("controller", "control law and its inputs"),
    "torque": ("drive", "drive and current loop"),
    "motor": ("motor_side", "motor, screw bearings and friction"),
    "table": ("transmission", "ball screw, nut and linear encoder"),
}

CREEP = 0.05  # of the top speed: below, Stribeck friction dominates
ACCELERATING = 0.02  # of the top acceleration: below is rounding of the set-points
AFTER_REVERSAL_S = 0.06  # duration of a reversal: flanks and friction have changed sides by then
_SHUFFLES = 199  # permutations: the least number that resolves `significance` twice (1 / 200)
_BLOCK_S = 0.1  # block of a permutation: longer than the correlation of residuals
_BINS = 40  # resolution of a range: 2.5 % of the motion
_WINDOWS = 5  # time windows that are reported: more are not read


def block_shares(fit: Fit) -> dict[str, float]:
    """Share of each channel in the energy above the noise floor."""
    total = dict.fromkeys(fit.noise_ratios[0], 0.0)
    for run, ratios in zip(fit.data.runs, fit.noise_ratios, strict=True):
        for name, ratio in ratios.items():
            total[name] += run.motor.size * max(ratio - 1.0, 0.0)
    whole = sum(total.values())
    return {name: value / whole if whole > 0.0 else 0.0 for name, value in total.items()}


def locate(fit: Fit, final: Fit) -> Location:
    """Locate the deviation of a fit from its recordings; `final` is the fit with explaining terms, if any."""
    bench, terms, data = final.hypothesis.bench, final.terms, fit.data
    shares = block_shares(fit)
    names = channel_names(bench, data.runs[0])
    strongest = sorted((name for name in shares if shares[name] > 0.05), key=lambda name: -shares[name])
    strongest = strongest or [max(shares, key=lambda name: shares[name])]
    block, element = BLOCKS[strongest[0]]
    if terms:
        mechanism = BY_ID[terms[0].effect]
        block, element = mechanism.block.value, mechanism.element_of(terms[0].variant)
    elif fit is final and strongest[0] in ("motor", "table"):  # no refit removes it
        block, element = acting(fit) or (block, element)
    # with findings the energy is that of their effect, which has no noise
    seen = mismatch_energies(fit, final)
    locked = lock(seen, max(strongest, key=lambda name: shares[name]), bench, terms)
    return Location(
        block=block,
        element=element,
        channels=tuple(names[name] for name in strongest),
        phases=phase_shares(seen),
        windows_s=windows(seen[0]),
        position_m=_range([run.run.position_command_m for run in seen], seen),
        speed_m_s=_range([np.abs(run.run.velocity_command_m_s) for run in seen], seen),
        **asdict(locked),
    )


def shown_in(fit: Fit, held_out: Dataset) -> Fit:
    """The fit on the recordings that show its mismatch: those of training, or the held-out ones if only they do."""
    return fit.on(held_out) if held_out.runs and fit.at_floor else fit


def mismatch_energies(fit: Fit, final: Fit) -> list[Energy]:
    """Energy of the effect of the terms of `final` by row, else that of the residuals of `fit`."""
    if final.terms:
        of_sensors = all(BY_ID[term.effect].block is Block.SENSOR for term in final.terms)
        return energies(without_terms(final.hypothesis), fit.data, final.hypothesis, of_sensors)
    return energies(fit.hypothesis, fit.data)


def phase_shares(seen: Sequence[Energy]) -> tuple[Phase, ...]:
    """Share of each phase of motion in the energy, the largest first."""
    total = dict.fromkeys(PhaseKind, 0.0)
    for energy in seen:
        kinds = phases(energy.run)
        for kind in PhaseKind:
            total[kind] += max(float(energy.rows[kinds == kind].sum()), 0.0)
    whole = sum(total.values()) or 1.0
    found = [Phase(kind=kind, share=value / whole) for kind, value in total.items()]
    return tuple(sorted(found, key=lambda phase: -phase.share))


def windows(energy: Energy) -> tuple[tuple[float, float], ...]:
    """Shortest time windows [s] with most of the energy; none if it is spread over the recording."""
    run = energy.run
    size = max(round(_BLOCK_S / run.period_s), 1)
    starts = np.arange(0, energy.rows.size, size)
    blocks = np.maximum(np.add.reduceat(energy.rows, starts), 0.0)
    order = np.argsort(blocks)[::-1]
    enough = int(np.searchsorted(np.cumsum(blocks[order]), CRITERIA.concentrated * blocks.sum())) + 1
    if blocks.sum() <= 0.0 or enough > CRITERIA.narrow * blocks.size:
        return ()
    chosen = np.zeros(blocks.size + 2, dtype=bool)
    chosen[1:-1][order[:enough]] = True
    edges = np.flatnonzero(np.diff(chosen.astype(int)))
    spans = sorted(zip(edges[::2], edges[1::2], strict=True), key=lambda span: -blocks[span[0] : span[1]].sum())
    begin, length = run.start.time_s, size * run.period_s
    return tuple(
        sorted((round(begin + float(a) * length, 3), round(begin + float(b) * length, 3)) for a, b in spans[:_WINDOWS])
    )


def _range(labels: Sequence[FloatArray], seen: Sequence[Energy]) -> tuple[float, float] | None:
    """Narrowest range of a quantity with most of the energy; None if it is wide or not significant."""
    size = max(round(_BLOCK_S / seen[0].run.period_s), 1)
    low, high = min(float(x.min()) for x in labels), max(float(x.max()) for x in labels)
    if high <= low:
        return None
    index = [np.minimum(((x - low) / (high - low) * _BINS).astype(int), _BINS - 1) for x in labels]
    time = np.bincount(np.concatenate(index), minlength=_BINS).astype(float)

    def spread(rows: Sequence[FloatArray]) -> tuple[float, int, int]:
        held = np.maximum(np.bincount(np.concatenate(index), weights=np.concatenate(rows), minlength=_BINS), 0.0)
        total = np.concatenate([[0.0], np.cumsum(held)])
        visited = np.concatenate([[0.0], np.cumsum(time)]) / time.sum()
        best = (1.0, 0, _BINS)
        for first in range(_BINS):
            last = int(np.searchsorted(total, total[first] + CRITERIA.concentrated * total[-1]))
            if last <= _BINS:
                best = min(best, (float(visited[last] - visited[first]), first, last))
        return best

    share, first, last = spread([energy.rows for energy in seen])
    if last - first > CRITERIA.narrow * _BINS:
        return None
    random = np.random.default_rng(0)
    null = [spread([_dealt(energy.rows, size, random) for energy in seen])[0] for _ in range(_SHUFFLES)]
    if (1 + sum(value <= share for value in null)) / (1 + _SHUFFLES) > CRITERIA.significance:
        return None
    width = (high - low) / _BINS
    return low + first * width, low + last * width


def _dealt(rows: FloatArray, size: int, random: np.random.Generator) -> FloatArray:
    """Permute blocks of rows (n,) at random."""
    starts = np.arange(0, rows.size, size)
    return np.concatenate([rows[start : start + size] for start in random.permutation(starts)])


def phases(run: Measured) -> NDArray[np.str_]:
    """Phase of motion (n,) at each row by its set-points; a reversal lasts `AFTER_REVERSAL_S`."""
    speed = run.velocity_command_m_s
    top = float(np.max(np.abs(speed))) or 1.0
    acceleration = np.gradient(speed, run.period_s)
    moving = np.abs(speed) > 1e-3 * top
    kinds = np.full(speed.size, PhaseKind.CONSTANT_FEED.value, dtype="<U16")
    kinds[np.abs(acceleration) > ACCELERATING * float(np.max(np.abs(acceleration)))] = PhaseKind.ACCELERATION.value
    kinds[np.abs(speed) < CREEP * top] = PhaseKind.CREEP.value
    kinds[~moving] = PhaseKind.STANDSTILL.value
    rows = np.flatnonzero(moving)
    turns = rows[1:][np.diff(np.sign(speed[rows])) != 0.0]
    for turn in turns:
        kinds[turn : turn + round(AFTER_REVERSAL_S / run.period_s)] = PhaseKind.REVERSAL.value
    return kinds
