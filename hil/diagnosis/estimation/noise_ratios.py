"""What a fit leaves of a recording, channel by channel, in units of the noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.diagnosis.estimation.fit import Fit
from hil.diagnosis.estimation.hypothesis import scales
from hil.identification.dataset import Measured


def noise_ratios(found: Fit, run: Measured) -> dict[str, float]:
    """Mean square over noise of each channel, block by block."""
    noise = scales(run, found.model.bench, found.model.observer_s)
    blocks = found.model.blocks(found.x, run)
    ratios = {name: float(np.mean((blocks[name] / noise[name])[run.judged] ** 2)) for name in blocks}
    if ratios.get("table", 0.0) > 1.0:
        ratios["table"] /= max(1.0, 1.0 + _rung(found, run, blocks["table"]) / run.noise.table_m**2)
    return ratios


def _rung(found: Fit, run: Measured, table: FloatArray) -> float:
    """Variance [m^2] that noise of the motor encoder adds to `table` (n,), the block of the table that is fed with the
    motor's measured motion, beyond what it adds to the table less the motor: a resonance of little damping rings."""
    shaken = replace(run, motor=run.motor + run.motor_noise * np.random.default_rng(0).standard_normal(run.motor.size))
    rings = float(np.var((found.model.blocks(found.x, shaken)["table"] - table)[run.judged]))
    return rings - float(np.mean((found.model.bench.axis.ratio_m_rad * run.motor_noise[run.judged]) ** 2))
