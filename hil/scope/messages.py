"""Messages between page and server: JSON from the page, JSON or binary frames to it.

    frame: length of the header (4 bytes, little endian) | header, JSON, padded to 8 bytes | rows of float64

A frame of traces has the times [s] in its first row and the traces in SI units in the others, as the header names them.
"""

from __future__ import annotations

import json
import struct
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from hil.arrays import FloatArray
from hil.errors import InputError
from hil.scope.trigger import ScopeEvent, Slope

MOST_POINTS = 20_000  # of a trace in a frame: more than any screen has
Names = Annotated[list[str], Field(max_length=64)]


class PageMessage(BaseModel):
    """A message of the page."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class See(PageMessage):
    """What the page draws: traces, length of the rolling window [s], points of a trace, shift of a second recording."""

    do: Literal["see"]
    traces: Names
    window_s: float = Field(gt=0.0, le=3600.0)
    points: int = Field(ge=2, le=MOST_POINTS)
    shift_s: float = 0.0


class Show(PageMessage):
    """Show this stretch of time of the rows at rest [s]; of a run that rolls, hold it first. Without: everything."""

    do: Literal["show"]
    from_s: float | None = None
    to_s: float | None = None


class Hold(PageMessage):
    """Hold what rolls, or let it roll."""

    do: Literal["hold"]
    on: bool


class Arm(PageMessage):
    """Wait for a trigger: a level of a trace, or an event; then show from `pre_s` before to `post_s` after it.

    again: wait for the next one at once.
    """

    do: Literal["arm"]
    trace: str = ""
    level: float = 0.0
    slope: Slope = Slope.RISING
    event: ScopeEvent | None = None
    pre_s: float = Field(ge=0.0, le=600.0)
    post_s: float = Field(ge=0.0, le=600.0)
    again: bool = False


class Disarm(PageMessage):
    """Wait for no trigger any more."""

    do: Literal["disarm"]


class Play(PageMessage):
    """Replay the recording from a time on [s], `speed` times as fast."""

    do: Literal["play"]
    from_s: float
    speed: float = Field(gt=0.0, le=1000.0)


class Measure(PageMessage):
    """Tell values at two times and statistics between them; without times those of the window."""

    do: Literal["measure"]
    from_s: float | None = None
    to_s: float | None = None


class AskSpectrum(PageMessage):
    """Amplitude spectrum of a trace, in the same stretch as `Measure`."""

    do: Literal["spectrum"]
    trace: str
    from_s: float | None = None
    to_s: float | None = None


class AgainstEachOther(PageMessage):
    """One trace over another one, in the same stretch as `Measure`."""

    do: Literal["xy"]
    x: str
    y: str
    from_s: float | None = None
    to_s: float | None = None


AnyMessage = See | Show | Hold | Arm | Disarm | Play | Measure | AskSpectrum | AgainstEachOther
_ADAPTER: TypeAdapter[AnyMessage] = TypeAdapter(Annotated[AnyMessage, Field(discriminator="do")])


def read_message(text: str) -> AnyMessage:
    """Read a message of the page. Raises InputError: what was given, what is allowed."""
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"])) or "message"
        raise InputError(f"{place}: given {str(first.get('input'))[:80]}: {first['msg']}") from None


def note(kind: str, **content: Any) -> str:
    """Return a JSON message to the page."""
    return json.dumps({"kind": kind, **content})


def frame(kind: str, values: FloatArray, **content: Any) -> bytes:
    """Return a binary frame of values (rows, n)."""
    header = json.dumps({"kind": kind, "shape": values.shape, **content}).encode()
    header += b" " * (-(len(header) + 4) % 8)
    return struct.pack("<I", len(header)) + header + np.ascontiguousarray(values, "<f8").tobytes()


def read_frame(data: bytes) -> tuple[dict[str, Any], FloatArray]:
    """Return header and values of a frame."""
    (size,) = struct.unpack_from("<I", data)
    header = json.loads(data[4 : 4 + size])
    return header, np.frombuffer(data, "<f8", offset=4 + size).reshape(header["shape"])
