"""What every exported file holds of a recording: its columns, its metadata as one JSON text, and its start."""

import json
from contextlib import suppress
from datetime import UTC, datetime
from typing import NamedTuple

from hil.arrays import FloatArray
from hil.recording.recording import Recording

METADATA = "hil_metadata"  # name of the text in every format


class Content(NamedTuple):
    """columns: (n,) by name, time_s first. metadata: JSON. start: instant of time_s = 0, 1970 if it is not known."""

    columns: dict[str, FloatArray]
    metadata: str
    start: datetime

    @property
    def signals(self) -> dict[str, FloatArray]:
        """Columns without the time."""
        return {name: values for name, values in self.columns.items() if name != "time_s"}


def content_of(recording: Recording) -> Content:
    """The content of a recording; its metadata keep the period, and every number and text."""
    start = datetime.fromtimestamp(0.0, UTC)
    with suppress(ValueError, TypeError):  # a run in virtual time has no instant
        told = datetime.fromisoformat(recording.metadata.get("start_time", ""))
        start = told if told.tzinfo else told.replace(tzinfo=UTC)
    columns = {"time_s": recording["time_s"]} | recording.columns
    return Content(columns, json.dumps(recording.metadata | {"period_s": recording.period_s}), start)
