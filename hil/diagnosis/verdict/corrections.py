"""Corrections of the bench file by a fit, and the bench with its terms."""

import math
from collections.abc import Sequence

from hil.bench.axis_fields import RATIOS
from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.value import Correction
from hil.diagnosis.wording import unit_in
from hil.identification.coordinates import DELAY
from hil.identification.estimator import Fit
from hil.identification.inference import standard_errors
from hil.identification.terms import within_a_turn
from hil.quantities import unit_of
from hil.twin.library import BY_ID


def corrections(bench_file: Bench, fit: Fit) -> dict[str, Correction]:
    """Nominal parameters of the bench file and as fitted; without a torque only the damping of the transmission.

    Motion alone gives the ratio of stiffness and mass, and nothing of the motor side. A parameter that ended at the
    bound of the allowed range, or was left as it is, has no correction, and no mass beside one that did (`not_split`).
    Values of the bench's mechanisms are among them.
    """
    hypothesis = fit.hypothesis
    told = hypothesis.nominal if fit.data.observability.torque_measured else RATIOS
    entries = zip(
        hypothesis.bench_values, hypothesis.coordinates, hypothesis.values, standard_errors(fit), strict=False
    )
    return {
        one.name: Correction(
            nominal=before,
            value=value,
            std=std,
            unit=unit_of(one.name) if one.parameter is None else unit_in(bench_file, one.parameter),
        )
        for before, one, value, std in entries
        if one.name in told
        and one.name not in (*fit.at_bound, *not_split(bench_file, fit.at_bound), DELAY)
        and not math.isclose(value, before)
        and (before or value > CRITERIA.sigmas * std)
    }


def not_split(bench: Bench, at_bound: Sequence[str]) -> tuple[str, ...]:
    """Masses of the axis if one of them ended at its bound: their sum is told, and no single one."""
    masses = bench.axis.MASSES
    return masses if set(masses) & set(at_bound) else ()


def diagnosed_bench(bench_file: Bench, fit: Fit) -> Bench:
    """Bench file with the parameters and permanent terms of a fit; every other command accepts it.

    An event is not expected in another recording.
    """
    entries = tuple(
        MechanismEntry(
            effect=term.effect,
            variant=BY_ID[term.effect].forms[term.variant],
            parameters=dict(zip(BY_ID[term.effect].names, within_a_turn(term).values, strict=True)),
        )
        for term in fit.terms
        if not term.windows
    )
    return fit.bench.model_copy(
        update={"name": f"{bench_file.name}_diagnosed", "mechanisms": fit.hypothesis.kept + entries}
    )
