"""Terms that lose their name when another term is fitted beside them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from diagnosis_runs import bench, fitted, recorded

from hil.diagnosis.search import forward_selection
from hil.diagnosis.search.initial_values import claimable
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()


def test_a_spring_that_a_later_fit_moves_out_of_reach_becomes_a_load() -> None:
    lag = Term("current_loop_lag", 0, (1e-3,))
    runs = [take(recorded(OWNER, Term("constant_load", 0, (0.8,)), lag), OWNER)]
    ratio_m_rad = OWNER.axis.ratio_m_rad
    spring = Term("spring_load", 0, (0.8 / ratio_m_rad / 8.0, -8.0))
    assert claimable(spring, OWNER, runs)
    found = fitted(Hypothesis(OWNER, (spring, lag)), runs)
    (out_of_reach, _) = found.terms
    assert not claimable(out_of_reach, OWNER, runs)
    load, other = forward_selection.claimed(found).terms
    assert (load.effect, other.effect) == ("constant_load", "current_loop_lag")
    assert load.values == pytest.approx((0.8,), rel=0.02)


@pytest.mark.parametrize(
    ("ratios", "left"),
    [({"motor": 0.6, "table": 100.0}, {"table": 10.0}), ({"motor": 16.0, "table": 100.0}, {}), ({"motor": 0.6}, {})],
)
def test_a_channel_is_set_aside_where_another_is_explained(ratios: dict[str, float], left: dict[str, float]) -> None:
    known = SimpleNamespace(exact_input=False, hidden=frozenset({"command"}))
    fit: Any = SimpleNamespace(noise_ratios=(ratios | {"command": 0.0},), data=SimpleNamespace(observability=known))
    assert forward_selection.unexplained_channels(fit) == pytest.approx(left)
