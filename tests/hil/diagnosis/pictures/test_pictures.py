"""Every mechanism of the library has its picture, in which measurement and mechanism agree."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, recorded, searched
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer

from hil.arrays import FloatArray
from hil.diagnosis import stages
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.pictures.findings import finding_figure

CURVE = POINTS = ""
from hil.diagnosis.pictures.view import around
from hil.diagnosis.result import Result, Unexplained, Verdict
from hil.diagnosis.search.initial_values import axis_facts
from hil.diagnosis.verdict.cross_validation import CrossValidation
from hil.identification.honest_refit import Refit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.twin.library import BY_ID, LIBRARY

OWNER = bench()
WITHIN_THE_RECORDING = {  # of 2.4 s over 60 mm, and 5 N m at most
    "torque_saturation": {"limit_n_m": 3.0},
    "external_force": {"start_s": 0.8, "end_s": 1.2},
    "local_friction": {"begin_m": 0.02, "end_m": 0.04, "flank_m": 0.002},
    "end_stop": {"edge_m": 0.05},
    "thermal_growth": {"time_constant_s": 1.0},
}


def diagnosis_of(effect: str, times: float = 3.0) -> Diagnosis:
    """A right diagnosis of an effect of some times the strength that an engineer would call a defect."""
    run = take(recorded(OWNER), OWNER)
    values = list(BY_ID[effect].typical_values(axis_facts(OWNER, [run])))
    as_it_is = ("presliding_hysteresis", "structural_mode", "preload_loss", "stribeck_friction", "transport_delay")
    values[0] *= 1.0 if effect in as_it_is else times
    for name, value in WITHIN_THE_RECORDING.get(effect, {}).items():
        values[BY_ID[effect].names.index(name)] = value
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


PAIRS = (  # labels of what was measured and of the twin that has the mechanism
    (POINTS, CURVE),
    ("measured - twin without the event", "modelled by the event"),
    ("measured, positive direction", "twin with the findings, positive"),
    ("measured, negative direction", "twin with the findings, negative"),
    ("measured", "twin with the findings"),
)


def drawn(axis: Axes) -> dict[str, FloatArray]:
    """Points (n, 2) of each labelled curve."""
    lines = {line.get_label(): line for line in axis.lines}
    lines |= {bars.get_label(): bars.lines[0] for bars in axis.containers if isinstance(bars, ErrorbarContainer)}
    return {str(label): np.asarray(line.get_xydata()) for label, line in lines.items()}


def deviation(axis: Axes) -> float | None:
    """Deviation of the twin from the measurement where its curve is strong, over the measurement there (rms)."""
    curves = drawn(axis)
    for measured, modelled in PAIRS:
        if measured in curves and modelled in curves:
            x, points = curves[measured].T
            other_x, other = curves[modelled].T
            assert np.array_equal(x, other_x)
            known = np.isfinite(points) & np.isfinite(other)
            points, other = points[known], other[known]
            strong = np.abs(other) >= 0.5 * np.abs(other).max()
            return float(np.sqrt(np.mean((points - other)[strong] ** 2) / np.mean(points[strong] ** 2)))
    return None


@pytest.mark.parametrize("effect", [mechanism.id for mechanism in LIBRARY])
def test_the_picture_of_a_mechanism_shows_measurement_and_twin_agree(effect: str) -> None:
    diagnosis = diagnosis_of(effect)
    shown = finding_figure(diagnosis, diagnosis.final.terms[0])
    assert shown.caption.endswith("Recordings: run.")
    axes = shown.figure.axes
    assert axes[-1].get_xlabel()
    assert all("[" in axis.get_ylabel() for axis in axes)  # a unit
    if "Spectrum" in axes[0].get_title("left"):
        nominal, found = (drawn(axes[0])[name][:, 1] for name in ("nominal twin, refitted", "twin with the findings"))
        assert found.max() < 0.5 * nominal.max()
    else:
        for share in map(deviation, axes):
            assert share is not None
            assert share < 0.3


def test_the_location_shows_shares_that_add_up_and_densities_with_units() -> None:
    figure = diagnosis_of("stribeck_friction").plot("location")
    block, phase, position, speed, time, set_point = figure.axes
    for axis in (block, phase):
        assert sum(bar.get_width() for bar in axis.patches) == pytest.approx(100.0, abs=1.0)
    assert position.get_xlabel() == "position of the table [mm]"
    assert speed.get_xlabel().startswith("speed of the table [")
    assert time.get_xlabel() == "time [s]"
    assert "[" in set_point.get_ylabel()
