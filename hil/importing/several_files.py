"""What each of several files is for: a recording by itself, a part of one, or set-points alone."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from hil.errors import InputError, PartOfAxis
from hil.importing.draft_map import draft_map, labels_of
from hil.importing.foreign_table import read_table
from hil.importing.lexicon import Quantity
from hil.importing.readme import FileHints

_OF_AN_AXIS = (Quantity.POSITION, Quantity.VELOCITY, Quantity.EFFORT, Quantity.UNKNOWN)


def is_whole(source: Path, told: FileHints) -> bool:
    """True if a file has what a recording needs, by itself."""
    try:
        return all(one.key != "column" for one in draft_map(source, *told).asked)
    except PartOfAxis:
        return False


def set_points_alone(sources: Sequence[Path]) -> list[Path]:
    """The files that hold set-points and nothing measured, beside others; none where all do."""
    found = [one for one in sources if _is_set_points(one)] if len(sources) > 1 else []
    return found if len(found) < len(sources) else []


def _is_set_points(source: Path) -> bool:
    with suppress(InputError):
        labels = [one for one in labels_of(read_table(source)).values() if one.quantity in _OF_AN_AXIS]
        return bool(labels) and all(one.command for one in labels)
    return False
