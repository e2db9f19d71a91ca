"""Marks of single answers."""

from __future__ import annotations

from math import inf, pi

import pytest
from proof_cases import concealed, finding, marked, truth

from hil.validation.proof.answer.answers import parse_answer
from hil.validation.proof.score.grading import GradedCase


def test_one_law_of_two_names_is_right_by_either() -> None:
    load = truth("single", concealed("constant_load"))
    for name in ("constant_load", "asymmetric_friction"):
        assert marked(load, finding(name)).right
    other = marked(load, finding("backlash", "constant_load"))
    assert (other.top, other.in_set, other.right, other.spurious) == (False, True, False, ())


def test_a_name_beside_the_right_one_is_spurious_and_so_is_the_same_name_twice() -> None:
    ripple = truth("single", concealed("torque_ripple"))
    beside = marked(ripple, finding("backlash"), finding("torque_ripple"))
    assert (beside.top, beside.in_set, beside.right) == (False, False, False)
    assert [named.effect for named in beside.spurious] == ["backlash"]
    twice = marked(ripple, finding("torque_ripple"), finding("torque_ripple"))
    assert [twice.named_right(named) for named in twice.answer.named] == [True, False]
    assert twice.wrong == "It names torque ripple, which is not there."


def test_pairs_are_matched_one_by_one() -> None:
    pair = truth("pair", concealed("backlash"), concealed("torque_ripple"))
    assert marked(pair, finding("torque_ripple"), finding("backlash")).right
    half = marked(pair, finding("torque_ripple"), finding("preload_loss", "backlash"))
    assert [named and named.effect for named in half.matched] == [None, "torque_ripple"]
    assert half.spurious == ()
    assert half.wrong == "It does not name backlash."


def test_an_ambiguous_case_wants_the_set_and_then_one_of_it() -> None:
    of = truth("ambiguous", concealed("spring_load"), rivals=("constant_load",))
    assert marked(of, finding("asymmetric_friction", "spring_load")).right
    assert not marked(of, finding("asymmetric_friction", "spring_load")).blurred
    assert marked(of, finding("asymmetric_friction", "spring_load", "backlash")).blurred
    alone = marked(of, finding("spring_load"))
    assert (alone.top, alone.set_reported, alone.resolved) == (True, False, False)
    assert alone.wrong == "It does not report constant load as indistinguishable from what it names."
    for later, resolved in (
        (finding("spring_load"), True),
        (finding("spring_load", "constant_load"), False),
        (finding("asymmetric_friction"), False),
    ):
        answer = parse_answer({"verdict": "missing_physics", "missing": [later]})
        assert GradedCase(of, alone.answer, answer).resolved is resolved


def test_what_a_motion_cannot_show_must_be_listed_and_nothing_named() -> None:
    of = truth("insufficient", concealed("backlash", size=0.01), not_testable=("backlash",))
    assert marked(of, verdict="parameter_error", not_testable=["backlash", "torque_ripple"]).right
    assert not marked(of, verdict="parameter_error").right
    named = marked(of, finding("torque_ripple"), not_testable=["backlash"])
    assert (named.called_untestable, named.right) == (True, False)


def test_another_form_of_the_same_physics_is_right_beside_unexplained() -> None:
    bump, change = (truth("novel", concealed(name)) for name in ("novel_friction_bump", "novel_mass_change"))
    assert marked(bump).right
    named = marked(bump, finding("local_friction"))
    assert (named.right, named.names_too_much) == (True, False)
    for wrong in (
        marked(bump, finding("external_force")),
        marked(bump, finding("local_friction"), finding("external_force")),
        marked(bump, verdict="axis_changed"),
        marked(change, finding("local_friction")),
    ):
        assert not wrong.right
    assert marked(change).right
    assert marked(change, verdict="axis_changed").right


