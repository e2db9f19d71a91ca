"""A compensation that is tried on the bench: what helps is kept, a wrong or an old table is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from compensated_benches import EFFECTS, LIMITS, bench_of_effects, diagnosed

from hil.bench.bench_file import Bench
from hil.compensating.trial import Trial, try_compensation
from hil.compensating.trial_page import write_trial
from hil.control.compensation_tables import Adds
from hil.diagnosis.result import Result
from hil.errors import HilError
from hil.loop.run import RunResult, run_profile
from hil.motion.profile import Profile

TOLD = Result.model_construct(missing=(), partial=(), parameter_corrections={})  # no standard errors
MOVES = [{"kind": "sine_squared", "to_m": to_m, "feed_m_s": feed} for to_m, feed in ((0.05, 0.1), (0.0, 0.03))]
REST = {"kind": "dwell", "duration_s": 0.4}
MOTION = Profile.model_validate(
    {"schema_version": 1, "limits": LIMITS, "segments": [REST, MOVES[0], REST, MOVES[1], REST]}
)
FADE_S = 0.3


def tried(folder: Path, believed: Bench, machine: Bench | None = None) -> Trial:
    seeds = iter(range(1, 99))

    def run(bench: Bench, profile: Profile, place: Path, name: str) -> RunResult:
        return run_profile(bench, profile, place, name, virtual=True, seed=next(seeds))

    return try_compensation(machine or bench_of_effects(), believed, TOLD, {"move": MOTION}, folder, run, FADE_S)


def believing(effect: str, **values: float) -> Bench:
    entries = [{"effect": name, "parameters": own} for name, own in EFFECTS.items() if name != effect]
    return bench_of_effects(mechanisms=[*entries, {"effect": effect, "parameters": EFFECTS[effect] | values}])


@pytest.mark.long
def test_what_was_found_helps_as_predicted_and_is_kept(tmp_path: Path) -> None:
    trial = tried(tmp_path, diagnosed())
    (motion,) = trial.motions
    for adds in Adds:
        before = motion.before[0].of(adds)
        assert motion.after.of(adds) < 0.7 * before
        assert motion.predicted.after.of(adds) == pytest.approx(motion.after.of(adds), rel=0.25)
        assert motion.noise_m(adds) < 0.02 * before
    assert trial.section is not None
    assert {"torque over angle", "set-point over angle"} <= {entry["name"] for entry in trial.section["entries"]}
    write_trial(trial, bench_of_effects(), tmp_path)
    told = json.loads((tmp_path / "compensation.json").read_text(encoding="utf-8"))
    assert told["motions"][0]["following_m"]["after"] == motion.after.following_m
    page = (tmp_path / "compensation.html").read_text(encoding="utf-8")
    assert "before / after" in page
    assert "phase margin" in page
    assert trial.statement in page


@pytest.mark.long
@pytest.mark.parametrize(
    ("effect", "wrong", "table"),
    [
        ("cogging_torque", {"phase_rad": 0.4 + 3.14}, "torque over angle"),  # makes it twice as large
        ("periodic_lead_error", {"amplitude_m": 24e-6}, "set-point over angle"),
    ],
)
def test_a_wrong_table_is_left_out_and_the_axis_is_no_worse(
    tmp_path: Path, effect: str, wrong: dict[str, float], table: str
) -> None:
    trial = tried(tmp_path, believing(effect, **wrong))
    assert table in [name for name, _ in trial.left_out]
    assert {"inertia", "friction and load"} <= {one.name for one in trial.plan.compensation.tables}
    (motion,) = trial.motions
    for adds in Adds:
        assert motion.after.of(adds) <= motion.before[0].of(adds) + motion.noise_m(adds)
    assert trial.section is not None


@pytest.mark.long
def test_a_compensation_that_the_bench_has_is_said_to_be_off(tmp_path: Path) -> None:
    trial = tried(tmp_path / "first", diagnosed())
    assert trial.section
    again = tried(tmp_path / "again", diagnosed(), bench_of_effects(compensation=trial.section))
    assert ("compensation of the bench", "off in all these runs; what is kept takes its place") in again.left_out
    assert again.pairs(Adds.POSITION)[0][0] == pytest.approx(trial.pairs(Adds.POSITION)[0][0], rel=0.02)


@pytest.mark.long
def test_a_run_that_stops_ends_the_trial(tmp_path: Path) -> None:
    data = bench_of_effects().model_dump(mode="json")
    data["drive"]["following_error_m"] = 1e-6
    with pytest.raises(HilError, match="move_before stopped"):
        tried(tmp_path, diagnosed(), Bench.model_validate(data))


def never(bench: Bench, profile: Profile, place: Path, name: str) -> RunResult:
    raise AssertionError(name)


@pytest.mark.long
def test_what_the_drive_or_the_encoders_do_not_allow_costs_no_run(tmp_path: Path) -> None:
    data = bench_of_effects().model_dump(mode="json")
    data["drive"]["mode"], data["encoders"]["table"] = "csp", None
    bench = Bench.model_validate(data)
    trial = try_compensation(bench, diagnosed(), TOLD, {"move": MOTION}, tmp_path, never, FADE_S)
    assert trial.section is None
    reasons = dict(trial.left_out)
    assert "cst only" in reasons["torque over angle"]
    assert "linear encoder" in reasons["set-point over angle"]


def test_a_motion_that_ends_before_the_fade_in_is_refused_before_any_run(tmp_path: Path) -> None:
    with pytest.raises(HilError, match=r"given .* s of motion"):
        try_compensation(bench_of_effects(), diagnosed(), TOLD, {"move": MOTION, "short": MOTION}, tmp_path, never, 5.0)
