"""Second encoder of an axis with springs behind the measured motor, whatever torque moved it.

    m_t x'' = k (r q - x) + c (r q' - x') - F_t(x')        x second encoder, q measured motor: no torque

A torque that is measured with noise would drive the twin's motor, and the lighter the motor the farther: the noise of
the torque would then be in what the second encoder reads of the twin. Here the motor follows its measured motion: it is
so heavy that neither spring nor friction moves it, and gets the torque of a cubic spline through the measured
positions, also between rows that are far apart. A coarse encoder would drive a resonance with its counts: there the
torque tells the motion better (`hil.identification.residual_scales.follows`).
"""

import math
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from hil.arrays import FloatArray
from hil.identification.measured import Measured
from hil.identification.residual_scales import follows
from hil.identification.residuals import differences
from hil.identification.standstill import resting
from hil.twin.axis import Response, Steps, Twin, taken_back
from hil.twin.mechanism import Moment, Stage
from hil.twin.physics import Active
from hil.twin.structure.chain import Chain
from hil.twin.structure.modal import modal

if TYPE_CHECKING:
    from hil.identification.hypothesis import Hypothesis

_TORQUE = (Stage.CURRENT, Stage.TORQUE, Stage.MOTOR_TORQUE)
_MEMORY = 64  # values that a friction may remember, at most
_HEAVIER = 1e3  # motor over the axis: the spring moves it by a thousandth, which the observer takes back
_LONGEST_TICK_S = 2e-3  # of a twin that follows the motor: short against a mode up to 100 Hz
_LONGER = 2  # coarse steps of such ticks, at most: as those of a row of 4 ms
_MOST_DAMPED = 0.99  # ratio of a mode that the twin can integrate


def behind_motor(
    hypothesis: "Hypothesis", run: Measured, observer_s: float, steps: Steps, rests: Measured | None = None
) -> dict[str, FloatArray]:
    """Residual (n,) of a second encoder that is judged behind the measured motor; empty without one.

    The motor rests where it does in `rests`, by default in the run.
    """
    if not follows(run, bool(hypothesis.bench.axis.SPRINGS), observer_s):
        return {}
    twin = hypothesis.twin(observer_s, steps, run)
    measured, rest = hypothesis.undelayed(twin, run), resting(rests or run, twin.slow_velocity)
    chain = _with_heavy_motor(twin.physics.chain)
    active = tuple(one for one in twin.active if not _by_torque(one))
    heavy = replace(twin, physics=replace(twin.physics, chain=chain), active=active)
    predicted = measured._replace(table_position_m=_moved(heavy, _path(run, twin.late), run, rest))
    return {"table": differences(measured, predicted, hypothesis.bench, run.evaluated)["table"]}


class _Path(NamedTuple):
    """Cubic spline through the measured positions of the motor, and the second encoder, at ticks (n,) of a period.

    The acceleration is the mean of a tick; `parts` ticks are a row.
    """

    period_s: float
    parts: int
    motor: FloatArray
    acceleration: FloatArray
    table_m: FloatArray


@lru_cache(maxsize=8)  # most parameters of a fit leave the lateness as it is
def _path(run: Measured, late: tuple[Active, ...]) -> _Path:
    measured = taken_back(run.response, late, run.period_s)
    parts = max(math.ceil(run.period_s / _LONGEST_TICK_S - 1e-6), 1)
    rows, period_s = np.arange(run.motor.size), run.period_s / parts
    ticks = np.arange(run.motor.size * parts + 1) / parts
    spline = CubicSpline(rows, measured.motor_position)
    acceleration = np.diff(spline(ticks, 1)) / run.period_s / period_s
    table = np.interp(ticks[:-1], rows, measured.table_position_m)
    return _Path(period_s, parts, spline(ticks[:-1]), acceleration, table)


def _moved(heavy: Twin, path: _Path, run: Measured, rest: NDArray[np.bool_]) -> FloatArray:
    """Second encoder (n,) of a twin whose heavy motor moves along a path."""
    parts = path.parts
    torque = float(heavy.physics.chain.inertia_kg_m2.sum()) * path.acceleration
    finer = replace(
        heavy,
        gains=heavy.gains._replace(period_s=path.period_s),
        observer_s=heavy.observer_s / parts,
        push_n=np.repeat(heavy.push_n, parts),
        steps=heavy.steps._replace(coarse_s=min(parts, _LONGER) * heavy.steps.coarse_s),
    )
    moved = finer.observe(
        np.repeat(run.position_command_m, parts),
        np.repeat(run.velocity_command_m_s, parts),
        Response(path.motor, path.table_m, torque, torque),
        run.start,
        np.repeat(rest, parts),
        np.repeat(run.feedforward, parts),
    )
    return moved.table_position_m[::parts]


def _by_torque(active: Active) -> bool:
    """True for a mechanism of the motor's torque, or friction that depends on it: it is not that of a heavy motor."""
    if active.form.stage is not Stage.COULOMB:
        return active.form.stage in _TORQUE
    values, memory = np.array(active.values, dtype=np.float64), np.zeros(_MEMORY)
    moments = (Moment(0.0, 0.0, 1e-3, 1e-3, 0.0, 1.0, 0.0, 1.0, 0.0, torque) for torque in (0.0, 1.0))
    without, other = (active.form.contribution(1.0, at, values, memory) for at in moments)
    return bool(without != other)


def second_encoder(hypothesis: "Hypothesis", run: Measured, observer_s: float, steps: Steps) -> dict[str, FloatArray]:
    """Residual (n,) of the second encoder of an axis with springs, by the motion that was measured; else empty."""
    if not (hypothesis.bench.axis.SPRINGS and run.table_m.size):
        return {}
    behind = behind_motor(hypothesis, run, observer_s, steps)
    return behind or {"table": hypothesis.driven(run, observer_s, steps)["table"]}


def _with_heavy_motor(chain: Chain) -> Chain:
    """The chain with a heavy motor, the same springs, and what its dampers make of each mode (of two masses exact)."""
    own = modal(chain)
    damping = own.shape @ np.diag(2.0 * own.damping_ratio * own.frequency_rad_s) @ own.shape.T
    damping = chain.inertia_kg_m2 @ damping @ chain.inertia_kg_m2
    inertia = chain.inertia_kg_m2.copy()
    inertia[chain.motor, chain.motor] += _HEAVIER * float(chain.inertia_kg_m2.sum())
    heavy = modal(replace(chain, inertia_kg_m2=inertia))
    per_mode = np.einsum("im,ij,jm->m", heavy.shape, damping, heavy.shape)
    ratio = np.where(heavy.frequency_rad_s > 0.0, 0.5 * per_mode / np.maximum(heavy.frequency_rad_s, 1e-300), 0.0)
    return replace(chain, inertia_kg_m2=inertia, damping_ratio=np.clip(ratio, 0.0, _MOST_DAMPED))
