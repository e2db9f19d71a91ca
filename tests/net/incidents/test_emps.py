"""A real axis: what the recording of the EMPS benchmark holds beside one mass with symmetric friction."""

from __future__ import annotations

from functools import cache

import pytest
from diagnosis_runs import RIG

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.preparation.law_check import check_law
from hil.identification.compare import compare
from hil.identification.measured import take
from hil.importing.by_map import import_recording
from hil.recording.recording import Recording

EMPS = RIG.parent / "emps" / "DATA_EMPS.mat"


def recording() -> Recording:
    if not EMPS.is_file():
        pytest.skip("the EMPS recording is not beside the repository")
    return import_recording(EMPS, "emps")


@cache
def diagnosed() -> Diagnosis:
    """The diagnosis, made once."""
    return diagnose([recording()], [], load_bench("emps_symmetric"))


def test_wrong_gains_are_learnt_without_another_part_of_the_law() -> None:
    """The simplest law that leaves the noise of the position steps is learnt, not a lag and a delay beside."""
    owner = load_bench("emps_symmetric")
    law = owner.known_control
    given = {"position_gain_1_s": 1.48 * law.position_gain_1_s, "velocity_gain_n_s_m": 0.63 * 8557.43}
    wrong = owner.model_copy(update={"control": law.model_copy(update=given)})
    learnt = check_law([take(recording(), wrong)], wrong)
    assert set(learnt.corrections) == set(given)
    assert learnt.corrections["position_gain_1_s"].value == pytest.approx(law.position_gain_1_s, rel=1e-3)
    assert learnt.corrections["velocity_gain_n_s_m"].value == pytest.approx(8557.43, rel=1e-3)


@pytest.mark.long
def test_what_the_real_axis_does_is_found() -> None:
    result = diagnosed().result
    assert result.verdict == "missing_physics"
    found = {(finding.effect, finding.variant) for finding in result.missing}
    assert result.missing[0].effect == "asymmetric_friction"
    assert {("asymmetric_friction", "with speed"), ("nonlinear_viscous_friction", "thinning lubricant")} <= found
    cogging = next(finding for finding in result.missing if finding.effect == "cogging_torque")
    assert cogging.parameters["cycles_per_rev"].value == pytest.approx(1.0, abs=0.005)


@pytest.mark.long
def test_the_held_out_force_falls_below_a_third() -> None:
    force = diagnosed().result.fit["force_n"]
    assert force.mode == "closed_loop"
    assert force.validate_ is not None
    assert force.validate_.after_rms < force.validate_.before_rms / 3.0


@pytest.mark.long
def test_the_diagnosed_bench_says_the_same_to_a_comparison() -> None:
    found = diagnosed()
    before, after = (
        compare(recording(), Bench.model_validate(bench.model_dump())).channel("force_n").rms
        for bench in (found.owner, found.bench)
    )
    assert after < before / 3.0
