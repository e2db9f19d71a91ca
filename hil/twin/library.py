"""The library of mechanisms: one import and one line of the list each.

The order of the list is the order in which the contributions of one stage are composed.
"""

from __future__ import annotations

from hil.twin.mechanism import Mechanism
from hil.twin.mechanisms import backlash

LIBRARY: tuple[Mechanism, ...] = (
    backlash.MECHANISM,
)

BY_ID: dict[str, Mechanism] = {mechanism.id: mechanism for mechanism in LIBRARY}
