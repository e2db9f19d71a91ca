"""Recordings of one axis before and after a change: the parameters that differ are said."""

from __future__ import annotations

from dataclasses import replace

import pytest
from diagnosis_runs import bench, dataset, recorded

from hil.bench.bench_file import Bench
from hil.diagnosis.verdict.each_alone import changed
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term

OWNER = bench()


def rough(factor: float) -> Bench:
    friction = OWNER.axis.coulomb_torque_n_m  # type: ignore[union-attr]
    return OWNER.model_copy(
        update={"axis": OWNER.axis.model_copy(update={"coulomb_torque_n_m": factor * friction})}  # type: ignore[arg-type]
    )


def differing(*benches: Bench, terms: tuple[Term, ...] = ()) -> dict[str, tuple[float, ...]]:
    runs = [take(recorded(one, *terms, seed=k, name=f"run {k}"), OWNER) for k, one in enumerate(benches)]
    nominal = fit_nominal_parameters(dataset(runs, OWNER))
    found = changed(nominal, nominal.data.over([]), True)
    return {one.name: tuple(value.value for value in one.values) for one in found.summary.parameters} if found else {}


def test_a_parameter_that_differs_between_recordings_is_said() -> None:
    first, second = differing(rough(1.3), OWNER)["coulomb_torque_n_m"]
    assert first / second == pytest.approx(1.3, rel=0.02)
    assert "table_mass_kg" not in differing(rough(1.3), OWNER)


def test_alike_recordings_and_those_that_are_not_explained_alone_say_nothing() -> None:
    assert not differing(OWNER, OWNER)
    assert not differing(OWNER)
    assert not differing(rough(1.3), OWNER, terms=(Term("cogging_torque", 0, (0.3, 6.0, 0.2)),))


def test_a_change_at_the_end_of_a_part_is_told_with_its_moment() -> None:
    """Two recordings whose times follow each other: the axis is another one from the second on."""
    first, second = (take(recorded(one, seed=k, name=f"run {k}"), OWNER) for k, one in enumerate((OWNER, rough(1.3))))
    after_s = float(first.time_s[-1]) + first.period_s
    later = replace(second, start=second.start._replace(time_s=second.start.time_s + after_s))
    nominal = fit_nominal_parameters(dataset([first, later], OWNER))
    found = changed(nominal, nominal.data.over([]), True)
    assert found is not None
    assert found.summary.moment_s == pytest.approx(float(later.time_s[0]), abs=0.5)
    (friction,) = (one for one in found.summary.parameters if one.name == "coulomb_torque_n_m")
    assert friction.values[1].value / friction.values[0].value == pytest.approx(1.3, rel=0.03)