def test_below_the_floor_silence_is_right_and_a_wrong_name_is_not() -> None:
    of = truth("ladder", concealed("backlash", size=0.5))
    assert marked(of, verdict="no_mismatch").right
    assert marked(of, finding("backlash")).right
    assert not marked(of, finding("torque_ripple")).right
    assert not marked(truth("ladder", concealed("backlash", size=1.5)), verdict="no_mismatch").right
    assert not marked(of, verdict="error").right


def test_parameter_errors_are_relative_and_harmonics_weighted() -> None:
    of = truth(
        "single",
        concealed("periodic_lead_error", amplitude_m=10e-6, phase_rad=3.1, amplitude_2_m=1e-6, phase_2_rad=0.0),
    )
    case = marked(
        of,
        finding(
            "periodic_lead_error",
            amplitude_m=(11e-6, 1e-6),
            phase_rad=(0.1 - pi, 0.01),
            amplitude_2_m=(2e-6, 0.1e-6),
            phase_2_rad=(0.5, 1.0),
            amplitude_3_m=(1e-6, 0.0),
        ),
    )
    turn = 2.0 * pi - 3.1 + 0.1 - pi
    assert case.parameter_errors() == pytest.approx(
        {"amplitude_m": 0.1, "phase_rad": turn, "amplitude_2_m": 0.1, "phase_2_rad": 0.05}
    )
    assert case.covered() == {"amplitude_m": True, "phase_rad": False, "amplitude_2_m": False, "phase_2_rad": True}
    assert marked(of, finding("backlash", gap_m=(1e-6, 1e-6))).parameter_errors() == {}


def test_intervals_cover_up_to_1_645_standard_errors() -> None:
    of = truth("single", concealed("backlash", gap_m=10e-6))
    for gap_m, held in ((11.64e-6, True), (11.65e-6, False), (8.36e-6, True)):
        assert marked(of, finding("backlash", gap_m=(gap_m, 1e-6))).covered() == {"gap_m": held}


def test_places_by_name_or_else_by_location() -> None:
    ripple = truth("single", concealed("torque_ripple", place={"period_m": 0.0025}, cycles_per_rev=4.0, fraction=0.1))
    named = marked(ripple, finding("torque_ripple", cycles_per_rev=(4.02, 0.1), fraction=(0.1, 0.1)))
    assert named.period_error() == pytest.approx(1.0 - 4.0 / 4.02)
    assert set(named.parameter_errors()) == {"fraction"}
    assert marked(ripple, location={"order_per_rev": 8.0}).period_error() == pytest.approx(0.5)
    assert marked(ripple, location={"period_m": 0.0025, "order_per_rev": None}).period_error() == 0.0
    assert marked(ripple).period_error() == inf
    lead_error = truth("single", concealed("periodic_lead_error", place={"period_m": 0.01}, amplitude_m=1e-6))
    assert marked(lead_error).period_error() is None
    mode = truth("single", concealed("structural_mode", place={"frequency_hz": 50.0}, frequency_hz=50.0))
    assert marked(mode, location={"frequency_hz": 51.0}).frequency_error() == pytest.approx(0.02)
    assert marked(
        mode, finding("structural_mode", frequency_hz=(49.5, 1.0)), location={"frequency_hz": 51.0}
    ).frequency_error() == pytest.approx(0.01)
    push = truth("single", concealed("external_force", place={"window_s": [2.0, 4.0]}))
    assert marked(push, location={"windows_s": [[1.0, 2.5], [3.0, 4.0]]}).window_overlap() == pytest.approx(1.5 / 3.0)
    twice = marked(push, location={"windows_s": [[2.0, 3.0], [2.0, 3.0], [2.5, 3.5]]})
    assert twice.window_overlap() == pytest.approx(1.5 / 2.0)
    assert marked(push, finding("external_force", start_s=(2.0, 0.0), end_s=(5.0, 0.0))
                  ).window_overlap() == pytest.approx(2.0 / 3.0)  # fmt: skip
    assert marked(push).window_overlap() == 0.0
