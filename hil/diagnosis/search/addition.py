"""Measure a fit with one more term than its base for the rules of `acceptance.ADDED`.

Quantities are computed when a rule asks for them: each is a simulation or more.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.acceptance import ADDED, HARMLESS, VALUES
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.ledger import Considered, Ledger, accepted, examine
from hil.diagnosis.search.events import InsideWindows, inside_windows
from hil.diagnosis.search.initial_values import claimable, is_rare, possible, reads_wrong
from hil.diagnosis.search.shape import log_chance_below_noise
from hil.diagnosis.wording import channel_names
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.inference import bic_gain
from hil.identification.noise_floor import unrepeated
from hil.identification.terms import Term
from hil.identification.torque_left import torque_missed
from hil.identification.twin_deviation import in_measured_torque
from hil.twin.library import BY_ID
from hil.twin.mechanism import Block, Stage

_KNOTS = 12  # of a form: a curve with several bends


@dataclass(frozen=True)
class Harm:
    """One channel with a term: `ratios` are its mean squares over noise in each recording with the term, without it and
    by the bench file; `gain` is the energy that the term removes from it, `total` that from all channels that gain.
    """

    ratios: tuple[tuple[float, float, float], ...]
    gain: float
    total: float


@dataclass(frozen=True, eq=False)
class Addition:
    """A fit with one more term than its `base`.

    `reference` is the nominal fit beside the loads of the base: what the terms before it are measured against. `given`
    is the fit at the values of the bench file.
    """

    fit: Fit
    base: Fit
    reference: Fit
    given: Fit

    @cached_property
    def evidence(self) -> float:
        """Evidence for the term (BIC difference)."""
        return bic_gain(self.fit, self.base)

    @cached_property
    def removed(self) -> float:
        """Energy that the term removes from a channel over its noise, see `removed`."""
        return removed(self.base, self.fit, self.reference)

    @cached_property
    def explained(self) -> float | None:
        """Share that the term removes from the energy above the noise of the channel in which it removes most.

        A channel with a large mismatch of its own does not hide what a term explains of another, and slow motion or a
        burst not what it explains of the torque. None where the energy of that channel above the noise is not material.
        """
        gained = removed_by_channel(self.base, self.fit, self.reference)
        channel = max(gained, key=lambda name: gained[name])
        above = self.base.excess_by_channel[channel]
        if not above > CRITERIA.nothing * self.base.data.rows:
            return None
        left, without = self.torque or (0.0, 0.0)
        return min(max(gained[channel] / above, 1.0 - (left / without) ** 2 if without > 0.0 else 0.0), 1.0)

    @property
    def beside(self) -> int:
        """Number of terms of the base."""
        return len(self.base.terms)

    @cached_property
    def unrepeated(self) -> tuple[float, float]:
        """Energy of the differences between laps with the term and without it."""
        return unrepeated(self.fit.hypothesis, self.fit.data), unrepeated(self.base.hypothesis, self.base.data)

    @cached_property
    def log_chance(self) -> float | None:
        """Logarithm of the chance of the shape of the term below the noise; None above it."""
        return log_chance_below_noise(self.fit, self.base)

    @cached_property
    def inside(self) -> InsideWindows | None:
        """Residuals inside and outside the windows of a force; None for a permanent term."""
        return inside_windows(self.fit, self.base)

    @cached_property
    def torque(self) -> tuple[float, float] | None:
        """Torque missed with the term and without it, see `torque_of`."""
        return torque_of(self.fit, self.base, self.fit.terms[-1], self.fit.data)

    @cached_property
    def harm(self) -> Mapping[str, Harm]:
        """Each recorded channel with the term."""
        return harm(self.fit, self.base, self.given)

    @cached_property
    def claimable(self) -> bool:
        """True if the term can be there, and the name of its mechanism applies."""
        return claimable(self.fit.terms[-1], self.fit.bench, self.fit.data.runs)

    @cached_property
    def possible(self) -> bool:
        """True if the term can be there: else it is not even an equal of another."""
        return possible(self.fit.terms[-1], self.fit.bench, self.fit.data.runs)

    @cached_property
    def rare(self) -> bool:
        """True for a rare cause, see `is_rare`."""
        return is_rare(self.fit.terms[-1], self.fit.bench, self.fit.data.runs)

    @cached_property
    def conditions(self) -> Ledger:
        """Answers of the rules on evidence, size and form."""
        return examine(ADDED, self, CRITERIA)

    @cached_property
    def harmless(self) -> Ledger:
        """Answer of the rule on channels that pay."""
        return examine(HARMLESS, self, CRITERIA)

    @property
    def stands(self) -> bool:
        """True if the term has evidence, is material, and can be named as the cause."""
        return self.claimable and accepted(self.conditions)

    @property
    def considered(self) -> Considered:
        """The candidate and its ledger; channels are in it where the choice has asked for them."""
        more = (*self.conditions, *self.__dict__.get("harmless", ())) if self.possible else ()
        return Considered.of(self.fit.terms, (*examine(VALUES, self.claimable, CRITERIA), *more))


def removed(without: Fit, fit: Fit, reference: Fit) -> float:
    """Energy that a term removes from a channel, over that of the noise there; of the channel where it is largest."""
    gains, noise = removed_by_channel(without, fit, reference), without.residuals.by_channel
    return max((gains[name] / own.noise for name, own in noise.items() if own.noise), default=0.0)


def removed_by_channel(without: Fit, fit: Fit, reference: Fit) -> dict[str, float]:
    """Energy that a term removes from each channel, less the share that may be due to the form of those before it.

    The error of a sensor adds to its channel what its law says, with no dynamics between: of what a further term
    removes beside such errors, only a function of what they add, and of its rate, may be due to their form.
    """
    parts = [one.residuals.parts for one in (without, fit, reference)]
    direct = all(BY_ID[term.effect].block is Block.SENSOR for term in without.terms)
    found = dict[str, float]()
    for (_, channel), a, b, n in zip(parts[0], *(one.values() for one in parts), strict=True):
        gain, form = float(a @ a - b @ b), CRITERIA.form * max(float(n @ n - a @ a), 0.0)
        if direct and form > 0.0 and gain > 0.0:
            form = min(form, gain * share_of_form(a - b, n - a))
        found[channel] = found.get(channel, 0.0) + max(gain - form, 0.0)
    return found


def share_of_form(change: FloatArray, added: FloatArray) -> float:
    """Share of a change (n,) that is a function of what other terms add (n,) plus one of its rate, by least squares."""
    columns = np.column_stack([_hats(added), _hats(np.gradient(added))])
    left = change - columns @ np.linalg.lstsq(columns, change, rcond=1e-9)[0]
    varies = float(np.var(change))
    return 1.0 - float(np.var(left)) / varies if varies > 0.0 else 1.0


def _hats(values: FloatArray) -> FloatArray:
    """Piecewise linear functions (n, k) of values (n,), with as many of these between each two knots."""
    knots = np.unique(np.quantile(values, np.linspace(0.0, 1.0, _KNOTS)))
    return np.column_stack([np.interp(values, knots, one) for one in np.eye(knots.size)])


def torque_of(
    fit: Fit, without: Fit, term: Term, data: Dataset, given: Fit | None = None
) -> tuple[float, float] | None:
    """Torque missed on recordings with a term of the plant and without it; None where the torque says nothing of it.

    Without it is also the twin of the bench file, if `given`: a fit whose other parameters pay for a term is worse.

    An error of the transmission is no torque on an axis without a spring, nor is an error of the second encoder on any
    axis. One of the motor's encoder is: a motion that is read late, or wrong over the angle, needs another torque.
    """
    mechanism = BY_ID[term.effect]
    variant = mechanism.variants[term.variant]
    if mechanism.block is Block.CONTROLLER or (in_measured_torque(term) and variant.stage is not Stage.CHANNEL):
        return None
    if reads_wrong(term, fit.bench) or term.windows or (mechanism.in_transmission and not fit.bench.axis.SPRINGS):
        return None
    left, other = torque_missed(fit, data), torque_missed(without, data)
    if left is None or other is None or not np.isfinite(other):  # the twin without it does not hold the motion
        return None
    bench = None if given is None else torque_missed(given, data)
    return left, other if bench is None or not np.isfinite(bench) else min(other, bench)


def harm(fit: Fit, without: Fit, given: Fit) -> dict[str, Harm]:
    """Each recorded channel with the last term of a fit, without it, and by the bench file."""
    names, gains = channel_names(fit.bench, fit.data.runs[0]), dict[str, float]()
    ratios = dict[str, list[tuple[float, float, float]]]()
    for run, *each in zip(fit.data.runs, fit.noise_ratios, without.noise_ratios, given.noise_ratios, strict=True):
        for channel, ratio in each[0].items():
            gains[channel] = gains.get(channel, 0.0) + run.motor[run.evaluated].size * (each[1][channel] - ratio)
            ratios.setdefault(channel, []).append((ratio, each[1][channel], each[2][channel]))
    total = sum(max(gain, 0.0) for gain in gains.values())
    return {names[channel]: Harm(tuple(own), gains[channel], total) for channel, own in ratios.items()}
