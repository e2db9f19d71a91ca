"""The case generator: deterministic, plausible, and nothing of the truth beside the recordings."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from drivers.sim.effects import CATALOGUE, Effect
from drivers.sim.reality import record
from hil.bench.bench_file import load_bench
from hil.recording.recording import read_recording
from hil.twin.library import BY_ID
from hil.twin.maps import MAPS
from hil.validation.proof.draw import motions
from hil.validation.proof.draw.axes import WRONG_BY, draw_axis
from hil.validation.proof.draw.axis_kinds import KINDS, Kind
from hil.validation.proof.draw.cases import at_size, one, stage
from hil.validation.proof.draw.effect_size import EffectSizes
from hil.validation.proof.draw.effects import LIBRARY, NEED_TABLE, NOT_DRAWN, DrawScale, applicable, draw_effect
from hil.validation.proof.draw.expected import compared, inseparable
from hil.validation.proof.draw.generator import RECORDINGS, TIERS, DrawnCase, _turn, draw, rerun, write
from hil.validation.proof.draw.tiers import RUNGS, VISIBLE
from hil.validation.proof.draw.unknown_effects import draw_novel, novel

# Tier, number and kind of axis of cases that are quickly drawn
QUICK: dict[str, tuple[int, Kind | None]] = {
    "single": (1, "two_mass"), "ladder": (2, "two_mass"), "pair": (1, "one_mass"), "null": (1, "serial_chain"),
    "parameters_only": (1, "seven_dof"), "masked": (4, "two_mass"), "novel": (1, "two_mass"),
    "ambiguous": (19, None), "insufficient": (5, "one_mass"), "less_known": (1, "two_mass")}  # fmt: skip


@pytest.fixture(scope="module")
def cases() -> dict[str, DrawnCase]:
    return {tier: draw(tier, number, 7, axis=kind) for tier, (number, kind) in QUICK.items()}


def test_every_tier_has_a_quick_case() -> None:
    assert set(QUICK) == set(TIERS)


def test_the_library_of_the_generator_is_that_of_the_diagnosis() -> None:
    assert set(BY_ID) - {mapped.id for mapped in MAPS} == set(CATALOGUE)
    assert set(LIBRARY) == {name for name in CATALOGUE if not BY_ID[name].turning} - set(NOT_DRAWN)


def test_same_numbers_same_case_other_numbers_another(cases: dict[str, DrawnCase]) -> None:
    case = cases["single"]
    again, other = draw("single", 1, 7, axis="two_mass"), draw("single", 2, 7, axis="two_mass")
    assert again.truth == case.truth
    assert again.bench == case.bench
    for first, second in zip(case.recordings, again.recordings, strict=True):
        assert all(np.array_equal(first[channel], second[channel]) for channel in first.columns)
    assert other.truth.true_parameters != case.truth.true_parameters


@pytest.mark.parametrize(("arguments", "digest"), [
    (("single", 1, 7, None, "two_mass"), "f3ec482c9b59"), (("null", 1, 7, None, "serial_chain"), "fd9b21643722"),
    (("ladder", 2, 7, None, "two_mass"), "8bb08f2447a9"),
    (("parameters_only", 1, 7, None, "seven_dof"), "957791f8679c"),
    (("insufficient", 5, 7, None, "one_mass"), "98e8909af127"),
    (("novel", 1, 7, None, "two_mass"), "266a9120ee86"),
])  # fmt: skip
def test_a_tier_number_and_seed_give_the_case_that_they_always_gave(arguments: Any, digest: str) -> None:
    """Effect and recordings to six digits, since another machine's linear algebra may change the last ones."""
    case = draw(*arguments)
    effects = [
        f"{one.effect} {one.form} {[f'{name} {value:.6g}' for name, value in sorted(one.parameters.items())]}"
        for one in case.truth.effects
    ]
    rms = [
        f"{name} {np.sqrt(np.mean(np.square(values))):.6g}"
        for recording in case.recordings
        for name, values in sorted(recording.columns.items())
    ]
    assert hashlib.sha256(";".join([*effects, *rms]).encode()).hexdigest()[:12] == digest


def test_consecutive_numbers_take_all_effects_equally_often() -> None:
    rounds = [[_turn(LIBRARY, 28 * turn + at, 5) for at in range(28)] for turn in range(2)]
    assert set(rounds[0]) == set(rounds[1]) == set(LIBRARY)
    assert rounds[0] != rounds[1]
    assert draw("single", 3, 5).truth.effects[0].effect == rounds[0][3]


