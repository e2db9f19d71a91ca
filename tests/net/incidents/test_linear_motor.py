"""A linear motor that cogs, without a known lead or control law, moved slowly first: made by its own equations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hil.bench.bench_file import Bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.preparation.preflight import preflight
from hil.diagnosis.preparation.split import held_out_note, split
from hil.errors import InputError
from hil.identification.dataset import prepare_dataset
from hil.identification.derived_channels import reduced
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import Recording

PERIOD_S, STEPS = 1e-3, 10
MASS_KG, COULOMB_N, VISCOUS_N_S_M = 12.0, 15.0, 40.0
COGGING_N, PITCH_M = 8.0, 0.024
BENCH = Bench.model_validate(
    {
        "schema_version": 1,
        "name": "stage",
        "axis": {
            "model": "one_mass",
            "mass_kg": 11.5,
            "coulomb_force_n": 14.0,
            "viscous_force_n_s_m": 44.0,
        },
        "control": "unknown",
        "encoders": {"motor": {"resolution_m": 1e-7}, "table": None},
    }
)


def set_points(moves: list[tuple[float, float]]) -> np.ndarray:
    """Sine-squared moves there and back, (distance [m], top speed [m/s]), on the fine steps."""
    step_s, parts = PERIOD_S / STEPS, [np.zeros(1000)]
    for distance, speed in moves:
        time = np.arange(round(2.0 * distance / speed / step_s)) * step_s
        length = 2.0 * distance / speed
        there = 0.5 * speed * (time - length / (2.0 * math.pi) * np.sin(2.0 * math.pi * time / length))
        parts += [there, np.full(2000, distance), distance - there, np.zeros(2000)]
    return np.concatenate(parts)


def moved(moves: list[tuple[float, float]]) -> Recording:
    """Recording of the stage: position with counts, force with noise."""
    command, step_s, rng = set_points(moves), PERIOD_S / STEPS, np.random.default_rng(3)
    position = speed = force = integral = 0.0
    rows = []
    for step, wanted in enumerate(command):
        if step % STEPS == 0:
            read = round(position / 1e-7) * 1e-7
            ahead = (command[min(step + STEPS, command.size - 1)] - wanted) / PERIOD_S
            error = 60.0 * (wanted - read) + ahead - speed
            integral += 9.0 * error
            force = 1500.0 * error + integral
            rows.append((read, force + rng.normal(0.0, 0.3)))
        pull = force - VISCOUS_N_S_M * speed - COGGING_N * math.sin(2.0 * math.pi * position / PITCH_M + 0.8)
        speed += pull / MASS_KG * step_s
        loss = COULOMB_N / MASS_KG * step_s
        speed = math.copysign(max(abs(speed) - loss, 0.0), speed)
        position += speed * step_s
    columns = np.array(rows).T
    return Recording(name="stage", period_s=PERIOD_S, columns={"motor_position_m": columns[0], "force_n": columns[1]})


@pytest.fixture(scope="module")
def slow_first() -> Recording:
    return moved([(0.15, 0.06), (0.15, 0.3), (0.15, 0.6)])


def test_cogging_is_told_along_the_travel(slow_first: Recording) -> None:
    found = diagnose([slow_first], [], BENCH).result
    cogging = next(finding for finding in found.findings if finding.effect == "cogging_torque")
    assert cogging.parameters["cycles_per_rev"].unit == "1/m"
    assert 1.0 / cogging.parameters["cycles_per_rev"].value == pytest.approx(PITCH_M, rel=2e-3)
    assert cogging.parameters["amplitude_n_m"].value == pytest.approx(COGGING_N, rel=0.05)
    assert "every 24.0 mm of travel" in cogging.sentence
    assert found.torque_left is not None
    assert found.torque_left.final < 0.3 * found.torque_left.plain


def test_a_slow_motion_does_not_make_the_axis_heavier() -> None:
    """Its inertia is a hundredth of the cogging: a heavier twin only answers less to the force it lacks."""
    slow = moved([(0.15, 0.06)])
    bench = reduced(BENCH, [slow])
    found = fit_nominal_parameters(prepare_dataset(preflight([slow], bench).accepted(), bench))
    owner = found.estimator.evaluate(found.hypothesis.given)
    assert found.missed_torque <= 1.01 * owner.missed_torque
    assert found.bench.axis.physics().chain.inertia_kg_m2.sum() == pytest.approx(11.5)


def test_the_fast_moves_are_in_training(slow_first: Recording) -> None:
    (train,), (held_out,) = split([slow_first])
    assert train.start_s > held_out.start_s
    assert "stage (first part)" in held_out_note([held_out])
    fast_first = replace(slow_first, columns={name: values[::-1] for name, values in slow_first.columns.items()})
    (train,), (held_out,) = split([fast_first])
    assert train.start_s < held_out.start_s
    assert held_out_note([held_out]).endswith("validation.")


def test_the_part_held_out_moves_both_ways() -> None:
    """A third is one slow feed: friction and a load would be one offset in it."""
    feeds = moved([(0.15, 0.02), (0.15, 0.06)])
    (train,), (held_out,) = split([feeds])
    position = held_out["motor_position_m"]
    assert np.max(position) - position[-1] > 0.1 * np.ptp(position)
    assert len(train) > 0.4 * len(feeds)


def test_training_moves_both_ways() -> None:
    """There and back once, with a turn on the way back: its second half alone would move one way."""
    feeds = moved([(0.15, 0.06)])
    turns_m = 0.3 * np.array([0.0, 0.0, 0.1, 0.3, 0.5, 0.3, 0.1, 0.13, 0.1, 0.0, 0.0])
    rows = np.linspace(0.0, 1.0, len(feeds))
    position = np.interp(rows, np.linspace(0.0, 1.0, turns_m.size), turns_m)
    (train,), (held_out,) = split([replace(feeds, columns=feeds.columns | {"motor_position_m": position})])
    forwards, backwards = (np.sum(np.diff(side * train["motor_position_m"]).clip(0.0)) for side in (1.0, -1.0))
    assert min(forwards, backwards) > 0.1 * np.ptp(position)
    assert held_out.start_s > train.start_s


def test_friction_that_varies_is_no_wrong_sign() -> None:
    """On a slow move the force follows the cogging, not the acceleration; of a wrong sign friction is negative."""
    slow = moved([(0.15, 0.06)])
    preflight([slow], BENCH).accepted()
    turned = replace(slow, columns=slow.columns | {"force_n": -slow.columns["force_n"]})
    with pytest.raises(InputError, match="wrong sign"):
        preflight([turned], BENCH).accepted()
