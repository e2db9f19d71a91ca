"""References: every key, command, channel, mechanism and effect is documented, with unit and example."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer
from pydantic import BaseModel

from drivers.sim.effects import EFFECTS
from hil.channels import CHANNELS
from hil.cli import COMMANDS, app
from hil.files.yaml_model import load_model
from hil.loop.simulated_bench import load_simulated
from hil.manual.keys import BELOW, FORMATS, example_files, sections
from hil.manual.topics import reference_page
from hil.quantities import UNITS
from hil.twin.library import LIBRARY

FILES = example_files()
GROUP = typer.main.get_command(app)


def models_of(model: type[BaseModel], found: dict[str, type[BaseModel]]) -> dict[str, type[BaseModel]]:
    """All models within a model, by their classes: another way than that of the reference."""
    if model.__name__ not in found:
        found[model.__name__] = model
        for field in model.model_fields.values():
            for inner in _within(field.annotation):
                models_of(inner, found)
    return found


def _within(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    value = getattr(annotation, "__value__", annotation)
    return [model for part in getattr(value, "__args__", ()) for model in _within(part)]


@pytest.mark.parametrize("kind", FORMATS)
def test_every_key_is_documented(kind: str) -> None:
    models = models_of(FORMATS[kind], {})
    documented = sections(FORMATS[kind])
    assert len(documented) == len(models)
    assert sum(len(section.keys) for section in documented) == sum(len(model.model_fields) for model in models.values())
    page = reference_page(f"{kind}-keys", GROUP)
    rows = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert sorted(rows) == sorted(name for model in models.values() for name in model.model_fields)


@pytest.mark.parametrize("kind", FORMATS)
def test_every_key_has_meaning_example_and_unit(kind: str) -> None:
    every = [(section, key) for section in sections(FORMATS[kind]) for key in section.keys]
    assert [key.name for _, key in every if not key.meaning.strip(" .")] == []
    assert [f"{section.path}.{key.name}" for section, key in every if not key.example] == []
    endings = {"_m": "m", "_s": "s", "_kg": "kg", "_hz": "Hz", "_n_m": "N m", "_m_s": "m/s", "_rad": "rad", "_n": "N"}
    plain = {name: unit for name, unit in endings.items() if unit in UNITS or unit in ("kg", "Hz", "m/s")}
    for _, key in every:
        if key.example != BELOW and any(key.name.endswith(ending) for ending in plain):
            assert key.unit not in ("", "1"), key.name


@pytest.mark.parametrize(("kind", "path"), FILES, ids=lambda value: value if isinstance(value, str) else value.stem)
def test_files_of_which_examples_are_taken_are_valid(kind: str, path: Path) -> None:
    model = load_simulated(path) if kind == "bench" else load_model(path, FORMATS[kind])
    assert isinstance(model, FORMATS[kind])


def test_every_command_and_option_is_documented() -> None:
    page = reference_page("commands", GROUP)
    assert re.findall(r"^## hil (\S+)", page, re.MULTILINE) == [name for name, _ in COMMANDS]
    for name, command in GROUP.commands.items():  # type: ignore[attr-defined]
        text = page.split(f"## hil {name}\n", 1)[1].split("\n## ", 1)[0]
        assert len(re.findall(r"^\| `", text, re.MULTILINE)) == len(command.params)
        assert all(option in text for parameter in command.params for option in parameter.opts if option[0] == "-")
        assert [parameter.name for parameter in command.params if not parameter.help] == []


def test_every_channel_mechanism_and_effect_is_documented() -> None:
    pages = {topic: reference_page(topic, GROUP) for topic in ("channels", "mechanisms", "effects")}
    assert re.findall(r"^\| `(\w+)`", pages["channels"], re.MULTILINE) == list(CHANNELS)
    assert re.findall(r"^\| `(\w+)`", pages["effects"], re.MULTILINE) == list(EFFECTS)
    assert re.findall(r"^## (\w+)", pages["mechanisms"], re.MULTILINE) == [one.id for one in LIBRARY]
    for mechanism in LIBRARY:
        text = pages["mechanisms"].split(f"## {mechanism.id}\n", 1)[1].split("\n## ", 1)[0]
        assert mechanism.equation in text
        assert f"Source: {mechanism.source}." in text
        assert all(f"`{name}`" in text for name in mechanism.names)


def test_mechanisms_have_their_pictures_where_they_can_be_shown() -> None:
    page = reference_page("mechanisms", GROUP, lambda name: f"![{name}]({name}.svg)")
    assert re.findall(r"^!\[(\w+)\]", page, re.MULTILINE) == [mechanism.id for mechanism in LIBRARY]
