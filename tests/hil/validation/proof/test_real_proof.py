"""A proof on real recordings: seal, score, and a whole run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from proof_folders import answer, data, quiet
from typer.testing import CliRunner

from hil.bench.bench_file import load_bench
from hil.cli import app
from hil.errors import HilError, InputError
from hil.recording.recording import Recording, read_recording, write_parquet
from hil.twin.library import BY_ID
from hil.validation.proof.answer.answers import Answer, Named
from hil.validation.proof.answer.blind import DIAGNOSIS
from hil.validation.proof.conceal.cases import EDITS, RealTruth, draw_cases, ways
from hil.validation.proof.run import ANSWERS
from hil.validation.proof.run_real import prove_recordings
from hil.validation.proof.score.real import RealScores, score_real
from hil.validation.proof.score.real_page import write_real_proof
from hil.validation.proof.seal import CASES, SEAL, SEALED, sha256, unsealed

RECORDINGS = Path(__file__).parents[3] / "recordings"
NAMES = ("first_run", "second_run")


def recordings() -> list[Recording]:
    """Runs that are long enough to be cut: one recording after another one of the same axis, from rest to rest."""
    one, other = (read_recording(RECORDINGS / f"cogging_{name}.parquet") for name in ("learn", "prove"))
    return [joined(NAMES[0], one, other), joined(NAMES[1], other, one)]


def joined(name: str, *parts: Recording) -> Recording:
    columns = {channel: np.concatenate([part[channel] for part in parts]) for channel in parts[0].columns}
    columns["time_s"] = np.arange(columns["time_s"].size) * parts[0].period_s
    return Recording(name, columns, parts[0].period_s)


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten sealed cases without answers."""
    folder = tmp_path_factory.mktemp("real")
    found = prove_recordings(folder, recordings(), load_bench("reference"), 10, 3, 1, quiet, quiet, hours=0.0)
    assert found.cases == ()
    return folder


def test_the_seal_covers_the_truth_and_every_file(sealed: Path) -> None:
    about = data(sealed / SEAL)
    assert about["truths_sha256"] == sha256(sealed / SEALED / "truths.json")
    assert "--recording first_run --recording second_run" in about["command"]
    truths = [RealTruth.from_json(truth) for truth in unsealed(sealed).values()]
    assert len(truths) == 10
    nulls = [truth for truth in truths if not truth.kind]
    assert len(nulls) == 4
    assert {truth.half for truth in truths} == {truth.half for truth in nulls}
    case = sealed / CASES / "case_0000" / "train_1.parquet"
    content = case.read_bytes()
    case.write_bytes(content[:-1] + b"x")
    try:
        with pytest.raises(HilError, match=r"case_0000: recordings or bench are not what was sealed"):
            unsealed(sealed)
    finally:
        case.write_bytes(content)


def test_a_case_says_nothing_of_the_truth(sealed: Path) -> None:
    words = (*BY_ID, *EDITS, "kind", "truth", *NAMES)
    for place in (sealed / CASES).iterdir():
        assert {path.name for path in place.iterdir()} == {"train_1.parquet", "bench.yaml"}
        schema = pq.read_schema(place / "train_1.parquet")
        told = str(schema.metadata) + (place / "bench.yaml").read_text()
        assert not [word for word in words if word in told]


def test_the_same_seed_gives_the_same_cases_and_another_plan_is_refused(sealed: Path) -> None:
    found = [pair for recording in recordings() for pair in ways(recording, load_bench("reference"))]
    again = draw_cases(found, 10, 3)
    truths = unsealed(sealed)
    assert [case.truth for case in again] == [RealTruth.from_json(truths[case.truth.name]) for case in again]
    with pytest.raises(InputError, match=r"seal.json: given .* --seed 4 .*, allowed what was sealed"):
        prove_recordings(sealed, recordings(), load_bench("reference"), 10, 4, 1, quiet, quiet)
    with pytest.raises(InputError, match=r"allowed files of different names"):
        prove_recordings(sealed, [*recordings(), *recordings()], None, 10, 3, 1, quiet, quiet)


LOAD, SKEW, SCALE = "constant_load", "channel_time_skew", "cumulative_lead_error"


def truth(name: str, part: int = 0, **more: Any) -> RealTruth:
    return RealTruth(name, "run", part, False, **more)


def named(effect: str, confidence: float = 0.8, **parameters: tuple[float, float]) -> Named:
    return Named(effect, confidence=confidence, parameters=parameters)


def missing(*found: Named) -> Answer:
    return Answer("missing_physics" if found else "no_mismatch", found)


def scored(concealed: Answer, untouched: Answer, other: Answer, **more: Any) -> RealScores:
    truths = {"a": truth("a"), "b": truth("b", 1), "c": truth("c", kind="x", **more)}
    return score_real(truths, {"a": untouched, "b": other, "c": concealed})


def test_what_is_there_already_is_neither_right_nor_wrong() -> None:
    skewed = missing(named(SKEW))
    found = scored(missing(named(SKEW), named(LOAD)), skewed, skewed, right=(LOAD,), size=9.0).cases[2]
    assert found.first_right
    assert found.wrong == ()
    again = scored(missing(named(SKEW)), skewed, skewed, right=(SKEW,), size=9.0)
    assert again.cases[2].there_already
    figures = {goal.name: goal.measured for goal in again.goals}
    assert figures["told by 5 errors: named first"].of == 0  # type: ignore[union-attr]


