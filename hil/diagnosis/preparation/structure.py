"""Other structures of an axis for the same recordings: as one inertia, without the springs of its bench.

Motor and table with a spring between them have a resonance. Where the recordings do not tell how the mass is split,
nothing holds that resonance where it is, and the twin may miss the torque that one inertia predicts.
"""

from dataclasses import replace
from math import pi

from hil.bench.axis_models import Rigid
from hil.bench.bench_file import Bench
from hil.bench.turning_axes import Rotary
from hil.diagnosis.stages import Prepared
from hil.identification.dataset import prepare_dataset
from hil.identification.residual_scales import inertia


def as_one_inertia(prepared: Prepared) -> Prepared | None:
    """The recordings beside a twin of one inertia, the sum of all; None if it is one already."""
    bench = prepared.bench
    if not bench.axis.SPRINGS:
        return None
    one = rigid(bench)
    data = prepare_dataset(prepared.train.runs, one)
    return replace(prepared, bench=one, train=data, held_out=data.over(prepared.held_out.runs))


def rigid(bench: Bench) -> Bench:
    """The bench of an axis with all its mass as one."""
    axis, total = bench.axis, inertia(bench)
    friction = {name: getattr(axis, name) for name in axis.FRICTION}
    one = (
        Rotary(gear_ratio=1.0 / axis.ratio_m_rad, inertia_kg_m2=total, **friction)
        if axis.turns
        else Rigid(lead_m=2.0 * pi * axis.ratio_m_rad, mass_kg=total / axis.ratio_m_rad**2, **friction)
    )
    return bench.model_copy(update={"axis": one})