@pytest.mark.parametrize("tier", QUICK)
def test_recordings_are_finite_bounded_and_begin_at_rest(cases: dict[str, DrawnCase], tier: str) -> None:
    case = cases[tier]
    assert tuple(recording.name for recording in case.recordings) == RECORDINGS
    for recording in case.recordings:
        names, ratio = recording.axis, case.bench.gains.ratio_m_rad
        assert all(np.all(np.isfinite(values)) for values in recording.columns.values())
        lag_m = np.abs(recording["position_command_m"] - ratio * recording[names.motor_position])
        assert np.max(lag_m) < 0.015
        assert np.max(np.abs(recording[names.torque_command])) <= case.bench.gains.torque_limit_n_m
        assert recording["velocity_command_m_s"][0] == 0.0
        assert ratio * recording[names.motor_position][0] == pytest.approx(recording["position_command_m"][0], abs=1e-5)
    a, b, c = (recording["position_command_m"] for recording in case.recordings)
    rows = min(a.size, b.size, c.size)
    assert not any(np.array_equal(x[:rows], y[:rows]) for x, y in ((a, b), (b, c), (a, c)))


@pytest.mark.parametrize("tier", QUICK)
def test_a_case_folder_holds_recordings_and_bench_and_nothing_of_the_truth(
    cases: dict[str, DrawnCase], tier: str, tmp_path: Path
) -> None:
    case = cases[tier]
    place = write(case, tmp_path)
    files = {path.name: path for path in place.iterdir()}
    assert set(files) == {*(f"{name}.parquet" for name in RECORDINGS), "bench.yaml"}
    assert place.name == case.name
    assert tier not in case.name
    bench = load_bench(files["bench.yaml"])
    assert bench.model_dump() == case.bench.model_dump()
    assert bench.mechanisms == ()
    assert bench.simulation is None
    for name, value in case.truth.believed_parameters.items():
        assert getattr(bench.axis, name) == value
    for recording in case.recordings:
        read = read_recording(files[f"{recording.name}.parquet"])
        assert read.metadata == {}
        assert all(np.array_equal(read[channel], recording[channel]) for channel in recording.columns)
        about = json.dumps({str(k): str(v) for k, v in pq.read_schema(files[f"{recording.name}.parquet"])
                            .metadata.items()})  # fmt: skip
        assert not any(word in about for word in (*BY_ID, *TIERS, "novel"))


@pytest.mark.parametrize("tier", QUICK)
def test_the_truth_is_plain_data_and_says_what_is_right(cases: dict[str, DrawnCase], tier: str) -> None:
    truth = cases[tier].truth
    data: dict[str, Any] = json.loads(json.dumps(truth.as_json()))
    assert data["tier"] == tier
    verdicts = {"null": "no_mismatch", "parameters_only": "parameter_error", "insufficient": "parameter_error",
                "novel": "unexplained"}  # fmt: skip
    assert truth.verdict == verdicts.get(tier, "missing_physics")
    counts = {"null": (0,), "parameters_only": (0,), "pair": (2,), "masked": (1, 2)}
    assert len(truth.effects) in counts.get(tier, (1,))
    assert bool(truth.rivals) == (tier == "ambiguous")
    assert bool(truth.not_testable) == (tier in ("insufficient", "less_known"))
    assert bool(truth.forgotten) == (tier == "less_known")
    for concealed in truth.effects:
        assert (concealed.same_law == ()) == (tier == "novel")
        if tier != "novel":
            assert concealed.effect in concealed.same_law
            assert concealed.block == BY_ID[concealed.effect].block
            assert set(concealed.compared) <= {name for law in concealed.same_law for name in BY_ID[law].names}
    wrong = {name: truth.believed_parameters[name] / truth.true_parameters[name]
             for name in cases[tier].draft.axis.nominal}  # fmt: skip
    assert (set(wrong.values()) == {1.0}) == (tier == "null")
    assert all(1.0 / WRONG_BY <= factor <= WRONG_BY for factor in wrong.values())


@pytest.mark.parametrize("kind", KINDS)
def test_every_effect_can_be_drawn_and_run_on_each_axis(kind: Kind) -> None:
    """Over half a second of an axis: physics that the plant takes, in the forms of the catalogue."""
    rng = np.random.default_rng(3)
    axis = draw_axis(rng, kind)
    run, *_ = motions.good(rng, axis)
    scene = DrawScale(axis, 3.0 * axis.coulomb, 10.0)
    names = applicable(axis)
    assert set(LIBRARY) - set(names) == (set(NEED_TABLE) if kind == "one_mass" else set())
    rows = slice(0, round(0.5 / axis.period_s))
    seen = set()
    for name in (*names * 2, *novel(axis)):
        effect = draw_effect(name, scene, rng) if name in LIBRARY else draw_novel(name, scene, rng)
        if isinstance(effect, Effect):
            columns = record(
                axis.truth,
                axis.sensors,
                [effect],
                axis.servo,
                np.array(run.position_m[rows]),
                np.array(run.velocity_m_s[rows]),
                axis.period_s,
                step_s=2e-5,
            )
            assert all(np.all(np.isfinite(values)) for values in columns.values()), name
        seen.add(name)
    assert seen == {*names, *novel(axis)}


