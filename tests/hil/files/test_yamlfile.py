"""Every wrong file ends in one InputError that names file, line and field."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, model_validator

from hil.errors import FieldError, InputError, field_name
from hil.files.yaml_model import load_model, located


class Colour(StrEnum):
    RED = "red"
    GREEN = "green"


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Wheel(Part):
    kind: Literal["wheel"]
    radius_m: float = Field(gt=0, description="radius [m]")


class Arm(Part):
    kind: Literal["arm"]
    length_m: float = Field(gt=0)
    colour: Colour = Colour.RED


class Machine(Part):
    name: str
    node_id: int | None = None
    range_m: tuple[float, float] | None = None
    parts: tuple[Annotated[Wheel | Arm, Field(discriminator="kind")], ...] = ()
    spare: Arm | None = None

    @model_validator(mode="after")
    def _one_wheel_fits(self) -> Machine:
        for index, part in enumerate(self.parts):
            if isinstance(part, Wheel) and part.radius_m > 10:
                raise FieldError(("parts", index, "radius_m"), "given more than 10 m, allowed less")
        return self


def load(tmp_path: Path, text: str) -> Machine:
    path = tmp_path / "machine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_model(path, Machine)


def test_a_correct_file_gives_the_model(tmp_path: Path) -> None:
    machine = load(
        tmp_path,
        "name: on\nnode_id: 0x1F\nparts:\n- {kind: wheel, radius_m: 1e-3}\n- {kind: arm, length_m: 2, colour: green}\n",
    )
    assert machine == Machine(
        name="on",
        node_id=31,
        parts=(Wheel(kind="wheel", radius_m=0.001), Arm(kind="arm", length_m=2.0, colour=Colour.GREEN)),
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "name: a\nparts:\n- kind: wheel\n  radius_m: long\n",
            ":4: parts[0].radius_m: given 'long', allowed a valid number (radius [m]); correct the value",
        ),
        (
            "name: a\nparts:\n- kind: wheel\n  radius_m: '0.1'\n",
            ":4: parts[0].radius_m: given '0.1', allowed a valid number",
        ),
        ("name: a\nparts:\n- kind: wheel\n  radius_m: -1\n", ":4: parts[0].radius_m: given -1, allowed greater than 0"),
        (
            "name: a\nparts:\n- kind: wheel\n  radius_m: .nan\n",
            ":4: parts[0].radius_m: given nan, allowed a finite number",
        ),
        (
            "name: a\nparts:\n- kind: wheel\n  radius_m: .inf\n",
            ":4: parts[0].radius_m: given inf, allowed a finite number",
        ),
        (
            "name: a\nparts:\n\n- kind: wheel\n",
            ":4: parts[0].radius_m: given nothing, allowed a value (radius [m]); add this key",
        ),
        (
            "name: a\nparts:\n- kind: wheel\n  radius: 1\n  radius_m: 1\n",
            ":4: parts[0].radius: given an unknown key, allowed one of kind, radius_m; did you mean radius_m?",
        ),
        (
            "name: a\nparts:\n- kind: weel\n",
            ":3: parts[0].kind: given 'weel', allowed one of arm, wheel; did you mean wheel?",
        ),
        ("name: a\nparts:\n- length_m: 1\n", ":3: parts[0].kind: given nothing, allowed one of arm, wheel; choose one"),
        (
            "name: a\nparts:\n- {kind: arm, length_m: 1, colour: pink}\n",
            ":3: parts[0].colour: given 'pink', allowed 'red' or 'green'",
        ),
        (
            "name: a\nspare:\n  kind: arm\n  length_m: 1\n  x: 1\n",
            ":5: spare.x: given an unknown key, allowed one of kind, length_m",
        ),
        (
            "name: a\nparts:\n- kind: wheel\n  radius_m: 11\n",
            ":4: parts[0].radius_m: given more than 10 m, allowed less",
        ),
        ("name: 5\n", ":1: name: given 5, allowed a valid string"),
        ("name: a\nnode_id: 1.5\n", ":2: node_id: given 1.5, allowed a valid integer"),
        ("name: a\nname: b\n", ":2: name: given twice, allowed once; remove one"),
        ("name: &x a\n", ":1: given the anchor or alias 'x', allowed plain values"),
        ("name: a\nparts: *x\n", ":2: given the anchor or alias 'x', allowed plain values"),
        ("name: a\nparts: [1, 2\nnode_id: 3\n", ":3: broken YAML while parsing a flow sequence"),
        ("name: a\n  parts: 1\n", ":2: broken YAML"),
        ("name: a\n\tparts: 1\n", ":2: broken YAML"),
        ("name: !!python/object:os.system a\n", ":1: broken YAML"),
        ("name: a\n---\nname: b\n", ":2: broken YAML"),
        ("", ":1: given an empty file"),
        ("- 1\n", ":1: given a list, allowed a mapping of keys"),
        ("name: a\nrange_m: [1.0]\n", ":2: range_m: given a list of 1, allowed one more value; add it"),
        ("just text\n", ":1: given 'just text', allowed"),
        ("? [a, b]\n: 1\n", ":1: broken YAML"),
        ("name: \x07\n", ": not YAML text"),
        (
            "node_id: " + "9" * 5000 + "\n",
            ":1: given '9999999999999999999999999999999999999999', which is no int (Exceeds the limit",
        ),
        ('name: !!bool "x"\n', ":1: given 'x', which is no bool; correct the value"),
        ("name: !!float x\n", ":1: given 'x', which is no float (could not convert"),
        ("name: !!timestamp x\n", ":1: given 'x', which is no timestamp; correct the value"),
        ("[" * 3000, ": given hundreds of nested lists"),
    ],
)
def test_a_wrong_file_says_where_and_what(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert f"{tmp_path / 'machine.yaml'}{expected}" in message
    assert caught.value.exit_code == 2


def test_all_findings_come_in_the_order_of_lines_and_are_cut_when_many(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, "z: 1\nname: a\nnode_id: x\n")
    assert [line.split(":")[1] for line in str(caught.value).splitlines()] == ["1", "3"]
    with pytest.raises(InputError, match="and 4 more"):
        load(tmp_path, "name: a\n" + "".join(f"key{n}: 1\n" for n in range(12)))


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_model(tmp_path / "absent.yaml", Machine)
    with pytest.raises(InputError, match="Is a directory"):
        load_model(tmp_path, Machine)
    (tmp_path / "binary.yaml").write_bytes(b"name: \xff\xfe")
    with pytest.raises(InputError, match="byte 6 is not UTF-8"):
        load_model(tmp_path / "binary.yaml", Machine)


def test_an_error_found_later_is_located(tmp_path: Path) -> None:
    path = tmp_path / "machine.yaml"
    path.write_text("name: a\n\nparts:\n- kind: wheel\n  radius_m: 1\n")
    assert str(located(path, FieldError(("parts", 0, "radius_m"), "too small"))) == (
        f"{path}:5: parts[0].radius_m: too small"
    )


def test_field_errors_know_their_path() -> None:
    inner = FieldError(("to_m",), "too far")
    assert str(inner.inside("segments", 3)) == "segments[3].to_m: too far"
    assert field_name(("a", 0, 1, "b")) == "a[0][1].b"
