"""Responses of the twin: its chain with viscous friction under its sampled law, linear and exact at the ticks.

    q' = A q + B tau,  A = [[0, I], [-J^-1 K, -J^-1 C]],  tau held for a tick:   theta(z) = c (z - e^(A T))^-1 B_T tau

Coulomb friction is a constant while the axis slides one way, and gives no response.
"""

from collections.abc import Mapping

import numpy as np
from scipy.linalg import expm

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.frequency.curves import ResponseCurve
from hil.twin.axis import Twin
from hil.twin.mechanism import Stage
from hil.twin.structure.frequency import ComplexArray, SampledPlant, laplace, modal_damping, position_loop, velocity_law
from hil.twin.structure.modal import modal

POINTS, LOWEST_HZ = 2400, 0.05
_LINEAR = (Stage.CHAIN, Stage.VELOCITY_FILTER)  # mechanisms that the curves contain


def sampled_plant(twin: Twin, period_s: float) -> SampledPlant:
    """Held torque to motor and table angle at z, with the viscous friction of the motor."""
    chain = twin.chain
    size = len(chain.names)
    damping = modal_damping(chain, modal(chain))
    damping[chain.motor, chain.motor] += twin.physics.viscous_n_m_s_rad
    inverse = np.linalg.inv(chain.inertia_kg_m2)
    system = np.zeros((2 * size + 1, 2 * size + 1))
    system[:size, size : 2 * size] = np.eye(size)
    system[size : 2 * size, :size] = -inverse @ chain.stiffness_n_m_rad
    system[size : 2 * size, size : 2 * size] = -inverse @ damping
    system[size : 2 * size, -1] = inverse[:, chain.motor]
    held = expm(system * period_s)
    step, load = held[: 2 * size, : 2 * size], held[: 2 * size, -1:]

    def plant(z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        state = np.linalg.solve(z[:, None, None] * np.eye(2 * size) - step, load.astype(np.complex128))[..., 0]
        return state[:, chain.motor], state[:, chain.table]

    return plant


def twin_curves(bench: Bench, frequency_hz: FloatArray | None = None) -> dict[str, ResponseCurve]:
    """Responses of the twin of a bench by name, see `FrequencyResponse`, up to half the rate of their loop.

    `frequency_hz` (k,): ascending, by default dense over the whole range.
    """
    twin = bench.twin()
    gains, period_s, ratio = twin.loop_gains, twin.gains.period_s, bench.axis.ratio_m_rad
    if frequency_hz is None:
        frequency_hz = np.geomspace(LOWEST_HZ, 0.499 / period_s, POINTS)
    z = np.exp(laplace(frequency_hz) * period_s)
    plant = sampled_plant(twin, period_s)
    motor, table = plant(z)
    units = axis_units(bench)
    found: dict[str, tuple[ComplexArray, str]] = {"plant_motor": (motor, units[0])}
    if bench.has_table_encoder:
        found["plant_table"] = (ratio * table, units[1])
    slow = frequency_hz < 0.499 / (period_s * gains.position_ticks)
    if bench.law_known:
        pi_law, velocity = velocity_law(gains, z)
        opened = pi_law * velocity * motor
        found |= {"velocity_open": (opened, "1"), "velocity_closed": (opened / (1.0 + opened), "1")}
        position, closed = position_loop(plant, gains, frequency_hz[slow])
        if not bench.has_table_encoder:
            closed = position_loop(lambda z: (plant(z)[0], plant(z)[0]), gains, frequency_hz[slow])[1]
        found |= {"position_open": (position, "1"), "position_closed": (closed, "1")}
    return {
        name: ResponseCurve(
            titles(bench)[name],
            unit,
            frequency_hz[: values.size],
            np.asarray(values, dtype=np.complex128),
            np.zeros(values.size),
            np.ones(values.size),
        )
        for name, (values, unit) in found.items()
    }


def left_out(bench: Bench) -> list[str]:
    """Mechanisms of the bench that the curves of its twin do not contain, by their id."""
    return [active.effect for active in bench.twin().active if active.form.stage not in _LINEAR]


def axis_units(bench: Bench) -> tuple[str, str]:
    """Units of motor position and table position over torque or force."""
    return ("m/N", "m/N") if bench.axis.linear else ("rad/(N m)", "m/(N m)")


def titles(bench: Bench) -> Mapping[str, str]:
    """What each response leads from and to."""
    effort = "force" if bench.axis.linear else "torque"
    end = "table" if bench.has_table_encoder else "motor"
    return {
        "plant_motor": f"motor {effort} to motor position",
        "plant_table": f"motor {effort} to table position",
        "velocity_open": "velocity loop, open",
        "velocity_closed": "velocity loop, closed",
        "position_open": "position loop, open",
        "position_closed": f"position command to {end} position",
    }
