"""Every mechanism of the library has its picture, in which measurement and mechanism agree."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, recorded, searched
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis import stages
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.location.locate import block_shares
from hil.diagnosis.pictures import location
from hil.diagnosis.pictures.findings import finding_figure
from hil.diagnosis.pictures.laws import LAWS, of_axis
from hil.diagnosis.pictures.view import around, view_of
from hil.diagnosis.result import Result, Unexplained, Verdict
from hil.diagnosis.search.facts import axis_facts
from hil.diagnosis.verdict.cross_validation import CrossValidation
from hil.identification.honest_refit import Refit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.picture import Picture

OWNER = bench()
WITHIN_THE_RECORDING = {  # of 2.4 s over 60 mm, and 5 N m at most
    "torque_saturation": {"limit_n_m": 3.0},
    "external_force": {"start_s": 0.8, "end_s": 1.2},
    "local_friction": {"begin_m": 0.02, "end_m": 0.04, "flank_m": 0.002},
    "local_torque_constant": {"begin_m": 0.02, "end_m": 0.04, "flank_m": 0.002},
    "end_stop": {"edge_m": 0.05},
    "thermal_growth": {"time_constant_s": 1.0},
}


def stronger(term: Term, times: float) -> Term:
    """The term with another strength."""
    values = list(term.values)
    values[BY_ID[term.effect].strength] *= times
    return replace(term, values=tuple(values))


def diagnosis_of(effect: str, times: float = 3.0, believed: float = 1.0, owner: Bench = OWNER) -> Diagnosis:
    """A diagnosis of an effect of some times the strength that an engineer would call a defect.

    It is right, or has another strength: `believed` is the found one over the true one.
    """
    run = take(recorded(owner), owner)
    values = list(BY_ID[effect].typical_values(axis_facts(owner, [run])))
    as_it_is = (
        "presliding_hysteresis",
        "structural_mode",
        "preload_loss",
        "stribeck_friction",
        "transport_delay",
        "table_side_viscous_friction",
    )
    values[0] *= 1.0 if effect in as_it_is else times
    for name, value in WITHIN_THE_RECORDING.get(effect, {}).items():
        values[BY_ID[effect].names.index(name)] = value
    term = Term(effect, 0, tuple(values))
    runs = [take(recorded(owner, term), owner)]
    data = dataset(runs, owner)
    plain, right = evaluated(Hypothesis(owner), data), evaluated(Hypothesis(owner, (stronger(term, believed),)), data)
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
    return Diagnosis(stages.Reported(judged, result, owner, None))


def test_only_evaluated_rows_are_enlarged() -> None:
    run = take(recorded(OWNER), OWNER)
    assert run.evaluated.start > 0
    assert around(0, run, 0.3).start == run.evaluated.start


MEASURED = ("measured, ± 2 σ", "measured forwards", "measured backwards")
OF_POINTS = {MEASURED[1]: "fitted law forwards", MEASURED[2]: "fitted law backwards"}
CURVES = ("fitted law", "twin after")
WITHOUT_LAW = {Picture.TIME, Picture.FORCE}  # a residual over time has no curve of a law


class Drawn(NamedTuple):
    """A curve (n, 2), the points (m, 2) that were measured of it, and their standard errors (m,)."""

    curve: FloatArray
    points: FloatArray
    errors: FloatArray


def drawn(axis: Axes) -> list[Drawn]:
    """Curves of an axis with the points of each."""
    lines = {str(line.get_label()): np.asarray(line.get_xydata()) for line in axis.lines}
    curve = next((lines[name] for name in CURVES if name in lines), None)
    found = []
    for bars in axis.containers:
        label = str(bars.get_label())
        own = lines.get(OF_POINTS.get(label, ""), curve)
        if not isinstance(bars, ErrorbarContainer) or label not in MEASURED or own is None:
            continue
        points = np.asarray(bars.lines[0].get_xydata())
        segments = np.array(bars.lines[2][0].get_segments())
        found.append(Drawn(own, points, np.ptp(segments[:, :, 1], axis=1) / 4.0))  # two standard errors either side
    return found


def chi_square(one: Drawn) -> float:
    """Chi-square per point of the distance from the curve, which may turn back, in standard errors of the points.

    The nearest place of the curve counts, along x within a step of it.
    """
    curve, points = one.curve, one.points
    across = np.ptp(curve[:, 0]) or 1.0
    begin, along = curve[:-1], np.diff(curve, axis=0)
    total = 0.0
    for point, error in zip(points, one.errors, strict=True):
        scale = np.array([1e-3 * across, error])
        step = along / scale
        share = np.sum((point - begin) / scale * step, axis=1) / np.maximum(np.sum(step**2, axis=1), 1e-300)
        nearest = begin + np.clip(share, 0.0, 1.0)[:, None] * along
        total += float(np.min(np.sum(((point - nearest) / scale) ** 2, axis=1)))
    return total / len(points)


@pytest.mark.parametrize("effect", [mechanism.id for mechanism in LIBRARY])
def test_the_law_of_a_mechanism_runs_through_its_points(effect: str) -> None:
    diagnosis = diagnosis_of(effect)
    figure, caption = finding_figure(diagnosis, diagnosis.final.terms[0])
    assert caption.endswith(".")
    assert any(axis.get_xlabel() for axis in figure.axes)
    pairs = [one for axis in figure.axes for one in drawn(axis)]
    assert bool(pairs) is (BY_ID[effect].text.picture not in WITHOUT_LAW)
    for one in pairs:
        assert len(one.curve) >= 20
        assert chi_square(one) < 3.0


@pytest.mark.parametrize("effect", [one.id for one in LIBRARY if one.text.picture not in WITHOUT_LAW])
def test_a_wrong_law_does_not_run_through_its_points(effect: str) -> None:
    wrong = diagnosis_of(effect, believed=1.5)
    figure, _ = finding_figure(wrong, wrong.final.terms[0])
    assert max(chi_square(one) for axis in figure.axes for one in drawn(axis)) > 3.0


@pytest.mark.parametrize("effect", [one.id for one in LIBRARY if one.text.picture in LAWS])
def test_the_drawn_law_is_what_the_twin_left_before(effect: str) -> None:
    """Points are the law and the residual, so that the law itself is compared with the residual before.

    The observer attenuates a quick torque, and most of its lateness.
    """
    diagnosis = diagnosis_of(effect)
    term, (run,) = diagnosis.final.terms[0], diagnosis.train.runs
    law = LAWS[BY_ID[effect].text.picture]
    rows = law.rows(diagnosis, view_of(diagnosis, run, term))
    x, carrier, before = (values[rows.used] for values in (rows.x, rows.carrier, rows.before))
    expected = carrier * (law.value(term, diagnosis, x) - law.bare(x))
    assert np.corrcoef(before, expected)[0, 1] > 0.7
    assert 0.6 < float(before @ expected / (expected @ expected)) < 1.4


@pytest.mark.parametrize("effect", ["scale_interpolation_error", "periodic_lead_error", "backlash", "structural_mode"])
def test_a_picture_needs_no_second_encoder(effect: str) -> None:
    blind = OWNER.model_copy(update={"encoders": OWNER.encoders.model_copy(update={"table": None})})
    diagnosis = diagnosis_of(effect, owner=blind)
    figure, _ = finding_figure(diagnosis, diagnosis.final.terms[0])
    assert figure.axes[-1].get_xlabel() in ("time [s]", "frequency [Hz]")


def test_a_cogging_of_many_periods_is_folded_on_one_beside_its_line() -> None:
    diagnosis = diagnosis_of("cogging_torque")
    above, beside, _ = finding_figure(diagnosis, diagnosis.final.terms[0]).figure.axes
    (curve,) = (line.get_xydata() for line in above.lines if line.get_label() == "fitted law")
    assert len(curve) >= 400
    assert np.ptp(curve[:, 0]) == pytest.approx(30.0)  # degrees, of 12 periods per turn
    (after,) = (line for line in beside.lines if line.get_label() == "residual after")
    before = max(float(path.vertices[:, 1].max()) for one in beside.collections for path in one.get_paths())
    assert float(np.max(after.get_ydata())) < 0.05 * before


def test_no_legend_lies_over_data() -> None:
    for effect in ("cogging_torque", "stribeck_friction", "backlash", "transport_delay", "structural_mode"):
        diagnosis = diagnosis_of(effect)
        figure = finding_figure(diagnosis, diagnosis.final.terms[0]).figure
        figure.draw_without_rendering()
        assert all(axis.get_legend() is None for axis in figure.axes)
        legend = figure.legends[0].get_window_extent()
        assert not any(legend.overlaps(axis.get_window_extent()) for axis in figure.axes)
        assert legend.x0 >= 0.0
        assert legend.x1 <= figure.bbox.x1


def test_the_location_shows_shares_that_add_up_and_densities_with_units() -> None:
    figure = diagnosis_of("stribeck_friction").plot("location")
    block, phase, position, speed, time, set_point = figure.axes
    for axis in (block, phase):
        assert sum(bar.get_width() for bar in axis.patches) == pytest.approx(100.0, abs=1.0)
    assert position.get_xlabel() == "position of the table [mm]"
    assert speed.get_xlabel().startswith("speed of the table [")
    assert time.get_xlabel() == "time [s]"
    assert "[" in set_point.get_ylabel()


def test_a_panel_of_channels_that_show_nothing_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Below the noise of a row no channel has energy."""
    diagnosis = diagnosis_of("stribeck_friction")
    monkeypatch.setattr(location, "block_shares", lambda fit: dict.fromkeys(block_shares(fit), 0.0))
    titles = [axis.get_title("left") for axis in diagnosis.plot("location").axes]
    assert "Channel that shows it" not in titles
    assert "Phase of motion" in titles


