"""Read datasets of an HDF5 file with h5py, an optional library."""

import re
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import InputError
from hil.files.input_file import check_values, parsing
from hil.files.optional_library import optional_library
from hil.importing.channel_groups import Group, as_seconds, one_length
from hil.importing.column_names import label
from hil.importing.lexicon import Quantity
from hil.importing.number_form import NumberForm, numbers_of
from hil.importing.units import unit_named

# names of attributes, in lower case
_NAMES = ("path", "name", "label", "title")
_SAYS_NOTHING = re.compile(r"[A-Za-z]{0,2}\d+|[XY]")  # Y3, ch2, 7
_UNITS = ("unit", "units")
_FACTORS, _OFFSETS = ("scale_factor",), ("add_offset",)  # of the conventions CF for netCDF
_OF_WHOLE, _OFFSETS_OF_WHOLE = ("scale", "factor"), ("offset",)  # other numbers may hold them already
_MISSING = ("_fillvalue", "missing_value")


def load_hdf5(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Datasets and fields of tables by name, texts, and attributes of their groups, of the root and of folders beside.

    Units, factors and missing values are those of the attributes of a dataset, of which other numbers are read too. An
    attribute with different values in several places is left out. Links to other files are not followed.
    Raises InputError: damaged, too many values, or h5py is not installed.
    """
    library = optional_library(path, "h5py", "h5py", "exchange")
    with parsing(path, "HDF5 file"), library.File(path, "r") as file:
        every = list[Any]()
        file.visititems(lambda name, one: every.append(one))
        datasets = [one for one in every if _is_own(library, one)]
        values = sum(one.size * max(1, one.dtype.itemsize // 8) for one in datasets)
        check_values(path, values, f"datasets of {values} values")
        groups = dict[str, list[Any]]()
        for one in datasets:
            folder = one.parent.name if one.dtype.names is None else one.name
            if not folder.startswith("/#"):  # what MATLAB refers to by pointers
                groups.setdefault(folder, []).append(one)
        read = [group for name, members in groups.items() for group in _groups(library, name, members)]
        folders = [one for one in every if isinstance(one, library.Group)]
        of_data = [file, *(one for one in folders if one.name in groups)]
        told = _attributes(of_data)  # goes before that of a dataset, and this before that of another folder
        of_values = {*told, *_MISSING, *_FACTORS, *_OFFSETS, *_OF_WHOLE, *_OFFSETS_OF_WHOLE}
        told |= _attributes(datasets, of_values, texts=False)
        told |= _attributes([one for one in folders if _is_beside(one.name, groups)], set(told))
        texts = {name: np.array(*values) for name, values in told.items() if len(values) == 1}
    arrays, units = one_length(path, read)
    return texts | arrays, units


def _attributes(of: Sequence[Any], known: Collection[str] = (), texts: bool = True) -> dict[str, set[Any]]:
    """Values of the attributes of folders or datasets that are numbers or texts, by a name that is not known yet."""
    kinds, found = (int, float, np.integer, np.floating, *((str,) if texts else ())), dict[str, set[Any]]()
    for one in of:
        for name, value in one.attrs.items():
            if isinstance(value, kinds) and name not in known and name.lower() not in known:
                found.setdefault(name, set()).add(value)
    return found


def _is_beside(folder: str, data: Collection[str]) -> bool:
    """True for a folder without data beside all data, or beside a folder that holds all: /nameplate of /trace.

    What lies beside some of the data alone is of another axis or device.
    """
    above = folder.rpartition("/")[0] + "/"
    return folder not in data and all(f"{name}/".startswith(above) for name in data)


def _is_own(library: Any, one: Any) -> bool:
    """True for a dataset whose values are in this file."""
    return isinstance(one, library.Dataset) and one.shape is not None and not one.external and not one.is_virtual


def _groups(library: Any, name: str, datasets: list[Any]) -> list[Group]:
    """Datasets of one folder: those on its clock, which comes first, and the others."""
    channels, units, names = dict[str, Any](), dict[str, str](), _names(datasets)
    for one in datasets:
        key = names[one.name]
        if library.check_string_dtype(one.dtype) is not None:
            if one.size == 1:
                channels[key] = np.array(_text(one[()]))
            continue
        read = _matlab(one)
        given = {key: read} if read.dtype.names is None else {field: read[field] for field in read.dtype.names}
        for own, values in given.items():
            units[own] = _first_text(one.attrs, _UNITS)
            channels[own] = _scaled(one, own, values, units[own])
    rows = {own: len(values) for own, values in channels.items() if values.dtype.kind in "fiub" and values.size > 1}
    clocks = [own for own in rows if label(own, units.get(own, "")).quantity is Quantity.TIME]
    on_clock = [own for own in dict.fromkeys([*clocks, *rows]) if clocks and rows[own] == rows[clocks[0]]]
    on_clock = on_clock if len(on_clock) > 1 else []  # a clock alone is that of other folders
    rest = [own for own in channels if own not in on_clock]
    folder = name.strip("/").replace("/", ".") or "root"
    return [
        Group(folder, {own: channels[own] for own in names}, units, has_clock)
        for names, has_clock in ((on_clock, True), (rest, False))
    ]


def _names(datasets: list[Any]) -> dict[str, str]:
    """Names of the datasets of a folder by their paths: their own, or by an attribute if they say nothing, as Y3.

    The first attribute counts that no other dataset has, too.
    """
    names = {one.name: one.name.rpartition("/")[2] for one in datasets}
    told = {one.name: [_first_text(one.attrs, [key]) for key in _NAMES] for one in datasets}
    given = Counter(text for texts in told.values() for text in set(texts))
    for path, texts in told.items():
        own = next((text for text in texts if text and given[text] == 1 and text not in names.values()), "")
        names[path] = own if own and _SAYS_NOTHING.fullmatch(names[path]) else names[path]
    return names


def _matlab(dataset: Any) -> Any:
    """Values of a dataset; those of MATLAB (.mat of version 7.3) are transposed, and its texts are numbers."""
    kind = _text(dataset.attrs.get("MATLAB_class", ""))
    values = dataset[()]
    if kind == "char":
        return np.array("".join(map(chr, np.asarray(values).T.reshape(-1))))
    return np.asarray(values).T if kind else values


def _scaled(dataset: Any, name: str, values: Any, unit: str) -> Any:
    """Values in a unit with the factor and offset of the attributes, NaN where they say that one is missing.

    Raises InputError: a factor of whole numbers that is no number but 0, or two different ones.
    """
    values = np.asarray(values)
    if values.dtype.kind == "M":
        return as_seconds(values)
    if values.dtype.kind not in "fiub":
        return values
    known = unit_named(unit) if unit else label(name).unit
    raw = values.dtype.kind in "iu" and known not in (None, "counts")  # else the unit is that of the numbers
    factors, offsets = (*_FACTORS, *(_OF_WHOLE if raw else ())), (*_OFFSETS, *(_OFFSETS_OF_WHOLE if raw else ()))
    given = dict.fromkeys(_numbers(dataset.attrs, factors))
    if len(given) > 1 or any(not np.isfinite(one) or not one for one in given):
        told, place = ", ".join(f"{one:g}" for one in given), f"{dataset.file.filename}: {dataset.name}"
        raise InputError(f"{place}: given the factor {told}, allowed one finite number but 0; correct the attribute")
    factor, offset = next(iter(given), 1.0), next(iter(_numbers(dataset.attrs, offsets)), 0.0)
    bad = np.isin(values, [one for one in _numbers(dataset.attrs, _MISSING) if np.isfinite(one)])
    if bad.any():
        values = np.where(bad, np.nan, values.astype(np.float64))
    return values if (factor, offset) == (1.0, 0.0) else factor * values.astype(np.float64) + offset


def _numbers(attributes: Any, names: Sequence[str]) -> list[float]:
    """Attributes of some names that are numbers, also as texts; NaN of another text."""
    found = []
    for value in _named(attributes, names):
        number = np.asarray(value)
        if number.size == 1 and number.dtype.kind in "fiub":
            found.append(float(number.reshape(-1)[0]))
        elif text := _text(value):
            found.append(float(numbers_of([text], NumberForm())[0][0]))
    return found


def _first_text(attributes: Any, names: Sequence[str]) -> str:
    return next((text for value in _named(attributes, names) if (text := _text(value))), "")


def _named(attributes: Any, names: Sequence[str]) -> list[Any]:
    """Values of the attributes of some names, of which one is in lower case, in the order of these."""
    given = [(name, key) for name in names for key in attributes if key.lower() == name]
    return [attributes[key] for _, key in given]


def _text(value: Any) -> str:
    """A text, which libraries store as text, bytes, or an array of one of them."""
    one = np.asarray("" if getattr(value, "shape", ()) is None else value).reshape(-1)  # h5py.Empty has none
    first = one[0] if one.size else ""
    return first.decode(errors="replace") if isinstance(first, bytes) else str(first)
