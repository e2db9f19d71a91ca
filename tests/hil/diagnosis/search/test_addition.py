"""A term that worsens a channel: it comes after others, and falls if it costs more than a tenth of what it explains."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnosis_runs import bench

from hil.channels import AxisKind
from hil.diagnosis.acceptance import paying
from hil.diagnosis.search.addition import harm


def fit(motor: float, table: float) -> Any:
    """What is compared of a fit: mean square over noise of two channels in one run of 1000 rows."""
    run = SimpleNamespace(motor=np.zeros(1000), evaluated=slice(None), kind=AxisKind.ROTARY)
    ratios = ({"motor": motor, "table": table},)
    return SimpleNamespace(noise_ratios=ratios, data=SimpleNamespace(runs=(run,)), bench=bench())


GIVEN = fit(200.0, 1000.0)


@pytest.mark.parametrize(
    ("with_term", "without", "refutes"),
    [
        (fit(10.0, 5.0), fit(100.0, 5.0), set()),
        (fit(10.0, 5.0), fit(100.0, 3.0), set()),  # 2 lost, 90 gained
        (fit(90.0, 8.0), fit(100.0, 3.0), {"table_position_m"}),  # 5 lost, 10 gained
        (fit(10.0, 1.4), fit(100.0, 1.0), set()),  # within the noise
        (fit(10.0, 1300.0), fit(9000.0, 900.0), {"table_position_m"}),  # worse than by the bench file
    ],
)
def test_harm_is_weighed_against_what_a_term_explains(with_term: Any, without: Any, refutes: set[str]) -> None:
    assert paying(harm(with_term, without, GIVEN)) == refutes