def test_residuals_show_the_torque_that_a_term_takes_up() -> None:
    """Cogging: the measured torque, and what of it lacks where the axis slides, before and after."""
    diagnosis = diagnosis_of("cogging_torque")
    run = diagnosis.train.runs[0]
    measured, lacking = location.residual_panels(diagnosis, run)[-2:]
    before, after = (line.values for line in lacking.lines)
    amplitude = diagnosis.final.terms[0].values[0]
    assert measured.unit == lacking.unit == "N m"
    assert np.max(np.abs(before)) == pytest.approx(amplitude, rel=0.5)
    assert np.std(after) < 0.2 * np.std(before)


def test_cogging_of_a_linear_motor_is_drawn_over_its_way() -> None:
    """Without a lead 2 pi of its angle are 1 m: 40 cycles are a pitch of 25 mm."""
    linear = load_bench("emps").model_copy()
    on: Any = SimpleNamespace(given_bench=linear, final=SimpleNamespace(bench=linear))
    term = Term("cogging_torque", 0, (2.0, 40.0, 0.3))
    law = of_axis(LAWS[Picture.COGGING], on)
    per_turn_m = 2.0 * np.pi / linear.axis.physics().angle_per_unit
    assert (law.over.label, law.over.unit(on)) == ("position", "m")
    assert law.period(term) == pytest.approx(per_turn_m / 40.0)
    x = np.linspace(0.0, 0.2, 7)
    np.testing.assert_allclose(
        np.abs(law.value(term, on, x)), np.abs(2.0 * np.sin(80.0 * np.pi * x / per_turn_m + 0.3))
    )
    assert of_axis(LAWS[Picture.COGGING], SimpleNamespace(given_bench=OWNER)) is LAWS[Picture.COGGING]
