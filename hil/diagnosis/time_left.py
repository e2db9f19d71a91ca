"""Processor time that a diagnosis may take, and an estimate of the time that it still takes."""

import time
from collections.abc import Callable

from hil.quantities import digits

BUDGET_S = 110.0  # of processor time: one of 120 sealed answers with names that explain the mismatch took longer
_ROWS = 40_000  # as many as the longest of them had; a simulation takes as long as the recordings, up to
_LONGEST = 4.0  # as many budgets

# First words of a step -> share of the time that has usually passed when it begins: medians over single effects on
# two-mass and seven-mass axes. A second effect takes longer.
PASSED = {
    "screening the library beside 0": 0.06,
    "fitting mechanisms that springs may hide": 0.65,
    "fitting the explanation": 0.9,
    "fitting": 0.2,
    "screening": 0.5,
    "searching": 0.6,
    "testing on held-out": 0.95,
}


def usual_budget_s(rows: int) -> float:
    """Processor time [s] for recordings of so many rows, unless one is given."""
    return BUDGET_S * min(max(rows / _ROWS, 1.0), _LONGEST)


def with_time_left(progress: Callable[[str], None], begin_s: float, budget_s: float) -> Callable[[str], None]:
    """Return a receiver of steps that adds the estimated time left to each text and passes it on to `progress`.

    Only a step whose share is known has an estimate, and none after the budget, which limits the search: the steps
    after it may take longer. `begin_s` is the begin of the diagnosis on the monotonic
    clock.
    """

    def tell(step: str) -> None:
        share = next((passed for words, passed in PASSED.items() if step.startswith(words)), None)
        elapsed_s = time.monotonic() - begin_s
        if share is None or elapsed_s >= budget_s:
            progress(step)
            return
        left_s = min(elapsed_s * (1.0 / share - 1.0), budget_s - elapsed_s)
        text = f"{step} (about {digits(max(left_s, 1.0), 1)} s left)"
        progress(text)

    return tell
