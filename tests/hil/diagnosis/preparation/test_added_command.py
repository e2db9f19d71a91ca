"""A command that is added behind a known control law: its windows, their edges and heights, and what is no window."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from diagnosis_runs import bench, changed
from servo_loop import one_encoder, servo_run

from hil.bench.bench_file import Bench
from hil.diagnosis.preparation.added_command import added_windows
from hil.diagnosis.preparation.law_check import check_law
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.preparation.usable_law import LawCheck
from hil.diagnosis.result import Verdict
from hil.identification.law.replay import Settings
from hil.identification.measured import take
from hil.recording.recording import Recording

OWNER = one_encoder(bench())
HEIGHT_N_M = 0.8
WINDOWS_S = ((0.35, 0.60), (1.10, 1.35), (1.85, 2.10), (2.60, 2.85), (3.35, 3.60))


@cache
def run() -> Recording:
    return servo_run(OWNER, times=2)


def boxes(height_n_m: float = HEIGHT_N_M) -> np.ndarray:
    time_s = run()["time_s"]
    inside = [(time_s > start_s - 5e-4) & (time_s < end_s - 5e-4) for start_s, end_s in WINDOWS_S]
    return height_n_m * np.any(inside, axis=0)


def with_added(added: np.ndarray, in_torque: bool = True) -> Recording:
    """The recording with a command that its law did not ask for."""
    recording = run()
    torque = recording["torque_n_m"] + (added if in_torque else 0.0)
    return changed(recording, torque_command_n_m=recording["torque_command_n_m"] + added, torque_n_m=torque)


def checked(recording: Recording, owner: Bench = OWNER) -> LawCheck:
    measured = [take(recording, owner)]
    return check_law(measured, owner).beside(measured)


def assert_windows(law: LawCheck) -> None:
    assert len(law.windows) == len(WINDOWS_S)
    for found, (start_s, end_s) in zip(law.windows, WINDOWS_S, strict=True):
        assert found.start.value == pytest.approx(start_s, abs=1e-3)
        assert found.end.value == pytest.approx(end_s, abs=1e-3)
        assert found.strength.value == pytest.approx(HEIGHT_N_M, rel=0.01)


def test_windows_are_found_and_the_law_is_kept() -> None:
    law = checked(with_added(boxes()))
    assert_windows(law)
    assert law.bench is OWNER
    assert not law.corrections
    assert "0.800 N m more in 5 windows" in law.advice
    assert "for 250 ms every 750 ms" in law.advice
    assert law.verdict(Verdict.NO_MISMATCH) is Verdict.MISSING_PHYSICS


def test_windows_that_the_axis_felt_are_told_and_the_plant_judged_alone() -> None:
    """The loop answers to the force, so that law and windows together hardly change the command."""
    recording = servo_run(OWNER, times=2, added=boxes())
    found = prepare([recording], [], OWNER)
    assert_windows(found.law)
    assert not found.bench.law_known
    assert "The axis moves by it." in found.law.advice
    commands = np.concatenate([run.torque_command[run.lead_in :] for run in (*found.train.runs, *found.held_out.runs)])
    assert set(commands) <= set(recording["torque_command_n_m"])


@pytest.mark.long
@pytest.mark.xfail(
    strict=True, reason="what a wrong gain leaves hides the windows: law and windows are not fitted together"
)
def test_windows_beside_a_wrong_gain() -> None:
    control = OWNER.known_control
    gain = control.gain_names[0]
    wrong = OWNER.model_copy(update={"control": control.model_copy(update={gain: 1.05 * getattr(control, gain)})})
    law = checked(with_added(boxes()), wrong)
    assert len(law.windows) == len(WINDOWS_S)
    assert law.corrections[gain].value == pytest.approx(getattr(control, gain), rel=0.01)


@pytest.mark.parametrize("in_torque", [True, False])
def test_training_and_held_out_recordings_are_judged_without_them(in_torque: bool) -> None:
    found, plain = prepare([with_added(boxes(), in_torque)], [], OWNER), prepare([run()], [], OWNER)
    assert_windows(found.law)
    for data, bare in ((found.train, plain.train), (found.held_out, plain.held_out)):
        for one, other in zip(data.runs, bare.runs, strict=True):
            assert np.abs(one.torque_command - other.torque_command).max() < 0.01 * HEIGHT_N_M
            assert np.abs(one.torque - other.torque).max() < 0.01 * HEIGHT_N_M


@pytest.mark.parametrize(
    "shape",
    [
        lambda run: np.sign(run["velocity_command_m_s"]),  # a feed-forward of friction is constant in each direction
        lambda run: np.sin(2.0 * np.pi * 1.7 * run["time_s"]),
    ],
)
def test_another_shape_is_no_window(shape: Callable[[Recording], np.ndarray]) -> None:
    measured = take(with_added(HEIGHT_N_M * shape(run())), OWNER)
    assert not added_windows([measured], OWNER, Settings(OWNER.gains))
