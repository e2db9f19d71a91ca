"""Starting values of each mechanism for the recordings at hand, and the check of fitted values.

A start is a point of a mechanism's parameters at small but visible strength; its data stand on the mechanism. The score
test scales the strength and turns the phase.

While an axis moves in one direction at one feed, cogging, a torque constant that varies over a turn, and friction that
varies along the screw have the same effect. After a search found one of these screw-locked mechanisms, the others are
started at strengths with the same torque at creep, where all torque is Coulomb friction.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.search import disturbance as estimate
from hil.diagnosis.search.facts import axis_facts
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.identification.terms import Term, Window, free_slot
from hil.twin.library import BY_ID, LIBRARY
from hil.twin.mechanism import Block, Mechanism, Variant
from hil.twin.parameter import Dimension, Role
from hil.twin.scene import Scene


def scene(
    runs: Sequence[Measured],
    bench: Bench,
    blocks: Sequence[dict[str, FloatArray]],
    observer_s: float,
    lacking: Sequence[FloatArray] = (),
) -> Scene:
    """Estimate the quantities that starting values are computed from.

    `bench` has the nominal parameters as fitted, `blocks` their residuals block by block, one per run. `lacking` is the
    torque (n,) of each run that its twin lacks, where that is told better than by the motor's residual.
    """
    physics = bench.axis.physics()
    ratio = bench.axis.ratio_m_rad
    disturbances = [
        estimate.disturbance(run, block["motor"], inertia(bench), observer_s)
        for run, block in zip(runs, blocks, strict=True)
    ]
    if lacking:
        disturbances = [replace(one, torque=torque) for one, torque in zip(disturbances, lacking, strict=True)]
    stretch, most_stretch = stretches(runs, ratio) if runs[0].table_m.size else (0.0, 0.0)
    longest = max(range(len(runs)), key=lambda i: runs[i].motor.size)
    begin_s, events = runs[longest].start.time_s, estimate.force_windows(runs[longest], disturbances[longest])
    travel = max(float(np.ptp(run.position_command_m)) for run in runs)
    facts = axis_facts(bench, runs)
    lead = 2.0 * np.pi * ratio / physics.angle_per_unit
    friction, torques = max(physics.coulomb_n_m, 1e-6), [run.torque for run in runs]
    # a screw-locked effect is periodic in the angle and along the travel: orders and periods start each other
    periods = estimate.friction_periods(runs, disturbances, ratio)
    if physics.turn_known:
        orders = estimate.orders(runs, disturbances, physics.angle_per_unit)
        orders += estimate.other_orders(runs, disturbances, physics.angle_per_unit)
        ripple_orders = estimate.orders(runs, disturbances, physics.angle_per_unit, 2, torques)
    else:
        orders = estimate.waves(runs, disturbances, ratio)
        ripple_orders = estimate.waves(runs, disturbances, ratio, 2, torques)
    turns = [lead / order for order in dict.fromkeys((1.0, 2.0, *orders)) if _SHORTEST_M < lead / order < travel]
    per_lead = [lead / period for period in periods if period < lead]
    whole = [float(round(order)) for order in per_lead if abs(order - round(order)) < _WHOLE and physics.turn_known]
    orders = list(dict.fromkeys((*orders, *whole)))
    return Scene(
        coulomb=friction,
        peak_torque=max(float(np.max(np.abs(run.torque))) for run in runs),
        peak_speed=max(float(np.max(np.abs(d.velocity))) for d in disturbances),
        viscous_speed=max(physics.viscous_speed, 1e-6),
        travel_m=travel,
        positions_m=facts.positions_m,
        duration_s=max(run.motor.size * run.period_s for run in runs),
        period_s=runs[0].period_s,
        ratio=ratio,
        lead_m=lead,
        orders=orders,
        ripple_orders=ripple_orders,
        friction_periods=[*periods, *turns],
        friction_zones=estimate.zones(
            runs, disturbances, ratio, [-friction * np.sign(d.velocity) for d in disturbances]
        ),
        torque_zones=estimate.zones(runs, disturbances, ratio, torques),
        scale_periods=(
            estimate.scale_periods(runs, [block["table"] for block in blocks]) if runs[0].table_m.size else []
        ),
        lines_hz=estimate.lines_hz(runs[longest], disturbances[longest]),
        windows=[(begin_s + first_s, begin_s + last_s, level) for first_s, last_s, level in events],
        rest_m=estimate.rest_position(runs, disturbances, ratio),
        stretch=max(min(stretch, facts.lost_m), 0.5e-6),
        most_stretch=max(min(most_stretch, facts.lost_m), 1e-6),
    )


def stretches(runs: Sequence[Measured], ratio_m_rad: float) -> tuple[float, float]:
    """Table less motor position [m], typical and largest, of runs with a linear encoder."""
    apart = [run.table_m - ratio_m_rad * run.motor for run in runs]
    typical, most = np.max(
        [np.percentile(np.abs(stretch - np.median(stretch)), (60.0, 99.9)) for stretch in apart], axis=0
    )
    return float(typical), float(most)


_SHORTEST_M = 1e-3  # shortest period of friction along the travel: shorter ones are orders of the screw
_WHOLE = 0.05  # largest deviation of lead / period from a whole order of the screw


def starts(scene: Scene, bench: Bench, runs: Sequence[Measured] = ()) -> list[Term]:
    """Starting points of all variants of the library for a scene; an event is in the longest of the runs, or in all."""
    longest = max(runs, key=lambda run: run.motor.size, default=None)
    somewhere = [tuple(Window(run.name) for run in chosen) for chosen in ([longest] if longest else [], runs)]
    return [
        Term(mechanism.id, number, point, windows=windows)
        for mechanism in LIBRARY
        if bench.axis.turns or not mechanism.turning
        for number, variant in enumerate(mechanism.variants)
        if observable(mechanism, variant, bench)
        for point in mechanism.start_points(number, scene)
        for windows in (dict.fromkeys(somewhere) if mechanism.transient else [()])
    ]


# The angle is unknown, since the zero of the table is not that of the motor: eight phases are within 23 deg of any.
_PHASES = np.arange(8) * np.pi / 4.0


def likenesses(terms: Sequence[Term], bench: Bench) -> list[list[Term]]:
    """Terms with the effect of the last term, at eight phases, for each other screw-locked mechanism.

    `bench` has the nominal parameters as fitted.
    """
    *rest, last = terms
    physics = bench.axis.physics()
    lead_m = 2.0 * np.pi * bench.axis.ratio_m_rad / physics.angle_per_unit
    if not BY_ID[last.effect].search.screw_locked or physics.coulomb_n_m <= 0.0:
        return []
    size, place = _size_and_place(BY_ID[last.effect])
    share = last.values[size] / _unit(BY_ID[last.effect], physics.coulomb_n_m)
    order = _other(BY_ID[last.effect], last.values[place], lead_m)
    alike = []
    for mechanism in sorted(LIBRARY, key=lambda one: one.parameters[0].dimension is not Dimension.TORQUE):
        if not mechanism.search.screw_locked or mechanism.id == last.effect:
            continue
        size, place = _size_and_place(mechanism)
        repeats, bounds = _other(mechanism, order, lead_m), mechanism.parameters[place]
        if not bounds.low <= repeats <= bounds.high:
            continue
        values = dict.fromkeys(range(len(mechanism.parameters)), 0.0)
        values[size] = min(share * _unit(mechanism, physics.coulomb_n_m), mechanism.parameters[size].high)
        values[place] = repeats
        (turned,) = mechanism.indices(Role.PHASE)
        slot = free_slot(mechanism.id, rest)
        alike.append([Term(mechanism.id, 0, tuple((values | {turned: phase}).values()), slot) for phase in _PHASES])
    return alike


def _size_and_place(mechanism: Mechanism) -> tuple[int, int]:
    """Indices of the strength, and of the order or period."""
    return mechanism.strength, (mechanism.indices(Role.ORDER) or mechanism.indices(Role.PERIOD))[0]


def _unit(mechanism: Mechanism, coulomb: float) -> float:
    """Strength with the torque of Coulomb friction."""
    return coulomb if mechanism.parameters[mechanism.strength].dimension is Dimension.TORQUE else 1.0


def _other(mechanism: Mechanism, value: float, lead_m: float) -> float:
    """Convert an order to the mechanism's order or period, and the reverse."""
    return value if mechanism.indices(Role.ORDER) else lead_m / value


