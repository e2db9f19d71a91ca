"""Terms of a hypothesis: which are the same cause, and which do not go together."""

from __future__ import annotations

from diagnosis_runs import bench

from hil.diagnosis.sentence import sentence
from hil.diagnosis.wording import label
from hil.identification.terms import Term, compatible, repeats

SIX, FIFTEEN = Term("cogging_torque", 0, (0.2, 6.0, 0.5)), Term("cogging_torque", 0, (0.15, 15.0, -1.0), slot=1)


def test_the_same_period_is_the_same_cause() -> None:
    assert repeats(SIX, Term("cogging_torque", 0, (0.5, 6.3, 0.0)))
    assert not repeats(SIX, FIFTEEN)
    assert not repeats(SIX, Term("torque_ripple", 0, (0.02, 6.0, 0.0)))
    assert compatible([SIX, FIFTEEN])
    more = [
        Term("cogging_torque", 0, (0.1, order, 0.0), slot=2 + index) for index, order in enumerate((30.0, 45.0, 60.0))
    ]
    assert compatible([SIX, FIFTEEN, *more[:2]])
    assert not compatible([SIX, FIFTEEN, *more])


def test_the_same_torque_is_not_named_twice() -> None:
    load, friction = Term("constant_load", 0, (0.1,)), Term("asymmetric_friction", 0, (0.05,))
    assert not compatible([load, friction])
    assert compatible([load, Term("asymmetric_friction", 1, (0.05,)), SIX])  # with speed it is another torque


UPPER, LOWER = 0, 1


def test_there_is_one_stop_at_each_end() -> None:
    upper, lower = Term("end_stop", UPPER, (1e5, 0.3)), Term("end_stop", LOWER, (1e5, 0.1), 1)
    assert compatible([upper, lower])
    assert not compatible([upper, Term("end_stop", UPPER, (2e5, 0.35), 1)])
    assert [label(stop, bench()) for stop in (upper, lower)] == ["end stop, upper end", "end stop, lower end"]
    assert sentence(lower, bench()).count("lower end") == 1
