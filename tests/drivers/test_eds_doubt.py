"""EDS files that say a thing twice, leave it out, or are none: what is read then, what is said, what is refused."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from clean_eds import CLEAN, read
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.eds_file import read_eds
from drivers.eds_text import MOST_BYTES, EdsError


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
    eds, at = read(tmp_path, CLEAN + compact), CLEAN.count("\n") + 2
    assert eds.where(0x2000, 0) == f"line {at}: [2000] CompactSubObj"
    assert eds.where(0x2000, 3) == f"line {at + 3}: [2000] DataType=0x0003 (INTEGER16)"
    assert eds.where(0x2000, 4) == "0x2000:04 has no DataType"
    gain = eds.dictionary[0x2000]
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
    with pytest.raises(EdsError, match=r"none\.eds: cannot be read \(No such file or directory\)"):
        read_eds(tmp_path / "none.eds", 9)
    with pytest.raises(EdsError, match=r"cannot be read \(.*null byte\)"):
        read_eds(tmp_path / "no\0ne.eds", 9)
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
