"""The shipped EDS files: canopen reads them without a warning, and the simulated nodes are what they describe."""

from __future__ import annotations

import configparser
import logging
from pathlib import Path

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from drive_rig import Mass

from drivers.inprocess import InProcessBus
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup, SetupNetwork
from drivers.sim.can_node import SimulatedDevice
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.encoder_node import SimulatedEncoder

FILES = ["servo_drive.eds", "linear_encoder.eds"]


def variables(path: Path) -> list[ODVariable]:
    objects = canopen.import_od(str(path), node_id=9).values()
    return [v for o in objects for v in ([o] if isinstance(o, ODVariable) else o.values())]


@pytest.mark.parametrize("name", FILES)
def test_eds_loads_without_warnings_and_lists_what_it_contains(name: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        dictionary = canopen.import_od(str(EDS_FOLDER / name), node_id=9)
    assert caplog.records == []
    parser = configparser.RawConfigParser()
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(EDS_FOLDER / name)
    listed: list[int] = []
    for section in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        count = parser.getint(section, "SupportedObjects")
        listed += [int(parser.get(section, str(k)), 16) for k in range(1, count + 1)]
    assert sorted(listed) == sorted(dictionary)
    for index in listed:
        if parser.has_option(f"{index:04X}", "SubNumber"):
            subs = [s for s in parser.sections() if s.startswith(f"{index:04X}sub")]
            assert len(subs) == parser.getint(f"{index:04X}", "SubNumber")
    assert parser.get("FileInfo", "FileName") == name


@pytest.mark.parametrize("name", FILES)
def test_eds_identity_is_the_one_in_its_device_information(name: str) -> None:
    dictionary = canopen.import_od(str(EDS_FOLDER / name), node_id=9)
    information = dictionary.device_information
    assert dictionary[0x1018][1].default == information.vendor_number
    assert dictionary[0x1018][2].default == information.product_number
    assert dictionary[0x1018][3].default == information.revision_number
    assert dictionary[0x1000].default & 0xFFFF in (402, 406)
    assert {500_000, 1_000_000} <= information.allowed_baudrates


@pytest.mark.parametrize(("name", "kind"), [(FILES[0], SimulatedDrive), (FILES[1], SimulatedEncoder)])
def test_the_node_answers_for_every_object_of_its_eds(name: str, kind: type[SimulatedDevice]) -> None:
    bus = InProcessBus()
    client = bus.port()
    kind(bus.port(), Mass(), node_id=9)  # type: ignore[call-arg,arg-type]
    with DeviceSetup(SetupNetwork(client), 9, EDS_FOLDER / name) as device:
        numeric = [v for v in variables(EDS_FOLDER / name) if v.data_type not in (0x9, 0xF)]
        assert len(numeric) > 40
        for variable in numeric:
            value = device.read(variable.index, variable.subindex)
            if variable.writable and variable.index < 0x1400:
                device.write(variable.index, variable.subindex, value)
