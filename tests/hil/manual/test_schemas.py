"""hil validate --schema: the JSON Schemas accept what the program accepts, and refuse what an editor should mark."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
from command_line import hil, refused

from hil.files.yaml_model import _read
from hil.manual.keys import EXAMPLES, FORMATS, example_files
from hil.manual.schemas import json_schema

FILES = example_files()


@pytest.mark.parametrize(("kind", "path"), FILES, ids=lambda value: value if isinstance(value, str) else value.stem)
def test_a_valid_file_is_valid_in_an_editor(kind: str, path: Path) -> None:
    jsonschema.validate(_read(path)[1], json_schema(kind))


@pytest.mark.parametrize("kind", FORMATS)
def test_the_command_prints_the_schema(kind: str, tmp_path: Path) -> None:
    ran = hil(tmp_path, "validate", "--schema", kind)
    assert ran.returncode == 0
    schema = json.loads(ran.stdout)
    assert schema == json_schema(kind)
    jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("lead_m: 0.010", "lead_mm: 10"),
        ("lead_m: 0.010", "lead_m: 10"),
        ("position_gain_1_s: 36.84", "position_gain_1_s: high"),
        ("model: two_mass", "model: three_mass"),
        ("interface: inprocess", "interface: bluetooth"),
    ],
)
def test_a_wrong_bench_is_marked(old: str, new: str, tmp_path: Path) -> None:
    text = (EXAMPLES / "bench-wrong-on-purpose.yaml").read_text()
    assert old in text
    path = tmp_path / "bench.yaml"
    path.write_text(text.replace(old, new))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(_read(path)[1], json_schema("bench"))
    refused(tmp_path, "validate", path.name)


@pytest.mark.parametrize("control", ["control: unknown", "control:", "control: {position_gain_1_s: unknown}"])
def test_an_unknown_law_is_valid(control: str, tmp_path: Path) -> None:
    axis = (EXAMPLES / "bench-screw-simple.yaml").read_text().split("control:")[0]
    path = tmp_path / "bench.yaml"
    path.write_text(f"{axis}{control}\n")
    jsonschema.validate(_read(path)[1], json_schema("bench"))
    assert hil(tmp_path, "validate", path.name).returncode == 0


def test_a_law_that_is_not_known_may_have_a_delay(tmp_path: Path) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text((EXAMPLES / "bench-seven-masses.yaml").read_text())
    assert hil(tmp_path, "validate", path.name).returncode == 0


def test_files_or_a_schema_but_not_both_nor_neither(tmp_path: Path) -> None:
    assert "give files to check, or --schema" in refused(tmp_path, "validate")
    assert "give files to check, or --schema" in refused(tmp_path, "validate", "a.yaml", "--schema", "map")
