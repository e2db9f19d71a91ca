"""Names compared with their rivals again, beside the terms that were found after them."""

from dataclasses import replace

from diagnosis_runs import bench, dataset, fitted, recorded

from hil.diagnosis.search.exchange import exchanged
from hil.diagnosis.search.rivals import RivalFit
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import take
from hil.identification.terms import Term

OWNER = bench()
LOAD, STRIBECK = Term("constant_load", 0, (0.4,)), Term("stribeck_friction", 0, (0.9, 3.0))
WRONG = Term("friction_gradient", 0, (0.3,))


def test_a_rival_as_good_as_the_named_one_before_is_named_where_it_is_better_beside_the_others() -> None:
    data = dataset([take(recorded(OWNER, LOAD, STRIBECK), OWNER)], OWNER)
    base = fitted(Hypothesis(OWNER), data, evaluations=4)
    explained = fitted(Hypothesis(OWNER, (WRONG, STRIBECK)), data, evaluations=8)
    near = RivalFit((LOAD,), reduced=4.1, evidence=30.0, more=0.1, named=4.0)

    found = exchanged(explained, {WRONG.key: [near]}, base, base)
    assert [term.effect for term in found.fit.terms] == [STRIBECK.effect, LOAD.effect]
    assert found.fit.cost < 0.5 * explained.cost
    (rival,) = found.rivals[LOAD.key]
    assert rival.terms[-1].effect == WRONG.effect
    assert rival.evidence > 0.0
    assert {one.key: one.added for one in found.considered} == {LOAD.key: True, WRONG.key: False}

    far = replace(near, reduced=9.0)
    kept = exchanged(explained, {WRONG.key: [far]}, base, base)
    assert kept.fit is explained
    assert kept.rivals == {WRONG.key: [far]}

    right = fitted(Hypothesis(OWNER, (LOAD, STRIBECK)), data, evaluations=8)
    other = RivalFit((WRONG,), reduced=4.1, evidence=3.0, more=0.1, named=4.0)
    same = exchanged(right, {LOAD.key: [other]}, base, base)
    assert same.fit is right
    (rival,) = same.rivals[LOAD.key]
    assert rival.evidence > other.evidence  # beside the friction law it is refuted
