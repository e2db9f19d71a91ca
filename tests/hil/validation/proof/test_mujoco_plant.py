"""A third party's physics as the plant: it agrees with the twin where nothing is concealed, and its effects show."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.reality import record
from hil.identification.dataset import Dataset, prepare_dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.twin.library import BY_ID
from hil.validation.proof.draw.cases import stage
from hil.validation.proof.draw.mujoco_model import EFFECTS
from hil.validation.proof.draw.mujoco_plant import draw_mujoco, record_mujoco

pytest.importorskip("mujoco", reason="MuJoCo is not installed: make peers")


def test_the_nominal_axis_leaves_as_little_as_with_the_simulated_axis() -> None:
    """In closed loop, with the true parameters in the twin: three simulations that share nothing but the controller."""
    on = stage(np.random.default_rng(1), "two_mass")
    axis, run = on.axis, on.runs[1]
    simulated = record(axis.truth, axis.sensors, [], axis.servo, run.position_m, run.velocity_m_s, axis.period_s, 5)

    def left(recording: Recording) -> dict[str, float]:
        bench = replace(axis, believed=axis.true).bench
        measured = take(recording, bench)
        (channels,) = Hypothesis(bench).residuals(Dataset((measured,), bench), closed=True).channels
        return {name: float(np.sqrt(np.mean(values[measured.evaluated] ** 2))) for name, values in channels.items()}

    ours, theirs = left(Recording("run", simulated, axis.period_s)), left(record_mujoco(axis, None, run, 5))
    assert theirs["torque"] == pytest.approx(ours["torque"], rel=0.02)
    assert theirs["table"] == pytest.approx(ours["table"], rel=0.02)
    assert theirs["motor"] < 2.0 * ours["motor"]  # half a step of time, see the model


@pytest.mark.parametrize(
    "effect",
    [
        "constant_load",
        "cogging_torque",
        "backlash",
        pytest.param("periodic_lead_error", marks=pytest.mark.long),
        pytest.param("spring_load", marks=pytest.mark.long),
        pytest.param("table_side_friction", marks=pytest.mark.long),
        pytest.param("stribeck_friction", marks=pytest.mark.long),
    ],
)
def test_what_mujoco_moves_is_what_the_library_says_of_an_effect(effect: str) -> None:
    case = draw_mujoco("single", EFFECTS.index(effect), 11)
    bench = replace(case.draft.axis, believed=case.draft.axis.true).bench
    run, true = take(case.recordings[1], bench), case.truth.effects[0]
    assert true.effect == effect
    values = tuple(true.parameters.get(name, 0.0) for name in BY_ID[effect].names)

    def left(*terms: Term) -> float:
        found = Hypothesis(bench, terms).residuals(prepare_dataset([run], bench))
        return float(np.mean(found.vector**2))

    variant = {"exponential": 1}.get(true.form, int(effect == "backlash"))  # its flanks push only
    without, with_it = left(), left(Term(effect, variant, values))
    assert with_it < min(1.3, 1.0 + 0.1 * (without - 1.0)), (without, with_it)


def test_only_two_masses_move_in_mujoco() -> None:
    axis = stage(np.random.default_rng(1), "one_mass").axis
    with pytest.raises(ValueError, match="two_mass"):
        record_mujoco(axis, None, stage(np.random.default_rng(1), "two_mass").runs[0], 1)
