"""What the bench has already is told where it matters: beside what the twin leaves of the torque."""

from __future__ import annotations

import pytest
from diagnosis_runs import bench, dataset, evaluated, fitted, recorded

from hil.bench.bench_file import Bench, MechanismEntry
from hil.diagnosis.verdict.in_bench import in_bench, matters
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term


def with_load(load_n_m: float) -> Bench:
    entry = MechanismEntry(effect="constant_load", parameters={"load_torque_n_m": load_n_m})
    return bench().model_copy(update={"mechanisms": (entry,)})


@pytest.mark.parametrize(("load_n_m", "told"), [(0.5, True), (1e-4, False)])
def test_a_load_is_told_if_it_is_more_than_the_torque_left(load_n_m: float, told: bool) -> None:
    """Recordings with a cogging that the twin lacks: a load far below it says nothing of them."""
    owner = with_load(load_n_m)
    seen = (Term("constant_load", 0, (load_n_m,)), Term("cogging_torque", 0, (0.05, 12.0, 0.0)))
    run = take(recorded(bench(), *seen), owner)
    data = dataset([run], owner)
    fit = evaluated(Hypothesis(owner), data)
    (entry,) = fit.hypothesis.kept
    assert matters(fit, entry, data) is told
    said = in_bench(fit, dataset([run], owner))
    assert ("A constant load of 0.500 N m: a weight, a preload, or an offset" in said) is told
    assert "such as a weight" not in said


@pytest.mark.parametrize(("file_n_m", "told"), [(0.3, " The bench file has 0.300 N m."), (0.5, "")])
def test_a_load_that_departs_from_the_bench_file_is_told_with_both_values(file_n_m: float, told: str) -> None:
    owner = with_load(file_n_m)
    data = dataset([take(recorded(bench(), Term("constant_load", 0, (0.5,))), owner)], owner)
    said = in_bench(fitted(Hypothesis(owner), data), data)
    assert "A constant load of 0.500 N m" in said
    assert said.endswith(f"torque channel.{told}")


@pytest.mark.parametrize(("late_s", "told"), [(-0.0048, "torque is recorded 4.30 ms after it acts"), (-0.0005, "")])
def test_a_lateness_of_the_torque_is_told_from_a_row_on(late_s: float, told: str) -> None:
    """Without the half row for which the twin holds each value."""
    control = {"law": "unknown", "velocity_period_s": 0.001, "torque_delay_s": late_s}
    owner = Bench.model_validate({**bench().model_dump(exclude={"control"}), "control": control})
    run = take(recorded(bench()), owner)
    data = dataset([run], owner)
    said = in_bench(evaluated(Hypothesis(owner), data), data)
    assert told in said
    assert bool(said) is bool(told)


@pytest.mark.parametrize(
    ("factor", "told"), [(2.0, ", 50 % of the 113 N/µm that the owner of the axis tells."), (1.1, "")]
)
def test_a_stiffness_is_told_beside_that_of_the_owner_where_it_departs(factor: float, told: str) -> None:
    owner = bench()
    data = dataset([take(recorded(owner), owner)], owner)
    said = in_bench(fitted(Hypothesis(owner), data), data, (), {"stiffness_n_m": factor * owner.axis.stiffness_n_m})
    assert "A spring of 56." in said
    assert ("owner of the axis" in said) is bool(told)
    assert told in said
