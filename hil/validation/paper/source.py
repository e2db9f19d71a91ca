"""Axis of the source paper: stated and assumed parameters, and its simulated moves."""

from dataclasses import dataclass
from math import pi

import numpy as np

from hil.arrays import FloatArray
from hil.control.cascade import Gains, make_gains
from hil.motion.pieces import Motion
from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan
from hil.twin.axis import Response, Twin
from hil.twin.physics import Physics
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, Chain, seven_dof, two_mass

LEAD_M = 0.010
RATIO_M_RAD = LEAD_M / (2.0 * pi)
MOTOR_MASS_KG, TABLE_MASS_KG, STIFFNESS_N_M = 335.0, 384.0, 5.64e7  # Eq. 22-23
COULOMB_N_M, VISCOUS_N_M_S_RAD = 1.1, 0.0064  # Sec. 3.2.3
POSITION_GAIN_1_S, INTEGRAL_TIME_S, TORQUE_CONSTANT_N_M_A = 36.84, 6.2e-3, 1.4  # Table 2
VELOCITY_GAIN_N_M_S_RAD = 20e-3 * TORQUE_CONSTANT_N_M_A * 60.0 / (2.0 * pi)  # 20 mA/rpm x Kt
STROKE_M = 0.100
FEEDS_M_MIN = (7.0, 22.0, 30.0)

# Not in the source, or lost with its Table 1 and figures.
DAMPING_RATIO = 0.03
ACCELERATION_M_S2 = 2.5
JERK_M_S3 = 120.0

ASSUMPTIONS = (
    "Inertias and stiffnesses of the 7-dof model are a reconstruction: Table 1 of the source is lost.",
    f"Modal damping ratio {DAMPING_RATIO:g} for every elastic mode: the source gives none.",
    f"Moves with at most {ACCELERATION_M_S2:g} m/s^2, at which 22 m/min over 100 mm has hardly any constant "
    f"feed, as the source says; jerk at most {JERK_M_S3:g} m/s^3. The source states neither.",
    "The position loop closes on the motor encoder, with 100 % velocity feed-forward in the time plots; "
    "the source names a feed-forward but not its gain. Frequency responses are shown with and without it.",
    "Velocity loop every 1 ms, position loop every 4 ms; the torque limit is never reached.",
)


def chains() -> dict[str, Chain]:
    """Build the two models of the source by name: "2-dof" with its printed values, "7-dof" reconstructed."""
    return {
        "2-dof": two_mass(MOTOR_MASS_KG, TABLE_MASS_KG, STIFFNESS_N_M, DAMPING_RATIO, LEAD_M),
        "7-dof": seven_dof(RECONSTRUCTED_TABLE_1, DAMPING_RATIO),
    }


def gains(velocity_feedforward: float, position_from_table: bool = False) -> Gains:
    """Build the cascade of Table 2."""
    return make_gains(
        position_gain_1_s=POSITION_GAIN_1_S,
        velocity_gain_n_m_s_rad=VELOCITY_GAIN_N_M_S_RAD,
        velocity_integral_time_s=INTEGRAL_TIME_S,
        velocity_feedforward=velocity_feedforward,
        ratio_m_rad=RATIO_M_RAD,
        position_from_table=position_from_table,
    )


@dataclass(frozen=True)
class SimulatedMove:
    """Simulated move: set-points and response (n,) at the control period."""

    feed_m_min: float
    command: Trajectory
    response: Response

    @property
    def table(self) -> Motion:
        """Motion of the table; velocity, acceleration and jerk are central differences of its position."""
        period_s = self.command.period_s
        position = self.response.table_position_m
        velocity = np.gradient(position, period_s)
        acceleration = np.gradient(velocity, period_s)
        return Motion(position, velocity, acceleration, np.gradient(acceleration, period_s))

    @property
    def following_error_m(self) -> FloatArray:
        """Position command minus table position (n,)."""
        return self.command.position_m - self.response.table_position_m


def simulate(chain: Chain, feed_m_min: float, velocity_feedforward: float = 1.0) -> SimulatedMove:
    """Simulate a 100 mm move of an axis with friction by Eq. 24, from rest, in closed loop."""
    law = gains(velocity_feedforward)
    profile = Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": ACCELERATION_M_S2, "jerk_m_s3": JERK_M_S3},
            "segments": [
                {"kind": "dwell", "duration_s": 0.052},
                {"kind": "sine_squared", "to_m": STROKE_M, "feed_m_s": feed_m_min / 60.0},
                {"kind": "dwell", "duration_s": 0.252},
            ],
        }
    )
    command = plan(profile, law.period_s)
    twin = Twin(Physics(chain, COULOMB_N_M, VISCOUS_N_M_S_RAD), law)
    return SimulatedMove(feed_m_min, command, twin.simulate(command.position_m, command.velocity_m_s))
