"""EDS files in the dialects of makers: any dress of a clean file gives the same object dictionary."""

from __future__ import annotations

import io
import random
import re
from collections.abc import Callable

import canopen
import pytest
from canopen.objectdictionary.eds import import_eds
from clean_eds import CLEAN, blocks, content, read
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.eds_file import read_eds
from drivers.eds_text import node_formula, number, octal
from drivers.sdo_setup import EDS_FOLDER


def each_line(change: Callable[[str, str], str]) -> Callable[[str, random.Random], str]:
    """Change every `key=value`."""

    def dress(text: str, rng: random.Random) -> str:
        return re.sub(r"(?m)^([^\[=\n]+)=(.*)$", lambda m: change(m[1], m[2]), text)

    return dress


def each_number(form: Callable[[int, random.Random], str]) -> Callable[[str, random.Random], str]:
    """Write every integer in another form."""

    def dress(text: str, rng: random.Random) -> str:
        return re.sub(r"(?m)=(-?(?:0x[0-9A-F]+|\d+))$", lambda m: f"={form(int(m[1], 0), rng)}", text)

    return dress


def head(form: Callable[[str], str]) -> Callable[[str, random.Random], str]:
    return lambda text, rng: re.sub(r"(?m)^\[(.*)\]$", lambda m: form(m[1]), text)


def shuffled(text: str, rng: random.Random) -> str:
    parts = blocks(text)
    rng.shuffle(parts)
    return "\n\n".join(parts) + "\n"


def doubled_section(text: str, rng: random.Random) -> str:
    return text + "\n" + rng.choice(blocks(text)) + "\n"


def doubled_key(text: str, rng: random.Random) -> str:
    return re.sub(r"(?m)^(DataType=.*|AccessType=.*)$", r"\1\n\1", text)


OTHER_TOOLS = (
    "\n[Tool.Add-In]\nDataType=abc\n[Bed]\nx=1\n[Dead subset]\n[Face]\n[M1SubExt1027]\n[1000ObjectLinks]\nx=0\n"
)
DRESSES: dict[str, Callable[[str, random.Random], str]] = {
    "upper-case keys": each_line(lambda key, value: f"{key.upper()}={value}"),
    "lower-case keys": each_line(lambda key, value: f"{key.lower()}={value}"),
    "spaces": each_line(lambda key, value: f"  {key} =\t{value}  "),
    "comments behind": each_line(lambda key, value: f"{key}={value} ; as the manual says = here"),
    "empty values": lambda text, rng: text.replace("PDOMapping=0\n", "PDOMapping=\n"),
    "no ObjectType": lambda text, rng: text.replace("ObjectType=0x7\n", ""),
    "empty limits": lambda text, rng: text.replace("DefaultValue=0\n", "LowLimit=\nHighLimit=\nDefaultValue=0\n"),
    "decimal": each_number(lambda value, rng: str(value)),
    "leading zeros": each_number(lambda value, rng: f"{'-' * (value < 0)}0x{abs(value):08x}"),
    "quotes": each_number(lambda value, rng: f'"{value}"'),
    "comment at once": each_number(lambda value, rng: f"{value};0x7"),
    "fraction": each_number(lambda value, rng: f"{value}.0" if value == 0 else str(value)),
    "formula": lambda text, rng: text.replace("$NODEID+0x40000180", "0x40000180 + $NodeID"),
    "upper-case heads": head(lambda name: f"[{name.upper()}]"),
    "lower-case heads": head(lambda name: f"[{name.lower()}]"),
    "zeros in heads": head(lambda name: f"[{re.sub(r'^(?=1|6)', '00', name)}]".replace("sub", "sub0")),
    "0x in heads": head(lambda name: f"[ {re.sub(r'^(?=1|6)', '0x', name)} ] ; object"),
    "open heads": head(lambda name: f"[{name}"),
    "lines without =": lambda text, rng: text.replace("\n\n", "\nThis line says nothing\n\n"),
    "comment lines": lambda text, rng: text.replace("\n\n", "\n; DataType=1\n# DataType=2\n\n"),
    "doubled keys": doubled_key,
    "doubled section": doubled_section,
    "shuffled": shuffled,
    "other tools": lambda text, rng: text + OTHER_TOOLS,
    "no file information": lambda text, rng: "\n\n".join(blocks(text)[1:]) + "\n",
    "wrong counts": lambda text, rng: re.sub(r"(SupportedObjects|SubNumber)=\d", r"\1=99", text),
    "record called array": lambda text, rng: text.replace("ObjectType=0x9", "ObjectType=0x8"),
    "no records": lambda text, rng: re.sub(r"\[1(018|800)\]\n.*\nObjectType=0x9\n.*\n", "", text),
}  # fmt: skip
ENCODINGS = {
    "plain": str.encode,
    "BOM": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 BE": lambda text: b"\xfe\xff" + text.encode("utf-16-be"),
    "UTF-16 without mark": lambda text: text.encode("utf-16-le"),
    "cp1252": lambda text: b"; \x81\n" + text.encode("cp1252"),
    "NULs at the end": lambda text: text.encode() + b"\x1a" + bytes(300),
}
ENDS = ["\n", "\r\n", "\r", "\r\r\n"]


