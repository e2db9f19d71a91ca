"""Measured less simulated: the datum of an encoder, which nobody knows, and simulations that run away."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_runs import bench, changed, dataset, recorded

from hil.bench.bench_file import load_bench
from hil.diagnosis.preparation.preflight import preflight
from hil.identification.compare import compare
from hil.identification.dataset import FASTEST_OBSERVER_S
from hil.identification.hypothesis import Hypothesis
from hil.identification.residuals import Residuals, differences
from hil.identification.terms import Term
from hil.twin.axis import Response

OWNER = bench()
PLAY = Term("backlash", 0, (20e-6,))


@pytest.mark.parametrize("shift_m", [3e-6, -50e-6, 0.4])
@pytest.mark.parametrize("terms", [(), (PLAY,), (Term("table_side_friction", 0, (0.4,)),)])
def test_residuals_are_the_same_wherever_its_zero_lies(shift_m: float, terms: tuple[Term, ...]) -> None:
    recording = recorded(OWNER, PLAY)
    shifted = changed(recording, table_position_m=recording["table_position_m"] + shift_m)
    hypothesis = Hypothesis(OWNER, terms)
    data = (dataset(preflight([run], OWNER).accepted(), OWNER) for run in (recording, shifted))
    known, moved = (hypothesis.residuals(one).vector for one in data)
    np.testing.assert_allclose(moved, known, atol=1e-3 * np.std(known))


def test_the_comparison_takes_it_off_and_says_so() -> None:
    recording = recorded(OWNER)
    shifted = changed(recording, table_position_m=recording["table_position_m"] + 50e-6)
    before, after = compare(recording, OWNER), compare(shifted, OWNER)
    for one, other in zip(before.channels, after.channels, strict=True):
        assert other.rms == pytest.approx(one.rms, rel=1e-6, abs=1e-12)
    assert any("position of the linear encoder" in note and "50 µm" in note for note in after.notes)


@pytest.mark.parametrize("rest_s", [0.2, 3.0])
@pytest.mark.parametrize("shift_m", [0.0, 1e-3])
def test_a_recording_may_begin_on_one_flank_of_a_gap(rest_s: float, shift_m: float) -> None:
    """An axis with play starts anywhere in its gap; only the twin starts in the middle."""
    whole = recorded(OWNER, PLAY, times=2)
    stands = np.flatnonzero(whole["velocity_command_m_s"] == 0.0)
    begin = int(stands[stands > 1000][0]) + 20  # in a rest after a move
    rest = np.full(round(rest_s / whole.period_s), begin)
    rows = np.concatenate([rest, np.arange(begin, whole["time_s"].size)])
    columns = {name: values[rows] for name, values in whole.columns.items()}
    columns["time_s"] = np.arange(rows.size) * whole.period_s
    columns["table_position_m"] = columns["table_position_m"] + shift_m
    (run,) = preflight([changed(whole, **columns)], OWNER).accepted()
    table = Hypothesis(OWNER, (PLAY,)).blocks(run, FASTEST_OBSERVER_S)["table"][run.evaluated]
    assert np.sqrt(np.mean(table**2)) < 2.0 * run.noise.table_m


@pytest.mark.parametrize("force_n", [8.0, 200.0])
@pytest.mark.parametrize(
    "term",
    [
        Term("periodic_lead_error", 0, (5e-6, 1.0, 0.0, 0.0, 0.0, 0.0)),
        Term("spring_load", 0, (5e3, 0.05)),
        Term("backlash", 0, (20e-6,)),
        Term("preload_loss", 0, (10e-6, 0.4)),
        Term("preload_loss", 0, (10e-6, 0.0)),
        Term("position_dependent_stiffness", 0, (-5.0,)),
    ],
)
def test_an_axis_that_stands_has_stood_before(term: Term, force_n: float) -> None:
    """The twin begins at rest under whatever bends the transmission, it does not spring there."""
    hypothesis = Hypothesis(OWNER, (Term("external_force", 0, (force_n, 0.0, 10.0)), term))
    still = np.zeros(300)
    answer = hypothesis.twin().simulate(still, still)
    assert np.ptp(answer.table_position_m) < 2e-9


@pytest.mark.parametrize("shift_rad", [0.03, -6e3])
def test_where_the_loop_goes_by_the_table_the_motor_has_the_datum(shift_rad: float) -> None:
    owner = OWNER.model_copy(update={"control": OWNER.control.model_copy(update={"position_feedback": "table"})})
    assert owner.gains.position_from_table
    recording = recorded(owner, PLAY)
    shifted = changed(recording, motor_position_rad=recording["motor_position_rad"] + shift_rad)
    data = dataset(preflight([recording, shifted], owner).accepted(), owner)
    known, moved = Hypothesis(owner, (PLAY,)).residuals(data, closed=True).channels
    for channel, noise in (("motor", 1e-6 / owner.axis.ratio_m_rad), ("table", 0.3e-6), ("torque", 0.015)):
        assert np.std(moved[channel] - known[channel]) < noise, channel


BENCH = load_bench("reference")
ALL = slice(None)
RNG = np.random.default_rng(7)
MEASURED = Response(*RNG.standard_normal((4, 50)))


def test_a_datum_of_the_linear_encoder_counts_for_nothing() -> None:
    shifted = MEASURED._replace(table_position_m=MEASURED.table_position_m + 0.05)
    found = differences(shifted, MEASURED, BENCH, ALL)
    np.testing.assert_allclose(found["table"], 0.0, atol=1e-12)
    assert set(found) == {"motor", "table", "torque"}


def test_what_was_not_judged_does_not_move_the_datum() -> None:
    jump = MEASURED.table_position_m + np.where(np.arange(50) < 10, 1.0, 0.0)
    found = differences(MEASURED._replace(table_position_m=jump), MEASURED, BENCH, slice(10, None))
    np.testing.assert_allclose(found["table"], np.where(np.arange(50) < 10, 1.0, 0.0), atol=1e-12)


@pytest.mark.parametrize("away", [np.inf, -np.inf, np.nan])
def test_a_twin_that_runs_away_gives_no_finite_difference_and_no_warning(away: float) -> None:
    lost = Response(*(np.where(np.arange(50) < 25, values, away) for values in MEASURED))
    found = differences(MEASURED, lost, BENCH, ALL)
    assert not np.isfinite(found["torque"][25:]).any()
    assert not np.isfinite(found["table"][25:]).any()
    assert np.isfinite(found["torque"][:25]).all()


def test_the_energy_of_each_channel_is_counted_once_and_a_hidden_one_has_none() -> None:
    recording = recorded(OWNER, PLAY)
    data = dataset(preflight([recording], OWNER).accepted(), OWNER)
    residuals = Hypothesis(OWNER).residuals(data)
    assert sum(one.energy for one in residuals.by_channel.values()) == pytest.approx(
        residuals.vector @ residuals.vector
    )
    assert sum(one.rows for one in residuals.by_channel.values()) == residuals.vector.size
    assert all(one.noise <= one.rows for one in residuals.by_channel.values())
    hidden = SimpleNamespace(observability=SimpleNamespace(hidden={"table"}), runs=data.runs, scales=data.scales)
    assert "table" not in replace(residuals, data=hidden).by_channel


def test_a_channel_far_below_its_noise_counts_with_the_mean_of_all() -> None:
    """Nine tenths of hardly anything are no evidence."""
    parts = {(0, "motor"): np.full(100, 0.1), (0, "table"): np.full(100, 2.0)}
    residuals: Any = SimpleNamespace(parts=parts, data=SimpleNamespace(observability=SimpleNamespace(hidden=set())))
    motor, table = (Residuals.by_channel.func(residuals)[name] for name in ("motor", "table"))
    assert motor.noise == pytest.approx(50.5)
    assert (table.energy, table.noise) == pytest.approx((400.0, 100.0))


def test_a_channel_above_its_floor_weighs_what_it_leaves() -> None:
    rng = np.random.default_rng(3)
    known = Hypothesis(OWNER).residuals(dataset(preflight([recorded(OWNER)], OWNER).accepted(), OWNER))
    names = [name for _, name in known.parts]
    assert {"motor", "table"} <= set(names)
    size = {"motor": 9.0}
    vector = np.concatenate(
        [size.get(name, 0.5) * rng.standard_normal(one.size) for (_, name), one in known.parts.items()]
    )

    def of(vector: np.ndarray) -> Residuals:
        residuals = replace(known)
        residuals.__dict__["vector"] = vector
        return residuals

    (loss, weights), parts = of(vector).likelihood_loss, dict(zip(names, known.split(vector), strict=True))
    mean = {name: float(part @ part) / part.size for name, part in parts.items()}
    expected = sum(
        part.size * (1.0 + np.log(mean[name]) if name == "motor" else mean[name]) for name, part in parts.items()
    )
    assert loss == pytest.approx(expected)
    by_name = dict(zip(names, known.split(weights), strict=True))
    np.testing.assert_allclose(by_name["motor"], mean["motor"] ** -0.5)
    np.testing.assert_array_equal(by_name["table"], 1.0)
    # the weighted squares go down as the loss does: slope along the residuals themselves
    slope = (of((1.0 + 1e-6) * vector).likelihood_loss[0] - loss) / 1e-6
    assert slope == pytest.approx(2.0 * float((weights * vector) @ (weights * vector)), rel=1e-4)
