"""Starting values of each mechanism for the recordings at hand: where a search for it begins.

A start is a point of a mechanism's parameters at small but visible strength. The screen asks how much of
the residual the twin's answer to it explains, scales the strength, and turns the phase. A variant without an
entry of its own starts as its mechanism does, a mechanism without an entry from the middle of its bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.search import disturbance as estimate
from hil.identification.dataset import Measured, inertia
from hil.twin.library import BY_ID, LIBRARY


@dataclass(frozen=True)
class Start:
    """Parameter values of one variant, and which of them are strength and phase (-1: no phase).

    Further pairs of strength and phase follow the first for so many `harmonics`. Without a phase, the strength counts
    from what is `known`. What acts `instead` of something that the bench knows takes that away whatever its strength.
    """

    effect: str
    variant: int
    values: tuple[float, ...]
    strength: int = 0
    phase: int = -1
    harmonics: int = 1
    known: float = 0.0  # of the strength, what the bench has of it already
    instead: bool = False


@dataclass(frozen=True, eq=False)
class Scene:
    """What the starting values are scaled by."""

    coulomb: float  # [N m]
    peak_torque: float  # [N m]
    peak_speed: float  # [rad/s]
    viscous_speed: float  # [rad/s] at which viscous friction equals Coulomb friction
    travel_m: float
    duration_s: float
    ratio: float
    orders: list[float]
    ripple_orders: list[float]
    friction_periods: list[float]
    scale_periods: list[float]
    window: tuple[float, float, float]  # start, end, level [N m]
    stretch: float  # table against motor [m], typical
    most_stretch: float  # and the most


def scene(runs: Sequence[Measured], bench: Bench, blocks: Sequence[dict[str, FloatArray]], observer_s: float) -> Scene:
    """Measure what the starting values need.

    `bench` has the nominal parameters as fitted, `blocks` their residuals block by block, one per run.
    """
    physics = bench.axis.physics()
    ratio = bench.axis.ratio_m_rad
    found = [
        estimate.disturbance(run, block["motor"], inertia(bench), observer_s)
        for run, block in zip(runs, blocks, strict=True)
    ]
    stretch, most_stretch = stretches(runs, ratio) if runs[0].table_m.size else (0.0, 0.0)
    longest = max(range(len(runs)), key=lambda i: runs[i].motor.size)
    travel = max(float(np.ptp(run.position_command_m)) for run in runs)
    lead = 2.0 * np.pi * ratio / physics.angle_per_unit
    # What is locked to the screw shows in its angle and along the travel alike: each is a start for the other.
    periods = estimate.friction_periods(runs, found, ratio)
    orders = estimate.orders(runs, found, physics.angle_per_unit)
    turns = [lead / order for order in dict.fromkeys((1.0, 2.0, *orders)) if _SHORTEST_M < lead / order < travel]
    orders = list(
        dict.fromkeys(
            (
                *orders,
                *(
                    float(round(lead / period))
                    for period in periods
                    if abs(lead / period - round(lead / period)) < _WHOLE and period < lead
                ),
            )
        )
    )
    ripple = [
        d.torque / np.where(np.abs(run.torque) > 0.2 * physics.coulomb_n_m, run.torque, np.inf)
        for run, d in zip(runs, found, strict=True)
    ]
    return Scene(
        coulomb=max(physics.coulomb_n_m, 1e-6),
        peak_torque=max(float(np.max(np.abs(run.torque))) for run in runs),
        peak_speed=max(float(np.max(np.abs(d.velocity))) for d in found),
        viscous_speed=max(physics.viscous_speed, 1e-6),
        travel_m=travel,
        duration_s=max(run.motor.size * run.period_s for run in runs),
        ratio=ratio,
        orders=orders,
        ripple_orders=estimate.orders(runs, found, physics.angle_per_unit, 2, ripple),
        friction_periods=[*periods, *turns],
        scale_periods=(
            [
                *estimate.scale_periods(runs, [block["table"] for block in blocks]),
                *([lead] if lead < travel and round(lead, 9) <= _LONGEST_SCALE_M else []),
            ]
            if runs[0].table_m.size
            else []
        ),
        window=estimate.force_window(runs[longest], found[longest]),
        stretch=max(stretch, 0.5e-6),
        most_stretch=max(most_stretch, 1e-6),
    )


def stretches(runs: Sequence[Measured], ratio_m_rad: float) -> tuple[float, float]:
    """Table against motor [m], typical and most, of runs with a linear encoder."""
    found = [run.table_m - ratio_m_rad * run.motor for run in runs]
    typical, most = np.max(
        [np.percentile(np.abs(stretch - np.median(stretch)), (60.0, 99.9)) for stretch in found], axis=0
    )
    return float(typical), float(most)


_SHORTEST_M = 1e-3  # along the travel: below, friction is not looked for
_LONGEST_SCALE_M = BY_ID["scale_interpolation_error"].parameters[1].high
_WHOLE = 0.05  # of a turn, to which a period makes a whole order of the screw

_Values = Sequence[tuple[float, ...]]
_STARTS: dict[str, tuple[Callable[[Scene], _Values], int, int]] = {
    "asymmetric_friction": (lambda s: [(0.05 * s.coulomb,)], 0, -1),
    "constant_load": (lambda s: [(0.05 * s.coulomb,)], 0, -1),
    "stribeck_friction": (lambda s: [(1.3 * s.coulomb, f * s.peak_speed) for f in (0.003, 0.01, 0.04)], -1, -1),
    "presliding_hysteresis": (lambda s: [(s.coulomb * s.ratio / d,) for d in (0.3e-6, 1e-6, 4e-6, 16e-6)], -1, -1),
    "position_dependent_friction": (lambda s: [(0.05, p, 0.0) for p in s.friction_periods], 0, 2),
    "nonlinear_viscous_friction": (lambda s: [(0.05 * s.coulomb / s.peak_speed**2,)], 0, -1),
    "nonlinear_viscous_friction.thinning lubricant": (
        lambda s: [(f * s.coulomb / s.viscous_speed**2,) for f in (0.1, 1.0)],
        -1,
        -1,
    ),
    "friction_drift": (lambda s: [(0.05, f * s.duration_s) for f in (0.2, 1.0, 5.0)], 0, -1),
    "table_side_friction": (lambda s: [(0.2,), (0.6,)], -1, -1),
    "backlash": (lambda s: [(f * s.stretch,) for f in (0.5, 1.0, 2.0, 4.0)], -1, -1),
    "preload_loss": (
        lambda s: [
            (zone, 0.4)
            for zone in (
                0.5 * s.stretch,
                s.stretch,
                2.0 * s.stretch,
                0.5 * s.most_stretch,
                s.most_stretch,
                1.5 * s.most_stretch,
            )
        ],
        -1,
        -1,
    ),
    "position_dependent_stiffness": (lambda s: [(0.1 / s.travel_m,)], 0, -1),
    "periodic_lead_error": (lambda s: [(0.5e-6, 0.0, 0.0, 0.0, 0.0, 0.0)], 0, 1),
    "cumulative_lead_error": (lambda s: [(1e-6 / s.travel_m,)], 0, -1),
    "thermal_growth": (lambda s: [(1e-6 / s.travel_m, f * s.duration_s) for f in (0.2, 1.0, 5.0)], 0, -1),
    "structural_mode": (lambda s: [(f, 0.03, 0.15) for f in np.geomspace(12.0, 240.0, 13)], -1, -1),
    "cogging_torque": (lambda s: [(0.01 * s.coulomb, o, 0.0) for o in s.orders], 0, 2),
    "torque_ripple": (lambda s: [(0.01, o, 0.0) for o in dict.fromkeys((*s.ripple_orders, *s.orders))], 0, 2),
    "torque_constant_saturation": (lambda s: [(0.02 / s.peak_torque**2,)], 0, -1),
    "torque_saturation": (lambda s: [(f * s.peak_torque,) for f in (0.999, 0.95, 0.85, 0.7)], -1, -1),
    "torque_dead_zone": (lambda s: [(f * s.coulomb,) for f in (0.03, 0.15)], -1, -1),
    "current_loop_lag": (lambda s: [(2e-4,), (1e-3,)], -1, -1),
    "transport_delay": (lambda s: [(1.5e-4,), (7e-4,)], -1, -1),
    "velocity_filter_lag": (lambda s: [(2e-4,), (1e-3,)], -1, -1),
    "channel_time_skew": (lambda s: [(2e-4,)], 0, -1),
    "encoder_eccentricity": (lambda s: [(1e-4, 0.0)], 0, 1),
    "scale_interpolation_error": (lambda s: [(1e-7, p, 0.0) for p in s.scale_periods], 0, 2),
    "external_force": (lambda s: [(s.window[2] / s.ratio or 1.0, s.window[0], s.window[1])], 0, -1),
    # at rest where the axis starts, or so far away that it pushes alike all over a short motion
    "spring_load": (
        lambda s: [(0.02 * s.coulomb / s.ratio / s.travel_m, f * s.travel_m) for f in (0.0, -20.0, 20.0)],
        0,
        -1,
    ),
}

# Nothing tells them apart from parameters of the motor side where no linear encoder is.
NEEDS_TABLE = frozenset(
    {
        "backlash",
        "preload_loss",
        "position_dependent_stiffness",
        "periodic_lead_error",
        "cumulative_lead_error",
        "thermal_growth",
        "scale_interpolation_error",
        "structural_mode",
        "table_side_friction",
    }
)


def starts(scene: Scene, bench: Bench) -> list[Start]:
    """All starting points of the library for this scene, every variant."""
    found = []
    for mechanism in LIBRARY:
        if mechanism.id in NEEDS_TABLE and not bench.has_table_encoder:
            continue
        for variant, name in enumerate(mechanism.variants):
            if name == "table_position" and not bench.has_table_encoder:
                continue
            known = _STARTS.get(f"{mechanism.id}.{name}") or _STARTS.get(mechanism.id)
            if known:
                values, strength, phase = known
                points = values(scene)
            else:
                points, strength, phase = [tuple(0.5 * (p.low + p.high) for p in mechanism.parameters)], 0, -1
            for point in points:
                inside = tuple(
                    min(max(value, p.low), p.high)
                    for value, p in zip(point, BY_ID[mechanism.id].parameters, strict=True)
                )
                harmonics = (len(inside) - strength) // 2 if phase == strength + 1 else 1
                found.append(Start(mechanism.id, variant, inside, strength, phase, harmonics))
    return found
