"""Measured less simulated: each encoder's datum, and simulations that run away."""

import numpy as np
import pytest

from hil.bench.bench_file import load_bench
from hil.identification.residuals import differences
from hil.twin.axis import Response

BENCH = load_bench("reference")
ALL = slice(None)
RNG = np.random.default_rng(7)
MEASURED = Response(*RNG.standard_normal((4, 50)))


def test_a_datum_of_the_linear_encoder_counts_for_nothing() -> None:
    shifted = MEASURED._replace(table_position_m=MEASURED.table_position_m + 0.05)
    found = differences(shifted, MEASURED, BENCH, ALL)
    np.testing.assert_allclose(found["table"], 0.0, atol=1e-12)
    assert set(found) == {"motor", "table", "torque"}


def test_what_was_not_judged_does_not_move_the_datum() -> None:
    jump = MEASURED.table_position_m + np.where(np.arange(50) < 10, 1.0, 0.0)
    found = differences(MEASURED._replace(table_position_m=jump), MEASURED, BENCH, slice(10, None))
    np.testing.assert_allclose(found["table"], np.where(np.arange(50) < 10, 1.0, 0.0), atol=1e-12)


@pytest.mark.parametrize("away", [np.inf, -np.inf, np.nan])
def test_a_twin_that_runs_away_gives_no_finite_difference_and_no_warning(away: float) -> None:
    lost = Response(*(np.where(np.arange(50) < 25, values, away) for values in MEASURED))
    found = differences(MEASURED, lost, BENCH, ALL)
    assert not np.isfinite(found["torque"][25:]).any()
    assert not np.isfinite(found["table"][25:]).any()
    assert np.isfinite(found["torque"][:25]).all()
