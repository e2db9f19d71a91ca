"""An unnamed fault is located on the table, in the transmission, in the linear encoder or on the motor."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_runs import bench, changed, recorded

from hil.diagnosis.location.locate import locate
from hil.diagnosis.location.reaction_torque import acting, stiffness_between
from hil.identification.dataset import prepare_dataset
from hil.identification.measured import take
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.terms import Term
from hil.recording.recording import Recording
from hil.twin.structure.chain import serial_chain, two_mass

OWNER = bench()


def bursts() -> Recording:
    """The linear encoder reads 5 um of noise for 0.2 s."""
    clean = recorded(OWNER)
    noisy = np.where(np.abs(clean.columns["time_s"] - 0.5) < 0.1, 5e-6, 0.0)
    error_m = noisy * np.random.default_rng(3).standard_normal(noisy.size)
    return changed(clean, table_position_m=clean.columns["table_position_m"] + error_m)


@pytest.mark.parametrize(
    ("truth", "block"),
    [
        (Term("external_force", 0, (150.0, 0.3, 0.6)), "table"),
        (Term("spring_load", 0, (3000.0, 0.02)), "table"),
        (Term("periodic_lead_error", 0, (3e-6, 0.4, 1e-6, 1.0, 0.0, 0.0)), "transmission"),
        (None, "sensor"),
        (Term("cogging_torque", 0, (0.1, 6.0, 0.2)), "motor_side"),
        (Term("torque_ripple", 0, (0.2, 6.0, 0.2)), "motor_side"),
    ],
    ids=["push", "spring", "lead", "noise bursts", "cogging", "ripple"],
)
def test_the_motor_tells_on_which_side_of_the_transmission_it_acts(truth: Term | None, block: str) -> None:
    runs = (take(recorded(OWNER, truth) if truth else bursts(), OWNER),)
    left = fit_nominal_parameters(prepare_dataset(runs, OWNER))
    assert locate(left, left).block == block


def test_wrong_parameters_are_placed_where_they_show_and_not_where_they_seem_to_act() -> None:
    """A heavier table loads the spring as a force on it would."""
    runs = (take(recorded(bench(table_mass_kg=1.5 * OWNER.axis.table_mass_kg)), OWNER),)
    refitted = fit_nominal_parameters(prepare_dataset(runs, OWNER))
    owner = refitted.estimator.evaluate(refitted.hypothesis.given)
    assert acting(owner) is not None
    assert locate(owner, refitted).block in ("motor_side", "transmission")


def test_without_a_second_encoder_nothing_is_told() -> None:
    runs = (take(recorded(OWNER, Term("external_force", 0, (150.0, 0.3, 0.6))), OWNER),)
    owner = OWNER.model_copy(update={"encoders": OWNER.encoders.model_copy(update={"table": None})})
    blind = (take(changed(recorded(owner), table_position_m=None), owner),)
    assert acting(fit_nominal_parameters(prepare_dataset(blind, owner))) is None
    assert acting(fit_nominal_parameters(prepare_dataset(runs, OWNER))) is not None


def test_the_stiffness_that_holds_the_table_is_that_of_the_springs_in_series() -> None:
    assert stiffness_between(two_mass(10.0, 200.0, 1e8, 0.02, 0.01)) == pytest.approx(1e8 * (0.01 / (2 * np.pi)) ** 2)
    chain = serial_chain([1e-3, 1e-3, 1e-3], [100.0, 50.0], 0.02, 0.01)
    assert stiffness_between(chain) == pytest.approx(1.0 / (1.0 / 100.0 + 1.0 / 50.0))
