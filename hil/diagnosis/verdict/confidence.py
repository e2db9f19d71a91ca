"""Confidence of a finding: the probability that this effect is there, whatever else is missing.

    p = 1 / (1 + exp(-s))
    s = a - b ln(1 + e / (factor - 1)) - c ln+(1 / (factor - 1)) - d ln+(1000 / (1 + margin)) - ln(1 + m / factor)

with ln+ = max(ln, 0). factor is the residual energy without the term over that with it, so that 1 / (factor - 1) is
the energy left over that which the term explains, and e ten times the share of what is left that is above the noise
floor. Below the noise of a row the energy of the torque that is missed counts, if it falls more. m is the torque on
held-out motion that the twin misses beyond noise, in shares of 3 %: where an axis is only half described, a name of
little gain is not sure. Confidence falls with a small energy gain, more so beside a residual that has structure, and
with a close rival. The constants are `Criteria.offset` to `plenty`.
"""

import math

from hil.diagnosis.criteria import CRITERIA, Criteria


def confidence(left: float, factor: float, margin: float, missed: float = 0.0, c: Criteria = CRITERIA) -> float:
    """Probability that the effect of a finding is there, in [0, 1].

    `left`: largest remaining rms of all channels and recordings in units of noise. `factor`: residual energy without
    the term over that with it. `margin`: evidence against the best rival that is not equivalent (BIC difference).
    `missed`: share of the torque (rms) on held-out motion that the twin misses beyond noise.
    """
    if not math.isfinite(left) or not math.isfinite(missed):
        return 0.0
    gain = max(factor - 1.0, c.least_gain)
    little = max(math.log(1.0 / gain), 0.0)  # without a clearly needed term the energy doubles
    close = max(math.log(c.plenty / (1.0 + min(max(margin, 0.0), c.plenty))), 0.0)
    unexplained = max(left**2 - c.floor, 0.0) / max(left**2, c.floor) / gain
    described = math.log(1.0 + missed / (c.missed * (1.0 + gain)))
    score = c.offset - c.left_weight * math.log(1.0 + c.structure * unexplained)
    score -= c.gain_weight * little + c.rival_weight * close + described
    return 1.0 / (1.0 + math.exp(-score))
