"""Which cases a proof consists of."""

from __future__ import annotations

from collections import Counter

import pytest

from hil.errors import InputError
from hil.validation.proof.draw.generator import TIERS
from hil.validation.proof.draw.plan import FULL, counts, plan


def test_the_full_proof_has_the_cases_that_were_promised() -> None:
    assert set(FULL) == set(TIERS)
    assert counts(sum(FULL.values())) == FULL
    assert (FULL["single"], FULL["pair"], FULL["masked"], FULL["novel"]) == (300, 200, 100, 60)
    assert FULL["null"] + FULL["parameters_only"] == 300


@pytest.mark.parametrize("cases", [1, 6, 9, 40, 333])
def test_a_plan_mixes_the_tiers_in_their_shares(cases: int) -> None:
    planned = plan(cases, 3)
    assert planned == plan(cases, 3)
    assert planned != plan(cases, 4)
    assert [case.name for case in planned] == [f"case_{place:04d}" for place in range(cases)]
    found = Counter(case.tier for case in planned)
    assert all(abs(found[tier] - cases * FULL[tier] / sum(FULL.values())) < 1.0 for tier in TIERS)
    for tier in found:
        numbers = sorted(case.number for case in planned if case.tier == tier)
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    if cases >= 40:
        tiers = [case.tier for case in planned]
        assert tiers != sorted(tiers, key=TIERS.index)


@pytest.mark.parametrize("cases", [0, -3, 10_001])
def test_a_plan_of_no_cases_is_refused(cases: int) -> None:
    with pytest.raises(InputError, match=rf"--cases: given {cases}, allowed 1 to 10000"):
        plan(cases, 1)


def test_a_plan_of_some_tiers_has_no_others() -> None:
    planned = plan(30, 3, only=("single", "null"))
    assert Counter(case.tier for case in planned) == {"single": 20, "null": 10}
    with pytest.raises(InputError, match="--only: given novell, allowed single, pair"):
        plan(30, 3, only=("novell",))