_BLOCK_OF = {"command": Block.CONTROLLER, "torque": Block.DRIVE, "motor": Block.MOTOR_SIDE}


def observable(mechanism: Mechanism, variant: Variant, bench: Bench) -> bool:
    """True if the encoders of a bench can show a variant of a mechanism.

    False for a lateness of the torque where the bench leaves `torque_delay_s` open.
    """
    if variant.moves_torque and bench.torque_delay_s is not None:
        return False
    if not bench.has_table_encoder:
        return felt_by_motor(mechanism, variant, bench)
    return variant.observable is None or variant.observable(True)


def other_variants(term: Term, bench: Bench) -> list[Term]:
    """The term in each other variant that a bench can show, at values that give nearly the same effect."""
    mechanism = BY_ID[term.effect]
    return [
        replace(term, variant=number, values=tuple(mechanism.search.as_variant(term.values, term.variant, number)))
        for number, variant in enumerate(mechanism.variants)
        if number != term.variant and observable(mechanism, variant, bench)
    ]


def felt_by_motor(mechanism: Mechanism, variant: Variant, bench: Bench) -> bool:
    """True if the motor's encoder alone can show a variant of a mechanism: it acts on the motor, or on its reading."""
    if variant.observable is not None:
        return variant.observable(False)
    felt = bool(bench.axis.SPRINGS) or not mechanism.in_transmission  # as a reaction of the table
    return felt and not mechanism.search.needs_table


def reads_wrong(term: Term, bench: Bench) -> bool:
    """True for an error of the second encoder's reading: nothing else of the axis changes with it."""
    mechanism = BY_ID[term.effect]
    return mechanism.block is Block.SENSOR and not felt_by_motor(mechanism, mechanism.variants[term.variant], bench)


def block_observed(effect: str, runs: Sequence[Measured]) -> bool:
    """True if input and output of the block of a mechanism are known in the recordings."""
    return not any(BY_ID[effect].block is _BLOCK_OF[channel] for run in runs for channel in run.observability.hidden)


def claimable(term: Term, bench: Bench, runs: Sequence[Measured] = ()) -> bool:
    """True if a term can be there, and the name of its mechanism applies at its values."""
    named = BY_ID[term.effect].is_claimable
    return block_observed(term.effect, runs) and named(term.values, term.variant, axis_facts(bench, runs))


def is_rare(term: Term, bench: Bench, runs: Sequence[Measured] = ()) -> bool:
    """True for a cause that is rarer at its values than a like one."""
    return BY_ID[term.effect].is_rare(term.values, axis_facts(bench, runs))


def possible(term: Term, bench: Bench, runs: Sequence[Measured] = ()) -> bool:
    """True if a term can be there, though the name of its law may be another mechanism's."""
    can_be = BY_ID[term.effect].is_possible
    return block_observed(term.effect, runs) and can_be(term.values, term.variant, axis_facts(bench, runs))
