"""Write a drafted map as YAML with comments that explain its keys and how each value was found."""

import json
import re

from hil.channels import CHANNELS
from hil.importing.lexicon import NOMINAL
from hil.importing.map_draft import MapDraft

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_RESERVED = {"true", "false", "null", "yes", "no", "on", "off"}
ASKED = "# <-- write:"  # before the question beside a key without a value
_KEYS = """\
# Each channel: value [SI] = sign x scale x factor(unit) x column + offset. Keys of a channel:
#   column  name in the file; NAME[i] is column i (from 0) of the matrix NAME of a .mat file
#   unit    m mm um in | rad deg rev counts | m/s mm/s m/min rad/s deg/s rpm | N kN | N m mN m | A V % permille
#   sign    -1 if the column is positive the other way
#   scale   factor beside the unit (1);  offset: added afterwards, in SI (0)
#   empty   hold: an empty cell stands for the value before, of a column that is written on change
#   time    column and unit of its own stamps; it is then interpolated to those of the file
#   wraps_at                                  range of a counter (also of time) or angle that starts again, in its unit
#   counts_per_rev, counts_per_m              for the unit counts
#   torque_constant_n_m_a, force_constant_n_a for the unit A
#   rated   N m or N at 100 %, for the units % and permille;  gain: N m or N per volt, for the unit V
"""


def map_text(draft: MapDraft) -> str:
    """The map as text of a YAML file; a key that is asked has no value, and its question beside it."""
    clock, name = draft.clock, draft.table.path.name
    lines = [f"# Map of {name}, drafted by hil import. Correct it and import again with --map."]
    if draft.unsure:
        lines += ["# Please check:", *(f"#   - {note}" for note in draft.unsure)]
    lines += [f"about: {_value(f'{name}, map drafted from the file itself')}"]
    if clock.time is not None:
        lines += [f"time:                     # {clock.how}", f"  column: {_value(clock.time.column)}"]
        lines += [f"  unit: {clock.time.unit}                 # s, ms, us, 100 ns, ns, min, d (days), date (text)"]
        others = clock.time.model_dump(exclude_defaults=True, exclude={"column", "unit"})
        lines += [f"  {key}: {_value(value)}" for key, value in others.items()]
    else:
        lines += [f"sample_rate_hz: {clock.rate_hz!r}   # instead of time stamps; {clock.how}"]
    if draft.resample_hz is not None:
        lines += [f"resample_hz: {draft.resample_hz!r}   # for rows that are missing or taken at uneven moments"]
    if draft.rows_per_sample is not None:
        lines += [f"rows_per_sample: {draft.rows_per_sample!r}   # each sample stands in so many rows and is kept once"]
    if draft.missing:
        lines += ["missing: leave_out          # rows without a value; refuse: do not import such a file"]
    options = draft.table.csv.model_dump(exclude_defaults=True)
    lines += ["csv:                      # how the text file is written"] if options else []
    lines += [f"  {key}: {_value(value)}" for key, value in options.items()]
    asked = {(one.channel, one.key): one.what for one in draft.asked}
    if ("", "lead_m") in asked:
        lines += [f"lead_m:   {ASKED} {asked['', 'lead_m']}"]
    elif draft.lead_m is not None:
        lines += [f"lead_m: {draft.lead_m!r}   # m per revolution of the motor; {draft.lead_how}"]
    told = [(one, draft.table.constants[one]) for one in NOMINAL if one in draft.table.constants]
    lines += ["nominal:                  # of the parts: masses split the one that is found"] if told else []
    lines += [f"  {one}: {_value(value.value)}   # {value.text}" for one, value in told]
    lines += [*_KEYS.rstrip().splitlines(), "channels:"]
    for one in draft.channels:
        lines += [f"  {one.channel}:   # {CHANNELS[one.channel].meaning} [{CHANNELS[one.channel].unit}]; {one.how}"]
        for key, value in one.entry.items():
            what = asked.get((one.channel, key))
            lines += [f"    {key}: {_value(value)}" if what is None else f"    {key}:   {ASKED} {what}"]
    if draft.left_out:
        lines += ["# Columns that are not used:", *(f"#   {name}: {why}" for name, why in draft.left_out.items())]
    return "\n".join(line.replace("\t", " ") if line.startswith("#") else line for line in lines) + "\n"


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if not isinstance(value, str):
        return repr(value)
    plain = _PLAIN.fullmatch(value) and value.lower() not in _RESERVED
    return value if plain else json.dumps(value, ensure_ascii=False)


def asked_lines(text: str) -> list[tuple[int, str]]:
    """Lines (from 1) of a map's text with a key that has no value yet, and the key with its question."""
    lines = [(number, *line.partition(ASKED)) for number, line in enumerate(text.splitlines(), 1)]
    return [
        (number, f"{key.strip()} {question.strip()}")
        for number, key, mark, question in lines
        if mark and key.rstrip().endswith(":")
    ]
