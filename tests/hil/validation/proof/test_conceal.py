"""Edits of real recordings are exact: the law of the library, applied to what was edited, gives the recording back."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.bench.bench_file import load_bench
from hil.identification.least_squares import Estimate
from hil.recording.recording import Recording, read_recording
from hil.twin.mechanism import WIDTH, Moment, Stage
from hil.twin.parameter import Role
from hil.validation.proof.conceal.cases import EDITS, SIZES, conceal, edited, ways
from hil.validation.proof.conceal.edit import Edit, current_for, ends, later
from hil.validation.proof.conceal.half import EditedChannel, Half, halves
from hil.validation.proof.conceal.sensor_edits import LOSSES, SENSOR_EDITS

RECORDING = Path(__file__).parents[3] / "recordings" / "clean.parquet"
LAWFUL = ("second encoder late", "torque late", "scale of the second encoder", "second encoder within a short period",
          "second encoder once per turn")  # fmt: skip
RIGID = ("force in a window", "force in windows")
DIRECT = "torque constant in a zone"
SLOW = "scale over time"  # what grows within 2 s is another scale


@pytest.fixture(scope="module")
def uses() -> dict[str, Half]:
    """First half of a recording with the law of its bench, as a plant, as one mass, and as one that the motor moves."""
    bench = load_bench("reference")
    lawful, plant = (pair[0] for pair in ways(read_recording(RECORDING), bench))
    one_mass = {"model": "rigid", "lead_m": bench.axis.lead_m, "mass_kg": 700.0, "coulomb_torque_n_m": 1.1,
                "viscous_torque_n_m_s_rad": 0.0064}  # fmt: skip
    rigid = type(bench).model_validate({"axis": one_mass, "encoders": {"table": None}})
    turned = {"model": "rotary", "gear_ratio": 1.0, "inertia_kg_m2": 2e-3, "coulomb_torque_n_m": 1.1,
              "viscous_torque_n_m_s_rad": 0.0064}  # fmt: skip
    direct = type(bench).model_validate({"axis": turned, "encoders": {"table": None}})
    benches = {"rigid": rigid, "direct": direct}
    return {"law": lawful, "plant": plant} | {name: replace(plant, bench=one) for name, one in benches.items()}


def draw(half: Half, kind: str, tries: int = 40) -> Edit:
    """An edit of a kind that least squares tell in the half."""
    rng = np.random.default_rng(4)
    drawn = (edit for _ in range(tries) if (edit := EDITS[kind](half, rng)) is not None)
    found = next((one for one in drawn if one.error or isfinite(_told(half, one).std_error)), None)
    assert found is not None, kind
    return found


def _told(half: Half, edit: Edit) -> Estimate:
    return half.told(edit.channel, edit.shape, edit.instead)


def of(uses: dict[str, Half], kind: str) -> Half:
    if kind == SLOW:
        return replace(uses["plant"], recording=replace(uses["plant"].recording, period_s=0.002))
    return uses[
        "direct" if kind == DIRECT else "rigid" if kind in RIGID else "law" if kind == "torque late" else "plant"
    ]


KINDS = list(EDITS)


@pytest.mark.parametrize("kind", KINDS)
def test_the_law_of_the_library_gives_the_recording_back(uses: dict[str, Half], kind: str) -> None:
    half = of(uses, kind)
    edit = draw(half, kind)
    if edit.mechanism is None:
        return
    strength = 0.3 * edit.largest
    values = edit.mechanism.complete(edit.values(strength))
    law, stage = edit.mechanism.variants[edit.variant].contribution, edit.mechanism.variants[edit.variant].stage
    changed, untouched = edit.change(strength), edit.change(0.0)
    period_s = half.recording.period_s
    if stage in (Stage.CHANNEL, Stage.ANSWER):
        cut = slice(3 * ends(strength / period_s), -3 * ends(strength / period_s))
        place = {EditedChannel.MOTOR: 0, EditedChannel.TABLE: 1, EditedChannel.CURRENT: 3}[edit.channel]
        channels = (untouched,) * 4
        expected = law(channels, values, period_s)[place]
        # another interpolation: they differ in the noise beyond 0.9 of the Nyquist frequency
        assert np.max(np.abs((changed - expected)[cut])) < 0.2 * np.max(np.abs((changed - untouched)[cut]))
        return
    coulomb, viscous = half.plain["coulomb"].value, half.plain["viscous"].value
    parameters, memory = np.array(values), np.zeros(WIDTH)

    def apply(inputs: np.ndarray) -> np.ndarray:
        loads = changed - max(viscous, 0.0) * half.moved.velocity
        rows = zip(inputs, half.time_s, half.angle_rad, half.moved.velocity, half.position_m, loads, strict=True)
        return np.array([
            law(value, Moment(time_s, 0.0, period_s, period_s, angle, speed, at, half.ratio, coulomb / viscous, torque),
                parameters, memory)
            for value, time_s, angle, speed, at, torque in rows
        ])  # fmt: skip

    ones = np.ones(changed.size)
    if stage in (Stage.TORQUE, Stage.MOTOR_TORQUE, Stage.CURRENT):
        found, wanted = apply(changed), untouched
    elif stage is Stage.TABLE_FORCE:
        first = half.time_s < values[2]  # until the first of the windows ends
        found, wanted = (changed + half.ratio * apply(0.0 * ones))[first], untouched[first]
    elif stage in (Stage.DRAG, Stage.BIAS):
        found, wanted = untouched + apply(0.0 * ones), changed
    elif stage is Stage.COULOMB:
        found, wanted = untouched + (apply(coulomb * ones) - coulomb) * half.moved.direction, changed
    elif stage is Stage.FRICTION_SCALE:
        friction = coulomb * half.moved.direction + max(viscous, 0.0) * half.moved.velocity
        found, wanted = untouched + (apply(ones) - 1.0) * friction, changed
    elif stage is Stage.TRANSMISSION:
        # the twin takes the position of the table by the motor, the edit that of its encoder
        found, wanted = untouched + half.ratio * apply(0.0 * ones), changed
        assert np.max(np.abs(found - wanted)) < 5e-3 * np.max(np.abs(changed - untouched)) + 1e-7
        return
    else:  # at the reading, which is the position
        position = half.table if stage is Stage.TABLE_READING else None
        assert stage in (Stage.TABLE_READING, Stage.MOTOR_READING)
        if position is not None:
            half = replace(half)
            half.__dict__["motor"] = position / half.ratio
        found, wanted = apply(untouched), changed
    assert np.max(np.abs(found - wanted)) <= 1e-9 * max(float(np.max(np.abs(wanted))), 1.0)


@pytest.mark.parametrize("kind", KINDS)
def test_least_squares_find_the_strength_that_was_concealed(uses: dict[str, Half], kind: str) -> None:
    """The estimate on the edited channels less that on the untouched ones is the strength."""
    half = of(uses, kind)
    edit = draw(half, kind)
    if edit.error:
        return
    shape, small = edit.shape, 0.01 * edit.largest
    before = half.told(edit.channel, shape, edit.instead)
    changed = edited(half, edit, small)
    if edit.whole:
        changed = Recording("run", {**half.recording.columns, _name(half, edit): edit.change(small)}, changed.period_s)
    after = replace(half, recording=changed)
    for kept in ("motor", "moved", "_torque_columns", "sliding"):
        after.__dict__[kept] = getattr(half, kept)  # the regressors of the untouched half
    if edit.channel is EditedChannel.MOTOR:
        after.__dict__["motor"] = edit.change(small)
    found = after.told(edit.channel, shape, edit.instead).value - before.value
    assert found == pytest.approx(small, rel=0.05)


def _name(half: Half, edit: Edit) -> str:
    names = half.recording.axis
    return {"table": names.table_position, "motor": names.motor_position}.get(edit.channel, names.torque)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind in LAWFUL])
def test_under_a_known_law_nothing_that_it_reads_is_changed(uses: dict[str, Half], kind: str) -> None:
    half = uses["law"]
    edit = draw(half, kind)
    cut = ends(0.3 * edit.largest / edit.whole) if edit.whole else 0
    found = edited(half, edit, 0.3 * edit.largest)
    for name in ("position_command_m", "velocity_command_m_s", "motor_position_rad", "torque_command_n_m"):
        assert np.array_equal(found[name], half.recording[name][cut : len(half.recording) - cut])


def test_under_a_known_law_other_kinds_are_not_drawn(uses: dict[str, Half]) -> None:
    rng = np.random.default_rng(5)
    found = {kind for kind in EDITS if conceal(uses["law"], kind, rng) is not None}
    assert found
    assert found <= set(LAWFUL)
    with_table_loop = uses["law"].bench.known_control.model_copy(update={"position_feedback": "table"})
    closed = replace(uses["law"], bench=uses["law"].bench.model_copy(update={"control": with_table_loop}))
    assert all(EDITS[kind](closed, rng) is None for kind in SENSOR_EDITS if kind != "torque late")


def test_sizes_are_those_wanted_and_kept_in_the_truth(uses: dict[str, Half]) -> None:
    rng, found = np.random.default_rng(6), []
    for kind in KINDS:
        case = conceal(of(uses, kind), kind, rng)
        if case is not None:
            found.append(case.truth)
            assert SIZES[0] * 0.5 < case.truth.size < SIZES[1] * 1.5  # a delay may be rounded to whole rows
            assert set(case.truth.compared) <= {*case.truth.parameters, "offset_torque_n_m"}
    assert len(found) > 15


def test_halves_are_the_recording(uses: dict[str, Half]) -> None:
    whole = read_recording(RECORDING)
    one, other = halves(whole)
    for name in whole.columns:
        joined = np.concatenate([one[name], other[name]])
        assert name == "time_s" or np.array_equal(joined, whole[name])
    assert one["time_s"][0] == other["time_s"][0] == 0.0
    plant = uses["plant"].recording
    assert "torque_command_n_m" not in plant.columns
    assert np.array_equal(plant["torque_n_m"], one["torque_n_m"])


def test_losses_lose_what_they_say(uses: dict[str, Half]) -> None:
    half, rng = uses["plant"], np.random.default_rng(7)
    fewer = LOSSES["rows lost"](half, rng)
    kept = np.isin(half.time_s.round(9), fewer["time_s"].round(9))
    assert 0.97 <= kept.mean() < 1.0
    assert np.array_equal(fewer["torque_n_m"], half.torque[kept])
    coarse = LOSSES["coarser counts"](half, rng)
    coarser, step = coarse["motor_position_rad"], half.bench.motor_count
    assert 2.0 * step < 2.0 * np.max(np.abs(coarser - half.motor)) < 100.0 * step
    assert np.array_equal(coarse["torque_n_m"], half.torque)


@given(st.floats(-20.0, 20.0), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_a_delay_is_undone_by_its_reverse(rows: float, seed: int) -> None:
    rng, at = np.random.default_rng(seed), np.arange(1500)
    # a band-limited motion on a ramp, as a position is
    samples = 0.01 * at + sum(
        rng.normal() * np.sin(2.0 * np.pi * rng.uniform(0.001, 0.35) * at + rng.uniform(0.0, 6.0)) for _ in range(6)
    )
    cut = slice(2 * ends(rows), -2 * ends(rows))
    back = later(later(samples, rows), -rows)
    assert np.max(np.abs(back - samples)[cut]) < 2e-3 * np.std(samples)
    whole = round(rows)
    moved = later(samples, float(whole))
    assert np.array_equal(moved[50:-50], np.roll(samples, whole)[50:-50])


@given(st.floats(0.0, 0.12), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_a_current_gives_its_torque_back(lost: float, seed: int) -> None:
    torque = np.random.default_rng(seed).uniform(-3.0, 3.0, 200)
    falling = lost / 9.0
    current = current_for(torque, falling)
    assert np.allclose(current * (1.0 - falling * current**2), torque, atol=1e-12)
    assert np.all(np.abs(current) >= np.abs(torque) - 1e-12)


def test_each_named_kind_says_which_parameter_is_its_strength(uses: dict[str, Half]) -> None:
    for kind in KINDS:
        edit = draw(of(uses, kind), kind)
        if edit.mechanism is not None:
            one, two = edit.values(0.1 * edit.largest), edit.values(0.2 * edit.largest)
            changed = {index for index, (a, b) in enumerate(zip(one, two, strict=True)) if a != b}
            assert changed == {edit.mechanism.strength} == {edit.mechanism.indices(Role.STRENGTH)[0]}
