"""The simulated axis of a bench has the masses, springs and counts of its bench file, by formulas of its own."""

from __future__ import annotations

import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drivers.inprocess import InProcessBus
from hil.bench.axis_models import OneMass, Rigid, SerialChain, SevenDofAxis, TwoMass
from hil.bench.bench_file import load_bench
from hil.bench.hardware import SimulationSection
from hil.bench.turning_axes import Rotary, RotaryTwoMass
from hil.errors import FieldError
from hil.loop.simulated_bench import SimulatedNodes, _counts_per_lead, _counts_per_turn, make_plant, true_axis
from hil.twin.structure.modal import modal

FRICTION = {"coulomb_torque_n_m": 0.3, "viscous_torque_n_m_s_rad": 0.002}
AXES: dict[str, Any] = {
    "rigid": Rigid(lead_m=0.013, mass_kg=91.0, **FRICTION),
    "two masses": TwoMass(lead_m=0.013, motor_mass_kg=311.0, table_mass_kg=207.0, stiffness_n_m=3.1e7,
                          damping_ratio=0.02, **FRICTION),
    "seven": SevenDofAxis(**FRICTION),
    "chain": SerialChain(lead_m=0.013, inertias_kg_m2=(0.0011, 0.0007, 0.0005), stiffnesses_n_m_rad=(310.0, 170.0),
                         inertia_scale=1.3, stiffness_scale=0.7, **FRICTION),
    "rotary": Rotary(gear_ratio=7.0, inertia_kg_m2=0.003, **FRICTION),
    "rotary, two": RotaryTwoMass(gear_ratio=7.0, motor_inertia_kg_m2=0.003, load_inertia_kg_m2=0.21,
                                 stiffness_n_m_rad=2100.0, **FRICTION),
}  # fmt: skip


@pytest.mark.parametrize("name", AXES)
def test_inertia_frequencies_and_friction_are_those_of_the_twin(name: str) -> None:
    axis = AXES[name]
    truth, chain = true_axis(axis, SimulationSection()), axis.chain()
    ratio = axis.ratio_m_rad
    assert truth.drive_ratio_m_rad == pytest.approx(ratio)
    assert ratio**2 * sum(truth.mass_kg) == pytest.approx(float(chain.inertia_kg_m2.sum()), rel=1e-3)
    assert (truth.coulomb_torque_n_m, truth.viscous_torque_n_m_s_rad) == (0.3, 0.002)
    if len(truth.mass_kg) > 1:
        assert truth.damping_ratio == axis.damping_ratio
        found = 2.0 * math.pi * truth.frequencies_hz()[1:]
        assert found == pytest.approx(np.sort(modal(chain).frequency_rad_s)[1:], rel=1e-3)


def test_values_of_the_simulation_are_the_true_ones() -> None:
    truth = true_axis(AXES["rigid"], SimulationSection(axis={"mass_kg": 95.0}))
    assert truth.mass_kg == (95.0,)
    with pytest.raises(FieldError, match=r"allowed the numbers of rigid"):
        true_axis(AXES["rigid"], SimulationSection(axis={"mass_kg": -1.0}))
    with pytest.raises(FieldError, match=r"nut_position_m.*allowed null on a simulated bench"):
        true_axis(SevenDofAxis(nut_position_m=0.1, **FRICTION), SimulationSection())


def test_a_linear_axis_is_in_newtons_and_its_lead_a_turn() -> None:
    axis = OneMass(mass_kg=90.0, coulomb_force_n=20.0, viscous_force_n_s_m=200.0)
    truth = true_axis(axis, SimulationSection())
    assert (truth.mass_kg, truth.linear, truth.lead_m) == ((90.0,), True, pytest.approx(2.0 * math.pi))
    assert (truth.coulomb_torque_n_m, truth.viscous_torque_n_m_s_rad) == (20.0, 200.0)
    assert true_axis(axis.model_copy(update={"screw_lead_m": 0.02}), SimulationSection()).lead_m == 0.02


def test_counts_of_the_motor_encoder() -> None:
    rotary = load_bench("reference")
    counts = rotary.encoders.motor.counts_per_rev
    assert _counts_per_turn(rotary) == counts
    assert _counts_per_lead(rotary, true_axis(rotary.axis, SimulationSection())) == counts
    motor = SimpleNamespace(resolution_m=1e-6, counts_per_rev=None)
    linear: Any = SimpleNamespace(axis=SimpleNamespace(linear=True), encoders=SimpleNamespace(motor=motor))
    assert _counts_per_turn(linear) == pytest.approx(2.0 * math.pi * 1e6)
    axis: Any = SimpleNamespace(linear=True, screw_ratio_m_rad=0.02 / (2.0 * math.pi))
    assert _counts_per_lead(linear, axis) == pytest.approx(0.02 / 1e-6)


@pytest.mark.parametrize(("counts", "allowed"), [(1 << 20, True), (0xFFFF_FFFF, True), (1 << 32, False)])
def test_counts_per_revolution_fit_the_object_of_the_drive(counts: int, allowed: bool) -> None:
    """Object 0x608F is UNSIGNED32."""
    reference = load_bench("reference")
    motor = reference.encoders.motor.model_copy(update={"counts_per_rev": counts})
    bench = reference.model_copy(update={"encoders": reference.encoders.model_copy(update={"motor": motor})})
    with nullcontext() if allowed else pytest.raises(FieldError, match=r"encoders\.motor: .* allowed 1 to 4294967295"):
        SimulatedNodes(bench, InProcessBus().port(), seed=1).close()


@pytest.mark.parametrize(("seed", "allowed"), [(0, True), (7, True), (-1, False), (1.5, False)])
def test_a_seed_is_a_whole_number_from_zero(seed: Any, allowed: bool) -> None:
    if allowed:
        make_plant(load_bench("reference"), seed)
        return
    with pytest.raises(FieldError, match="allowed a whole number, 0 or more"):
        make_plant(load_bench("reference"), seed)
