"""A drafted map: clock, channels with how they were found, and what is unsure."""

from dataclasses import dataclass, field

from hil.importing.clock import StampClock
from hil.importing.foreign_table import ForeignTable


@dataclass(frozen=True)
class DraftedChannel:
    """Entry of a channel: its keys in the order of the file, and how it was found."""

    channel: str
    entry: dict[str, object]
    how: str


@dataclass
class MapDraft:
    """A drafted map: `unsure` is what the user should check, `left_out` the other columns with the reason."""

    table: ForeignTable
    clock: StampClock
    channels: list[DraftedChannel] = field(default_factory=list)
    lead_m: float | None = None
    lead_how: str = ""
    rows_per_sample: float | None = None  # of a logger that repeated samples
    missing: bool = False  # rows without a value are left out
    unsure: list[str] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)

    def content(self) -> dict[str, object]:
        """The map as its file holds it."""
        clock = self.clock
        content: dict[str, object] = {"about": f"{self.table.path.name}, map drafted from the file itself"}
        if clock.column is not None:
            content["time"] = {"column": clock.column, "unit": clock.unit}
        else:
            content["sample_rate_hz"] = clock.rate_hz
        if clock.resample_hz is not None:
            content["resample_hz"] = clock.resample_hz
        if self.rows_per_sample is not None:
            content["rows_per_sample"] = self.rows_per_sample
        if self.missing:
            content["missing"] = "leave_out"
        options = self.table.csv.model_dump(exclude_defaults=True)
        if options:
            content["csv"] = {k: list(v) if isinstance(v, tuple) else v for k, v in options.items()}
        if self.lead_m is not None:
            content["lead_m"] = self.lead_m
        content["channels"] = {one.channel: one.entry for one in self.channels}
        return content
