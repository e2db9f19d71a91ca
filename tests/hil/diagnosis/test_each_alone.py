"""Recordings of one axis before and after a change: the parameters that differ are said."""

from __future__ import annotations

from diagnosis_runs import bench, dataset, recorded

from hil.bench.bench_file import Bench
from hil.diagnosis.verdict.each_alone import changed_between
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

OWNER = bench()


def rough(factor: float) -> Bench:
    friction = OWNER.axis.coulomb_torque_n_m  # type: ignore[union-attr]
    return OWNER.model_copy(
        update={"axis": OWNER.axis.model_copy(update={"coulomb_torque_n_m": factor * friction})}  # type: ignore[arg-type]
    )


def said(*benches: Bench, terms: tuple[Term, ...] = ()) -> str:
    runs = [take(recorded(one, *terms, seed=k, name=f"run {k}"), OWNER) for k, one in enumerate(benches)]
    return changed_between(fit_nominal_parameters(dataset(runs, OWNER)))


def test_a_parameter_that_differs_between_recordings_is_said() -> None:
    text = said(rough(1.3), OWNER)
    assert "coulomb_torque_n_m" in text
    assert "in run 0" in text
    assert "mass" not in text


def test_alike_recordings_and_those_that_are_not_explained_alone_say_nothing() -> None:
    assert not said(OWNER, OWNER)
    assert not said(OWNER)
    assert not said(rough(1.3), OWNER, terms=(Term("cogging_torque", 0, (0.3, 6.0, 0.2)),))
