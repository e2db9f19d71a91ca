"""hil investigate on the simulated bench in virtual time: it runs, diagnoses, and runs what it designed."""

from __future__ import annotations

import io
import json
from contextlib import nullcontext
from pathlib import Path

import pytest
import yaml
from bench_runs import bench_with

from hil.commands.investigate import _confirmed, investigate
from hil.diagnosis.candidate_motions import reach
from hil.errors import HilError, InputError
from hil.identification.measured import take
from hil.investigation import investigate as investigate_bench
from hil.loop.run import RunResult, run_profile
from hil.motion.profile import Profile, load_profile
from hil.motion.trajectory import plan
from hil.recording.recording import read_recording
from hil.report.compare_report import write_bench

# noise enough to move a reading by a count: else counting looks like physics at a single feed
LOAD = {
    "sensors": {"table_noise_m": 2e-7},
    "effects": [{"effect": "constant_load", "parameters": {"load_torque_n_m": 0.1}}],
}
ONE_WAY = Profile.model_validate(
    {
        "schema_version": 1,
        "limits": {"velocity_m_s": 0.4, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
        "segments": [
            {"kind": "dwell", "duration_s": 0.3},
            {"kind": "sine_squared", "to_m": 0.34, "feed_m_s": 0.06137},
            {"kind": "dwell", "duration_s": 0.3},
        ],
    }
)


def write_inputs(folder: Path) -> tuple[Path, Path]:
    """A profile in one direction, and a bench whose axis stands askew."""
    profile, bench = folder / "one_way.yaml", folder / "bench.yaml"
    profile.write_text(yaml.safe_dump(ONE_WAY.model_dump(mode="json", exclude_none=True)))
    write_bench(bench_with(simulation=LOAD), bench)
    return profile, bench


@pytest.mark.long
def test_what_one_direction_hides_is_found_by_the_motion_that_it_designs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    profile, bench = write_inputs(tmp_path)
    out = tmp_path / "out"
    investigate([profile], str(bench), virtual=True, folder=out)
    rounds = [
        json.loads((out / f"round_{number + 1}" / "diagnosis.json").read_text())
        for number in range(len(list(out.glob("round_*"))))
    ]
    first, last = rounds
    assert first["verdict"] == "parameter_error"  # of Coulomb friction: one direction tells no more
    assert {"constant_load", "asymmetric_friction"} <= set(first["not_testable"])
    assert "constant_load" in first["next_experiment"]["separates"]
    assert json.loads((out / "diagnosis.json").read_text())["missing"] == last["missing"]
    (finding,) = last["missing"]
    assert finding["effect"] == "asymmetric_friction"
    # within the model accuracy a soft spring far from its rest is a constant load
    assert set(finding["equivalents"]) == {"constant_load", "spring_load"}
    assert finding["parameters"]["offset_torque_n_m"]["value"] == pytest.approx(0.1, rel=0.03)
    assert last["next_experiment"] is None
    assert (out / "report.html").is_file()
    text = capsys.readouterr().out
    assert "No motion within the range of these recordings distinguishes asymmetric friction from spring load" in text
    # what it ran by itself went no farther, faster or harder than what it had seen
    recorded = reach([take(read_recording(out / "round_1" / "one_way.parquet"), bench_with())], bench_with())
    designed = load_profile(out / "round_2" / "next_experiment_1.yaml")
    assert designed.limits.velocity_m_s <= recorded.velocity_m_s <= 0.06137
    assert designed.limits.acceleration_m_s2 <= recorded.acceleration_m_s2 <= 2.2
    assert recorded.low_m <= plan(designed, 1e-3).position_m.min()
    assert plan(designed, 1e-3).position_m.max() <= recorded.high_m


@pytest.mark.long
def test_a_designed_motion_that_is_not_confirmed_is_not_run(tmp_path: Path) -> None:
    bench, asked = bench_with(simulation=LOAD), list[Profile]()

    def run(profile: Profile, place: Path, name: str) -> RunResult:
        return run_profile(bench, profile, place, name, virtual=True)

    def allowed(profile: Profile) -> bool:
        asked.append(profile)
        return False

    found = investigate_bench(
        {"one_way": ONE_WAY}, {}, bench, tmp_path, run, allowed, lambda: nullcontext(lambda text, share=None: None)
    )
    assert found.ended == "next_experiment.yaml was not run: it was not confirmed."
    assert found.rounds[0].motions == ("one_way",)
    assert found.diagnosis.experiment is not None
    assert asked == [found.diagnosis.experiment.profile]
    assert not (tmp_path / "round_2").exists()


def test_without_a_terminal_nobody_confirms(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert not _confirmed(ONE_WAY, 1e-3)


def test_a_run_that_stops_ends_it_and_keeps_the_recording(tmp_path: Path) -> None:
    bench = bench_with()
    assert bench.drive is not None
    bench = bench.model_copy(update={"drive": bench.drive.model_copy(update={"following_error_m": 1e-4})})

    def run(profile: Profile, place: Path, name: str) -> RunResult:
        return run_profile(bench, profile, place, name, virtual=True)

    with pytest.raises(HilError, match=r"one_way stopped: .*following error"):
        investigate_bench(
            {"one_way": ONE_WAY},
            {},
            bench,
            tmp_path,
            run,
            lambda profile: True,
            lambda: nullcontext(lambda text, share=None: None),
        )
    assert (tmp_path / "round_1" / "one_way.parquet").is_file()


def test_what_cannot_be_investigated_is_refused(tmp_path: Path) -> None:
    profile, bench = write_inputs(tmp_path)
    (tmp_path / "more").mkdir()
    twin = profile.rename(tmp_path / "more" / "one_way.yaml")
    profile, _ = write_inputs(tmp_path)
    with pytest.raises(InputError, match="allowed files with names of their own"):
        investigate([profile, twin], str(bench), virtual=True, folder=tmp_path / "out")
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "note.txt").touch()
    with pytest.raises(InputError, match="used: exists and is not empty"):
        investigate([profile], str(bench), virtual=True, folder=tmp_path / "used")
    assert not (tmp_path / "out").exists()
