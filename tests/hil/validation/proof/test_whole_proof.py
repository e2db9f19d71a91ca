"""The blind diagnosis of given cases, and whole proofs from the draw to the scores."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from proof_folders import answer, data, quiet
from typer.testing import CliRunner

from hil.cli import app
from hil.validation.proof.answer.blind import DIAGNOSIS, ERROR
from hil.validation.proof.code import code_sha256
from hil.validation.proof.draw.effects import LIBRARY
from hil.validation.proof.draw.plan import plan
from hil.validation.proof.run import ANSWERS, diagnose_blind, prove
from hil.validation.proof.score.scores import Scores
from hil.validation.proof.seal import CASES, SEAL, unseal

SEED, SMALL = 5, 6


def test_a_case_that_fails_is_an_answer_and_not_tried_again(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / CASES / name).mkdir(parents=True)
        (tmp_path / CASES / name / "bench.yaml").touch()
    answer(tmp_path, "two")
    shares: list[float | None] = []
    names = ["one", "two"]
    for _ in range(2):
        diagnose_blind(
            tmp_path / CASES, tmp_path / ANSWERS, names, code_sha256(), 2, lambda task, share: shares.append(share)
        )
    assert shares == [0.5, 1.0]
    assert "holdout" in data(tmp_path / ANSWERS / "one" / ERROR)["error"]
    assert not (tmp_path / ANSWERS / "two" / ERROR).exists()


@pytest.mark.long
def test_a_small_proof(tmp_path: Path) -> None:
    """Six cases from the draw to the page, with wide margins: one test, since it takes its time."""
    folder = tmp_path / "small"
    ran = CliRunner().invoke(app, ["prove", "--cases", str(SMALL), "--seed", str(SEED), "--out", str(folder)])
    assert ran.exit_code == 0, ran.output
    assert data(folder / SEAL)["truths_sha256"] in ran.output
    assert {"report.html", "proof.md", "scores.json"} <= {path.name for path in folder.iterdir()}

    # sealed before anything was diagnosed, and nothing changed since
    answers = list((folder / ANSWERS).rglob(DIAGNOSIS))
    assert len(answers) == len(unseal(folder)) == SMALL
    assert all(path.stat().st_mtime_ns > (folder / SEAL).stat().st_mtime_ns for path in answers)

    cases = data(folder / "scores.json")["cases"]
    assert len({case["tier"] for case in cases}) == SMALL
    concealing = [case for case in cases if case["concealed"]]
    named = [bool({one["effect"] for one in case["concealed"]} & {one["effect"] for one in case["named"]})
             for case in concealing]  # fmt: skip
    assert sum(named) >= len(named) / 2
    assert sum(bool(case["named"]) for case in cases if not case["concealed"]) <= 1

    # the quickest case alone in another folder, without a truth on the machine's way: the same answer
    quickest = min(cases, key=lambda case: case["runtime_s"])["name"]
    shutil.copytree(folder / CASES / quickest, tmp_path / "given" / "x")
    diagnose_blind(tmp_path / "given", tmp_path / ANSWERS, ["x"], code_sha256(), 1, quiet)
    first, again = data(folder / ANSWERS / quickest / DIAGNOSIS), data(tmp_path / ANSWERS / "x" / DIAGNOSIS)
    assert (again["verdict"], [found["effect"] for found in again["missing"]]) == (
        first["verdict"],
        [found["effect"] for found in first["missing"]],
    )
    for name, correction in first["parameter_corrections"].items():
        assert again["parameter_corrections"][name]["value"] == pytest.approx(correction["value"], rel=1e-6)


@pytest.mark.long
def test_forty_cases(tmp_path: Path) -> None:
    """Defaults of hil prove, with wide margins."""
    planned = plan(40, 1)
    found: Scores = prove(tmp_path, planned, 1, 2, quiet, quiet)
    measured = {goal.name: goal.value for goal in found.goals}
    least = {
        "detected where above the floor": 0.8,
        "singles: named first": 0.6,
        "singles: in the set named first": 0.7,
        "pairs: at least one named": 0.6,
        "block right": 0.6,
        "right where confidence ≥ 0.9": 0.6,
    }
    assert {name: measured[name] for name, value in least.items() if (measured[name] or 0.0) < value} == {}
    most = {"nulls: something named": 0.2, "wrong parameters: something named": 0.2, "parameters, median error": 0.1}
    assert {name: measured[name] for name, value in most.items() if (measured[name] or 0.0) > value} == {}
    effects = [case.concealed.effect for case in found.of_tier("single") if case.concealed]
    assert len(set(effects)) == len(effects) <= len(LIBRARY)
    assert np.all([case.answer.verdict != "error" for case in found.cases])
