"""Draft the map of a foreign file: its clock, its columns by role, and an entry for each channel."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hil.arrays import FloatArray
from hil.channels import AXIS_CHANNELS, CHANNELS, AxisKind
from hil.errors import InputError
from hil.files.input_file import bounded
from hil.importing.channel_clocks import on_one_clock
from hil.importing.channel_entries import ChannelEntries
from hil.importing.clock import StampClock, find_clock, time_columns
from hil.importing.column_names import Label, label
from hil.importing.damage import jump_notes, limit_notes, refuse_damage, refuse_missing
from hil.importing.foreign_table import ForeignTable, read_table
from hil.importing.held_samples import rows_per_slowest_sample
from hil.importing.lexicon import Quantity
from hil.importing.map_draft import DraftedChannel, MapDraft, ask_column
from hil.importing.map_file import ChannelSource
from hil.importing.on_change import columns_on_change, held
from hil.importing.one_rate import use_one_rate
from hil.importing.questions import effort_unit, position_unit
from hil.importing.readme import with_readme
from hil.importing.roles import Roles, find_roles, may_be_asked
from hil.importing.rows import at_regular_times, complete_rows, filled_in, without_duplicates
from hil.importing.slow_gaps import moving_little, with_gaps_filled
from hil.importing.unit_choice import are_counts
from hil.importing.units import unit_named
from hil.importing.wraps import lost_by, unwrapped, wrap_range

_TURNS = {360.0: "deg", 2.0 * np.pi: "rad"}  # unit of an angle by the range after which it starts again


@bounded
@np.errstate(invalid="ignore", over="ignore")  # an infinity is refused with its row, after sums and differences
def draft_map(
    path: str | Path, rate_hz: float | None = None, axis: str | None = None, readme: str | Path | None = None
) -> MapDraft:
    """Draft the map of a foreign file: which column is which channel, in which unit, with which sign.

    path: any file that `hil import` reads. rate_hz: rows per second, of a file without time stamps. axis: number or
    letter of the axis in the names of columns, of a file with several. readme: a text of the owner, which tells
    what the file does not: lead, counts, torque constant, units of columns.

    Returns the draft: `asked` are keys that the file does not tell, `unsure` is what to check. `hil.save` it as YAML,
    complete it there, and read the file with `import_recording`. Raises InputError: a damaged file, no clock, no column
    that moves, contradicting columns.
    """
    path = Path(path)
    table = read_table(path)
    table = table if readme is None else with_readme(table, Path(readme))
    given, labels = table.columns, labels_of(table)
    times = set(time_columns(table, labels))
    own = on_one_clock(table, labels)
    table = own.table
    on_change = columns_on_change(table.columns)
    filled_up = {name: held(table.columns[name]) for name in on_change}
    distinct = without_duplicates(table.columns | filled_up)
    lines = table.lines[distinct.rows] if table.lines is not None else None
    table = replace(table, columns=distinct.columns, lines=lines)
    labels = labels_of(table)
    clock = find_clock(table, labels, rate_hz)
    columns = {name: scaled(table, name) for name in table.columns if name not in clock.columns}
    may_wrap = [name for name in columns if labels[name].quantity in (Quantity.POSITION, Quantity.UNKNOWN)]
    wraps = {name: size for name in may_wrap if (size := wrap_range(columns[name])) is not None}
    unknown = [name for name in wraps if not (labels[name].unit or labels[name].odd_unit or are_counts(columns[name]))]
    turns = {name: _TURNS[wraps[name]] for name in unknown if wraps[name] in _TURNS}
    labels |= {name: replace(labels[name], quantity=Quantity.POSITION, unit=unit) for name, unit in turns.items()}
    columns |= {name: unwrapped(columns[name], size) for name, size in wraps.items()}
    filled = {n: filled_in(values, clock.time_s) for n, values in columns.items() if np.isfinite(values).any()}
    named = [name for name in filled if labels[name].quantity is Quantity.POSITION]
    dense = filled | {"time_s": clock.time_s}
    dense = with_gaps_filled(dense)[0] if moving_little(dense, named) else dense
    regular = at_regular_times(path, {name: dense[name] for name in filled}, dense["time_s"])
    found = {name: lost_by(name, size, filled, labels, regular.period_s) for name, size in wraps.items()}
    lost = {name: f"{speed} goes half of its range and more from row to row" for name, speed in found.items() if speed}
    labels |= {name: replace(labels[name], quantity=Quantity.OTHER) for name in lost}
    roles = find_roles(str(path), regular.longest_part(), labels, regular.period_s, axis, table.constants)
    roles.left_out |= lost
    if roles.motor is None and roles.motor_velocity is None:
        may_be = may_be_asked(regular.longest_part(), labels)
        draft = _without_motion(table, clock, roles, may_be, [*table.notes, *own.notes, *clock.unsure])
        _list_the_rest(draft, given, times)
        return draft
    _refuse_same_name(table, roles.used)
    use_one_rate(path, columns, roles)
    used = {name: columns[name] for name in roles.used}
    refuse_missing(table, used)
    # only now it is known which columns must be complete, and which repeat when a sample does
    positions = [name for name in (roles.motor, roles.table) if name]
    ratio = rows_per_slowest_sample({name: filled[name] for name in used}, positions)
    complete = complete_rows(used | {"time_s": clock.time_s}, ratio if ratio > 1.0 else None, positions)
    kept_s = complete.columns["time_s"]
    kept = {name: complete.columns.get(name, values[complete.rows]) for name, values in filled.items()}
    measured_rows = np.unique(complete.rows, return_index=True)[1]
    regular = at_regular_times(path, kept, kept_s, judged_by=[n for n in used if n != roles.unfollowed])
    live = regular.longest_part()
    refuse_damage(path, {name: filled[name] for name in used}, clock.time_s, live, roles, regular.period_s)
    measured = [name for name in (roles.effort, roles.effort_command) if name and not labels[name].command]
    draft = MapDraft(
        table,
        clock,
        resample_hz=regular.rate_hz,
        rows_per_sample=ratio if ratio > 1.0 else None,
        missing=any(np.isnan(values).any() for values in used.values()),
        left_out=roles.left_out | dict(remark.split(": ", 1) for remark in table.remarks),
        unsure=[
            *(
                *table.notes,
                *_scale_notes(table, used),
                *own.notes,
                *distinct.notes,
                *clock.unsure,
                *complete.notes,
                *regular.notes,
            ),
            *(
                note
                for name in positions
                for note in jump_notes(name, kept[name][measured_rows], kept_s[measured_rows])
            ),
            *(note for name in measured for note in limit_notes(name, kept[name])),
            *(
                f"{name}: wraps at {wraps[name]:g}; it is unwrapped{f', and in {turns[name]}' if name in turns else ''}"
                for name in used
                if name in wraps
            ),
            *(
                f"{name}: is written only where it changes; an empty cell holds its last value"
                for name in used
                if name in on_change
            ),
            *(
                f"{name}: its cells hold their units; they are read in {table.cell_units[name]}"
                for name in used
                if name in table.cell_units
            ),
            *roles.unsure,
            *(f"{name}: its unit is not known" for name, one in labels.items() if one.odd_unit and name in used),
        ],
    )
    ChannelEntries(draft, labels, roles, live, regular.period_s).fill()
    for one in draft.channels:
        entry, column = one.entry, str(one.entry["column"])
        _with_scale(one, table, draft.lead_m)
        entry |= {"time": own.times[column].model_dump(exclude_defaults=True)} if column in own.times else {}
        entry |= {"wraps_at": wraps[column] / table.scales.get(column, (1.0, 0.0))[0]} if column in wraps else {}
        entry |= {"empty": "hold"} if column in on_change else {}
    _list_the_rest(draft, given, times)
    return draft


def _without_motion(
    table: ForeignTable, clock: StampClock, roles: Roles, may_be: Sequence[str], unsure: list[str]
) -> MapDraft:
    """A map that asks which of the columns `may_be` are motion and torque, where none is known to be the motion."""
    left_out = roles.left_out | dict.fromkeys(may_be, "it may be one that is asked for above")
    draft, kind = MapDraft(table, clock, left_out=left_out, unsure=unsure), AxisKind.ROTARY
    names, motion = AXIS_CHANNELS[kind], "the measured position or velocity of the motor"
    ask_column(draft, names.motor_position, motion, position_unit(kind, (), False), may_be)
    ask_column(draft, names.torque, "the torque, force, current or voltage", effort_unit(kind), may_be)
    return draft


def _list_the_rest(draft: MapDraft, given: Mapping[str, FloatArray], times: Collection[str]) -> None:
    """List the columns `given` (n,), of which `times` are of time, that have no reason yet: each is used or listed."""
    entries = [ChannelSource.model_validate(one.entry) for one in draft.channels]
    stamps = [one.time for one in entries if one.time] + [
        one.time.fraction for one in entries if one.time and one.time.fraction
    ]
    used = draft.clock.columns | {one.column for one in entries} | {one.column for one in stamps}
    for name, values in given.items():
        if name in used:
            draft.left_out.pop(name, None)
        elif name not in draft.left_out:
            why = "another time" if name in times else "no channel takes it"
            draft.left_out[name] = why if np.isfinite(values).any() else "has no finite number"


def labels_of(table: ForeignTable) -> dict[str, Label]:
    """Meaning of the columns by all that the file says of them."""
    firm = table.cell_units | table.firm_units
    units = table.units | firm
    told = {name: (units.get(name, ""), table.words.get(name, ""), name in firm) for name in table.columns}
    labels = {name: replace(label(table.titles.get(name, name), *of), column=name) for name, of in told.items()}
    # no axis moves hundreds of metres in whole ones: enc_m is the motor's encoder
    metres = [name for name, one in labels.items() if one.unit == "m" and are_counts(table.columns[name])]
    return labels | {name: replace(labels[name], unit=unit_named(units.get(name, ""))) for name in metres}


def scaled(table: ForeignTable, name: str) -> FloatArray:
    """A column (n,) with the factor and offset that the file gives for it."""
    factor, offset = table.scales.get(name, (1.0, 0.0))
    return factor * table.columns[name] + offset


def _with_scale(one: DraftedChannel, table: ForeignTable, lead_m: float | None) -> None:
    """Add factor and offset that the file gives for a column."""
    factor, offset = table.scales.get(str(one.entry["column"]), (1.0, 0.0))
    if offset:
        in_si = ChannelSource.model_validate(one.entry).factor_to(CHANNELS[one.channel].unit, lead_m)
        one.entry["offset"] = offset * (in_si or 0.0)
    if factor != 1.0:
        one.entry["scale"] = float(str(one.entry.get("scale", 1.0))) * factor


def _refuse_same_name(table: ForeignTable, used: Collection[str]) -> None:
    titles = [table.titles.get(name, name) for name in used]
    twice = next((title for title in titles if titles.count(title) > 1), None)
    if twice is not None:
        raise InputError(
            f"{table.path}: {twice!r} names two columns of the header that may both be used, allowed one; say which "
            "by a map with csv.column_names: hil import FILE --map MAP.yaml"
        )


def _scale_notes(table: ForeignTable, used: Collection[str]) -> list[str]:
    given = {name: scale for name, scale in table.scales.items() if name in used and scale != (1.0, 0.0)}
    return [
        f"{name}: the header's factor {factor:g} and offset {offset:g} are taken"
        for name, (factor, offset) in given.items()
    ]
