"""EDS files that a bench names: `hil validate` and `hil run` read them before anything else, and say what is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import hil, refused

from drivers.sdo_setup import EDS_FOLDER
from hil.files.shipped import shipped_files

PROFILE = Path(__file__).parents[3] / "profiles" / "jog.yaml"
DRIVE = (EDS_FOLDER / "servo_drive.eds").read_text()
POSITION = "ParameterName=Position actual value\nObjectType=0x7\nDataType=0x0004"


def bench(folder: Path, eds: Path, encoder: Path | None = None) -> Path:
    path = folder / "mine.yaml"
    text, lines = shipped_files("bench")["reference"].read_text(), [f"\ndrive:\n  eds: {eds}\n"]
    assert "\ndrive:" in text
    if encoder is not None:
        lines = [f"\ndrive:\n  eds: {eds}\n  encoder: {{eds: {encoder}}}\n"]
    path.write_text(text.replace("\ndrive:\n", lines[0], 1))
    return path


def dressed(text: str) -> bytes:
    text = text.replace("[6064]", "[0x6064]").replace("Position actual value", "Lageistwert in °") + "one line\n"
    return text.replace("\n", "\r\n").encode("cp1252")


def test_a_makers_dialect_is_read(tmp_path: Path) -> None:
    eds = tmp_path / "drive.eds"
    eds.write_bytes(dressed(DRIVE))
    ran = hil(tmp_path, "validate", str(bench(tmp_path, eds)))
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""


def test_what_a_file_leaves_in_doubt_is_noted(tmp_path: Path) -> None:
    eds = tmp_path / "drive.eds"
    eds.write_text(DRIVE.replace(POSITION, POSITION.replace("0x0004", "0x0007")))
    ran = hil(tmp_path, "validate", str(bench(tmp_path, eds)))
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr.startswith(f"note: {eds}, line ")
    said = "[6064] DataType=0x0007 (UNSIGNED32) is read as INTEGER32, which CiA fixes for this object"
    assert said in ran.stderr
    ran = hil(tmp_path, "run", str(PROFILE), "--bench", str(bench(tmp_path, eds)), "--virtual")
    assert ran.returncode == 0, ran.stderr
    assert said in ran.stderr


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "line 1: is no EDS file"),
        (bytes(range(256)) * 20, "line 1: is no EDS file"),
        (b"segments: []\n", "given: 'segments: []'"),
        (DRIVE.replace(POSITION, POSITION.replace("0x0004", "0x0008")).encode(), "(REAL32), allowed INTEGER32"),
        (DRIVE[: DRIVE.index("[6064]")].encode(), "does not know the object 0x6064:00"),
        (DRIVE.replace("VendorNumber=0x000007FF", "VendorNumber=ours").encode(), "line 16: [DeviceInfo] VendorNumber"),
    ],
)
def test_a_file_that_cannot_be_used_ends_with_2(tmp_path: Path, content: bytes, reason: str) -> None:
    eds = tmp_path / "drive.eds"
    eds.write_bytes(content)
    path = bench(tmp_path, eds)
    line = path.read_text().splitlines().index(f"  eds: {eds}") + 1
    for arguments in (("validate", str(path)), ("run", str(PROFILE), "--bench", str(path), "--virtual")):
        said = refused(tmp_path, *arguments)
        assert f"mine.yaml:{line}: drive.eds: given {eds}" in said
        assert reason in said


def test_a_missing_file_a_folder_and_a_huge_file_end_with_2(tmp_path: Path) -> None:
    huge = tmp_path / "huge.eds"
    with huge.open("wb") as file:
        file.truncate(100_000_000)  # sparse
    for eds, reason in (
        (tmp_path / "none.eds", "cannot be read"),
        (tmp_path, "is a folder"),
        (huge, "100000000 bytes"),
    ):
        assert reason in refused(tmp_path, "validate", str(bench(tmp_path, eds)))


def test_the_encoders_file_is_read_too(tmp_path: Path) -> None:
    good, none = EDS_FOLDER / "servo_drive.eds", tmp_path / "none.eds"
    said = refused(tmp_path, "validate", str(bench(tmp_path, good, none)))
    assert f"drive.encoder.eds: given {none}: cannot be read" in said
