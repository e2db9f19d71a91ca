"""EDS files in the dialects of makers: any dress of a clean file gives the same object dictionary."""

from __future__ import annotations

import contextlib
import io
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ObjectDictionary, ODVariable
from canopen.objectdictionary.eds import import_eds
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.eds_file import read_eds
from drivers.eds_text import MOST_BYTES, EdsError, node_formula, number
from drivers.sdo_setup import EDS_FOLDER

CLEAN = """[FileInfo]
FileName=small.eds

[DeviceInfo]
VendorName=Acme
VendorNumber=0x00000123
ProductName=Drive 7
ProductNumber=77
RevisionNumber=0x00010002
BaudRate_500=1
BaudRate_1000=1
SimpleBootUpSlave=1
NrOfRXPDO=1

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=1
Dummy0004=0
Dummy0005=0
Dummy0006=0
Dummy0007=0

[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0

[1008]
ParameterName=Name
ObjectType=0x7
DataType=0x0009
AccessType=const
DefaultValue=Drive 7
PDOMapping=0

[1018]
ParameterName=Identity
ObjectType=0x9
SubNumber=3

[1018sub0]
ParameterName=Number of entries
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=2
PDOMapping=0

[1018sub1]
ParameterName=Vendor
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00000123
PDOMapping=0

[1018subA]
ParameterName=Extra
ObjectType=0x7
DataType=0x0007
AccessType=ro
PDOMapping=0

[1800]
ParameterName=TPDO
ObjectType=0x9
SubNumber=2

[1800sub0]
ParameterName=Number of entries
ObjectType=0x7
DataType=0x0005
AccessType=const
DefaultValue=1
PDOMapping=0

[1800sub1]
ParameterName=COB-ID
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x40000180
PDOMapping=0

[6064]
ParameterName=Größe in µm: Lage = 2°
ObjectType=0x7
DataType=0x0004
AccessType=ro
DefaultValue=0
PDOMapping=1

[6098]
ParameterName=Homing method
ObjectType=0x7
DataType=0x0002
LowLimit=-4
HighLimit=37
AccessType=rw
DefaultValue=-3
PDOMapping=0
"""


def content(dictionary: ObjectDictionary) -> dict[Any, Any]:
    """All that a client needs of a dictionary, comparable."""
    found: dict[Any, Any] = dict(vars(dictionary.device_information))
    for entry in dictionary.values():
        for v in [entry] if isinstance(entry, ODVariable) else entry.values():
            found[v.index, v.subindex] = (
                v.name, v.data_type, v.access_type, v.pdo_mappable, v.min, v.max, v.default, v.value, v.relative
            )  # fmt: skip
    return found


def read(folder: Path, data: bytes | str) -> Any:
    path = folder / "x.eds"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return read_eds(path, 9)


def blocks(text: str) -> list[str]:
    return [block for block in text.split("\n\n") if block.strip()]


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


@pytest.mark.parametrize("text", ["", "abc", "0x", "0xG", "1e5", "1.5", "--1", "1 2x", "$NODEID+1", "٣", "9" * 30])
def test_what_is_no_number(text: str) -> None:
    assert number(text) is None


# -- what is left in doubt is said ------------------------------------------------------------------------------------


def test_of_keys_with_two_values_the_last_counts_and_is_named(tmp_path: Path) -> None:
    eds = read(tmp_path, CLEAN + "\n[6098]\nDataType=0x0003\nParameterName=Other\nHighLimit=\n")
    assert eds.dictionary[0x6098].data_type == 3
    assert eds.dictionary[0x6098].max == 37
    last = CLEAN.count("\n") + 3
    (note,) = eds.notes
    assert note.startswith(f"line {last}: [6098] datatype is 0x0003, and 0x0002 in line ")
    assert note.endswith("; the last counts")


def test_a_leading_zero_of_the_identity_is_decimal_and_said(tmp_path: Path) -> None:
    eds = read(tmp_path, CLEAN.replace("ProductNumber=77", "ProductNumber=0077"))
    assert eds.dictionary.device_information.product_number == 77
    assert eds.notes == ("line 8: ProductNumber=0077 is read as 77, not as octal 63",)


def test_an_identity_that_is_no_number_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match=r"x\.eds, line 6: \[DeviceInfo\] VendorNumber is no number; given: Acme"):
        read(tmp_path, CLEAN.replace("0x00000123", "Acme", 1))


