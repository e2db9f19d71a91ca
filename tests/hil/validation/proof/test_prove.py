"""The proof as it is run: seal, the blind process and going on after an interruption."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from proof_folders import answer, data, quiet
from typer.testing import CliRunner

from hil.cli import app
from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.twin.library import BY_ID
from hil.validation.proof.answer.blind import DIAGNOSIS, ERROR
from hil.validation.proof.code import code_sha256
from hil.validation.proof.draw.generator import TIERS
from hil.validation.proof.draw.plan import Planned
from hil.validation.proof.run import ANSWERS, prove, score_others
from hil.validation.proof.score.page import write_proof
from hil.validation.proof.score.scores import score
from hil.validation.proof.score.tables import PUBLISHED, published
from hil.validation.proof.seal import CASES, SEAL, SEALED, draw_cases, read_seal, seal, sha256, unseal

QUICK = (Planned("case_0000", "parameters_only", 3), Planned("case_0001", "null", 8))


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sealed cases without answers."""
    folder = tmp_path_factory.mktemp("sealed")
    draw_cases(folder, QUICK, 7, 1, quiet)
    seal(folder, QUICK, "hil prove --cases 2 --seed 7 --out DIR", 7)
    return folder


@pytest.fixture
def copy(sealed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sealed, tmp_path / "copy"))


def test_a_seal_holds_the_truth_and_every_file(sealed: Path) -> None:
    about = data(sealed / SEAL)
    assert about["truths_sha256"] == sha256(sealed / SEALED / "truths.json")
    assert (about["seed"], about["cases"], about["code_sha256"]) == (7, 2, code_sha256())
    assert {path.name for path in (sealed / SEALED).iterdir()} == {"truths.json"}
    truths = unseal(sealed)
    assert [(truths[case.name].tier, truths[case.name].number) for case in QUICK] == [
        (case.tier, case.number) for case in QUICK
    ]
    for name, entry in data(sealed / SEALED / "truths.json").items():
        assert set(entry["sha256"]) == {"train_1.parquet", "train_2.parquet", "holdout.parquet", "bench.yaml"}
        for file, digest in entry["sha256"].items():
            assert sha256(sealed / CASES / name / file) == digest


def test_what_a_diagnosis_gets_says_nothing_of_the_truth(sealed: Path) -> None:
    words = (*BY_ID, *TIERS, "truth", "novel")
    for path in (sealed / CASES).rglob("*"):
        assert not any(word in path.name for word in words)
    for path in (sealed / CASES).rglob("bench.yaml"):
        assert not any(word in path.read_text() for word in (*BY_ID, "novel"))


@pytest.mark.parametrize("file", ["train_1.parquet", "holdout.parquet", "bench.yaml"])
def test_the_seal_notices_a_changed_file(copy: Path, file: str) -> None:
    path = copy / CASES / "case_0001" / file
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(HilError, match=r"case_0001: recordings or bench are not what was sealed"):
        unseal(copy)


def test_the_seal_notices_a_file_too_many_and_one_too_few(copy: Path) -> None:
    (copy / CASES / "case_0000" / "hint.txt").write_text("it is the backlash")
    with pytest.raises(HilError, match=r"case_0000: recordings or bench are not what was sealed"):
        unseal(copy)
    shutil.rmtree(copy / CASES / "case_0000")
    with pytest.raises(HilError, match=r"case_0000: recordings or bench are not what was sealed"):
        unseal(copy)


def test_the_seal_notices_a_changed_truth(copy: Path) -> None:
    path = copy / SEALED / "truths.json"
    truths = data(path)
    truths["case_0000"]["truth"]["verdict"] = "no_mismatch"
    write_json(path, truths)
    with pytest.raises(HilError, match=r"truths.json: is not what was sealed \(SHA-256 [0-9a-f]{64}\)"):
        unseal(copy)
    path.unlink()
    with pytest.raises(HilError, match=r"truths.json: is not what was sealed"):
        unseal(copy)
    (copy / SEAL).unlink()
    with pytest.raises(HilError, match=r"nothing is sealed here"):
        unseal(copy)


def test_drawing_goes_on_where_it_was_interrupted(copy: Path, sealed: Path) -> None:
    truths = data(copy / SEALED / "truths.json")
    # as it was when one case stood, and of the other its first recording
    (copy / SEAL).unlink()
    (copy / SEALED / "truths.json").unlink()
    write_json(copy / SEALED / "case_0000.json", truths["case_0000"])
    for file in ("train_2.parquet", "holdout.parquet", "bench.yaml"):
        (copy / CASES / "case_0001" / file).unlink()
    before = (copy / CASES / "case_0000" / "train_1.parquet").stat().st_mtime_ns
    with pytest.raises(InputError, match=r"case_0000.json: given a case of another plan, allowed one of --seed 8"):
        draw_cases(copy, QUICK, 8, 1, quiet)
    shares: list[float | None] = []
    draw_cases(copy, QUICK, 7, 1, lambda task, share: shares.append(share))
    about = seal(copy, QUICK, "hil prove --cases 2 --seed 7 --out DIR", 7)
    assert shares == [1.0]
    assert (copy / CASES / "case_0000" / "train_1.parquet").stat().st_mtime_ns == before
    assert about["truths_sha256"] == data(sealed / SEAL)["truths_sha256"]


