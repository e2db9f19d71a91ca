"""The axes and the motion that the benchmarks share."""

from hil.bench.axis_models import SerialChain, TwoMass
from hil.bench.bench_file import Bench, load_bench
from hil.bench.hardware import DriveSection, SimulationSection
from hil.bench.supervision_section import SupervisionSection
from hil.motion.trajectory import Trajectory, plan
from hil.validation.proof.draw.demo import from_rest, there_and_back

MODES = 20
MOVES = from_rest("100 mm at 7 and 22 m/min and back", [*there_and_back(0.1, 0.116667), *there_and_back(0.1, 0.366667)])
_STANDING = SupervisionSection(frozen_torque=1e9, torque_difference=1e9)


def trajectory(period_s: float) -> Trajectory:
    """Return the set-points of `MOVES`."""
    return plan(MOVES, period_s, 0.0)


def two_mass() -> Bench:
    """Return the reference bench."""
    return load_bench("reference")


def chain_of(masses: int) -> Bench:
    """Return the reference bench as a chain of its motor and so many masses less one, with springs of equal stiffness.

    The table is split into equal parts, and the compliance into equal springs.
    """
    bench = two_mass()
    axis, parts = bench.axis, masses - 1
    assert isinstance(axis, TwoMass)
    at_motor = axis.ratio_m_rad**2
    chain = SerialChain(
        lead_m=axis.lead_m,
        inertias_kg_m2=(axis.motor_mass_kg * at_motor, *(axis.table_mass_kg * at_motor / parts,) * parts),
        stiffnesses_n_m_rad=(axis.stiffness_n_m * at_motor * parts,) * parts,
        coulomb_torque_n_m=axis.coulomb_torque_n_m,
        viscous_torque_n_m_s_rad=axis.viscous_torque_n_m_s_rad,
    )
    return bench.model_copy(update={"axis": chain, "name": f"chain_{masses}"})


def twenty_modes(interface: str = "inprocess") -> Bench:
    """Return the chain of 20 masses on a bus, with bounds for an axis that stands still while the loop commands it."""
    drive = DriveSection.model_validate({"interface": interface, "following_error_m": 10.0, "supervision": _STANDING})
    return chain_of(MODES).model_copy(update={"drive": drive, "simulation": SimulationSection()})
