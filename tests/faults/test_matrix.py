"""A seeded share of the fault matrix and of the faults of the recorder; `make fault-matrix` does the whole."""

from __future__ import annotations

import pytest
from fault_kinds import KINDS
from matrix import one_run
from recorder_faults import RECORDER_KINDS, RecorderKind, recorder_run
from set_up_faults import SET_UP


@pytest.mark.parametrize("seed", range(1, 2 * (len(KINDS) + len(SET_UP)) + 1))
def test_every_fault_stops_the_axis_or_says_that_it_does_not(seed: int) -> None:
    run = one_run(seed)
    assert not run.wrong, f"{run.fault} in {run.state} ({run.about})"


@pytest.mark.long
@pytest.mark.parametrize("kind", RECORDER_KINDS, ids=lambda kind: kind.name)
def test_the_loop_does_not_notice_a_fault_of_the_recorder(kind: RecorderKind) -> None:
    assert not recorder_run(kind, seed=1).wrong
