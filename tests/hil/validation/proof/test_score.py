"""Scores against counts made by hand: statistics and rates of many answers, and the page."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path

import pytest
from proof_cases import concealed, finding, goals, scores, truth

from hil.errors import HilError
from hil.files.output import write_json
from hil.validation.proof.answer.answers import Answer, parse_answer, read_answers
from hil.validation.proof.answer.blind import DIAGNOSIS, ERROR
from hil.validation.proof.score.page import write_proof
from hil.validation.proof.score.scores import Goal, lead, score
from hil.validation.proof.score.statistics import (
    Rate,
    confidence_bins,
    confusion,
    expected_calibration_error,
    power,
    quantile,
    rate,
    verdicts,
)
from hil.validation.proof.score.tables import goal_row
from hil.validation.proof.seal import SEAL


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
        (pytest.approx(0.65), Rate(1, 1)),
        (pytest.approx(0.95), Rate(3, 4)),
    ]
    assert expected_calibration_error(bins) == pytest.approx((4 * 0.20 + 1 * 0.35) / 5)
    assert expected_calibration_error([]) is None
    assert confidence_bins([1.0], [True])[0].right == Rate(1, 1)


def test_rates_by_hand() -> None:
    single = truth("single", concealed("backlash", gap_m=10e-6))
    right = {
        "verdict": "missing_physics",
        "location": {"block": "transmission"},
        "missing": [finding("backlash", confidence=0.95, gap_m=(10.2e-6, 0.2e-6))],
        "fit": {
            "table": {"validate": {"after_rms": 1.1, "noise_floor_rms": 1.0}},
            "torque": {"validate": {"after_rms": 1.2, "noise_floor_rms": 1.0}},
        },
    }
    wrong = {
        "verdict": "missing_physics",
        "missing": [finding("preload_loss", "backlash", confidence=0.95)],
        "location": {"block": "table"},
    }
    nothing = {"verdict": "no_mismatch", "missing": []}
    pair = truth("pair", concealed("backlash"), concealed("torque_ripple"))
    both = {"verdict": "missing_physics", "missing": [finding("torque_ripple", confidence=0.55), finding("backlash")]}
    third = {"verdict": "missing_physics", "missing": [finding("backlash"), finding("spring_load")]}
    novel = truth("novel", concealed("novel_hammering"))
    unexplained = {"verdict": "unexplained", "missing": [], "location": {"block": "table"}}
    found = goals(
        scores(
            (single, right),
            (single, wrong),
            (single, None),
            (truth("single", concealed("spring_load")), nothing),
            (pair, both),
            (pair, third),
            (truth("null"), nothing),
            (truth("null"), unexplained),
            (truth("null"), wrong),
            (
                truth("parameters_only"),
                {
                    "verdict": "parameter_error",
                    "missing": [],
                    "parameter_corrections": {"table_mass_kg": {"value": 103.0, "std": 1.0}},
                },
            ),
            (novel, unexplained),
            (novel, both),
            (
                truth("insufficient", concealed("backlash", size=0.1), not_testable=("backlash",)),
                nothing | {"not_testable": ["backlash"]},
            ),
            (
                truth("ambiguous", concealed("spring_load"), rivals=("constant_load",)),
                {"verdict": "missing_physics", "missing": [finding("constant_load", "spring_load")]},
            ),
            (truth("masked", concealed("torque_ripple", size=2.0), concealed("backlash")), both),
        )
    )
    expected = {
        "nulls: something named": Rate(1, 3),
        "nulls: right verdict": Rate(1, 3),
        "wrong parameters: something named": Rate(0, 1),
        "wrong parameters: right verdict": Rate(1, 1),
        "detected where above the floor": Rate(8, 10),
        "singles: named first": Rate(1, 4),
        "singles: in the set named first": Rate(2, 4),
        "singles: worst effect": Rate(0, 1),
        "singles: more in that set": Rate(1, 4),
        "singles: a spurious second": Rate(1, 4),
        "pairs: both named": Rate(1, 2),
        "pairs: at least one named": Rate(2, 2),
        "pairs: a spurious third": Rate(1, 2),
        "masked: what hides is named": Rate(1, 1),
        "block right": Rate(1, 4),
        "parameters, 90 % intervals cover": Rate(1, 1),
        "held out ≤ 1.15 × floor if right": Rate(0, 1),
        "right where confidence ≥ 0.9": Rate(1, 3),
        "novel: unexplained": Rate(1, 2),
        "novel: something named": Rate(1, 2),
        "novel: block right": Rate(1, 2),
        "ambiguous: reported as a set": Rate(1, 1),
        "ambiguous: more in that set": Rate(0, 1),
        "ambiguous: resolved by motion": Rate(0, 1),
        "insufficient: called not testable": Rate(1, 1),
        "insufficient: something named": Rate(0, 1),
        "less known: named or not testable": Rate(0, 0),
        "less known: a spurious name": Rate(0, 0),
    }
    assert {name: goal.measured for name, goal in found.items() if isinstance(goal.measured, Rate)} == expected
    assert found["singles: worst effect"].detail == "spring_load"
    assert found["parameters, median error"].value == pytest.approx(0.02)
    assert found["parameters of the bench, median"].value == pytest.approx(0.03)
    # 0.95 promised, 1 of 3 right; 0.55 promised, 2 of 3 right (pair and masked; not on the novel one)
    assert found["confidence: calibration error"].value == pytest.approx((3 * (0.95 - 1 / 3) + 3 * (2 / 3 - 0.55)) / 6)
    met = {name: goal.met for name, goal in found.items()}
    assert met["wrong parameters: something named"] is True
    assert met["nulls: something named"] is False
    assert met["parameters, 90 % intervals cover"] is False
    assert met["nulls: right verdict"] is met["window overlap, median IoU"] is None


def test_no_answer_at_all_reaches_no_goal() -> None:
    """Silence names nothing; where a name would be wrong it is no less wrong."""
    cases = [truth(tier, *effects) for tier, effects in (
        ("single", [concealed("backlash")]), ("pair", [concealed("backlash"), concealed("torque_ripple")]),
        ("null", []), ("parameters_only", []), ("novel", [concealed("novel_hammering")]),
        ("ambiguous", [concealed("spring_load")]), ("insufficient", [concealed("backlash", size=0.1)]))]  # fmt: skip
    truths = {str(at): of for at, of in enumerate(cases)}
    failed = dict.fromkeys(truths, Answer("error"))
    for answers in ({}, failed):
        assert not [goal.name for goal in score(truths, answers).goals if goal.met]


def test_tallies_by_hand() -> None:
    backlash, friction = concealed("backlash", size=3.04), concealed("constant_load")
    right = {"verdict": "missing_physics", "missing": [finding("backlash")]}
    cases = scores((truth("ladder", backlash), right), (truth("ladder", backlash), {"verdict": "unexplained",
                   "missing": []}), (truth("ladder", concealed("backlash", size=0.51)), right),
                   (truth("single", friction), {"verdict": "missing_physics",
                                                "missing": [finding("asymmetric_friction")]}),
                   (truth("null"), right), (truth("novel", concealed("novel_hammering")), None)).cases  # fmt: skip
    assert [(rung.size, rung.detected, rung.named) for rung in power(cases)] == [
        (0.5, Rate(1, 1), Rate(1, 1)),
        (3.0, Rate(2, 2), Rate(1, 2)),
    ]
    assert confusion(cases) == {
        "constant_load": {"constant_load": 1},
        "backlash": {"backlash": 1, "unexplained": 1},
        "novel_hammering": {"no_answer": 1},
        "nothing": {"backlash": 1},
    }
    assert verdicts(cases)["ladder"] == {"missing_physics": 2, "unexplained": 1}


def test_another_method_is_scored_by_its_names_alone(tmp_path: Path) -> None:
    for name, effect in (("a", "backlash"), ("b", "spring_load")):
        (tmp_path / name).mkdir()
        write_json(tmp_path / name / DIAGNOSIS, {"verdict": "missing_physics", "missing": [{"effect": effect}]})
    (tmp_path / "c").mkdir()
    write_json(tmp_path / "c" / ERROR, {"kind": "ValueError", "error": "singular"})
    truths = {name: truth("single", concealed("backlash"), name=name) for name in "abcd"}
    answers = read_answers(tmp_path, truths)
    assert set(answers) == {"a", "b", "c"}
    assert (answers["c"].verdict, answers["c"].statement) == ("error", "ValueError: singular")
    other = score(truths, answers)
    assert goals(other)["singles: named first"].measured == Rate(1, 4)
    own = score(truths, {name: parse_answer({"verdict": "missing_physics", "missing": [finding("backlash")]})
                         for name in truths})  # fmt: skip
    ahead = lead(own, {"other": other, "blank": score(truths, {})})
    assert (ahead.value, ahead.detail, ahead.met) == (0.75, "other", True)
    begun = score({"a": truths["a"]}, answers)
    assert lead(own, {"other": other, "begun": begun}) == ahead  # which answered one case, rightly
    assert lead(own, {"begun": begun}).met is None


def test_an_answer_that_cannot_be_read_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / DIAGNOSIS).write_text('{"verdict": "no_mismatch"}')
    with pytest.raises(HilError, match=r"a/diagnosis.json: cannot be read as an answer .*missing.*; remove the folder"):
        read_answers(tmp_path, ["a"])


def test_a_confidence_that_is_none_is_no_answer() -> None:
    for given in (float("nan"), 1.01, -0.1):
        with pytest.raises(ValueError, match=r"confidence: given .* allowed 0 to 1"):
            parse_answer({"verdict": "missing_physics", "missing": [finding("backlash", confidence=given)]})


def test_goals_as_text() -> None:
    assert goal_row(Goal("x", Rate(81, 263), low=0.2)) == ("x", "≥ 20.0 %", "30.8 %", "25.5–36.6 %", "263", "yes")
    assert goal_row(Goal("x", 0.07, high=0.05, of=9, percent=False)) == ("x", "≤ 0.0500", "0.0700", "", "9", "no")
    assert goal_row(Goal("x", inf, high=0.05, of=9))[2:] == ("none given", "", "9", "no")
    assert goal_row(Goal("x", Rate(0, 0), 0.86, 0.94, detail="a_b")) == ("x (a b)", "86.0–94.0 %", "–", "", "0", "–")


def test_the_page_holds_scores_pictures_and_the_worst_cases(tmp_path: Path) -> None:
    load = concealed("constant_load", size=5.0, load_torque_n_m=0.5)
    named = {
        "verdict": "missing_physics",
        "runtime_s": 12.0,
        "statement": "Missing physics: the load.",
        "missing": [finding("constant_load", confidence=0.9, load_torque_n_m=(0.51, 0.01))],
    }
    false = named | {"statement": "Missing physics: something."}
    found = scores(
        (truth("single", load), named),
        (truth("ladder", load), named),
        (truth("null"), false),
        (truth("novel", concealed("novel_hammering")), {"verdict": "unexplained", "missing": []}),
    )
    write_json(
        tmp_path / SEAL,
        {
            "truths_sha256": "00ff",
            "seed": 3,
            "cases": 4,
            "sealed_at": "then",
            "command": "hil prove --cases 4 --seed 3 --out DIR",
            "git_commit": None,
            "git_changed": None,
            "versions": {"numpy": "2"},
        },
    )
    write_proof(found, {"other": found}, tmp_path)
    pictures = ("power", "confusion", "calibration", "errors", "times")
    assert {path.name for path in tmp_path.iterdir()} == {
        SEAL,
        "scores.json",
        "report.html",
        "proof.md",
        *(f"{name}.png" for name in pictures),
    }
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
