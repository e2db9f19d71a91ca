"""A geared axis with an encoder on its load, whose control law is known."""

from __future__ import annotations

from hil.bench.bench_file import Bench, load_bench

AXIS = {
    "model": "rotary_two_mass",
    "gear_ratio": 10.0,
    "motor_inertia_kg_m2": 1e-3,
    "load_inertia_kg_m2": 0.2,
    "stiffness_n_m_rad": 2e5,
    "coulomb_torque_n_m": 0.3,
    "viscous_torque_n_m_s_rad": 1e-3,
}
CONTROL = {
    "position_gain_1_s": 20.0,
    "velocity_gain_n_m_s_rad": 0.3,
    "velocity_integral_time_s": 0.02,
    "velocity_feedforward": 1.0,
}


def geared(*effects: dict[str, object]) -> Bench:
    """A geared axis whose law is known, with effects of the simulated axis."""
    data = load_bench("rotary_geared").model_dump(mode="json")
    return Bench.model_validate(
        data
        | {
            "axis": AXIS,
            "control": CONTROL,
            "simulation": {"effects": list(effects)},
            "drive": {"following_error_m": 1.0},
        }
    )
