"""Scores against counts made by hand: statistics, marks of single answers, rates of many."""

from __future__ import annotations

import json
from math import inf, pi
from pathlib import Path
from typing import Any

import pytest

from hil.errors import HilError
from hil.proof.answers import block, same_law
from hil.proof.blind import DIAGNOSIS, ERROR
from hil.proof.conceal import Concealed, Truth
from hil.proof.marking import Marked
from hil.proof.page import write_proof
from hil.proof.replies import read_replies, reply_of
from hil.proof.score import Goal, Scores, lead, score
from hil.proof.seal import SEAL
from hil.proof.statistics import Rate, confidence_bins, expected_calibration_error, quantile, rate
from hil.proof.tables import goal_row
from hil.proof.tallies import confusion, power, verdicts
from hil.report.output import write_json

VERDICTS = {"null": "no_mismatch", "parameters_only": "parameter_error", "insufficient": "parameter_error",
            "novel": "unexplained"}  # fmt: skip


def concealed(effect: str, size: float = 10.0, place: dict[str, Any] | None = None, **parameters: float) -> Concealed:
    return Concealed(effect, "", parameters, size, same_law(effect), block(effect), place or {},
                     parameters if same_law(effect) else {})


def truth(tier: str, *effects: Concealed, **more: Any) -> Truth:
    plain: dict[str, Any] = {"name": "case", "number": 0, "seed": 0, "axis": "two_mass", "rivals": (),
                             "not_testable": (), "believed_parameters": {}, "noise": {},
                             "true_parameters": {"lead_m": 0.01, "table_mass_kg": 100.0}}
    return Truth(tier=tier, effects=effects, verdict=VERDICTS.get(tier, "missing_physics"), **plain | more)


def finding(effect: str, *equivalents: str, confidence: float | None = None,
            **parameters: tuple[float, float]) -> dict[str, Any]:
    return {"effect": effect, "equivalents": equivalents, "confidence": confidence,
            "parameters": {name: {"value": value, "std": std} for name, (value, std) in parameters.items()}}


def marked(of: Truth, *missing: dict[str, Any], verdict: str = "", **more: Any) -> Marked:
    said = verdict or ("missing_physics" if missing else "unexplained")
    return Marked(of, reply_of({"verdict": said, "missing": missing, **more}))


def scores(*cases: tuple[Truth, dict[str, Any] | None]) -> Scores:
    """Of truths with their answers."""
    return score({str(at): of for at, (of, _) in enumerate(cases)},
                 {str(at): reply_of(answer) for at, (_, answer) in enumerate(cases) if answer is not None})


def goals(found: Scores) -> dict[str, Goal]:
    return {goal.name: goal for goal in found.goals}


@pytest.mark.parametrize(("hits", "of", "low", "high"), [
    (81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718),
])  # fmt: skip
def test_wilson_as_tabulated_by_newcombe_1998(hits: int, of: int, low: float, high: float) -> None:
    assert Rate(hits, of).interval == pytest.approx((low, high), abs=5e-5)


def test_intervals_hold_their_rate_and_nothing_is_known_of_none() -> None:
    for of in range(1, 40):
        for hits in range(of + 1):
            low, high = Rate(hits, of).interval
            assert 0.0 <= low <= hits / of <= high <= 1.0
    assert Rate(0, 0).value is None
    assert Rate(0, 0).interval == (0.0, 1.0)
    assert rate([True, False, True, True]) == Rate(3, 4)


def test_quantiles_by_nearest_rank_bear_infinity() -> None:
    assert quantile([3.0, 1.0, 2.0], 0.5) == 2.0
    assert quantile([1.0, inf, inf], 0.5) == inf
    assert quantile([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, inf], 0.9) == 9.0
    assert quantile([], 0.5) is None


