"""Rows of one value each, with its stamp and the name of its channel, as columns at the stamps of one channel."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.date_stamps import read_dates
from hil.files.input_file import check_values
from hil.importing.cell_units import read_cells
from hil.importing.lexicon import lexicon
from hil.importing.map_file import SeriesColumns
from hil.importing.number_form import NumberForm, numbers_of

_SLOW = 3.0  # intervals of the channel with most values: a value that is older holds
_MOSTLY = 0.5  # share of texts from which a channel is one of text
_REPEATS = 0.02  # share of the values of a channel at a stamp that it had before, with another value
_GOOD_OPC = 192.0  # quality of OPC (OPC DA 3.0, 6.8): from here on good


@dataclass(frozen=True, eq=False)
class SeriesRows:
    """Stamps (n,), in seconds if they are `dates`; columns (n,) by channel; `rows` (n,) of the stamps in the file.

    `others` are rows without a stamp and a number; `units` are those of values with units, `told` the unknown ones;
    `texts` the row and the first text of a channel among its numbers.
    """

    stamps: FloatArray
    dates: bool
    columns: dict[str, FloatArray]
    rows: NDArray[np.intp]
    others: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    units: dict[str, str] = field(default_factory=dict)
    told: dict[str, str] = field(default_factory=dict)
    texts: dict[str, tuple[int, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def series_rows(
    path: Path, fields: Mapping[str, Sequence[str]], place: Callable[[int], str], of: SeriesColumns, form: NumberForm
) -> SeriesRows:
    """Put the rows of `fields`, texts (n,) by column, into columns; `place` gives that of a row, for messages.

    Channels are taken at the stamps of the one with most values, while all of such a rate have values: between two of
    its values a channel is interpolated, as of a motion; after a longer time it has held its value. Raises InputError:
    a value without a stamp, a channel with different values at one stamp, none with two stamps.
    """
    names = [".".join(parts) for parts in zip(*(fields[name] for name in of.names), strict=True)]
    stamps, dates, note = _stamps(fields[of.time], form)
    numbers, _ = numbers_of([text.split(" ")[0] for text in fields[of.value]], form)
    blank = np.isnan(stamps)
    lost = np.flatnonzero(blank & np.isfinite(numbers))
    if lost.size:
        row = int(lost[0])
        raise InputError(
            f"{place(row)}: {of.time}: given {fields[of.time][row]!r}, allowed a time stamp as in the other "
            "rows; import the part of the file before it"
        )
    left, notes = _of_bad_quality(fields, of, place, stamps.size)
    notes = [note, *notes] if note else notes
    groups: dict[str, list[int]] = {}
    for row in np.flatnonzero(~blank & ~left).tolist():
        groups.setdefault(names[row], []).append(row)
    found = _Channels(fields, place, of, form)
    times, values, at = dict[str, FloatArray](), dict[str, FloatArray](), dict[str, NDArray[np.intp]]()
    for name, rows in groups.items():
        read = found.read(name, np.array(rows))
        good = np.isfinite(read)
        kept = np.array(rows)[good][np.argsort(stamps[rows][good], kind="stable")]  # monitors may print them late
        read = read[good][np.argsort(stamps[rows][good], kind="stable")]
        if kept.size:
            found.refuse_repeats(name, stamps[kept], read, kept)
            times[name], values[name], at[name] = stamps[kept], read, kept
    if len(times) < 2:
        raise InputError(
            f"{path}: given values of {listed(times) or 'no channel'} in {of.value}, allowed two channels or more; "
            "give a file with the channels of a motion"
        )
    most = max(times, key=lambda name: times[name].size)
    check_values(path, len(times) * times[most].size, f"{len(times)} channels of up to {times[most].size} values")
    longest = _SLOW * float(np.median(np.diff(times[most]))) if times[most].size > 1 else 0.0
    fast = [own for own in times.values() if own.size > 1 and np.median(np.diff(own)) <= longest]
    if not fast:
        raise InputError(f"{path}: no channel has two different stamps; give a file with the channels of a motion")
    first, last = max(own[0] for own in fast), min(own[-1] for own in fast)
    common = (times[most] >= first) & (times[most] <= last)
    if not common.any():
        raise InputError(
            f"{path}: the stamps of {listed(times)} have no time in common, allowed those of one recording; export one"
        )
    base = times[most][common]
    columns = {name: _at(base, times[name], values[name], longest) for name in times}
    notes.append(f"rows: a value of one channel each; {listed(columns)} are taken at the stamps of {most}")
    return SeriesRows(
        base,
        dates,
        columns,
        at[most][common],
        np.flatnonzero(blank),
        found.units,
        found.told,
        found.texts,
        tuple(notes),
    )


class _Channels:
    """Reads the values of each channel; keeps units, and texts that are no numbers."""

    def __init__(
        self, fields: Mapping[str, Sequence[str]], place: Callable[[int], str], of: SeriesColumns, form: NumberForm
    ) -> None:
        self.place, self.form = place, form
        self.values, self.of_unit = fields[of.value], fields[of.unit] if of.unit else None
        self.units, self.told, self.texts = dict[str, str](), dict[str, str](), dict[str, tuple[int, str]]()

    def read(self, name: str, rows: NDArray[np.intp]) -> FloatArray:
        """Numbers of the rows (n,) of a channel, NaN without one, or for one of texts."""
        plain = [self.values[row] for row in rows]
        given = [self.of_unit[row] for row in rows] if self.of_unit else []
        whole = [f"{one} {unit}".strip() for one, unit in zip(plain, given, strict=True)] if given else plain
        cells = read_cells(whole, self.form)
        if given and not cells.unit:  # of no unit that is known
            cells = read_cells(plain, self.form)
            self.told |= {name: given[0]} if given[0] else {}
            other = next((row for row, one in enumerate(given) if one != given[0]), None)
            if other is not None:
                self.texts[name] = int(rows[other]), f"{plain[other]} {given[other]}"
        if len(cells.texts) > _MOSTLY * rows.size:
            return np.full(rows.size, np.nan)
        if cells.texts and name not in self.texts:
            row = min(cells.texts)
            self.texts[name] = int(rows[row]), cells.texts[row]
        if cells.unit:
            self.units[name] = cells.unit
        return cells.values

    def refuse_repeats(self, name: str, stamps: FloatArray, values: FloatArray, rows: NDArray[np.intp]) -> None:
        again = np.flatnonzero((np.diff(stamps) == 0.0) & (np.diff(values) != 0.0)) + 1
        if again.size > _REPEATS * stamps.size:
            row = int(rows[again[0]])
            raise InputError(
                f"{self.place(row)}: {name}: given {self.values[row]!r} at the stamp of another value, "
                "allowed one value of a channel at a stamp; export stamps with more digits, or the column that tells "
                "the channels apart"
            )


def _stamps(texts: Sequence[str], form: NumberForm) -> tuple[FloatArray, bool, str]:
    """Stamps (n,), NaN without one; True if they are dates, in seconds; a note."""
    dates = read_dates(texts)
    if np.isfinite(dates.seconds).any():
        return dates.seconds, True, dates.note
    return numbers_of(texts, form)[0], False, ""


def _of_bad_quality(
    fields: Mapping[str, Sequence[str]], of: SeriesColumns, place: Callable[[int], str], count: int
) -> tuple[NDArray[np.bool_], list[str]]:
    """Rows (n,) whose quality is bad, and notes on them and on those of another quality than most."""
    given = fields[of.quality] if of.quality else ()
    bad = np.zeros(count, dtype=np.bool_)
    if not given:
        return bad, []
    usual = Counter(given).most_common(1)[0][0]
    good_opc = numbers_of([usual], NumberForm())[0][0] >= _GOOD_OPC
    codes = dict[str, bool]()
    for text in set(given):
        number = float(numbers_of([text], NumberForm())[0][0])
        of_opc = good_opc and number < _GOOD_OPC
        codes[text] = of_opc or any(text.lower().startswith(word) for word in lexicon().series.bad)
    bad[:] = [codes[text] for text in given]
    notes = []
    for rows, what in (
        (np.flatnonzero(bad), "left out"),
        ([row for row, text in enumerate(given) if text != usual and not codes[text]], "taken like the others"),
    ):
        if len(rows):
            first = int(rows[0])
            notes.append(
                f"{of.quality}: {len(rows)} rows are {given[first]!r} or another than {usual!r}, first "
                f"{place(first)}; they are {what}"
            )
    return bad, notes


def _at(stamps: FloatArray, own: FloatArray, values: FloatArray, longest: float) -> FloatArray:
    before = np.clip(np.searchsorted(own, stamps, side="right") - 1, 0, None)
    after = np.clip(before + 1, None, own.size - 1)
    slow = own[after] - own[before] > longest
    return np.where(slow, values[before], np.interp(stamps, own, values))
