"""Positions that are encoders by their names or steps by their numbers, and which of two is the motor's."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hil.arrays import FloatArray
from hil.identification.derivatives import motion
from hil.importing.column_names import Label
from hil.importing.relations import SAME_POSITION, derivative_of, driven, proportional
from hil.importing.unit_choice import MATCH, are_counts

_CLEARLY = (
    0.5  # of what the other encoder leaves unexplained: less is the motor's; noise and compliance make up for more
)


class MotorsEncoder(NamedTuple):
    """Name of the motor's encoder among two, and what tells it."""

    name: str
    why: str


def named_encoders(names: Sequence[str], labels: Mapping[str, Label]) -> set[str]:
    """Those of the positions `names` that are measured: called an encoder, or alike but for a number."""
    stems = [re.sub(r"\d+", "#", name) for name in names]
    alike = {name for name, stem in zip(names, stems, strict=True) if "#" in stem and stems.count(stem) > 1}
    return alike | {name for name in names if labels[name].encoder}


def motors_encoder(
    two: Sequence[str],
    live: Mapping[str, FloatArray],
    speeds: Sequence[str],
    efforts: Sequence[str],
    period_s: float,
) -> MotorsEncoder | None:
    """Tell the motor's encoder of `two`: its derivative is a speed, or it explains an effort; None if neither tells.

    All are names of columns (n,) of `live`.
    """
    moved = {name: motion(live[name], period_s) for name in two}
    derived = {(name, one): derivative_of(live[one], moved[name], period_s).share for name in two for one in speeds}
    causing = {(name, one): driven(live[one], moved[name], period_s).share for name in two for one in efforts}
    for shares, what in ((derived, "its derivative is"), (causing, "its motion explains more of")):
        if not shares:
            continue
        best, column = max(shares, key=lambda pair: shares[pair])
        other = max(share for (name, _), share in shares.items() if name != best)
        if 1.0 - shares[best, column] < _CLEARLY * (1.0 - other):
            return MotorsEncoder(best, f"{what} {column}")
    return None


def follows_steps(command: FloatArray, measured: FloatArray, named: bool) -> bool:
    """True if an encoder `measured` (n,) follows the steps of a stepper's `command` (n,).

    Names that do not say steps (`named`) need whole numbers, and counts of the encoder: a servo drive gives its
    set-points in these, one for one, which is no stepper.
    """
    relation = proportional(measured, command)
    counted = are_counts(command) and are_counts(measured) and abs(abs(relation.factor) - 1.0) > MATCH
    return relation.share > SAME_POSITION and (named or counted)
