"""The simulated reality reproduces the rig recordings, which another simulator made."""

from __future__ import annotations

import numpy as np
import pytest
from measured_recordings import rig

from drivers.sim.axis import two_mass
from drivers.sim.effects import Effect
from drivers.sim.reality import record
from drivers.sim.sensors import Sensors
from drivers.sim.servo import Servo

pytestmark = pytest.mark.net


@pytest.mark.parametrize(("folder", "truth", "effects"), [
    ("null", dict(motor_mass_kg=330.8, table_mass_kg=408.3, stiffness_n_m=5.348e7, coulomb_torque_n_m=0.7366,
                  viscous_torque_n_m_s_rad=0.00755, damping_ratio=0.0331), []),
    ("stribeck", dict(motor_mass_kg=322.7, table_mass_kg=328.3, stiffness_n_m=6.338e7, coulomb_torque_n_m=1.007,
                      viscous_torque_n_m_s_rad=0.00836, damping_ratio=0.0316),
     [Effect("stribeck_friction", {"static_torque_n_m": 1.708, "stribeck_velocity_rad_s": 3.085})]),
])  # fmt: skip
def test_reproduces_the_recordings_of_another_simulator(
    folder: str, truth: dict[str, float], effects: list[Effect]
) -> None:
    """Masses, stiffness and friction as fitted with this simulator to the first 16 s; torque to the sensor noise of
    0.01 N m rms, table to a fraction of a count, on that record."""
    rows = np.genfromtxt(rig(folder) / "train_1.csv", delimiter=",", names=True)[:16_000]
    ours = record(
        two_mass(**truth), Sensors(torque_noise_n_m=0.0), effects, Servo(velocity_gain_n_m_s_rad=0.2673803),
        np.array(rows["position_command_m"]), np.array(rows["velocity_command_m_s"]), step_s=2e-5,
    )  # fmt: skip
    assert np.std(ours["torque_n_m"] - rows["torque_n_m"]) < 0.0115
    assert np.std(ours["table_position_m"] - rows["table_position_m"]) < 0.25e-6