def test_answers_are_kept_and_scored(copy: Path) -> None:
    for name in ("case_0000", "case_0001"):
        answer(copy, name, runtime_s=1.0)
    told: list[str] = []
    found = prove(copy, QUICK, 7, 1, told.append, quiet)
    assert told == [f"sealed: SHA-256 {data(copy / SEAL)['truths_sha256']}, 2 cases, {data(copy / SEAL)['sealed_at']}"]
    assert [case.right for case in found.cases] == [False, True]


def test_another_method_is_scored_on_what_it_answered(copy: Path) -> None:
    (copy / "peers" / "silent").mkdir(parents=True)
    (copy / "peers" / "begun" / "case_0001").mkdir(parents=True)
    write_json(copy / "peers" / "begun" / "case_0001" / DIAGNOSIS, {"verdict": "no_mismatch", "missing": []})
    found = score(unseal(copy), {})
    assert {
        name: [(case.truth.name, case.right) for case in other.cases]
        for name, other in score_others(copy, found).items()
    } == {"begun": [("case_0001", True)]}
    assert score_others(copy, replace(found, cases=found.cases[:1])) == {}


def test_when_time_is_up_what_is_answered_is_scored(copy: Path) -> None:
    answer(copy, "case_0000")
    told: list[str] = []
    found = prove(copy, QUICK, 7, 1, told.append, quiet, hours=0.0)
    assert [(case.truth.name, case.right) for case in found.cases] == [("case_0000", False)]
    assert told[-1] == "the first 1 of 2 cases have an answer and are scored; the same command continues"
    write_proof(found, {}, copy)
    assert (copy / "proof.md").read_text().count("The first 1 of 2 cases, seed 7, sealed ") == 1
    assert not (copy / ANSWERS / "case_0001").exists()


def test_a_quick_case_behind_one_without_an_answer_is_not_scored(copy: Path) -> None:
    answer(copy, "case_0001")
    found = prove(copy, QUICK, 7, 1, quiet, quiet, hours=0.0)
    assert found.cases == ()
    write_proof(found, {}, copy)
    assert "0 of 0 goals reached" in (copy / "proof.md").read_text()


def test_another_plan_other_code_and_another_folder_are_refused(copy: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"seal.json: given hil prove --cases 2 --seed 9 .*, allowed what was sealed"):
        prove(copy, QUICK, 9, 1, quiet, quiet)
    write_json(copy / SEAL, data(copy / SEAL) | {"code_sha256": "0" * 64})
    with pytest.raises(InputError, match=r"was sealed for a diagnosis by other code"):
        prove(copy, QUICK, 7, 1, quiet, quiet)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds other things than a proof"):
        prove(tmp_path, QUICK, 7, 1, quiet, quiet)
    (copy / SEAL).write_text("{")
    with pytest.raises(HilError, match=r"seal.json: cannot be read"):
        read_seal(copy)


def test_all_and_some_at_once_is_refused(tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["prove", "--full", "--cases", "3", "--out", str(tmp_path / "new")])
    assert isinstance(ran.exception, InputError)
    assert str(ran.exception) == "--full: given with --cases 3, allowed one of them"
    assert not (tmp_path / "new").exists()


def test_without_a_folder_the_message_says_what_to_give() -> None:
    ran = CliRunner().invoke(app, ["prove", "--cases", "3"])
    assert isinstance(ran.exception, InputError)
    assert str(ran.exception).startswith("--out: not given, allowed a folder")


def test_published_results_are_printed_and_an_unknown_name_lists_them() -> None:
    names = sorted(path.stem for path in PUBLISHED.glob("*.json"))
    assert "20261206" in names
    for name in names:
        text = published(name)
        assert text.startswith("# ")
        assert text.count("| --- |") >= 1
    ran = CliRunner().invoke(app, ["prove", "--show", "20261206"])
    assert ran.exit_code == 0
    assert "| singles: named first | ≥ 92.0 % | 98.3 % | 91.0–99.7 % | 59 | yes |" in ran.output
    with pytest.raises(InputError, match=r"--show: given x, allowed 20261204, .*20261206"):
        published("x")


def test_the_blind_process_imports_nothing_that_knows(tmp_path: Path) -> None:
    """All that a diagnosis of a case loads, by what it would load: a case without recordings."""
    (tmp_path / "cases" / "empty").mkdir(parents=True)
    code = (
        "import sys; from pathlib import Path; from hil.validation.proof.answer.blind import diagnose_case;"
        f"diagnose_case(Path({str(tmp_path / 'cases' / 'empty')!r}), Path({str(tmp_path / 'answer')!r}));"
        "print(*sorted(name for name in sys.modules if name.split('.')[0] in ('hil', 'drivers')))"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(ran.stdout.split())
    assert "hil.diagnosis.diagnose" in loaded
    assert {name for name in loaded if name.startswith("hil.validation.proof.")} == {
        "hil.validation.proof.answer",
        "hil.validation.proof.answer.blind",
        "hil.validation.proof.case_folder",
        "hil.validation.proof.code",
    }
    assert not {
        name
        for name in loaded
        if name.startswith("drivers.sim") or name in ("hil.loop.simulated_bench", "hil.loop.run")
    }
    assert data(tmp_path / "answer" / "empty" / ERROR)["kind"] == "InputError"
