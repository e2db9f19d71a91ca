"""Doubts of a drafted map that a user has not settled by an edit."""

import yaml

from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text

_NO_SIZE = ("sign", "offset")  # keys of a channel that say nothing of its size
_CLOCK = ("time", "sample_rate_hz", "resample_hz")  # keys of a map


def still_open(draft: MapDraft, text: str) -> list[str]:
    """Notes of a draft on those channels, and on the clock, whose entries in the text of the map are as drafted.

    A note on the size of a channel (it begins with the channel) stays where only sign or offset changed. Raises
    yaml.YAMLError if the text is no YAML.
    """
    drafted, now = yaml.safe_load(map_text(draft)), yaml.safe_load(text)
    if not isinstance(now, dict) or not isinstance(now.get("channels"), dict):
        return []
    done = ["clock: "] if any(drafted.get(key) != now.get(key) for key in _CLOCK) else []
    done += ["lead_m: "] if drafted.get("lead_m") != now.get("lead_m") else []
    for channel, entry in drafted["channels"].items():
        changed = now["channels"].get(channel)
        if changed != entry:
            done.append(f"{entry['column']}: ")
        if not isinstance(changed, dict) or _size(changed) != _size(entry):
            done.append(f"{channel}: ")
    return [note for note in draft.unsure if not note.startswith(tuple(done))]


def _size(entry: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in entry.items() if key not in _NO_SIZE}
