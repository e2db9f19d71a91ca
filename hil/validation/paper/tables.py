"""Table of the reproduction: printed value, computed value, and the reason for a difference."""

from collections.abc import Iterator
from math import pi

import numpy as np
from scipy.optimize import brentq

from hil.arrays import FloatArray
from hil.twin.structure import frequency
from hil.twin.structure.ballscrew import equivalent_two_mass
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, seven_dof, two_mass
from hil.twin.structure.modal import modal
from hil.validation.paper import formulas, source
from hil.validation.paper.row import Row, row

EQ_20_HZ = (144.0, 432.0, 870.0, 2474.0, 2909.0, 3900.0)
_GRID_HZ = np.geomspace(0.1, 400.0, 4000)


def rows() -> tuple[Row, ...]:
    """Compute all comparisons, in the order of the source."""
    groups = (
        formulas.two_dof_formulas,
        formulas.transfer_functions,
        _modes,
        _equivalent_model,
        _friction,
        _control,
        _two_against_seven,
        _nut_position,
        _experiments,
    )
    return tuple(row for group in groups for row in group())


def frequencies_hz(model: str) -> FloatArray:
    """Frequencies [Hz] of a model of `source.chains`, the rigid body's 0 first."""
    return modal(source.chains()[model]).frequency_rad_s / (2.0 * pi)


def _modes() -> Iterator[Row]:
    for number, (value, printed) in enumerate(zip(frequencies_hz("7-dof")[1:], EQ_20_HZ, strict=True), start=2):
        yield row("mode", value, printed, number=number)


def _equivalent_model() -> Iterator[Row]:
    two = equivalent_two_mass(RECONSTRUCTED_TABLE_1)
    yield row("motor_mass", two.motor_mass_kg)
    yield row("table_mass", two.table_mass_kg)
    yield row("stiffness_parallel", two.stiffness_parallel_n_m)
    series = two_mass(two.motor_mass_kg, two.table_mass_kg, two.stiffness_series_n_m, 0.0, source.LEAD_M)
    series_hz = modal(series).frequency_rad_s[1] / (2.0 * pi)
    yield row("stiffness_series", two.stiffness_series_n_m, series_hz=series_hz)
    turning_kg = float(RECONSTRUCTED_TABLE_1.reduced()[0][1:4].sum()) / source.RATIO_M_RAD**2
    yield row("two_dof_frequency", frequencies_hz("2-dof")[1], turning_kg=turning_kg)


def _friction() -> Iterator[Row]:
    for feed in (7, 22):
        speed_rad_s = feed / 60.0 / source.RATIO_M_RAD
        yield row(f"friction_{feed}", source.COULOMB_N_M + source.VISCOUS_N_M_S_RAD * speed_rad_s)


def bandwidth_hz(model: str, velocity_feedforward: float, position_from_table: bool = False) -> float:
    """-3 dB bandwidth [Hz] of the continuous position loop, command to table."""
    law = source.gains(velocity_feedforward, position_from_table)
    return frequency.bandwidth_hz(_GRID_HZ, frequency.closed_loop(modal(source.chains()[model]), law, _GRID_HZ))


def _control() -> Iterator[Row]:
    needed_1_s = _position_gain_for(2.32)
    for model in ("2-dof", "7-dof"):
        sampled = frequency.sampled_closed_loop(modal(source.chains()[model]), source.gains(0.0), _GRID_HZ)
        yield row(
            "bandwidth",
            bandwidth_hz(model, 0.0),
            model=model,
            table_hz=bandwidth_hz(model, 0.0, position_from_table=True),
            sampled_hz=frequency.bandwidth_hz(_GRID_HZ, sampled),
            needed_1_s=needed_1_s,
            gain_1_s=source.POSITION_GAIN_1_S,
        )
    yield row("bandwidth_feedforward", bandwidth_hz("2-dof", 1.0))
    yield row("bandwidth_ratio", bandwidth_hz("7-dof", 0.0) / bandwidth_hz("2-dof", 0.0))


def _position_gain_for(wanted_hz: float) -> float:
    """Kv [1/s] that gives the 2-dof loop without feed-forward the bandwidth `wanted_hz`."""
    modes, law = modal(source.chains()["2-dof"]), source.gains(0.0)

    def excess_hz(gain_1_s: float) -> float:
        response = frequency.closed_loop(modes, law._replace(position_gain_1_s=gain_1_s), _GRID_HZ)
        return frequency.bandwidth_hz(_GRID_HZ, response) - wanted_hz

    return float(brentq(excess_hz, 1.0, source.POSITION_GAIN_1_S, xtol=1e-3))


def _two_against_seven() -> Iterator[Row]:
    two, seven = (source.simulate(chain, 30.0) for chain in source.chains().values())
    position = seven.response.table_position_m - two.response.table_position_m
    notes = "; ".join(note.partition(": ")[2] for note in two.command.notes)
    yield row("position_difference", _rms(position) * 1e6, notes=notes)
    yield row("torque_difference", _rms(seven.response.torque - two.response.torque))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _nut_position() -> Iterator[Row]:
    screw = RECONSTRUCTED_TABLE_1
    yield row("torsion", screw.screw_torsion_n_m_rad(0.100) / screw.screw_torsion_n_m_rad())
    near, far = (source.simulate(seven_dof(screw, source.DAMPING_RATIO, nut), 22.0) for nut in (0.05, 0.2))
    late_m = near.response.table_position_m - far.response.table_position_m
    fast = near.command.velocity_m_s > 0.1
    yield row("delay", np.max(np.abs(late_m[fast] / near.command.velocity_m_s[fast])) * 1e6)


def _experiments() -> Iterator[Row]:
    yield from (row("jerk_7", None), row("jerk_8", None))