# -- what CiA 306 leaves out ------------------------------------------------------------------------------------------


def test_compact_sub_indices_are_written_out(tmp_path: Path) -> None:
    compact = """
[2000]
ParameterName=Gain
ObjectType=8
DataType=0x0003
AccessType=rw
DefaultValue=0xFFFD
PDOMapping=1
CompactSubObj=3
[2000Name]
NrOfEntries=1
2=Second
[2000Value]
NrOfEntries=1
3=7
"""
    gain = read(tmp_path, CLEAN + compact).dictionary[0x2000]
    assert [(v.subindex, v.name, v.data_type, v.default, v.value) for v in gain.values()] == [
        (0, "Number of entries", 5, 3, None), (1, "Gain1", 3, -3, None), (2, "Second", 3, -3, None),
        (3, "Gain3", 3, -3, 7),
    ]  # fmt: skip
    assert 4 not in gain


ARRAY = "[2005]\nObjectType=8\nDataType=3\n[2005sub1]\nParameterName=First\n"


def test_types_that_the_file_defines_or_leaves_out(tmp_path: Path) -> None:
    more = "[A0]\nParameterName=Limited\n[A0sub1]\nDefaultValue=0x06\n[2001]\nDataType=0xA0\n[2002]\nObjectType=2\n"
    eds = read(tmp_path, CLEAN + more + "[2003]\nDataType=0xB0\nDefaultValue=4\n[2004sub0]\nAccessType=R\n" + ARRAY)
    assert eds.dictionary.get_variable(0x2005, 1).data_type == 3
    types = {index: eds.dictionary.get_variable(index, 0).data_type for index in range(0x2001, 0x2005)}
    assert types == {0x2001: 6, 0x2002: 15, 0x2003: 15, 0x2004: 5}


def test_no_sub_index_is_made_up(tmp_path: Path) -> None:
    eds = read(tmp_path, CLEAN.replace("ObjectType=0x9", "ObjectType=0x8"))
    assert eds.dictionary.get_variable(0x1800, 1) is not None
    assert eds.dictionary.get_variable(0x1800, 5) is None


# -- no EDS -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "line 1: is no EDS file.*given: an empty file"),
        (bytes(5000), "line 1: is no EDS file.*given: an empty file"),
        (b"\x7fELF\x02\x01" + bytes(range(256)) * 40, "line 1: is no EDS file"),
        (b"axis:\n  model: rigid\n", "line 1: is no EDS file.*given: 'axis:'"),
        (b'<?xml version="1.0"?>\n<ISO15745Profile/>\n', r"line 1: is no EDS file.*given: '<\?xml"),
        (b"[FileInfo]\nFileName=x.eds\n", "line 1: is no EDS file"),
        (b"".join(b"[%04X]\nCompactSubObj=254\nDataType=7\n" % k for k in range(0x2000, 0x3000)), "more than 20000"),
        (b" " * (MOST_BYTES + 1), f"given: {MOST_BYTES + 1} bytes; allowed: up to {MOST_BYTES}"),
    ],
)
def test_a_file_that_is_no_eds_is_refused_in_one_sentence(tmp_path: Path, data: bytes, said: str) -> None:
    with pytest.raises(EdsError, match=rf"x\.eds.*{said}") as refused:
        read(tmp_path, data)
    assert len(str(refused.value).splitlines()) == 1


def test_folders_and_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="is a folder"):
        read_eds(tmp_path, 9)
    with pytest.raises(EdsError, match="cannot be read"):
        read_eds(tmp_path / "none.eds", 9)
    with pytest.raises(EdsError, match="no regular file"):
        read_eds(Path("/dev/zero"), 9)


@settings(deadline=None, max_examples=60)
@given(cut=st.integers(0, len(CLEAN)), at=st.integers(0, len(CLEAN)), more=st.binary(max_size=12), wide=st.booleans())
def test_a_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, cut: int, at: int, more: bytes, wide: bool
) -> None:
    data = CLEAN.encode("utf-16" if wide else "utf-8")[: 2 * cut]
    with contextlib.suppress(EdsError):
        read(tmp_path_factory.getbasetemp(), data[:at] + more + data[at:])
