"""What the bench has already, as a draft has it, of what recordings tell."""

from collections.abc import Collection, Mapping

import numpy as np

from hil.bench.bench_file import MechanismEntry
from hil.bench.control_section import delay_in_words
from hil.diagnosis.sentence import TermErrors, sentence
from hil.diagnosis.wording import value_in_words
from hil.identification.coordinates import DELAY
from hil.identification.dataset import Dataset
from hil.identification.estimator import Fit
from hil.identification.hypothesis import Hypothesis
from hil.identification.inference import standard_errors
from hil.identification.least_squares import SIGMAS
from hil.identification.terms import Term
from hil.identification.torque_left import fit_plain, left_by_twin
from hil.quantities import digits, quantity, unit_of
from hil.twin.library import BY_ID

_DATA_SHEET = 0.3  # of a stiffness: those of catalogues are of parts, and of a nut without its load


def in_bench(
    final: Fit, held_out: Dataset, changes: Collection[str] = (), owner: Mapping[str, float] | None = None
) -> str:
    """Springs, a lateness of the torque of more than a row, and mechanisms of the bench that are above their errors and
    matter; empty without. Parameters that change are told elsewhere. A stiffness beside that which the `owner` tells.
    """
    hypothesis = final.hypothesis
    # a fit at the values of the bench file has no derivatives, and these values no errors
    errors = dict(zip(hypothesis.nominal, standard_errors(final) if final.jacobian.size else (), strict=False))
    axis, told = final.bench.axis, list[str]()
    for name in axis.SPRINGS:
        if unit_of(name) == "1" or name in changes:  # damping, or a factor on a stiffness, is no size of a spring
            continue
        if getattr(axis, name) > SIGMAS * errors.get(name, np.inf) and name not in final.at_bound:
            spring, unit = getattr(axis, name), unit_of(name)
            departs = _as_told(spring, errors.get(name, 0.0), (owner or {}).get(name), unit)
            told.append(f"A spring of {quantity(spring, unit)} in the transmission{departs}.")
    delay_s = hypothesis.resolved.bench.torque_delay_s
    acts_s = (delay_s or 0.0) + 0.5 * final.bench.period_s  # the twin holds each value for a row
    error_s = SIGMAS * errors.get(DELAY, 0.0)
    if (
        delay_s
        and DELAY not in changes
        and abs(acts_s) > max(error_s, final.bench.period_s)
        and DELAY not in final.at_bound
    ):
        told.append(f"The {delay_in_words(acts_s)}.")
    for kept in hypothesis.kept:
        entry, mechanism = kept.active(), BY_ID[kept.effect]
        known = [errors.get(f"{entry.effect}.{one.name}", 0.0) for one in mechanism.parameters]
        clear = abs(entry.values[mechanism.strength]) > SIGMAS * known[mechanism.strength]
        changes_too = any(f"{entry.effect}.{one.name}" in changes for one in mechanism.parameters)
        if clear and not changes_too and matters(final, kept, held_out if held_out.runs else final.data):
            term = Term(entry.effect, entry.variant, entry.values)
            text = sentence(term, final.bench, TermErrors(known, known[mechanism.strength]))
            told.append(text + _before(kept, final, known[mechanism.strength]))
    where = "The bench file has already, here refitted" if final.jacobian.size else "The bench file has already"
    return f"{where}: {' '.join(told)}" if told else ""


def _as_told(value: float, error: float, owner: float | None, unit: str) -> str:
    """Which share a value is of what the owner tells, in words; empty within its errors and those of data sheets."""
    if owner is None or abs(value - owner) <= max(SIGMAS * error, _DATA_SHEET * owner):
        return ""
    return f", {digits(100.0 * value / owner, 2)} % of the {quantity(owner, unit)} that the owner of the axis tells"


def _before(kept: MechanismEntry, final: Fit, error: float) -> str:
    """The strength that the bench file gives, if the fit departs from it by more than its errors; else empty."""
    hypothesis, mechanism = final.hypothesis, BY_ID[kept.effect]
    given = hypothesis.bench.mechanisms[hypothesis.resolved.bench.mechanisms.index(kept)].active()
    before, after = (entry.values[mechanism.strength] for entry in (given, kept.active()))
    if not abs(after - before) > SIGMAS * error > 0.0:
        return ""
    text = mechanism.variants[kept.active().variant].text or mechanism.text
    told = -before if after < 0.0 and text.reversed else before  # as the sentence counts it
    return f" The bench file has {value_in_words(told, mechanism.parameters[mechanism.strength], final.bench)}."


def matters(fit: Fit, entry: MechanismEntry, data: Dataset) -> bool:
    """True if a mechanism of the bench takes more of the torque than the twin leaves, in mean square on a data set.

    True where this cannot be told.
    """
    plain = fit_plain(fit.data) if data.observability.torque_measured else None
    if plain is None:
        return True
    bench, terms = fit.hypothesis.resolved
    others = tuple(one for one in bench.mechanisms if one is not entry)
    bare = Hypothesis(bench.model_copy(update={"mechanisms": others}), terms)
    left, without = (left_by_twin(one, data, plain) for one in (fit.hypothesis, bare))
    return left is None or without is None or without**2 - left**2 > left**2
