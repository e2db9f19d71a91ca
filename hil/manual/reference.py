"""References as Markdown pages: commands, keys of the files, channels, mechanisms, effects of the simulated axis.

Each page is made from the code that it describes; nothing of it is written by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from drivers.sim.effects import EFFECTS, ParameterRange
from hil.channels import CHANNELS
from hil.manual.keys import FORMATS, Key, KeySection, sections
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Mechanism
from hil.twin.parameter import ANYWHERE, Parameter

_INTRODUCED = {
    "bench": "A bench file describes an axis: parameters, control law, encoders, drive and, if it is simulated, its "
    "true behaviour. `hil validate my-bench.yaml` checks one. The keys of `axis` may also stand at the top level.",
    "profile": "A profile file describes a motion: limits, and segments that run one after the other, each from rest "
    "to rest. `hil guide profile` shows how to write one.",
    "map": "A map file says which column of a foreign recording is which channel: value = sign × scale × factor of the "
    "unit × column + offset. `hil import` drafts one.",
}


def keys(kind: str) -> str:
    """All keys of a file format with unit, default, example and meaning."""
    text = [_INTRODUCED[kind]]
    text += ["", "A key without a default may be absent. `–`: a number without a unit.", ""]
    text += [f"`hil validate --schema {kind}` prints the JSON Schema of this format for your editor."]
    for section in sections(FORMATS[kind]):
        text += [
            "",
            f"## {_heading(section)}",
            "",
            section.about,
            "",
            *_table(_KEY_COLUMNS, map(_key_row, section.keys)),
        ]
    return "\n".join([*text, ""])


_KEY_COLUMNS = ("key", "unit", "default", "example", "meaning")


def _heading(section: KeySection) -> str:
    place = f"`{section.path}`" if section.path else "The file"
    return f"{place} with `{section.kind}`" if section.kind else place


def _key_row(key: Key) -> tuple[str, ...]:
    unit = "–" if key.unit == "1" else key.unit
    allowed = f"Allowed: {key.allowed}" if key.allowed else ""
    meaning = ". ".join(part for part in (key.meaning, allowed) if part)
    return _code(key.name), unit, _value(key.default), _value(key.example), meaning


def _value(text: str) -> str:
    return text if text in ("required", "see below") else _code(text)


def commands(group: Any) -> str:
    """All commands of the program (a click group) with their arguments and options."""
    text = [
        "Exit codes: 0 done, 1 an error that the message explains, 2 a wrong file or argument, 3 the drive did not "
        "confirm that its power is off (switch it off at the mains), 130 ctrl-C."
    ]
    for name, command in group.commands.items():
        arguments = [one for one in command.params if one.param_type_name == "argument"]
        options = [one for one in command.params if one.param_type_name == "option"]
        usage = " ".join([f"hil {name}", *(_argument(one) for one in arguments), *(["[OPTIONS]"] if options else [])])
        text += ["", f"## hil {name}", "", command.help or "", "", f"    {usage}"]
        if rows := [*map(_argument_row, arguments), *map(_option_row, options)]:
            text += ["", *_table(("argument", "default", "meaning"), rows)]
    return "\n".join([*text, ""])


def _argument(parameter: Any) -> str:
    name = (parameter.metavar or parameter.name.upper()).removesuffix("...")
    several = "..." if parameter.nargs == -1 else ""
    return f"{name}{several}" if parameter.required else f"[{name}{several}]"


def _argument_row(parameter: Any) -> tuple[str, ...]:
    return _code(_argument(parameter)), "required" if parameter.required else "", parameter.help or ""


def _option_row(parameter: Any) -> tuple[str, ...]:
    flag, default = parameter.is_flag, parameter.default
    name = " / ".join([*parameter.opts, *parameter.secondary_opts])
    if parameter.secondary_opts:
        default = (parameter.opts if default else parameter.secondary_opts)[0]
    hidden = (flag and not parameter.secondary_opts) or default is None or callable(default) or default == []
    named = name if flag else f"{name} {parameter.metavar or parameter.name.upper()}"
    return (
        _code(named),
        "" if hidden else _code(f"{default:g}" if isinstance(default, float) else str(default)),
        (parameter.help or ""),
    )


def channels() -> str:
    """All channels of a recording with unit, meaning and sign."""
    rows = [(_code(one.name), "–" if one.unit == "1" else one.unit, one.meaning, one.sign) for one in CHANNELS.values()]
    return "\n".join(
        [
            "A column is named by its quantity and its SI unit. The motor side is in rad and N m on a rotary axis, in "
            "m and N on a linear one.",
            "",
            *_table(("channel", "unit", "meaning", "positive if"), rows),
            "",
        ]
    )


def mechanisms(picture: Callable[[str], str] = lambda name: "") -> str:
    """All mechanisms with equation, source and parameters; `picture` gives the Markdown of the picture of an id."""
    text = ["The effects that a diagnosis can name and that a bench file may contain (`mechanisms`)."]
    text += ["Units are those of a rotary axis; a linear one has N for N m and m for rad.", ""]
    if picture(LIBRARY[0].id):
        text += ["A picture shows what a mechanism changes in closed loop on an axis that moves 100 mm there and back,"]
        text += ["slowly and fast. Its strength is up to three times what an engineer would call a defect.", ""]
    contents = [(f"[{_name(one)}](#{one.id})", one.block.value.replace("_", " "), one.element) for one in LIBRARY]
    text += _table(("mechanism", "block", "part of the axis"), contents)
    for mechanism in LIBRARY:
        text += ["", *_mechanism(mechanism, picture(mechanism.id))]
    return "\n".join([*text, ""])


def _name(mechanism: Mechanism) -> str:
    return mechanism.id.replace("_", " ").capitalize()


def _mechanism(mechanism: Mechanism, picture: str) -> list[str]:
    forms = [name for name in mechanism.forms if name]
    return [
        f"## {mechanism.id}",
        "",
        f"Part: {mechanism.element} (block {mechanism.block.value.replace('_', ' ')}).",
        *([f"Forms: {', '.join(map(_code, forms))}."] if forms else []),
        "",
        f"    {mechanism.equation}",
        "",
        f"Source: {mechanism.source}.",
        *(["", picture] if picture else []),
        "",
        *_table(("parameter", "unit", "allowed", "default", "role"), map(_parameter_row, mechanism.parameters)),
    ]


def _parameter_row(one: Parameter) -> tuple[str, ...]:
    low, high = (f"{bound:g}" if abs(bound) < ANYWHERE else "any" for bound in (one.low, one.high))
    default = "required" if one.default is None else _code(f"{one.default:g}")
    return (
        _code(one.name),
        one.dimension.unit().replace("1/rev", "per revolution"),
        f"{low} to {high}",
        default,
        one.role,
    )


def effects() -> str:
    """All effects that the simulated axis can have, for `simulation.effects` of a bench file."""
    text = ["What `simulation.effects` of a bench file may conceal in the simulated"]
    text += ["axis. On a linear axis n_m means N, rad means m. Without a form, the first one acts.", ""]
    rows = [
        (
            _code(name),
            one.physics,
            ", ".join(_code(form) for form in one.forms if form),
            "; ".join(f"`{parameter}`{_range(bounds)}" for parameter, bounds in one.parameters.items()),
        )
        for name, one in EFFECTS.items()
    ]
    return "\n".join([*text, *_table(("effect", "physics", "forms", "parameters: allowed, default"), rows), ""])


def _range(bounds: ParameterRange) -> str:
    low, high = (f"{bound:g}" for bound in (bounds.low, bounds.high))
    limits = "" if low == "-inf" and high == "inf" else f" ≥ {low}" if high == "inf" else f" {low} to {high}"
    return f"{limits} ({bounds.default:g})" if bounds.default is not None else limits


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


def _table(columns: Sequence[str], rows: Any) -> list[str]:
    """Lines of a Markdown table."""
    lines = [columns, ["---"] * len(columns), *rows]
    return ["| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in line) + " |" for line in lines]