@pytest.mark.long
def test_sizes_are_monotone_in_the_strength_and_hit_the_rungs() -> None:
    rng = np.random.default_rng(5)
    on = stage(rng, "two_mass")
    for name, strength in (("cogging_torque", "amplitude_n_m"), ("backlash", "gap_m")):
        effect = draw_effect(name, on.scale, rng)
        strengths = []
        for rung in (RUNGS[0], 3.0, RUNGS[-1]):
            found = at_size(effect, rung, on)
            assert found is not None
            assert found[1] == pytest.approx(rung, rel=0.05)
            strengths.append(found[0].parameters[strength])
        assert strengths == sorted(strengths)


def test_a_size_beyond_the_internal_step_is_no_size() -> None:
    rng = np.random.default_rng(5)
    on = stage(rng, "two_mass")
    # the smaller the effect, the stiffer the bristle: at last its mode is too fast for the step
    assert at_size(draw_effect("presliding_hysteresis", on.scale, rng), 1e-4, on) is None


def test_a_size_counts_only_what_no_parameter_explains() -> None:
    rng = np.random.default_rng(8)
    axis = draw_axis(rng, "two_mass")
    sizes_of = EffectSizes(axis, motions.good(rng, axis)[1:2])
    # a load is friction as long as the axis moves one way only
    load = Effect("constant_load", {"load_torque_n_m": 0.1 * axis.coulomb})
    one_way = EffectSizes(axis, motions.poor(rng, axis, "one_way")[:1])
    assert one_way.size([load]) < 0.01 * sizes_of.size([load])
    # twice the strength, twice the size, for what enters as it is
    double = Effect("constant_load", {"load_torque_n_m": 0.2 * axis.coulomb})
    assert sizes_of.sizes([double])["torque"] == pytest.approx(2.0 * sizes_of.sizes([load])["torque"], rel=0.05)


def test_a_pair_and_a_rival(cases: dict[str, DrawnCase]) -> None:
    first, second = cases["pair"].truth.effects
    assert second.effect not in first.same_law
    assert all(VISIBLE[0] <= concealed.size <= VISIBLE[1] for concealed in (first, second))
    truth = cases["ambiguous"].truth
    assert truth.rivals[0] not in truth.effects[0].same_law


@pytest.mark.long
def test_what_no_motion_tells_apart_is_not_paired() -> None:
    assert (
        inseparable("constant_load")
        == inseparable("spring_load")
        == {"constant_load", "asymmetric_friction", "spring_load"}
    )
    for effect in BY_ID:
        assert effect in inseparable(effect)
        assert all(effect in inseparable(other) for other in inseparable(effect))
    for number in (0, 3):
        first, second = draw("pair", number, 4, effect="spring_load").truth.effects
        assert second.effect not in inseparable(first.effect)


def test_another_run_of_a_case_is_of_the_same_axis(cases: dict[str, DrawnCase]) -> None:
    case = cases["single"]
    again = rerun(case.draft, case.draft.runs[0], seed=11)
    assert len(again) == len(case.recordings[0])
    channel = again.axis.motor_position
    assert np.max(np.abs(again[channel] - case.recordings[0][channel])) < 1e-3 * np.ptp(again[channel])
    assert not np.array_equal(again["torque_n_m"], case.recordings[0]["torque_n_m"])


def test_a_base_is_compared_by_the_mass_that_acts_like_it() -> None:
    """mu = 4: a table of 0.8 of its mass with 0.2 of it on a spring."""
    axis = draw_axis(np.random.default_rng(1), "two_mass")
    base = Effect("structural_mode", {"frequency_hz": 50.0, "damping_ratio": 0.02, "mass_ratio": 4.0}, "base")
    assert compared(base, axis) == pytest.approx({"frequency_hz": 50.0 * np.sqrt(0.8), "mass_ratio": 0.25})


@pytest.mark.parametrize(("arguments", "says"), [
    ({"tier": "easy"}, r"tier: must be one of single, .*insufficient, less_known, got 'easy'"),
    ({"tier": "single", "effect": "backslash"}, r"effect: must be one of .*backlash.*, got 'backslash'"),
    ({"tier": "null", "effect": "backlash"}, r"effect: must be one of none in the tier null, got"),
    ({"tier": "novel", "effect": "backlash"}, r"must be one of .*novel_friction_bump.*, got 'backlash'"),
    ({"tier": "ambiguous", "effect": "backslash"}, r"effect: must be one of .*cogging_torque, .*, got 'backslash'"),
])  # fmt: skip
def test_refusals_say_what_is_allowed(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        draw(**{"number": 1, "seed": 7, **arguments})


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_every_effect_can_be_concealed_visibly_on_each_axis(kind: Kind) -> None:
    for name in LIBRARY:
        if kind == "one_mass" and name in NEED_TABLE:
            continue
        found = None
        for number in range(20):
            rng = np.random.default_rng([number, 3])
            found = one(rng, stage(rng, kind), name, VISIBLE)
            if found is not None:
                break
        assert found is not None, name
        assert rerun(found, found.runs[2], seed=1).columns
