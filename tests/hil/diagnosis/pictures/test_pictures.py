"""Every mechanism of the library has its picture, in which measurement and mechanism agree."""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnosis_runs import bench, dataset, evaluated, recorded, searched

from hil.diagnosis import stages
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.pictures.findings import finding_figure
from hil.diagnosis.pictures.view import around
from hil.diagnosis.result import Result, Unexplained, Verdict
from hil.diagnosis.search.initial_values import axis_facts
from hil.diagnosis.verdict.cross_validation import CrossValidation
from hil.figures.drawing import save
from hil.identification.honest_refit import Refit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.twin.library import BY_ID

OWNER = bench()


def diagnosis_of(effect: str, times: float = 3.0) -> Diagnosis:
    """A right diagnosis of an effect of some times the strength that an engineer would call a defect."""
    run = take(recorded(OWNER), OWNER)
    values = list(BY_ID[effect].typical_values(axis_facts(OWNER, [run])))
    as_it_is = ("presliding_hysteresis", "structural_mode", "preload_loss", "stribeck_friction")
    values[0] *= 1.0 if effect in as_it_is else times
    if effect == "torque_saturation":
        values[0] = 3.0
    if effect == "external_force":
        values[1:] = [0.8, 1.2]
    term = Term(effect, 0, tuple(values))
    runs = [take(recorded(OWNER, term), OWNER)]
    data = dataset(runs, OWNER)
    plain, right = evaluated(Hypothesis(OWNER), data), evaluated(Hypothesis(OWNER, (term,)), data)
    proof = CrossValidation(right, (), ())
    tested = stages.Tested(searched(plain, plain, right), proof, Refit(plain, ""))
    verdict = Verdict.MISSING_PHYSICS
    judged = stages.Judged(tested, verdict, verdict, None, False, plain, plain, right)
    result = Result(
        verdict=verdict,
        statement="",
        location=None,
        missing=(),
        parameter_corrections={},
        fit={},
        not_testable=(),
        unexplained=Unexplained(share=0.0, description=""),
        runtime_s=0.0,
    )
    return Diagnosis(stages.Reported(judged, result, OWNER, None))


def test_only_evaluated_rows_are_enlarged() -> None:
    run = take(recorded(OWNER), OWNER)
    assert run.evaluated.start > 0
    assert around(0, run, 0.3).start == run.evaluated.start


@pytest.mark.parametrize("effect", BY_ID)
def test_every_mechanism_has_its_picture(effect: str, tmp_path: Path) -> None:
    diagnosis = diagnosis_of(effect)
    shown = finding_figure(diagnosis, diagnosis.final.terms[0])
    assert save(shown.figure, tmp_path / f"{effect}.png").stat().st_size > 10_000
    assert shown.caption.endswith("Recordings: run.")
    axes = shown.figure.axes
    assert all(axis.get_xlabel() or axis is not axes[-1] for axis in axes)
    assert all("[" in axis.get_ylabel() for axis in axes)  # a unit


def test_the_location_has_its_picture(tmp_path: Path) -> None:
    figure = diagnosis_of("stribeck_friction").plot("location")
    assert save(figure, tmp_path / "location.png").stat().st_size > 10_000
