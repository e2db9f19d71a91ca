"""A drafted map: clock, channels with how they were found, and what is unsure."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from hil.channels import CHANNELS
from hil.importing.clock import StampClock
from hil.importing.foreign_table import ForeignTable
from hil.importing.questions import missing_column


@dataclass(frozen=True)
class DraftedChannel:
    """Entry of a channel: its keys in the order of the file, and how it was found."""

    channel: str
    entry: dict[str, object]
    how: str


class Asked(NamedTuple):
    """A key that the file does not tell and that the user writes; `channel` is empty for a key of the map itself."""

    channel: str
    key: str
    what: str


@dataclass
class MapDraft:
    """A drafted map: `unsure` is what the user should check, `left_out` the other columns with the reason.

    `asked` are the keys without which it cannot be applied; the values that stand for them here mean nothing.
    """

    table: ForeignTable
    clock: StampClock
    channels: list[DraftedChannel] = field(default_factory=list)
    lead_m: float | None = None
    lead_how: str = ""
    resample_hz: float | None = None  # to which rows that are missing or uneven are interpolated
    rows_per_sample: float | None = None  # of a logger that repeated samples
    missing: bool = False  # rows without a value are left out
    unsure: list[str] = field(default_factory=list)
    asked: list[Asked] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        lines = [f"Drafted map of {self.table.path.name}"]
        for one in self.channels:
            asked = {key for channel, key, _ in self.asked if channel == one.channel}
            entry = ", ".join(f"{key}: {value}" for key, value in one.entry.items() if key not in asked)
            lines.append(f"  {one.channel}: {entry}  ({one.how})")
        lines += [f"  please write: {' '.join(filter(None, one))}" for one in self.asked]
        lines += [f"  please check: {note}" for note in self.unsure]
        return "\n".join([*lines, *(f"  not used: {name}, {why}" for name, why in self.left_out.items())])


def ask_column(draft: MapDraft, channel: str, what: str, unit_question: str, columns: Sequence[str]) -> None:
    """Add a channel of which column and unit are asked; `columns` are those that may be it."""
    draft.channels.append(DraftedChannel(channel, {"column": "", "unit": CHANNELS[channel].unit}, "not found"))
    draft.asked.append(Asked(channel, "column", missing_column(what, columns, channel)))
    of_column = unit_question.replace("its unit is not in the file; ", "of that column; ")
    draft.asked.append(Asked(channel, "unit", of_column))
