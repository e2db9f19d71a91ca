"""The noise floor of repeated laps is what does not repeat, however large the rest is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_runs import bench, dataset, evaluated, moves, recorded

from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import Mode
from hil.diagnosis.verdict.fit_table import fit_table
from hil.identification.dataset import prepare_dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.laps import Laps
from hil.identification.measured import Measured, take
from hil.identification.noise_floor import floor, noise_response
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.validation.proof.draw.generator import draw, rerun


@pytest.fixture(scope="module")
def three_laps() -> Measured:
    return take(recorded(bench(), times=3), bench())


def lag_s(laps: Laps, run: Measured) -> float:
    """The lag [s] after which the most rows repeat."""
    return float(np.argmax(np.bincount(laps.again - laps.first))) * run.period_s


def test_repeated_laps_are_found(three_laps: Measured) -> None:
    found = three_laps.laps
    assert found is not None
    period = (three_laps.motor.size - 1) / 3 * three_laps.period_s
    assert min(abs(lag_s(found, three_laps) - period * k) for k in (1, 2)) < 0.002


@pytest.mark.parametrize("sigma", [0.01, 0.3])
def test_only_what_does_not_repeat_is_noise(three_laps: Measured, sigma: float) -> None:
    found = three_laps.laps
    assert found is not None
    repeatable = 5.0 * np.sin(three_laps.position_command_m / 0.01) + 3.0 * np.sign(three_laps.velocity_command_m_s)
    noise = np.random.default_rng(3).normal(0.0, sigma, repeatable.size)
    assert floor(repeatable + noise, 1e-6, found) == pytest.approx(sigma, rel=0.05)


def test_a_floor_is_never_below_the_sensor_noise(three_laps: Measured) -> None:
    found = three_laps.laps
    assert floor(np.zeros(three_laps.motor.size), 0.02, found) == 0.02


def test_a_late_encoder_does_not_widen_the_scale_of_its_channel(three_laps: Measured) -> None:
    late = replace(three_laps, table_m=np.concatenate([np.full(2, three_laps.table_m[0]), three_laps.table_m[:-2]]))
    before, after = (prepare_dataset([run], bench()).scales()[0]["table"] for run in (three_laps, late))
    assert np.median(after[late.moving]) == pytest.approx(np.median(before[late.moving]), rel=0.05)


def test_without_laps_the_floor_is_the_sensor_noise() -> None:
    once = take(recorded(bench()), bench())
    assert once.laps is None
    assert floor(np.ones(once.motor.size), 0.02, None) == 0.02


def test_in_closed_loop_the_axis_moves_with_what_its_encoders_count() -> None:
    """Runs of a simulated axis with coarse counts that begin within some of them differ by `noise_response`."""
    case = draw("single", 101966, 20261130)
    axis, last, rng = case.draft.axis, case.draft.runs[2], np.random.default_rng(3)
    starts_m = rng.uniform(0.0, 2e-6, 4)
    tables_m = np.array(
        [
            rerun(case.draft, replace(last, position_m=np.array(last.position_m) + start_m), 5)["table_position_m"][50:]
            - start_m
            for start_m in starts_m
        ]
    )
    tables_m -= tables_m.mean(axis=1, keepdims=True)
    differ_m = np.sqrt(np.mean(np.var(tables_m, axis=0, ddof=1)))
    exact = case.bench.model_copy(update={"axis": case.bench.axis.model_copy(update=case.truth.true_parameters)})
    run = take(case.recordings[2], exact)
    limit = Term(
        "torque_saturation",
        BY_ID["torque_saturation"].forms.index("hidden"),
        (case.truth.effects[0].parameters["limit_n_m"],),
    )
    found = evaluated(Hypothesis(exact, (limit,)), prepare_dataset([run], exact))
    moved_m = noise_response(found.hypothesis, run)["table"]
    assert differ_m > 1.5 * axis.table_noise_m
    assert np.hypot(run.noise.table_m, moved_m) == pytest.approx(differ_m, rel=0.3)
    # one run of a loop at its torque limit strays from its twin by far more, and its blocks do not: they are shown
    table = fit_table(found, found, found, dataset([], exact))["table_position_m"]
    assert table.mode is Mode.BLOCKS
    assert table.train.after_rms < CRITERIA.strays * table.train.noise_floor_rms


def test_the_floor_in_closed_loop_has_the_answer_of_the_axis_to_its_sensors() -> None:
    owner = bench()
    run = take(recorded(owner), owner)
    found = evaluated(Hypothesis(owner), prepare_dataset([run], owner))
    table = fit_table(found, found, found, dataset([], owner))["table_position_m"]
    assert table.mode is Mode.CLOSED_LOOP
    moved_m = noise_response(found.hypothesis, run)["table"]
    assert table.train.noise_floor_rms == pytest.approx(np.hypot(run.noise.table_m, moved_m))


def test_one_coarse_count_in_a_stiff_loop_is_noise_and_no_chaos() -> None:
    """The torque moves by many times the noise of its sensor, and by half as much for half a count."""
    owner = bench()
    coarse = owner.encoders.motor.model_copy(update={"counts_per_rev": 4000})
    owner = owner.model_copy(update={"encoders": owner.encoders.model_copy(update={"motor": coarse})})
    run = take(recorded(owner), owner)
    moved = noise_response(Hypothesis(owner), run)
    assert moved["torque"] > 5.0 * run.noise.torque
    assert moved["motor"] > 0.0 < moved["table"]


def test_a_loop_that_sticks_and_slips_has_no_noise_of_its_own_making() -> None:
    """A twin that lacks the lead error of a chattering axis strays by a hundred times the noise of its sensors, and
    so do two of its own runs from one another: that is no floor."""
    sticking, lead = Term("stribeck_friction", 0, (2.2, 0.05)), Term("periodic_lead_error", 0, (4e-6, 0.3))
    creep = moves(
        [
            {"kind": "dwell", "duration_s": 0.2},
            *({"kind": "sine_squared", "to_m": to_m, "feed_m_s": 0.0006} for to_m in (0.004, 0.0)),
        ]
    )
    run = take(recorded(bench(), sticking, lead, profile=creep), bench())
    wrong = evaluated(Hypothesis(bench(), (sticking,)), prepare_dataset([run], bench()))
    assert set(noise_response(wrong.hypothesis, run).values()) == {0.0}
    table = fit_table(wrong, wrong, wrong, dataset([], bench()))["table_position_m"]
    assert table.train.after_rms > 50.0 * table.train.noise_floor_rms


def test_a_push_in_one_lap_is_no_noise() -> None:
    rng, rows = np.random.default_rng(3), np.arange(12_000)
    laps = Laps(rows, rows + 12_000)
    residual = 0.2 * rng.standard_normal(24_000)
    calm = laps.noise(residual)
    residual[3_000:4_500] += 5.0
    assert calm == pytest.approx(0.2, rel=0.03)
    assert laps.noise(residual) == pytest.approx(0.2, rel=0.03)
    assert laps.difference(residual) > 1.0
