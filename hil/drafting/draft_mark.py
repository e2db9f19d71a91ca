"""A mark in a drafted bench file: of the recordings that it was drafted from, and of its own text.

It tells whether somebody edited the file, and whether the recordings, as their maps read them, are others since.
"""

import hashlib
import json
from collections.abc import Sequence
from typing import NamedTuple

from hil.recording.recording import Recording

_BEGIN = "# drafted by hil, from recordings "


class DraftState(NamedTuple):
    """What is true of a bench file with a mark: somebody edited it, and its recordings are others since."""

    edited: bool
    outdated: bool


def marked(text: str, recordings: Sequence[Recording]) -> str:
    """The text of a drafted bench file with its mark as the last line."""
    text = f"{text.rstrip()}\n"
    return f"{text}{_BEGIN}{_of_recordings(recordings)}, text {_digest(text.encode())}\n"


def draft_state(text: str, recordings: Sequence[Recording]) -> DraftState | None:
    """Compare a bench file with its mark and with recordings; None without a mark: it was not drafted so."""
    lines = text.splitlines(keepends=True)
    mark = next((line for line in lines if line.startswith(_BEGIN)), None)
    if mark is None:
        return None
    rest = "".join(line for line in lines if line is not mark)
    source, _, own = mark.removeprefix(_BEGIN).strip().partition(", text ")
    return DraftState(own != _digest(rest.encode()), source != _of_recordings(recordings))


def _of_recordings(recordings: Sequence[Recording]) -> str:
    """Digest of what a draft reads: the columns in SI units, and what the maps say beside them."""
    found = hashlib.sha256()
    for one in recordings:
        found.update(json.dumps([one.period_s, one.metadata], sort_keys=True, default=str).encode())
        for name, values in sorted(one.columns.items()):
            found.update(name.encode())
            found.update(values.tobytes())
    return found.hexdigest()[:16]


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