@settings(deadline=None, max_examples=150)
@given(
    names=st.lists(st.sampled_from(sorted(DRESSES)), unique=True, max_size=6),
    encoding=st.sampled_from(sorted(ENCODINGS)),
    end=st.sampled_from(ENDS),
    seed=st.integers(0, 99),
)
def test_any_dress_gives_the_same_dictionary(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], encoding: str, end: str, seed: int
) -> None:
    folder, rng, text = tmp_path_factory.getbasetemp(), random.Random(seed), CLEAN
    for name in sorted(names, key=list(DRESSES).index):
        text = DRESSES[name](text, rng)
    eds = read(folder, ENCODINGS[encoding](text.replace("\n", end)))
    assert content(eds.dictionary) == content(import_eds(io.StringIO(CLEAN), 9))
    assert eds.notes == ()


@pytest.mark.parametrize("name", sorted(DRESSES))
def test_each_dress_changes_the_text(name: str) -> None:
    assert DRESSES[name](CLEAN, random.Random(1)) != CLEAN


@pytest.mark.parametrize("name", ["servo_drive.eds", "linear_encoder.eds"])
def test_a_clean_file_is_read_as_canopen_reads_it(name: str) -> None:
    eds = read_eds(EDS_FOLDER / name, 9)
    assert content(eds.dictionary) == content(canopen.import_od(str(EDS_FOLDER / name), node_id=9))
    assert eds.notes == ()


@given(value=st.integers(-(2**63), 2**64 - 1), zeros=st.integers(0, 3))
def test_numbers_in_every_form(value: int, zeros: int) -> None:
    sign, size = "-" * (value < 0), abs(value)
    if len(f"{size}") + zeros <= 20:
        assert number(f" {sign}{'0' * zeros}{size} ") == value
    assert number(f"{sign}0x{size:X}") == number(f"'{sign}0x{size:x}' // x") == value
    if value >= 0:
        assert node_formula(f"$NODEID+0x{value:X}") == node_formula(f"{value} + $NodeId;x") == value


@pytest.mark.parametrize(("text", "offset"), [
    ("$NODEID", 0), ('"$nodeid" ; alone', 0), ("$NODEID+", 0), ("0x180", None), ("$NODEID+abc", None)])  # fmt: skip
def test_the_node_id_alone_is_a_formula(text: str, offset: int | None) -> None:
    assert node_formula(text) == offset


@pytest.mark.parametrize("text", ["", "abc", "0x", "0xG", "1e5", "1.5", "--1", "1 2x", "$NODEID+1", "٣", "9" * 30])
def test_what_is_no_number(text: str) -> None:
    assert number(text) is None


@pytest.mark.parametrize(("text", "value"), [
    ("077", 63), ("'0010' ; ten", 8), ("0" * 19 + "7", 7), ("0" * 20 + "7", None), ("08", None), ("77", None),
    ("0", None), ("0x7", None), ("", None),
])  # fmt: skip
def test_a_leading_zero_may_mean_octal(text: str, value: int | None) -> None:
    assert octal(text) == value