def test_calibration_error_by_hand() -> None:
    # bin [0.9, 1]: 0.95 promised, 3 of 4 right; bin [0.6, 0.7): 0.65, 1 of 1
    bins = confidence_bins([0.95, 0.95, 0.95, 0.95, 0.65], [True, True, True, False, True])
    assert [(found.confidence, found.right) for found in bins] == [
        (pytest.approx(0.65), Rate(1, 1)), (pytest.approx(0.95), Rate(3, 4))]
    assert expected_calibration_error(bins) == pytest.approx((4 * 0.20 + 1 * 0.35) / 5)
    assert expected_calibration_error([]) is None
    assert confidence_bins([1.0], [True])[0].right == Rate(1, 1)


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
    assert [twice.named_right(named) for named in twice.reply.named] == [True, False]
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
    alone = marked(of, finding("spring_load"))
    assert (alone.top, alone.set_reported, alone.resolved) == (True, False, False)
    assert alone.wrong == "It does not say that constant load cannot be told from what it names."
    for later, resolved in ((finding("spring_load"), True), (finding("spring_load", "constant_load"), False),
                            (finding("asymmetric_friction"), False)):
        answer = reply_of({"verdict": "missing_physics", "missing": [later]})
        assert Marked(of, alone.reply, answer).resolved is resolved


def test_what_a_motion_cannot_show_must_be_listed_and_nothing_named() -> None:
    of = truth("insufficient", concealed("backlash", size=0.01), not_testable=("backlash",))
    assert marked(of, verdict="parameter_error", not_testable=["backlash", "torque_ripple"]).right
    assert not marked(of, verdict="parameter_error").right
    named = marked(of, finding("torque_ripple"), not_testable=["backlash"])
    assert (named.called_untestable, named.right) == (True, False)


def test_below_the_floor_silence_is_right_and_a_wrong_name_is_not() -> None:
    of = truth("ladder", concealed("backlash", size=0.5))
    assert marked(of, verdict="no_mismatch").right
    assert marked(of, finding("backlash")).right
    assert not marked(of, finding("torque_ripple")).right
    assert not marked(truth("ladder", concealed("backlash", size=1.5)), verdict="no_mismatch").right
    assert not marked(of, verdict="error").right


def test_parameter_errors_are_relative_and_harmonics_weighted() -> None:
    of = truth("single", concealed("periodic_lead_error", amplitude_m=10e-6, phase_rad=3.1, amplitude_2_m=1e-6,
                                   phase_2_rad=0.0))
    case = marked(of, finding("periodic_lead_error", amplitude_m=(11e-6, 1e-6), phase_rad=(0.1 - pi, 0.01),
                              amplitude_2_m=(2e-6, 0.1e-6), phase_2_rad=(0.5, 1.0), amplitude_3_m=(1e-6, 0.0)))
    turn = 2.0 * pi - 3.1 + 0.1 - pi
    assert case.parameter_errors() == pytest.approx({
        "amplitude_m": 0.1, "phase_rad": turn, "amplitude_2_m": 0.1, "phase_2_rad": 0.05})
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
    assert marked(mode, finding("structural_mode", frequency_hz=(49.5, 1.0)),
                  location={"frequency_hz": 51.0}).frequency_error() == pytest.approx(0.01)
    push = truth("single", concealed("external_force", place={"window_s": [2.0, 4.0]}))
    assert marked(push, location={"windows_s": [[1.0, 2.5], [3.0, 4.0]]}).window_overlap() == pytest.approx(1.5 / 3.0)
    assert marked(push, finding("external_force", start_s=(2.0, 0.0), end_s=(5.0, 0.0))
                  ).window_overlap() == pytest.approx(2.0 / 3.0)  # fmt: skip
    assert marked(push).window_overlap() == 0.0


