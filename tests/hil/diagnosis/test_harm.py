"""A term that worsens a channel: it comes after others, and falls if it costs more than a tenth of what it explains."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hil.diagnosis.search.harm import harmed, refuting


def fit(motor: float, table: float) -> Any:
    """What is compared of a fit: mean square over noise of two channels in one run of 1000 rows."""
    run = SimpleNamespace(motor=np.zeros(1000), evaluated=slice(None))
    return SimpleNamespace(noise_ratios=({"motor": motor, "table": table},), data=SimpleNamespace(runs=(run,)))


OWNER = fit(200.0, 1000.0)


@pytest.mark.parametrize(
    ("found", "without", "harms", "refutes"),
    [
        (fit(10.0, 5.0), fit(100.0, 5.0), set(), set()),
        (fit(10.0, 5.0), fit(100.0, 3.0), {"table"}, set()),  # 2 lost, 90 gained
        (fit(90.0, 8.0), fit(100.0, 3.0), {"table"}, {"table"}),  # 5 lost, 10 gained
        (fit(10.0, 1.4), fit(100.0, 1.0), set(), set()),  # within the noise
        (fit(10.0, 1300.0), fit(9000.0, 900.0), {"table"}, {"table"}),  # worse than by the bench file
    ],
)
def test_harm_is_weighed_against_what_a_term_explains(
    found: Any, without: Any, harms: set[str], refutes: set[str]
) -> None:
    assert harmed(found, without, OWNER) == harms
    assert refuting(found, without, OWNER) == refutes
