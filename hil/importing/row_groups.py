"""Rows of several joints in turn, whose name is a column: those of the one that moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil.importing.column_names import label
from hil.importing.lexicon import Quantity
from hil.importing.map_file import CsvOptions
from hil.importing.relations import SMOOTH, roughness
from hil.importing.text_rows import TextRows, read_rows


@dataclass(frozen=True)
class RowGroup:
    """Options of a map that take the rows of one joint, these rows, and a note."""

    options: CsvOptions
    rows: TextRows
    note: str


def moving_group(path: Path, names: Sequence[str], options: CsvOptions, rows: TextRows, most: int) -> RowGroup | None:
    """The only joint that moves, or the first one; None where rows are not those of several."""
    if not rows.in_turn:
        return None
    column, texts = next(iter(rows.in_turn.items()))
    read: dict[str, tuple[CsvOptions, TextRows, float]] = {}
    for text in texts:
        one = options.model_copy(update={"only": {column: text}})
        part = read_rows(path, names, one, most)
        positions = [name for name in part.numbers if label(name).quantity is Quantity.POSITION]
        values = [part.numbers[name][np.isfinite(part.numbers[name])] for name in positions]
        read[text] = one, part, min((roughness(one) for one in values if one.size > 2), default=np.inf)
    moving = [text for text in texts if read[text][2] < SMOOTH]
    taken = moving[0] if len(moving) == 1 else texts[0]
    note = f"rows: of {', '.join(texts)} in turn; those of {taken} are taken; correct csv.only for another"
    return RowGroup(read[taken][0], read[taken][1], note)
