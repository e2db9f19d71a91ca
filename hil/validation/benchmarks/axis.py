"""The axes and the motion that the benchmarks share."""

from hil.bench.bench_file import Bench, load_bench
from hil.bench.hardware import DriveSection, SimulationSection
from hil.bench.supervision_section import SupervisionSection
from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan

MODES = 20

_STANDING = SupervisionSection(frozen_torque=1e9, torque_difference=1e9)


def moves() -> Profile:
    """100 mm at 7 and 22 m/min and back."""
    there_and_back = [
        {"kind": "sine_squared", "to_m": target, "feed_m_s": feed}
        for feed in (0.116667, 0.366667)
        for target in (0.1, 0.0)
    ]
    dwell = {"kind": "dwell", "duration_s": 0.2}
    return Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
            "segments": [dwell, *(segment for move in there_and_back for segment in (move, dwell))],
        }
    )


def trajectory(period_s: float, laps: int = 1) -> Trajectory:
    """Set-points of `moves`, several times over."""
    profile = moves()
    return plan(profile.model_copy(update={"segments": profile.segments * laps}), period_s, 0.0)


def two_mass() -> Bench:
    """The reference bench."""
    return load_bench("reference")


def twenty_modes(interface: str = "inprocess") -> Bench:
    """The masses and the stiffness of the reference bench spread over a row of 20 inertias, on a bus."""
    reference = two_mass()
    axis, ratio = reference.axis, reference.axis.ratio_m_rad
    mass_kg, stiffness_n_m = 335.0 + 384.0, 5.64e7
    data = reference.model_dump() | {
        "name": "20 modes",
        "axis": {
            "model": "serial_chain",
            "lead_m": 0.010,
            "damping_ratio": 0.03,
            "inertias_kg_m2": [mass_kg * ratio**2 / MODES] * MODES,
            "stiffnesses_n_m_rad": [stiffness_n_m * ratio**2 * (MODES - 1)] * (MODES - 1),
            "coulomb_torque_n_m": 1.1,
            "viscous_torque_n_m_s_rad": 0.0064,
        },
        # the axis stands still; the loop takes the same time, and the deviation is no fault in a benchmark
        "drive": DriveSection(interface=interface, following_error_m=10.0, supervision=_STANDING).model_dump(),
        "simulation": SimulationSection().model_dump(),
    }
    assert not axis.linear
    return Bench.model_validate(data)
