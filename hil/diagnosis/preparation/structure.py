"""Simpler twins for the same recordings: without the springs of the bench, its control law, or an open delay.

Motor and table with a spring between them have a resonance. Where the recordings do not tell how the mass is split,
nothing holds that resonance where it is, and the twin may miss the torque that one inertia predicts. A law that is
nearly right says at which instants a torque acts; where it runs faster than the rows, they tell that better. A delay
of the torque is left open for what a logger does within a row; one that ends at its bound is to be named.
"""

from dataclasses import replace
from math import pi

from hil.bench.axis_models import Rigid
from hil.bench.bench_file import Bench
from hil.bench.turning_axes import Rotary
from hil.diagnosis.preparation.usable_law import set_aside
from hil.diagnosis.stages import Prepared, Searched
from hil.identification.coordinates import DELAY
from hil.identification.dataset import prepare_dataset
from hil.identification.measured import Measured, later
from hil.identification.residual_scales import inertia

_ONE = (
    "The recordings do not tell the springs and the split of the masses of the bench: with them the twin predicts the "
    "torque of held-out motion worse than as one inertia. The axis was judged as one inertia."
)


def as_one_inertia(prepared: Prepared) -> Prepared | None:
    """The recordings beside a twin of one inertia, the sum of all; None if it is one, or all of it is held."""
    bench = prepared.bench
    one = rigid(bench) if bench.axis.SPRINGS else bench
    if one is bench or not one.axis.refitted:
        return None
    data = prepare_dataset(prepared.train.runs, one)
    notes = (*prepared.notes, _ONE)
    return replace(prepared, bench=one, train=data, held_out=data.over(prepared.held_out.runs), notes=notes)


def as_plant_alone(prepared: Prepared) -> Prepared | None:
    """The recordings beside the twin without its control law, whose rows may be samples; None without a law."""
    if not prepared.bench.law_known or not prepared.train.observability.torque_measured:
        return None
    law = set_aside(prepared.bench, "with it the twin predicts the torque of held-out motion worse than without")
    runs = [
        replace(run, observability=replace(run.observability, closed_loop=False))
        for run in (*prepared.train.runs, *prepared.held_out.runs)
    ]
    bench = law.bench.sampled(runs[0].period_s)
    data = prepare_dataset(runs[: len(prepared.train.runs)], bench)
    held_out = data.over(runs[len(prepared.train.runs) :])
    notes = (*prepared.notes, *law.notes)
    return replace(prepared, bench=bench, train=data, held_out=held_out, law=law, notes=notes)


def without_open_delay(searched: Searched) -> Prepared | None:
    """The recordings beside a twin without a delay of the torque, where the search left it at the bound; else None.

    A delay given in the bench file stays. The rows of a logger are samples: they act half a row to either side of their
    instants.
    """
    prepared = searched.prepared
    if DELAY not in searched.final.at_bound or prepared.law.bench.torque_delay_s is not None:
        return None
    control = prepared.bench.control.model_copy(update={DELAY: None})
    bench = prepared.bench.model_copy(update={"control": control})
    data = prepare_dataset([_sampled(run) for run in prepared.train.runs], bench)
    held_out = data.over([_sampled(run) for run in prepared.held_out.runs])
    return replace(prepared, bench=bench, train=data, held_out=held_out)


def _sampled(run: Measured) -> Measured:
    return replace(run, torque=later(run.torque, -0.5), torque_command=later(run.torque_command, -0.5))


def rigid(bench: Bench) -> Bench:
    """The bench of an axis with all its mass as one."""
    axis, total = bench.axis, inertia(bench)
    friction = {name: getattr(axis, name) for name in axis.FRICTION}
    one: Rotary | Rigid = (
        Rotary(gear_ratio=1.0 / axis.ratio_m_rad, inertia_kg_m2=total, **friction)
        if axis.turns
        else Rigid(lead_m=2.0 * pi * axis.ratio_m_rad, mass_kg=total / axis.ratio_m_rad**2, **friction)
    )
    weighed = one.MASSES if set(axis.MASSES) <= set(axis.held) else ()
    held = (*weighed, *(name for name in axis.held if name in axis.FRICTION))
    return bench.model_copy(update={"axis": one.model_copy(update={"held": held})})
