"""Parts of a recording for training and validation, where it is cut in motion."""

import numpy as np
import pytest

from hil.bench.bench_file import load_bench
from hil.bench.control_section import UnknownControl
from hil.diagnosis.preparation.split import split
from hil.identification.measured import LEAD_IN, take
from hil.recording.recording import Recording

ROWS, PERIOD_S = 6000, 1e-3
BENCH = load_bench("emps_symmetric").model_copy(
    update={"control": UnknownControl(law="unknown", velocity_period_s=PERIOD_S)}
)


def swinging(rest: bool) -> Recording:
    """A sine of 1 Hz without a row at rest, or with a rest of half a second at two thirds."""
    time_s = np.arange(ROWS) * PERIOD_S
    position = 0.1 * np.sin(2.0 * np.pi * time_s + 0.01)
    if rest:
        position[4000:4500] = 0.0
    columns = {
        "motor_position_m": position,
        "force_n": np.cos(3.0 * time_s),
        "position_command_m": position,
        "velocity_command_m_s": np.gradient(position, PERIOD_S),
    }
    return Recording("swing", columns, PERIOD_S)


def test_a_part_that_begins_in_motion_has_rows_before_it_that_are_not_evaluated() -> None:
    (train,), (held_out,) = split([swinging(rest=False)])
    assert LEAD_IN not in train.metadata
    lead = held_out.metadata[LEAD_IN]
    assert lead == len(held_out) / 2 == ROWS - len(train)
    assert held_out.start_s + lead * PERIOD_S == pytest.approx(len(train) * PERIOD_S)
    assert take(held_out, BENCH).evaluated.start == lead
    assert take(train, BENCH).evaluated.start < lead


def test_a_part_that_begins_at_rest_has_none() -> None:
    _, (held_out,) = split([swinging(rest=True)])
    assert LEAD_IN not in held_out.metadata
