"""The EMPS recording: its published figures, and what a diagnosis finds beside one mass with symmetric friction."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from diagnosis_runs import dataset
from emps_windows import EDGE_S, PERIOD_S, Push, pushed
from measured_recordings import emps

from hil.bench.bench_file import Bench, load_bench
from hil.channels import AxisKind
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.preparation.law_check import check_law
from hil.diagnosis.preparation.split import split
from hil.drafting.loop_values import loop_values
from hil.identification.compare import compare
from hil.identification.friction import identify_friction
from hil.identification.hypothesis import Hypothesis
from hil.identification.inverse_dynamics import fit_inverse_dynamics
from hil.identification.laps import Laps
from hil.identification.measured import Measured, take

pytestmark = pytest.mark.net


@cache
def diagnosed() -> Diagnosis:
    """The diagnosis, made once."""
    return diagnose([emps()], [], load_bench("emps_symmetric"))


def test_wrong_gains_are_learnt_without_another_part_of_the_law() -> None:
    """The simplest law that leaves the noise of the position steps is learnt, not a lag and a delay beside."""
    owner = load_bench("emps_symmetric")
    law = owner.known_control
    given = {"position_gain_1_s": 1.48 * law.position_gain_1_s, "velocity_gain_n_s_m": 0.63 * 8557.43}
    wrong = owner.model_copy(update={"control": law.model_copy(update=given)})
    learnt = check_law([take(emps(), wrong)], wrong)
    assert set(learnt.corrections) == set(given)
    assert learnt.corrections["position_gain_1_s"].value == pytest.approx(law.position_gain_1_s, rel=1e-3)
    assert learnt.corrections["velocity_gain_n_s_m"].value == pytest.approx(8557.43, rel=1e-3)


@pytest.mark.parametrize("answered", [False, True])
def test_pulses_added_to_the_command_are_found_behind_its_law(answered: bool) -> None:
    """25 pulses of 178.2 N for 500 ms, in the recorded command alone, or felt by the axis, to which the law answers."""
    height_n, recording, owner = 178.2, emps(), load_bench("emps_symmetric")
    pushes = [Push(0.3 + 0.97 * k, 0.8 + 0.97 * k, height_n) for k in range(25)]
    recording = pushed(pushes) if answered else recording
    time_s = np.arange(len(recording)) * PERIOD_S
    inside = [(time_s > push.start_s - 5e-4) & (time_s < push.end_s - 5e-4) for push in pushes]
    columns = {name: recording[name] + height_n * np.any(inside, axis=0) for name in ("force_command_n", "force_n")}
    measured = [take(replace(recording, columns={**recording.columns, **columns}), owner)]
    law = check_law(measured, owner).beside(measured)
    assert law.bench.law_known is not answered
    for found, push in zip(law.windows, pushes, strict=True):
        assert found.start.value == pytest.approx(push.start_s, abs=EDGE_S)
        assert found.end.value == pytest.approx(push.end_s, abs=EDGE_S)
        assert found.strength.value == pytest.approx(height_n, rel=0.01)


def test_what_the_real_axis_does_is_found() -> None:
    result = diagnosed().result
    assert result.verdict == "missing_physics"
    found = {(finding.effect, finding.variant) for finding in result.missing}
    assert result.missing[0].effect == "asymmetric_friction"
    assert {("asymmetric_friction", "with speed"), ("nonlinear_viscous_friction", "thinning lubricant")} <= found
    cogging = next(finding for finding in result.missing if finding.effect == "cogging_torque")
    assert cogging.parameters["cycles_per_rev"].value == pytest.approx(1.0, abs=0.005)


def test_the_held_out_force_falls_below_a_third() -> None:
    force = diagnosed().result.fit["force_n"]
    assert force.mode == "closed_loop"
    assert force.validate_ is not None
    assert force.validate_.after_rms < force.validate_.before_rms / 3.0


def test_the_diagnosed_bench_says_the_same_to_a_comparison() -> None:
    found = diagnosed()
    before, after = (
        compare(emps(), Bench.model_validate(bench.model_dump())).channel("force_n").rms
        for bench in (found.owner, found.bench)
    )
    assert after < before / 3.0


def lag_s(laps: Laps, run: Measured) -> float:
    """The lag [s] after which the most rows repeat."""
    return float(np.argmax(np.bincount(laps.again - laps.first))) * run.period_s


def test_the_emps_record_has_its_published_floor() -> None:
    """Position about 0.22 um, force 0.3 to 0.37 N, by three laps."""
    owner = load_bench("emps_symmetric")
    run = take(emps(), owner)
    found = run.laps
    assert found is not None
    assert lag_s(found, run) == pytest.approx(6.24)
    (left,) = Hypothesis(owner).residuals(dataset([run], owner), closed=True).channels
    assert found.noise(left["motor"]) == pytest.approx(0.2e-6, rel=0.15)
    assert 0.3 <= found.noise(left["torque"]) <= 0.37


def test_a_row_after_a_cut_in_motion_is_evaluated() -> None:
    owner = load_bench("emps_symmetric")
    first, last = [take(part, owner) for (part,) in split([emps()])]
    assert last.time_s[last.evaluated.start] == pytest.approx(first.time_s[-1] + PERIOD_S)


def test_emps_with_its_published_parameters() -> None:
    recording = emps()
    result = compare(recording, load_bench("emps"))
    assert result.channel("motor_position_m").rms <= 1.7e-6
    assert result.channel("force_n").rms <= 2.5
    assert result.channel("acceleration_m_s2").relative <= 0.045
    assert result.inverse_dynamics is not None
    assert result.inverse_dynamics.relative_error == pytest.approx(0.0408, abs=5e-4)
    blocks = {block.deviation.name: block.deviation.rms for block in result.blocks}
    assert "drive" not in blocks  # the force was not recorded apart from its command
    assert result.channel("force_n").relative > blocks["controller"] / 54.0


def test_emps_at_constant_feed_agrees_with_its_inverse_dynamics() -> None:
    result = identify_friction(emps())
    assert result.kind is AxisKind.LINEAR
    # 20.394 N, 203.5 N s/m, -3.165 N: another method on other parts of the same record, not equal
    assert abs(result.coulomb - 20.394) < 3 * result.coulomb_std_error
    assert abs(result.viscous - 203.50) < 3 * result.viscous_std_error
    assert abs(result.offset + 3.165) < 3 * result.offset_std_error
    assert result.plot().axes[0].get_ylabel() == "mean force [N]"


def test_the_published_parameters_of_emps_come_out() -> None:
    fit = fit_inverse_dynamics(emps())
    # to the digits printed by Janot, Gautier and Brunot
    assert fit.inertia == pytest.approx(95.109, abs=5e-4)
    assert fit.viscous == pytest.approx(203.50, abs=5e-3)
    assert fit.coulomb == pytest.approx(20.394, abs=1e-3)
    assert fit.offset == pytest.approx(-3.165, abs=5e-4)
    assert 100 * fit.relative_error == pytest.approx(4.08, abs=5e-3)


def test_the_shipped_map_imports_emps() -> None:
    recording = emps()
    assert recording.kind is AxisKind.LINEAR
    assert len(recording) == 24841
    # the stamps jitter by 24 ns from step to step and do not drift: the period is 1 ms
    assert recording.period_s == 0.001
    assert "stamps within 3.2e-08 s" in recording.metadata["clock"]
    assert recording["force_n"][0] == pytest.approx(35.15065188248547 * 2.53862809, rel=1e-8)
    assert recording.metadata["derived"]["force_n"] == "copy of force_command_n, the only one recorded"
    # the record's own control law: force = gtau kv (kp (qg - qm) - d/dt of the two-sample mean of qm)
    position = recording["motor_position_m"]
    velocity = (position[2:] - position[:-2]) / (2 * recording.period_s)
    error = recording["position_command_m"] - position
    force = 35.15065188248547 * 243.45 * (160.18 * error[2:] - velocity)
    assert np.abs(force - recording["force_command_n"][2:]).max() < 1.0  # of 170 N


def test_the_law_of_emps_is_drafted() -> None:
    """The published law: 160.18 1/s, 243.45 V s/m x 35.15065 N/V, no feed-forward, difference of two-sample means."""
    published = load_bench("emps_symmetric").gains
    values = {entry.key: entry.value for entry in loop_values(emps(), 1.0).values}
    assert values["position_gain_1_s"] == pytest.approx(published.position_gain_1_s, rel=1e-3)
    assert values["velocity_gain_n_s_m"] == pytest.approx(published.velocity_gain_n_m_s_rad, rel=1e-3)
    assert values["velocity_feedforward"] == pytest.approx(0.0, abs=1e-3)
    assert values["velocity_estimate"] == "two_sample_mean"
    assert "velocity_integral_time_s" not in values