def test_rates_by_hand() -> None:
    single = truth("single", concealed("backlash", gap_m=10e-6))
    right = {"verdict": "missing_physics", "location": {"block": "transmission"},
             "missing": [finding("backlash", confidence=0.95, gap_m=(10.2e-6, 0.2e-6))],
             "fit": {"table": {"validate": {"after_rms": 1.1, "noise_floor_rms": 1.0}},
                     "torque": {"validate": {"after_rms": 1.2, "noise_floor_rms": 1.0}}}}
    wrong = {"verdict": "missing_physics", "missing": [finding("preload_loss", "backlash", confidence=0.95)],
             "location": {"block": "table"}}
    nothing = {"verdict": "no_mismatch", "missing": []}
    pair = truth("pair", concealed("backlash"), concealed("torque_ripple"))
    both = {"verdict": "missing_physics", "missing": [finding("torque_ripple", confidence=0.55), finding("backlash")]}
    third = {"verdict": "missing_physics", "missing": [finding("backlash"), finding("spring_load")]}
    novel = truth("novel", concealed("novel_hammering"))
    unexplained = {"verdict": "unexplained", "missing": [], "location": {"block": "table"}}
    found = goals(scores(
        (single, right), (single, wrong), (single, None), (truth("single", concealed("spring_load")), nothing),
        (pair, both), (pair, third), (truth("null"), nothing), (truth("null"), unexplained), (truth("null"), wrong),
        (truth("parameters_only"), {"verdict": "parameter_error", "missing": [], "parameter_corrections": {
            "table_mass_kg": {"value": 103.0, "std": 1.0}}}),
        (novel, unexplained), (novel, both),
        (truth("insufficient", concealed("backlash", size=0.1), not_testable=("backlash",)),
         nothing | {"not_testable": ["backlash"]}),
        (truth("ambiguous", concealed("spring_load"), rivals=("constant_load",)),
         {"verdict": "missing_physics", "missing": [finding("constant_load", "spring_load")]}),
        (truth("masked", concealed("torque_ripple", size=2.0), concealed("backlash")), both)))
    expected = {
        "nulls: something named": Rate(1, 3), "nulls: right verdict": Rate(1, 3),
        "wrong parameters: something named": Rate(0, 1), "wrong parameters: right verdict": Rate(1, 1),
        "detected where above the floor": Rate(8, 10), "singles: named first": Rate(1, 4),
        "singles: in the set named first": Rate(2, 4), "singles: worst effect": Rate(0, 1),
        "singles: a spurious second": Rate(0, 4), "pairs: both named": Rate(1, 2),
        "pairs: at least one named": Rate(2, 2), "pairs: a spurious third": Rate(1, 2),
        "masked: what hides is named": Rate(1, 1), "block right": Rate(1, 4),
        "parameters, 90 % intervals cover": Rate(1, 1), "held out ≤ 1.15 × floor if right": Rate(0, 1),
        "right where confidence ≥ 0.9": Rate(1, 3), "novel: unexplained": Rate(1, 2),
        "novel: something named": Rate(1, 2), "novel: block right": Rate(1, 2),
        "ambiguous: reported as a set": Rate(1, 1), "ambiguous: resolved by motion": Rate(0, 1),
        "insufficient: called not testable": Rate(1, 1), "insufficient: something named": Rate(0, 1)}
    assert {name: goal.measured for name, goal in found.items() if isinstance(goal.measured, Rate)} == expected
    assert found["singles: worst effect"].detail == "spring_load"
    assert found["parameters, median error"].value == pytest.approx(0.02)
    assert found["parameters of the bench, median"].value == pytest.approx(0.03)
    # 0.95 promised, 1 of 3 right; 0.55 promised, 2 of 3 right (pair and masked; not on the novel one)
    assert found["confidence: calibration error"].value == pytest.approx(
        (3 * (0.95 - 1 / 3) + 3 * (2 / 3 - 0.55)) / 6)
    met = {name: goal.met for name, goal in found.items()}
    assert met["wrong parameters: something named"] is True
    assert met["nulls: something named"] is False
    assert met["parameters, 90 % intervals cover"] is False
    assert met["nulls: right verdict"] is met["window overlap, median IoU"] is None


def test_tallies_by_hand() -> None:
    backlash, friction = concealed("backlash", size=3.04), concealed("constant_load")
    right = {"verdict": "missing_physics", "missing": [finding("backlash")]}
    cases = scores((truth("ladder", backlash), right), (truth("ladder", backlash), {"verdict": "unexplained",
                   "missing": []}), (truth("ladder", concealed("backlash", size=0.51)), right),
                   (truth("single", friction), {"verdict": "missing_physics",
                                                "missing": [finding("asymmetric_friction")]}),
                   (truth("null"), right), (truth("novel", concealed("novel_hammering")), None)).cases  # fmt: skip
    assert [(rung.size, rung.detected, rung.named) for rung in power(cases)] == [
        (0.5, Rate(1, 1), Rate(1, 1)), (3.0, Rate(2, 2), Rate(1, 2))]
    assert confusion(cases) == {
        "constant_load": {"constant_load": 1}, "backlash": {"backlash": 1, "unexplained": 1},
        "novel_hammering": {"no_answer": 1}, "nothing": {"backlash": 1}}
    assert verdicts(cases)["ladder"] == {"missing_physics": 2, "unexplained": 1}


