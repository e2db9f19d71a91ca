"""Read columns from an XML file of records, as recorders of controllers and logging programs write them:

<rec time="0.002" f1="1.5"/>                          values as attributes
<row><time>0.002</time><speed>1.5</speed></row>       values as elements
"""

from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, iterparse

from hil.files.input_file import check_values

_WHOLE_NAN = 0x7FF0_0000_0000_0000  # an IEEE 754 number without a value, whose bits were written as a whole number
# attributes of an element that tells of a column
_TITLES = ("description", "name", "bezeichnung", "nom", "nome", "nombre")
_UNITS = ("units", "unit", "unitstype", "einheit", "unite", "unita", "unidad", "uom")


def xml_columns(path: Path) -> tuple[dict[str, list[Any]], dict[str, str]]:
    """Values of the kind of record that stands most often, by name: a number, other text, or None where one has none.

    And their units. Attributes of an element with an id tell of the column of this name: SINUMERIK Trace writes
    <dataSignal id="f1" name="..." description="..." units="..."/> before <rec time="0" f1="1.5"/>.
    """
    records = dict[str, list[dict[str, str]]]()
    about = dict[str, dict[str, str]]()
    values = 0
    for _, element in iterparse(path):
        if not len(element) and not element.attrib:
            continue  # a value of the element around it
        record = element.attrib | {_tag(one): (one.text or "").strip() for one in element if not len(one)}
        if "id" in element.attrib:
            about[element.attrib["id"]] = {key.lower(): text for key, text in element.attrib.items()}
        elif record:
            records.setdefault(_tag(element), []).append(record)
            values += len(record)
            check_values(path, values, f"records with {values} values")
        element.clear()
    rows = max(records.values(), key=len, default=[])
    keys = list(dict.fromkeys(key for one in rows for key in one))
    check_values(path, len(rows) * len(keys), f"{len(rows)} records of {len(keys)} values")
    titles = {key: _first(about.get(key, {}), _TITLES) or key for key in keys}
    twice = Counter(titles.values())
    names = {key: title if twice[title] == 1 else f"{title} {key}" for key, title in titles.items()}
    units = {names[key]: unit for key in keys if (unit := _first(about.get(key, {}), _UNITS))}
    columns = [[_value(one.get(key, "")) for one in rows] for key in keys]
    if any(isinstance(value, str) for column in columns for value in column):  # texts of all tell their decimal mark
        columns = [
            [None if value is None else one[key] for value, one in zip(column, rows, strict=True)]
            for key, column in zip(keys, columns, strict=True)
        ]
    return {names[key]: column for key, column in zip(keys, columns, strict=True)}, units


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2]  # without its namespace


def _first(given: dict[str, str], keys: tuple[str, ...]) -> str:
    return next((text for key in keys if (text := given.get(key, "").strip())), "")


def _value(text: str) -> float | str | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        return text
    return None if value >= _WHOLE_NAN else value