def test_the_same_name_at_another_place_is_another_effect() -> None:
    cogging = "cogging_torque"

    def teeth(order: float) -> Named:
        return named(cogging, cycles_per_rev=(order, 0.1))

    given = {"right": (cogging,), "size": 9.0, "parameters": {"cycles_per_rev": 6.0}}
    before = missing(teeth(72.0))
    found = scored(missing(teeth(72.1), teeth(6.0)), before, before, **given).cases[2]
    assert (found.there_already, found.first_right, found.wrong) == (False, True, ())
    other = scored(missing(teeth(72.1), teeth(12.0)), before, before, **given).cases[2]
    assert (other.first_right, len(other.wrong)) == (False, 1)
    assert scored(missing(), missing(teeth(6.1)), before, **given).cases[2].there_already


def test_a_force_at_another_time_is_another_one() -> None:
    force = "external_force"

    def push(start: float, end: float) -> Named:
        return named(force, start_s=(start, 0.1), end_s=(end, 0.1))

    given = {"right": (force,), "size": 9.0, "parameters": {"start_s": 2.0, "end_s": 3.0}}
    assert scored(missing(push(2.1, 3.1)), missing(), missing(), **given).cases[2].first_right
    assert not scored(missing(push(4.0, 5.0)), missing(), missing(), **given).cases[2].first_right


def test_a_name_in_one_untouched_half_only_is_a_false_alarm() -> None:
    both = scored(missing(), missing(named("asymmetric_friction")), missing(named(LOAD)))
    assert [len(case.new) for case in both.cases[:2]] == [0, 0]
    one = scored(missing(), missing(named(SKEW)), missing())
    assert [len(case.new) for case in one.cases[:2]] == [1, 0]
    assert one.goals[0].measured.hits == 1  # type: ignore[union-attr]


def test_a_wrong_name_is_counted_by_its_confidence() -> None:
    found = scored(missing(named(SCALE, 0.95)), missing(), missing(), right=(LOAD,), size=9.0)
    figures = {goal.name: goal.value for goal in found.goals}
    assert (figures["wrong name above 0.9"], figures["wrong name above 0.5"]) == (1.0, 1.0)
    assert not found.cases[2].first_right
    sure = scored(missing(named(SCALE, 0.6)), missing(), missing(), shape_missing=True)
    figures = {goal.name: goal.value for goal in sure.goals}
    assert (figures["wrong name above 0.9"], figures["no name for it: something named"]) == (0.0, 1.0)


def test_intervals_of_an_effect_that_was_there_are_those_of_the_change() -> None:
    name = "load_torque_n_m"
    before = missing(named(LOAD, **{name: (2.0, 0.1)}))
    for value, held in ((2.5, True), (3.0, False), (0.5, False)):
        after = missing(named(LOAD, **{name: (value, 0.1)}))
        given = {"right": (LOAD,), "compared": {name: 0.4}, "adds": True, "effect": LOAD}
        assert scored(after, before, before, **given).cases[2].covered() == {name: held}


def test_a_page_is_written_of_what_is_answered(sealed: Path, tmp_path: Path) -> None:
    import shutil

    folder = Path(shutil.copytree(sealed, tmp_path / "copy"))
    for number in range(10):
        answer(folder, f"case_{number:04d}", runtime_s=1.0)
    found = prove_recordings(folder, recordings(), load_bench("reference"), 10, 3, 1, quiet, quiet)
    write_real_proof(found, folder)
    assert {"report.html", "proof.md", "scores.json"} <= {path.name for path in folder.iterdir()}
    assert len(data(folder / "scores.json")["cases"]) == 10
    assert "| case_0009 |" in (folder / "proof.md").read_text()


def test_a_recording_that_is_too_short_to_be_cut_is_left_out(tmp_path: Path) -> None:
    told: list[str] = []
    short = [read_recording(RECORDINGS / "clean.parquet")]
    with pytest.raises(InputError, match=r"--recording: given recordings of which no half"):
        prove_recordings(tmp_path, short, load_bench("reference"), 5, 1, 1, told.append, quiet)
    assert "too short" in told[0]


@pytest.mark.parametrize("wrong", [["--full"], ["--only", "single"], ["--plant", "mujoco"]])
def test_options_of_simulated_axes_are_refused(wrong: list[str], tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["prove", "--recording", "run.parquet", *wrong, "--out", str(tmp_path / "new")])
    assert isinstance(ran.exception, InputError)
    assert str(ran.exception).startswith("--recording: given")


@pytest.mark.long
def test_a_whole_proof_on_a_recording(tmp_path: Path) -> None:
    """From the command to the page, with the answers of the blind process."""
    folder, files = tmp_path / "proof", [tmp_path / f"{name}.parquet" for name in NAMES]
    for recording, path in zip(recordings(), files, strict=True):
        write_parquet(recording, path)
    given = ["--bench", "reference", "--cases", "5", "--seed", "2", "--workers", "1", "--out", str(folder)]
    ran = CliRunner().invoke(app, ["prove", "--recording", *map(str, files), *given])
    assert ran.exit_code == 0, ran.output
    assert data(folder / SEAL)["truths_sha256"] in ran.output
    answers = list((folder / ANSWERS).rglob(DIAGNOSIS))
    assert len(answers) == 5
    assert all(path.stat().st_mtime_ns > (folder / SEAL).stat().st_mtime_ns for path in answers)
    assert (folder / "report.html").exists()
