"""Draft the map of a foreign file: its clock, its columns by role, and an entry for each channel."""

from pathlib import Path

import numpy as np

from hil.importing.channel_entries import ChannelEntries
from hil.importing.clock import find_clock
from hil.importing.column_names import label
from hil.importing.complete_rows import complete_rows
from hil.importing.even_rows import even_rows, filled_in, find_wraps, with_rate, without_duplicates
from hil.importing.foreign_table import read_table
from hil.importing.held_samples import rows_per_slowest_sample
from hil.importing.map_draft import MapDraft
from hil.importing.oddities import jumps_told, limit_told, refuse_damage, refuse_missing
from hil.importing.roles import find_roles
from hil.importing.wraps import unwrapped


def draft_map(path: Path, rate_hz: float | None = None, axis: str | None = None) -> MapDraft:
    """Draft the map of `path`; `rate_hz` and `axis` are what the user says beside the file.

    Raises InputError: a damaged file, no clock, no motion, no column that goes with it, contradicting columns.
    """
    table, doubled = without_duplicates(read_table(path))
    labels = {name: label(name, table.units.get(name, "")) for name in table.columns}
    clock = find_clock(table, labels, rate_hz)
    columns = {name: values for name, values in table.columns.items() if name != clock.column}
    wraps = find_wraps(columns, labels)
    columns |= {name: unwrapped(columns[name], size) for name, size in wraps.items()}
    filled = {n: filled_in(values, clock.time_s) for n, values in columns.items() if np.isfinite(values).any()}
    live = even_rows(path, filled, clock.time_s)
    roles = find_roles(str(path), live.columns, labels, live.period_s, axis)
    used = {name: columns[name] for name in roles.used}
    refuse_missing(path, used, table.texts)
    # only now it is known which columns must be complete, and which repeat when a sample does
    positions = [name for name in (roles.motor, roles.table) if name]
    ratio = rows_per_slowest_sample({name: filled[name] for name in used}, positions)
    complete = complete_rows(used | {"time_s": clock.time_s}, ratio if ratio > 1.0 else None, positions)
    kept = {name: values[complete.rows] for name, values in filled.items()}
    even = even_rows(path, kept, complete.columns["time_s"], judged_by=[n for n in used if n != roles.unfollowed])
    jumps = [note for n in positions for note in jumps_told(n, kept[n], complete.columns["time_s"])]
    measured = [name for name in (roles.effort, roles.effort_command) if name and not labels[name].command]
    limits = [note for name in measured for note in limit_told(name, kept[name])]
    refuse_damage(path, {name: filled[name] for name in used}, clock.time_s, even.columns, roles, even.period_s)
    clock = with_rate(clock, even)
    unwraps = [f"{name}: wraps at {wraps[name]:g}; it is unwrapped" for name in used if name in wraps]
    notes = [*doubled, *clock.unsure, *complete.notes, *even.notes, *jumps, *limits, *unwraps]
    draft = MapDraft(table, clock, unsure=[*notes, *roles.unsure], left_out=dict(roles.left_out))
    draft.left_out |= dict(remark.split(": ", 1) for remark in table.remarks)
    draft.unsure += [
        f"{one.column}: its unit is not known" for one in labels.values() if one.odd_unit and one.column in used
    ]
    ChannelEntries(draft, labels, roles, even.columns, even.period_s).fill()
    draft.missing = any(np.isnan(values).any() for values in used.values())
    draft.rows_per_sample = ratio if ratio > 1.0 else None
    for entry in (one.entry for one in draft.channels if one.entry["column"] in wraps):
        entry["wraps_at"] = wraps[str(entry["column"])]
    return draft
