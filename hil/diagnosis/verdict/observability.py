"""Which mechanisms a motion could show at all: the change each would make at a typical strength, in units of noise.

    visible = | (1 - P) (r(with) - r(without)) |^2,   P: projection on what the nominal parameters can explain

A mechanism is not testable where even the most of its variants stays below the evidence that a name takes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from hil.bench.bench_file import Bench
from hil.diagnosis.search.forward_selection import MATERIAL, NEEDED
from hil.diagnosis.search.initial_values import NEEDS_TABLE
from hil.identification.dataset import Measured
from hil.identification.estimator import POOL, Fit
from hil.identification.terms import Term
from hil.twin.library import BY_ID, LIBRARY


def not_testable(found: Fit, asked: Collection[str] = tuple(BY_ID), margin: float = 1.0) -> tuple[str, ...]:
    """Ids of the mechanisms asked for that the data of a fit cannot show, in the library's order.

    `margin` is how many times as visible as needed: more than one where the recordings are only imagined.
    """
    bench, hypothesis = found.bench, found.hypothesis.rebased
    present = {term.effect for term in found.terms} | {entry.effect for entry in bench.mechanisms}
    typical = _typical(bench, found.data.runs)
    nuisance, _ = np.linalg.qr(found.jacobian[:, : hypothesis.nominal_count])
    enough = margin * max(NEEDED, MATERIAL * found.rows)

    def visible(effect: str, variant: int) -> bool:
        changed = hypothesis.with_term(Term(effect, variant, typical[effect]))
        change = found.estimator.residuals(changed).vector - found.residuals.vector
        change -= nuisance @ (nuisance.T @ change)
        return float(change @ change) > enough

    wanted = [mechanism for mechanism in LIBRARY if mechanism.id in asked and mechanism.id not in present]
    jobs = [
        (mechanism.id, variant)
        for mechanism in wanted
        for variant in range(len(mechanism.variants))
        if bench.has_table_encoder or mechanism.id not in NEEDS_TABLE
    ]
    shown = {effect for (effect, _), seen in zip(jobs, POOL.map(lambda job: visible(*job), jobs), strict=True) if seen}
    return tuple(mechanism.id for mechanism in wanted if mechanism.id not in shown)


def _typical(bench: Bench, runs: Sequence[Measured]) -> dict[str, tuple[float, ...]]:
    """Strengths that an engineer would call a defect, in the units of the axis; after the sources in the library."""
    physics, ratio = bench.axis.physics(), bench.axis.ratio_m_rad
    coulomb = max(physics.coulomb_n_m, 1e-6)
    limit = bench.gains.torque_limit_n_m
    rated = limit / 3.0 if np.isfinite(limit) else max(float(np.max(np.abs(run.torque))) for run in runs)
    count = bench.encoders.table.resolution_m if bench.encoders.table is not None else 1e-7
    middle = 0.5 * max(run.motor.size * run.period_s for run in runs)
    return {
        "asymmetric_friction": (0.1 * coulomb,),
        "constant_load": (0.1 * coulomb,),
        "stribeck_friction": (1.5 * coulomb, 2e-3 / ratio),
        "presliding_hysteresis": (coulomb * ratio / 5e-6,),
        "position_dependent_friction": (0.1, 0.1, 0.0),
        "nonlinear_viscous_friction": (0.2 * coulomb / (0.3 / ratio) ** 2,),
        "friction_drift": (0.2, 600.0),
        "table_side_friction": (0.3,),
        "backlash": (3e-6,),
        "preload_loss": (3e-6, 0.5),
        "position_dependent_stiffness": (0.5,),
        "periodic_lead_error": (2e-6, 0.0),
        "cumulative_lead_error": (20e-6,),
        "thermal_growth": (50e-6, 1800.0),
        "structural_mode": (40.0, 0.03, 0.1),
        "cogging_torque": (0.02 * rated, 12.0, 0.0),
        "torque_ripple": (0.02, 6.0, 0.0),
        "torque_constant_saturation": (0.1 / (3.0 * rated) ** 2,),
        "torque_saturation": (2.5 * rated,),
        "torque_dead_zone": (0.05 * coulomb,),
        "current_loop_lag": (5e-4,),
        "transport_delay": (5e-4,),
        "velocity_filter_lag": (5e-4,),
        "channel_time_skew": (2e-4,),
        "encoder_eccentricity": (2e-4 if not bench.axis.linear else 2e-4 / physics.angle_per_unit, 0.0),
        "scale_interpolation_error": (max(0.5 * count, 1e-7), 20e-6, 0.0),
        "external_force": (0.2 * coulomb / ratio, middle, middle + 1.0),
        "spring_load": (0.5 * coulomb / ratio, 0.0),
    }
