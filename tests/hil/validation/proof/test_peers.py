"""Other methods: each names what it should be able to, in the form of the interface."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hil.errors import HilError
from hil.twin.library import BY_ID, LIBRARY
from hil.validation.proof.answer.answers import parse_answer
from hil.validation.proof.draw.effects import NOT_DRAWN
from hil.validation.proof.draw.generator import DrawnCase, draw, write
from hil.validation.proof.peers import METHODS, SLOW, answer_case, signals
from hil.validation.proof.peers.case import PeerCase, read_case
from hil.validation.proof.peers.fit_everything import fit_everything
from hil.validation.proof.peers.regressors import Equation, named
from hil.validation.proof.peers.sparse_regression import pysindy, select_forward
from hil.validation.proof.peers.terms import TRACES

QUICK = [name for name in METHODS if name not in SLOW]


@pytest.fixture(scope="module")
def concealed() -> DrawnCase:
    """A push against one mass, some ten times its noise."""
    return draw("single", 1, 3, effect="external_force", axis="one_mass")


@pytest.fixture(scope="module")
def folder(concealed: DrawnCase, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(concealed, tmp_path_factory.mktemp("cases"))


@pytest.fixture(scope="module")
def case(folder: Path) -> PeerCase:
    return read_case(folder)


@pytest.mark.parametrize("method", QUICK)
def test_a_large_effect_is_named_first_in_the_form_of_the_interface(
    method: str, case: PeerCase, concealed: DrawnCase
) -> None:
    if method.startswith("pysindy"):
        pytest.importorskip("pysindy", reason="not installed: make peers")
    assert concealed.truth.effects[0].size > 5.0
    answer = METHODS[method](case)
    reply = parse_answer(json.loads(json.dumps(answer)))
    assert reply.verdict == "missing_physics"
    assert reply.named[0].effect == "external_force"
    assert all(found.effect in BY_ID for found in reply.named)


def test_every_mechanism_of_the_library_has_a_term_and_every_term_is_one_of_it() -> None:
    assert {effect for effects in TRACES.values() for effect in effects} == {
        one.id for one in LIBRARY if not one.turning and one.id not in NOT_DRAWN
    }


@pytest.mark.long
def test_one_fit_of_everything_names_it_too(case: PeerCase) -> None:
    assert "external_force" in [found["effect"] for found in fit_everything(case)["missing"]]


@pytest.mark.long
def test_one_fit_of_everything_answers_in_the_form_of_the_interface(case: PeerCase) -> None:
    """After two steps, which take it nowhere yet."""
    reply = parse_answer(fit_everything(case, evaluations=2))
    assert all(found.effect in BY_ID for found in reply.named)


@pytest.mark.parametrize(("tier", "verdict"), [("null", "no_mismatch"), ("parameters_only", "parameter_error")])
def test_with_nothing_to_name_the_parameters_are_judged(tier: str, verdict: str, tmp_path: Path) -> None:
    answer = METHODS["residual_tests"](read_case(write(draw(tier, 1, 3, axis="one_mass"), tmp_path)))
    assert answer == {"verdict": verdict, "missing": []}


def test_without_pysindy_the_message_says_what_to_do(case: PeerCase, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysindy", None)
    with pytest.raises(HilError, match=r"pysindy is not installed, allowed .*make peers") as raised:
        pysindy(case)
    assert raised.value.exit_code == 1


@pytest.mark.long
def test_the_command_has_each_method_answer_every_case_once(folder: Path, tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "hil.validation.proof.peers",
        str(folder.parent),
        str(tmp_path),
        "--first",
        "1",
        "--jobs",
        "2",
        "--method",
        "forward_selection",
        "--method",
        "residual_tests",
    ]
    kept = tmp_path / "residual_tests" / folder.name / "diagnosis.json"
    kept.parent.mkdir(parents=True)
    kept.write_text("{}", encoding="utf-8")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [folder.name]
    answer = json.loads((tmp_path / "forward_selection" / folder.name / "diagnosis.json").read_text(encoding="utf-8"))
    assert answer["verdict"] == "missing_physics"
    assert answer["runtime_s"] > 0.0
    assert kept.read_text(encoding="utf-8") == "{}"
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == ""


def test_a_case_that_cannot_be_read_is_a_wrong_answer_of_each_method(folder: Path, tmp_path: Path) -> None:
    broken = tmp_path / "cases" / "case_0000"
    shutil.copytree(folder, broken)
    (broken / "bench.yaml").write_text("axis: 3\n", encoding="utf-8")
    answer_case(broken, tmp_path / "peers", ("forward_selection", "residual_tests"))
    for method in ("forward_selection", "residual_tests"):
        error = json.loads((tmp_path / "peers" / method / "case_0000" / "error.json").read_text(encoding="utf-8"))
        assert error["kind"] == "InputError"


def test_forward_selection_finds_the_terms_of_a_sum_and_stops_at_noise() -> None:
    rng = np.random.default_rng(1)
    terms = rng.standard_normal((2000, 30))
    terms[:, 4] = 0.9 * terms[:, 3] + 0.1 * terms[:, 4]  # resembles one that is there
    target = 2.0 * terms[:, 3] - terms[:, 11] + 0.1 * terms[:, 20] + rng.standard_normal(2000)
    found = select_forward(Equation("motor", target, terms, [(("",), ("",))] * 30, 1.0))
    assert found[:2] == [3, 11]
    assert set(found) <= {3, 11, 20}


def test_the_mechanism_that_most_terms_speak_for_is_named_and_a_sign_can_tell() -> None:
    """x in two equations is a spring, in one a pitch; what is too small is not named."""
    x = np.random.default_rng(2).standard_normal((500, 3))
    pitch_or_spring = (("pitch", "spring"), ("pitch", "spring"))
    table = Equation("transmission", 2.0 * x[:, 0], x[:, :1], [pitch_or_spring], 1.0)
    motor = Equation(
        "motor",
        x[:, 0] - 3.0 * x[:, 1] + 0.1 * x[:, 2],
        x,
        [(("spring",), ("spring",)), (("late",), ("early",)), (("tiny",), ("tiny",))],
        1.0,
    )
    assert named([(table, [0])]) == ["pitch"]
    assert named([(table, [0]), (motor, [])]) == ["pitch"]
    assert named([(table, [0]), (motor, [0, 1, 2])]) == ["early", "spring"]


def test_a_late_and_a_lagging_torque_are_means_of_what_is_held() -> None:
    torque, fine = np.random.default_rng(3).standard_normal(50), 1000
    held = np.repeat(torque, fine)
    late = np.concatenate([np.full(1300, torque[0]), held[:-1300]]).reshape(50, fine).mean(axis=1)
    assert signals.delayed(torque, 1.3e-3, 1e-3)[2:] == pytest.approx(late[2:], abs=1e-9)
    state, lag = np.empty(held.size), 0.0
    for row, value in enumerate(held):
        lag += (value - lag) * (1.0 - np.exp(-1e-6 / 0.7e-3))
        state[row] = lag
    assert signals.lagged(torque, 0.7e-3, 1e-3) == pytest.approx(state.reshape(50, fine).mean(axis=1), abs=2e-3)


def test_derivatives_of_a_polynomial_are_its_derivatives_and_a_turn_is_where_the_way_begins_anew() -> None:
    time_s = np.arange(400) * 1e-3
    inner = slice(30, -30)
    assert signals.smooth(3.0 + time_s**2, 1e-3, 2)[inner] == pytest.approx(2.0, abs=1e-6)
    assert signals.smooth(5.0 + 0.2 * time_s, 1e-3, 1)[inner] == pytest.approx(0.2, abs=1e-9)
    position = np.abs(time_s - 0.2)
    way = signals.direction(np.where(time_s < 0.2, -1.0, 1.0))
    assert signals.since_reversal(position, way)[[0, 199, 200, 300]] == pytest.approx([0.0, 0.199, 0.0, 0.1], abs=2e-3)
    rest = np.where((time_s > 0.1) & (time_s < 0.15), 0.0, 1.0)
    rows = signals.sliding(rest, 1e-3)
    assert rows[50]
    assert not rows[95:156].any()
    assert (signals.direction(rest) == 1.0).all()
