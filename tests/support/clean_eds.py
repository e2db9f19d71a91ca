"""A small EDS file that every reader takes, and its content as a client sees it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from canopen.objectdictionary import ObjectDictionary, ODVariable

from drivers.eds_file import read_eds

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
    """Write an EDS file into a folder and read it as of node 9."""
    path = folder / "x.eds"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return read_eds(path, 9)


def blocks(text: str) -> list[str]:
    """Sections of an EDS file."""
    return [block for block in text.split("\n\n") if block.strip()]
