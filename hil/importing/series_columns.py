"""Tell if the rows of a table are of one value each (time, channel, value), and which columns say what of it."""

from collections.abc import Callable, Collection, Sequence
from itertools import pairwise

from hil.files.date_stamps import is_date, seconds_of
from hil.importing.cell_units import number_part
from hil.importing.column_names import label, plain_words
from hil.importing.lexicon import Quantity, lexicon
from hil.importing.map_file import SeriesColumns
from hil.importing.number_form import NumberForm, number_of
from hil.importing.units import unit_named

_MOSTLY = 0.5  # share of the rows
_MORE = 0.05  # share of the steps by which another column of words must let stamps go forwards to be one of the names
_FEWEST = 3  # rows of a channel: with fewer the text is one of its row
_MOST_COLUMNS = 100  # of rows of one value
_FORWARDS = 0.9  # share of the steps of a channel's stamps: few are printed late


def find_series(names: Sequence[str], rows: Sequence[Sequence[str]], form: NumberForm) -> SeriesColumns | None:
    """The columns of such rows, by a sample of them in the order of the file; None for rows of all channels.

    One column holds values that differ within a channel; columns of words name the channel: those that are needed so
    that its stamps go forwards, and do not begin anew. A single channel in the sample is one only if the header says
    so.
    """
    if len(names) > _MOST_COLUMNS:
        return None
    known = lexicon().series
    columns = {name: [row[index].strip() for row in rows] for index, name in enumerate(names)}
    numbers = [name for name, column in columns.items() if _most(column, lambda one: _number(one, form) is not None)]
    dates = [name for name, column in columns.items() if _most(column, is_date)]
    words = [name for name, column in columns.items() if name not in (*numbers, *dates) and any(column)]
    if not words:
        return None
    times = dates or [name for name in numbers if label(name).quantity is Quantity.TIME] or numbers[:1]
    units = [name for name in words if _says(name, known.unit) or _most(columns[name], _is_unit)]
    units = [] if len(units) == len(words) else units  # channels whose names are units
    quality = [name for name in columns if _says(name, known.quality) and name not in (*times, *units)]
    named = [name for name in words if name not in (*units, *quality)]
    told = [name for name in named if _says(name, known.name)]
    if not times or not named:
        return None
    time = max(times, key=lambda name: len(set(columns[name])))
    stamps = list(seconds_of(columns[time]) if dates else (_number(one, form) or 0.0 for one in columns[time]))

    def channels(of: Sequence[str]) -> list[tuple[str, ...]]:
        return list(zip(*(columns[name] for name in of), strict=True))

    channel = (told or named)[:1]
    for name in sorted(named, key=lambda name: name not in told):
        if len(set(channels(channel))) == 1:
            channel = [name] if len(set(columns[name])) > 1 else channel
        elif _needed(stamps, channels(channel), channels([*channel, name])):
            channel = [*channel, name]
    channel.sort(key=lambda name: (name in told, names.index(name)))  # of a path the last words count
    groups = channels(channel)
    several = len(set(groups)) > 1
    if len(set(groups)) > len(rows) / _FEWEST or _forwards(stamps, groups) < _FORWARDS:
        return None
    values = [
        name
        for name in numbers
        if name not in (*times, *quality) and _differs(columns[name], groups) and not _counts(columns[name], form)
    ]
    spoken = [name for name in values if _says(name, known.value)]
    by_words = len(spoken) == 1 and bool(set(channel) & set(told))
    values = spoken if by_words else values
    if len(values) != 1 or not (several or by_words):
        return None
    unit, status = (next(iter(found), None) for found in (units, quality))
    return SeriesColumns(time=time, names=tuple(channel), value=values[0], unit=unit, quality=status)


def _most(column: Sequence[str], test: Callable[[str], bool]) -> bool:
    """True if most of the cells that are not empty are of a kind."""
    filled = [one for one in column if one]
    return sum(map(test, filled)) > _MOSTLY * len(filled) if filled else False


def _is_unit(text: str) -> bool:
    return unit_named(text) is not None


def _number(text: str, form: NumberForm) -> float | None:
    return number_of(number_part(text), form)


def _says(name: str, words: Collection[str]) -> bool:
    return any(word in words for word in plain_words(name))


def _forwards(stamps: Sequence[float], groups: Sequence[tuple[str, ...]], least: float = -1e-12) -> float:
    """Share of the steps of stamps within a channel that are greater than `least`, from the first row or the last."""
    last = dict[tuple[str, ...], float]()
    steps = []
    for stamp, group in zip(stamps, groups, strict=True):
        if group in last:
            steps.append(stamp - last[group])
        last[group] = stamp
    ways = [sum(way * step > least for step in steps) for way in (1.0, -1.0)]
    return max(ways) / len(steps) if steps else 0.0


def _needed(stamps: Sequence[float], groups: Sequence[tuple[str, ...]], more: Sequence[tuple[str, ...]]) -> bool:
    """True if stamps go forwards in more steps within the channels `more` than within `groups`, or begin anew less."""
    better = _forwards(stamps, more, 0.0) > _forwards(stamps, groups, 0.0) + _MORE
    if better:
        return True
    times = dict[tuple[str, ...], list[float]]()
    for stamp, group in zip(stamps, more, strict=True):
        times.setdefault(group, []).append(stamp)
    spans = [max(of) - min(of) for of in times.values()]
    # all of one time: a state that was another one for a while tells no channels apart
    return min(spans) > _MOSTLY * max(spans) and _begins(stamps, more) < _begins(stamps, groups)


def _begins(stamps: Sequence[float], groups: Sequence[tuple[str, ...]]) -> int:
    """Steps within a channel against its direction by most of the time of all stamps: another series begins there."""
    last, steps = dict[tuple[str, ...], float](), list[float]()
    for stamp, group in zip(stamps, groups, strict=True):
        steps.append(stamp - last.get(group, stamp))
        last[group] = stamp
    way = 1.0 if sum(step > 0.0 for step in steps) >= sum(step < 0.0 for step in steps) else -1.0
    return sum(way * step < -_MOSTLY * (max(stamps) - min(stamps)) for step in steps)


def _differs(column: Sequence[str], groups: Sequence[tuple[str, ...]]) -> bool:
    """True if a column has different texts within a channel."""
    return len(set(zip(groups, column, strict=True))) > len(set(groups))


def _counts(column: Sequence[str], form: NumberForm) -> bool:
    """True for a column that numbers the rows."""
    numbers = [_number(one, form) for one in column]
    return all(one is not None and other is not None and other >= one + 1.0 for one, other in pairwise(numbers))
