"""What a draft was unsure of and its map, edited since, has still as it was drafted."""

import yaml

from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text

_CLOCK = ("time", "sample_rate_hz", "resample_hz")  # keys of a map


def still_open(draft: MapDraft, text: str) -> list[str]:
    """The notes of a draft that hold for a map of this text: those on a channel or a clock that nobody changed.

    Raises yaml.YAMLError if the text is no YAML.
    """
    drafted, now = yaml.safe_load(map_text(draft)), yaml.safe_load(text)
    if not isinstance(now, dict) or not isinstance(now.get("channels"), dict):
        return []
    done = ["clock: "] if any(drafted.get(key) != now.get(key) for key in _CLOCK) else []
    for channel, entry in drafted["channels"].items():
        if now["channels"].get(channel) != entry:
            done += [f"{channel}: ", f"{entry['column']}: "]
    return [note for note in draft.unsure if not note.startswith(tuple(done))]