def test_another_method_is_scored_by_its_names_alone(tmp_path: Path) -> None:
    for name, effect in (("a", "backlash"), ("b", "spring_load")):
        (tmp_path / name).mkdir()
        write_json(tmp_path / name / DIAGNOSIS, {"verdict": "missing_physics", "missing": [{"effect": effect}]})
    (tmp_path / "c").mkdir()
    write_json(tmp_path / "c" / ERROR, {"kind": "ValueError", "error": "singular"})
    truths = {name: truth("single", concealed("backlash")) for name in "abcd"}
    replies = read_replies(tmp_path, truths)
    assert set(replies) == {"a", "b", "c"}
    assert (replies["c"].verdict, replies["c"].statement) == ("error", "ValueError: singular")
    other = score(truths, replies)
    assert goals(other)["singles: named first"].measured == Rate(1, 4)
    own = score(truths, {name: reply_of({"verdict": "missing_physics", "missing": [finding("backlash")]})
                         for name in truths})  # fmt: skip
    ahead = lead(own, {"other": other, "blank": score(truths, {})})
    assert (ahead.value, ahead.detail, ahead.met) == (0.75, "other", True)


def test_an_answer_that_cannot_be_read_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / DIAGNOSIS).write_text('{"verdict": "no_mismatch"}')
    with pytest.raises(HilError, match=r"a/diagnosis.json: cannot be read as an answer .*missing.*; remove the folder"):
        read_replies(tmp_path, ["a"])


def test_goals_as_text() -> None:
    assert goal_row(Goal("x", Rate(81, 263), low=0.2)) == ("x", "≥ 20.0 %", "30.8 %", "25.5–36.6 %", "263", "yes")
    assert goal_row(Goal("x", 0.07, high=0.05, of=9, percent=False)) == ("x", "≤ 0.0500", "0.0700", "", "9", "no")
    assert goal_row(Goal("x", inf, high=0.05, of=9))[2:] == ("none given", "", "9", "no")
    assert goal_row(Goal("x", Rate(0, 0), 0.86, 0.94, detail="a_b")) == ("x (a b)", "86.0–94.0 %", "–", "", "0", "–")


def test_the_page_holds_scores_pictures_and_the_worst_cases(tmp_path: Path) -> None:
    load = concealed("constant_load", size=5.0, load_torque_n_m=0.5)
    named = {"verdict": "missing_physics", "runtime_s": 12.0, "statement": "Missing physics: the load.",
             "missing": [finding("constant_load", confidence=0.9, load_torque_n_m=(0.51, 0.01))]}
    false = named | {"statement": "Missing physics: something."}
    found = scores((truth("single", load), named), (truth("ladder", load), named), (truth("null"), false),
                   (truth("novel", concealed("novel_hammering")), {"verdict": "unexplained", "missing": []}))
    write_json(tmp_path / SEAL, {
        "truths_sha256": "00ff", "seed": 3, "cases": 4, "sealed_at": "then",
        "command": "hil prove --cases 4 --seed 3 --out DIR",
        "git_commit": None, "git_changed": None, "versions": {"numpy": "2"}})
    write_proof(found, {"other": found}, tmp_path)
    pictures = ("power", "confusion", "calibration", "errors", "times")
    assert {path.name for path in tmp_path.iterdir()} == {SEAL, "scores.json", "report.html", "proof.md",
                                                          *(f"{name}.png" for name in pictures)}
    page = (tmp_path / "report.html").read_text()
    assert "It names constant load, which is not there." in page
    assert "Missing physics: something." in page
    assert "00ff" in page
    assert page.count("data:image/png") == len(pictures)
    text = (tmp_path / "proof.md").read_text()
    assert "| nulls: something named | ≤ 1.00 % | 100 % | 20.7–100.0 % | 1 | no |" in text
    assert "| 5 | 1 | 100 % | 20.7–100.0 % | 100 % | 20.7–100.0 % |" in text
    assert "A diagnosis took 12.0 s in the median, 12.0 s at most." in text
    data = json.loads((tmp_path / "scores.json").read_text())
    assert data["goals"][0] == {"name": "nulls: something named", "detail": "", "low": 0.0, "high": 0.01, "value": 1.0,
                                "hits": 1, "of": 1, "interval_95": pytest.approx([0.20654, 1.0], abs=1e-5),
                                "met": False}  # fmt: skip
    assert [case["right"] for case in data["cases"]] == [True, True, False, True]
    assert data["runtime_s"]["median"] == 12.0
