"""Plan the cases of a proof: how many of each tier, in mixed order."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from hil.errors import InputError

# Cases of the full proof. 300 singles are ten and more of each effect; the ladder has a dozen on each rung.
FULL: Mapping[str, int] = {
    "single": 300,
    "pair": 200,
    "null": 150,
    "parameters_only": 150,
    "masked": 100,
    "novel": 60,
    "ladder": 140,
    "ambiguous": 60,
    "insufficient": 60,
    "less_known": 120,
}
# MuJoCo moves two-mass axes: three of each effect that its model has.
MUJOCO: Mapping[str, int] = {"single": 45, "parameters_only": 15}
PLANTS: Mapping[str, Mapping[str, int]] = {"simulated": FULL, "mujoco": MUJOCO}
MOST = 10_000  # case folders have four digits
_NUMBERS = 1_000_000  # upper limit of the number of the first case of a tier


@dataclass(frozen=True)
class Planned:
    """A case to be drawn: its neutral folder name, its tier and its number within the tier."""

    name: str
    tier: str
    number: int


def plan(cases: int, seed: int, plant: str = "simulated", only: Collection[str] = ()) -> tuple[Planned, ...]:
    """Plan `cases` cases with each tier's share of the full proof on a plant, shuffled by the seed; `only`: some tiers.

    Numbers within a tier are consecutive, so that its effects are drawn equally often. Raises InputError for a number
    of cases out of range and for a tier that the plant lacks.
    """
    known = PLANTS[plant]
    for tier in only:
        if tier not in known:
            raise InputError(f"--only: given {tier}, allowed {', '.join(known)}")
    if not 1 <= cases <= MOST:
        raise InputError(f"--cases: given {cases}, allowed 1 to {MOST}")
    shares = {tier: share for tier, share in known.items() if not only or tier in only}
    random = np.random.default_rng([seed, cases])
    # each tier starts at a number of its own, since equal numbers of two tiers conceal the same effect
    order = [
        (tier, first + number)
        for tier, count in counts(cases, shares).items()
        for first in (int(random.integers(_NUMBERS)),)
        for number in range(count)
    ]
    return tuple(
        Planned(f"case_{place:04d}", *order[index]) for place, index in enumerate(random.permutation(len(order)))
    )


def counts(cases: int, full: Mapping[str, int] = FULL) -> dict[str, int]:
    """Return the cases of each tier in a proof of `cases`, by largest remainders."""
    whole = sum(full.values())
    found = {tier: cases * count // whole for tier, count in full.items()}
    missing = cases - sum(found.values())
    for tier in sorted(full, key=lambda tier: -(cases * full[tier] % whole))[:missing]:
        found[tier] += 1
    return found
