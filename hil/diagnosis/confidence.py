"""How sure a name is, from what speaks for it: one monotone function, to be calibrated on recordings of known cause.

    p = 1 / (1 + exp(-s)),   s = a + b ln(1 + margin) + c explained + d held_out
"""

from __future__ import annotations

import math

OFFSET, MARGIN, EXPLAINED, HELD_OUT = -3.2, 0.45, 2.0, 1.8
_UNTESTED = 0.4      # a name without held-out recordings counts as one that half works there
_MOST = 1e6          # evidence beyond makes nobody surer


def confidence(margin: float, explained: float, held_out: float | None) -> float:
    """Probability that a name is right, in [0, 1]; grows with each argument.

    `margin`: evidence against the best rival that is not equivalent (BIC difference); `explained` and `held_out`:
    share of the energy above the noise floor that is explained on training and on held-out recordings, the latter None
    without any.
    """
    held = _UNTESTED if held_out is None else min(max(held_out, 0.0), 1.0)
    score = (OFFSET + MARGIN * math.log1p(min(max(margin, 0.0), _MOST)) + EXPLAINED * min(max(explained, 0.0), 1.0)
             + HELD_OUT * held)
    return 1.0 / (1.0 + math.exp(-score))
