"""Write bench.diagnosed.yaml: the owner's bench file with what a diagnosis found, each change explained at its line.

What the diagnosis doubts is in comments. The section `simulation` is the stand-in of the machine, which a diagnosis
does not change: where the simulated axis takes values from `axis` that the diagnosis corrects, the former ones are
written into it. So the next run moves the same machine as before, beside the better twin.
"""

import json
import textwrap
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from hil.bench.bench_file import Bench, load_bench
from hil.bench.hardware import SimulationSection
from hil.diagnosis.diagnosis import Diagnosis
from hil.diagnosis.wording import title, whole_name
from hil.errors import InputError
from hil.files.output import write_text
from hil.files.yaml_edit import YamlChange, comment_lines, root_keys, with_changes, with_items, without_item
from hil.report.changed_values import changed_values
from hil.report.compare_report import bench_text
from hil.report.found_mechanisms import FoundItem, found_items

MECHANISMS = "mechanisms"
STAND_IN = "stands in for the machine that was recorded; a diagnosis does not change it, hil run moves it"


def write_diagnosed_bench(
    diagnosis: Diagnosis, path: Path, source: Path | None = None, machine: SimulationSection | None = None
) -> None:
    """Write the bench of a diagnosis as a copy of the bench file `source`, whose comments and order stay.

    Without `source`, or where its layout cannot be changed by lines, the bench is written anew. `machine`: the
    simulated axis that was recorded, if it is not that of the bench.
    """
    given = diagnosis.reported.judged.tested.searched.prepared.bench_file
    items, dropped = found_items(diagnosis), _dropped(diagnosis, given)
    values = changed_values(diagnosis, given)
    if items or dropped or any(one.value is not None for one in values):
        name = f"{given.name.removesuffix('_diagnosed')}_diagnosed"
        values.append(YamlChange(("name",), name if name.isidentifier() else json.dumps(name), ""))
    values += _of_machine(given, values, machine)
    expected = _expected(given, values, items, dropped)
    heading = _heading(diagnosis, given, items)
    attempts = [(source.read_text(encoding="utf-8"), values, dropped)] if source else []
    left = [one for one in values if one.path[:2] not in [(MECHANISMS, at) for at in dropped]]
    attempts.append((bench_text(_expected(given, [], [], dropped)), [_moved(one, dropped) for one in left], []))
    for text, changes, gone in attempts:
        with suppress(ValueError, yaml.YAMLError, InputError):  # a layout that cannot be changed by lines
            write_text(path, heading + _edited(text, changes, items, gone))
            if load_bench(path) == expected:
                return
    write_text(path, heading + bench_text(expected))


def _edited(text: str, values: Sequence[YamlChange], items: Sequence[FoundItem], dropped: Sequence[int]) -> str:
    keys = root_keys(text)
    lifted = () if "axis" in keys else ("axis",)  # an axis file: its keys stand at the top level
    text = with_changes(text, [one._replace(path=one.path[1:]) if one.path[:1] == lifted else one for one in values])
    for at in sorted(dropped, reverse=True):
        text = without_item(text, MECHANISMS, at, "taken out, because of what was found:")
    new = "".join(item.text for item in items)
    if MECHANISMS in keys or not all(item.doubt for item in items):
        return with_items(text, MECHANISMS, new) if items else text
    return f"{text.rstrip()}\n{comment_lines(f'{MECHANISMS}:')}{new}" if items else text


def _expected(given: Bench, values: Sequence[YamlChange], items: Sequence[FoundItem], dropped: Sequence[int]) -> Bench:
    """The bench that the file must say."""
    data: Any = given.model_dump()
    for change in values:
        if change.value is not None:
            place = data
            for part in change.path[:-1]:
                place = place[part]
            key, value = change.path[-1], change.value
            if key == "name":
                value = yaml.safe_load(value)
            elif change.path[0] != "simulation":
                value = _number(value, place[key])
            place[key] = value
    kept = [entry for at, entry in enumerate(data[MECHANISMS]) if at not in dropped]
    data[MECHANISMS] = [*kept, *(item.entry.model_dump() for item in items if not item.doubt)]
    return Bench.model_validate(data)


def _number(value: Any, before: Any) -> Any:
    """A value of a change as the bench has it; a mapping is merged with that before."""
    if isinstance(value, dict):
        return before | {key: _number(entry, before[key]) for key, entry in value.items()}
    with suppress(ValueError):
        return float(value)
    return value


def _dropped(diagnosis: Diagnosis, given: Bench) -> list[int]:
    """Indices of mechanisms of the bench that a term replaces."""
    kept = [entry.effect for entry in diagnosis.final.hypothesis.kept]
    dropped = []
    for at, entry in enumerate(given.mechanisms):
        if entry.effect in kept:
            kept.remove(entry.effect)
        else:
            dropped.append(at)
    return dropped


def _moved(change: YamlChange, dropped: Sequence[int]) -> YamlChange:
    """A change of a list from which items were taken."""
    at = change.path[1] if len(change.path) > 1 else None
    if not isinstance(at, int):
        return change
    return change._replace(path=(change.path[0], at - sum(one < at for one in dropped), *change.path[2:]))


def _of_machine(given: Bench, values: Sequence[YamlChange], machine: SimulationSection | None) -> list[YamlChange]:
    """The simulated axis stays what it was, though it takes from `axis` what it does not say itself."""
    before = given.simulation
    if before is None:
        return []
    wanted = machine or before
    changed = [str(one.path[1]) for one in values if one.path[0] == "axis" and one.value is not None]
    former = {name: getattr(given.axis, name) for name in changed} | wanted.axis
    after = wanted.model_copy(update={"axis": former})
    brief = after.model_dump(mode="json", exclude_defaults=True)
    changes = [
        YamlChange(("simulation", key), brief.get(key, value), "")
        for key, value in after.model_dump(mode="json").items()
        if value != before.model_dump(mode="json")[key]
    ]
    return [YamlChange(("simulation",), None, STAND_IN), *changes]


def _heading(diagnosis: Diagnosis, given: Bench, items: Sequence[FoundItem]) -> str:
    result = diagnosis.result
    names = ", ".join(dict.fromkeys(whole_name(run.name) for run in diagnosis.train.runs))
    lines = [f"Bench {given.name} after a diagnosis of {names}. {result.statement}"]
    lines.append(
        "Changed values have their standard error (+-), at whose second digit they are rounded, and the value before."
    )
    if any(item.doubt for item in items):
        lines.append("What is doubtful is in comments, with the reason; take it out of them to use it.")
    events = [one.effect for one in result.findings if one.windows]
    if events:
        lines.append(f"Not in this file, as another recording has it not: {', '.join(map(title, events))}.")
    plain = ("".join(sign if sign.isprintable() else " " for sign in line) for line in lines)
    return "".join(comment_lines(textwrap.fill(line, 110)) for line in plain) + "#\n"
