"""Isolate an unnamed fault to table or linear encoder from the motor's reaction torque.

A deviation e of the table, reduced to the motor, causes the torque on the motor

    k e        if a force acts on the table
    -J e''     if the transmission has an error, which moves the table against its inertia
    0          if the linear encoder has an error

with the stiffness k between motor and table and the inertia J of the table. The torque on the motor is the disturbance
torque d of `hil.diagnosis.search.disturbance`; the share of a reaction x in it is <d, x> / <x, x>.
"""

import numpy as np
from scipy.signal import lfilter

from hil.arrays import FloatArray
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.search.disturbance import disturbance, smooth
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.residual_scales import inertia
from hil.twin.mechanism import Block
from hil.twin.structure.chain import Chain

TABLE = (Block.TABLE.value, "table, its guides and external forces")
ENCODER = (Block.SENSOR.value, "linear encoder")

# The linear encoder is at fault if the expected reaction torque stands out of the usual one for longer than this and is
# missing: some ten windows of the moving mean. Fewer rows may be a single impact.
_FEW_S = 0.05
_DEVIATION = 1.4826  # standard deviation of Gaussian noise over the median of its size


def acting(fit: Fit) -> tuple[str, str] | None:
    """Block and element if the reaction torque isolates the table or the linear encoder, else None."""
    fitted, runs = fit.bench, fit.data.runs
    chain = fitted.axis.physics().chain
    if len(chain.names) < 2 or not all(run.table_m.size and run.observability.torque_measured for run in runs):
        return None
    stiffness, table_inertia = stiffness_between(chain), float(chain.inertia_kg_m2[chain.table, chain.table])
    observer_s, felt, off, moved = fit.data.observer_s, list[FloatArray](), list[FloatArray](), list[FloatArray]()
    for run, blocks in zip(runs, fit.residuals.channels, strict=True):
        seen = disturbance(run, blocks["motor"], inertia(fitted), observer_s)
        table = smooth(_observed(blocks["table"] / fitted.axis.ratio_m_rad, run, observer_s), run.period_s)
        table = smooth(table, run.period_s)  # like the torque, which is smoothed twice too
        speed = np.gradient(table, run.period_s)
        rows = np.flatnonzero(seen.sliding[run.evaluated]) + (run.evaluated.start or 0)
        felt.append(smooth(seen.torque, run.period_s)[rows])
        off.append(stiffness * (table[rows] - np.mean(table[rows])) if rows.size else table[rows])
        moved.append(-table_inertia * np.gradient(speed, run.period_s)[rows])
    torque, force, reaction = (np.concatenate(parts) for parts in (felt, off, moved))
    if torque.size == 0:
        return None
    size = float(np.linalg.norm(torque - torque.mean()) * np.linalg.norm(force))
    if _share(torque - torque.mean(), force) > CRITERIA.felt and torque @ force > CRITERIA.correlated * size:
        return TABLE
    clear = np.abs(reaction) > CRITERIA.stands_out * _DEVIATION * np.median(np.abs(torque))
    if (
        np.count_nonzero(clear) * runs[0].period_s > _FEW_S
        and _share(torque[clear], reaction[clear]) < CRITERIA.missing
    ):
        return ENCODER
    return None


def stiffness_between(chain: Chain) -> float:
    """Stiffness [motor units] of the table against the motor at standstill."""
    free = [place for place in range(len(chain.names)) if place != chain.motor]
    at_table = np.eye(len(free))[free.index(chain.table)]
    return 1.0 / float(at_table @ np.linalg.solve(chain.stiffness_n_m_rad[np.ix_(free, free)], at_table))


def _observed(values: FloatArray, run: Measured, observer_s: float) -> FloatArray:
    """Filter values (n,) like the observer filters a torque: two lags of its time constant."""
    kept = float(np.exp(-run.period_s / observer_s))
    for _ in range(2):
        values = lfilter([1.0 - kept], [1.0, -kept], values)
    return np.asarray(values, dtype=np.float64)


def _share(torque: FloatArray, reaction: FloatArray) -> float:
    return float(torque @ reaction) / max(float(reaction @ reaction), 1e-300)
