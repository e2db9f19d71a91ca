"""Data types of an EDS against those that CiA fixes: a wrong one is read right or refused, never a wrong value."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from canopen.objectdictionary.datatypes import (
    DOMAIN,
    INTEGER16,
    INTEGER32,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    UNSIGNED64,
    VISIBLE_STRING,
)
from drive_rig import Rig, in_process

from drivers.canopen_drive import DriveSettings
from drivers.cia402 import DriveState
from drivers.eds_file import read_eds
from drivers.object_types import profile_type
from drivers.port import ConfigurationError
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup, SetupNetwork

DRIVE = (EDS_FOLDER / "servo_drive.eds").read_text()
ENCODER = (EDS_FOLDER / "linear_encoder.eds").read_text()
OTHER_SIGN = {"2": "5", "5": "2", "3": "6", "6": "3", "4": "7", "7": "4"}


def retyped(text: str, section: str, data_type: str) -> str:
    """The EDS with another line for the data type of one object."""
    changed, count = re.subn(rf"(\[{section}\]\n(?:\w+=.*\n)*?)DataType=.*\n", rf"\g<1>{data_type}\n", text)
    assert count == 1
    return changed


def rig_with(folder: Path, drive: str = DRIVE, encoder: str = ENCODER, turns: float = -1.5) -> Rig:
    (folder / "drive.eds").write_text(drive)
    (folder / "encoder.eds").write_text(encoder)
    rig = in_process(settings=DriveSettings(eds=folder / "drive.eds"))
    rig.encoder.settings = replace(rig.encoder.settings, eds=folder / "encoder.eds")
    rig.plant.motor_position_rad = turns * 6.283185307179586
    return rig


def positions(rig: Rig) -> tuple[float, float]:
    rig.set_up()
    sample = rig.enable()
    rig.encoder.preset(-0.02)
    return sample.motor_position_rad, rig.encoder.read(rig.now_s).position_m


def test_every_sign_is_that_of_the_profile(tmp_path: Path) -> None:
    turned = [re.sub(r"DataType=0x000([2-7])", lambda m: f"DataType=0x000{OTHER_SIGN[m[1]]}", text)
              for text in (DRIVE, ENCODER)]  # fmt: skip
    expected = positions(rig_with(tmp_path))
    assert expected == pytest.approx((-9.42477796, -0.02))
    assert positions(rig_with(tmp_path, *turned)) == expected


@pytest.mark.parametrize(("index", "data_type", "read_as"), [
    (0x13FF, INTEGER32, INTEGER32), (0x1400, INTEGER32, UNSIGNED32), (0x1BFF, INTEGER32, UNSIGNED32),
    (0x1C00, INTEGER32, INTEGER32), (0x6041, INTEGER16, UNSIGNED16), (0x6064, UNSIGNED32, INTEGER32),
    (0x6064, UNSIGNED16, INTEGER16), (0x6004, UNSIGNED32, INTEGER32), (0x2000, UNSIGNED32, UNSIGNED32),
    (0x6041, VISIBLE_STRING, VISIBLE_STRING), (0x6040, UNSIGNED64, UNSIGNED64),
])  # fmt: skip
def test_the_sign_of_a_known_object_is_fixed_and_its_length_kept(index: int, data_type: int, read_as: int) -> None:
    assert profile_type(index, 0, data_type) == read_as


@pytest.mark.parametrize(("section", "subindex", "read_as"), [("1018sub0", 0, UNSIGNED8), ("1018sub1", 1, DOMAIN)])
def test_an_entry_without_type_is_bytes_but_for_the_number_of_entries(
    tmp_path: Path, section: str, subindex: int, read_as: int
) -> None:
    path = tmp_path / "drive.eds"
    path.write_text(retyped(DRIVE, section, "DataType="))
    assert read_eds(path, 5).dictionary[0x1018][subindex].data_type == read_as


def test_another_sign_is_said_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "drive.eds"
    path.write_text(retyped(DRIVE, "6064", "DataType=0x7"))
    line = path.read_text().splitlines().index("DataType=0x7") + 1
    assert read_eds(path, 5).notes == (
        f"line {line}: [6064] DataType=0x7 (UNSIGNED32) is read as INTEGER32, which CiA fixes for this object",
    )


@pytest.mark.parametrize(
    ("section", "given", "allowed"),
    [
        ("6064", "DataType=0x0008", r"line \d+: \[6064\] DataType=0x0008 \(REAL32\), allowed INTEGER32"),
        ("6064", "DataType=0x0003", r"line \d+: \[6064\] DataType=0x0003 \(INTEGER16\), allowed INTEGER32"),
        ("6077", "DataType=4", r"line \d+: \[6077\] DataType=4 \(INTEGER32\), allowed INTEGER16"),
        ("6071", "DataType=", r"line \d+: \[6071\] has no DataType, allowed INTEGER16"),
        ("6041", "DataType=word", r"line \d+: \[6041\] DataType=word \(unknown\), allowed UNSIGNED16"),
        ("6041", "DataType=0x0005", r"line \d+: \[6041\] DataType=0x0005 \(UNSIGNED8\), allowed UNSIGNED16"),
        ("6076", "DataType=0x0008", r"0x6076:00 .*given: line \d+: \[6076\] DataType=0x0008 \(REAL32\)"),
    ],
)
def test_another_length_or_kind_is_refused(tmp_path: Path, section: str, given: str, allowed: str) -> None:
    rig = rig_with(tmp_path, retyped(DRIVE, section, given))
    with pytest.raises(ConfigurationError, match=allowed):
        rig.set_up()
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED


def test_an_encoder_position_of_another_length_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"\[6004\] DataType=0x1B \(UNSIGNED64\), allowed INTEGER32"):
        rig_with(tmp_path, encoder=retyped(ENCODER, "6004", "DataType=0x1B")).set_up()


def test_a_longer_answer_than_the_eds_says_is_never_cut(tmp_path: Path) -> None:
    rig = rig_with(tmp_path, retyped(DRIVE, "6076", "DataType=0x0006"))
    rig.set_up()
    assert rig.drive.info.rated_torque_n_m == 4.0
    rig.node.dictionary.values[0x607600] = 70_000
    with pytest.raises(ConfigurationError, match=r"0x6076.*no number as the EDS.*given: 70 11 01 00; allowed: 2 bytes"):
        rig.set_up()
    rig = rig_with(tmp_path, retyped(DRIVE, "6072", "DataType=0x0007"))
    with pytest.raises(ConfigurationError, match=r"0x6072.*no number as the EDS.*given: b8 0b; allowed: 4 bytes"):
        rig.set_up()


@pytest.mark.parametrize("kind", ["0x9", "0x8"])
def test_a_sub_index_that_is_not_there_is_not_used(tmp_path: Path, kind: str) -> None:
    begin = DRIVE.index("[1400sub5]")
    without = DRIVE[:begin] + DRIVE[DRIVE.index("[1401]") :]
    name = "RPDO communication parameter 1\nObjectType="
    without = without.replace(f"{name}0x9", f"{name}{kind}")
    rig = rig_with(tmp_path, without)
    rig.set_up()
    assert not rig.drive.info.supervises_commands
    with (
        DeviceSetup(SetupNetwork(rig.port), 5, tmp_path / "drive.eds") as device,
        pytest.raises(ConfigurationError, match=r"0x1400:05: the EDS does not know the object"),
    ):
        device.read(0x1400, 5)


def test_a_pdo_without_its_mapping_object_is_no_fault_of_the_file(tmp_path: Path) -> None:
    text = re.sub(r"\[1601(sub\d)?\]\n(\w+=.*\n)*\n", "", DRIVE)
    assert "[1601" not in text
    rig_with(tmp_path, text).set_up()
