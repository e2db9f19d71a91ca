"""Set-up of a drive refuses wrong devices and settings: simulated drive, and the SDO server of canopen."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import canopen
import pytest
from drive_rig import Mass, Rig, in_process, servo

from drivers.bus import BusConfig, PythonCanPort, open_bus
from drivers.canopen_drive import CanopenDrive, DriveSettings
from drivers.canopen_master import CanopenMaster
from drivers.cia402 import POWERED, DriveState, OperationMode
from drivers.cia402_setup import FEEDBACK
from drivers.inprocess import InProcessBus
from drivers.pdo import Entry
from drivers.port import ConfigurationError, IdentityError, ResponseTimeout
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup, SetupNetwork
from drivers.sim.cia402_device import STATUS
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.sdo_server import SdoServer


def test_no_answer_names_node_and_object() -> None:
    with pytest.raises(ResponseTimeout, match=r"node 7, object 0x1000:00 \(Device type\): no SDO answer"):
        in_process(settings=DriveSettings(node_id=7)).set_up()


def test_another_device_is_refused(make: Callable[..., Rig]) -> None:
    rig = make(settings=DriveSettings(serial_number=4711))
    with pytest.raises(IdentityError, match=r"another serial number than described; given: 0x1; allowed: 0x1267"):
        rig.set_up()
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED


def test_an_encoder_is_no_drive() -> None:
    with pytest.raises(IdentityError, match=r"another device profile.*0x196.*0x192"):
        in_process(settings=DriveSettings(node_id=6)).set_up()


def test_a_mode_the_drive_refuses_is_reported() -> None:
    rig = in_process(settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_VELOCITY))  # no loops inside this drive
    with pytest.raises(ConfigurationError, match=r"0x6060:00 \(Modes of operation\): the device refuses.*0x06090030"):
        rig.set_up()


def test_a_period_that_cannot_be_expressed_is_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"period cannot be expressed; given: 0\.0011112 s"):
        in_process(settings=DriveSettings(period_s=0.0011112)).set_up()


def test_a_late_answer_to_an_earlier_request_is_no_answer_to_this_one() -> None:
    rig = in_process()
    answer = rig.node._on_sdo

    def after_a_late_one(can_id: int, data: bytes, now_s: float) -> None:
        rig.node_port.send(0x585, bytes.fromhex("43001000 92010200"), now_s)
        answer(can_id, data, now_s)

    rig.node_port.ignore(0x605, answer)
    rig.node_port.listen(0x605, after_a_late_one)
    rig.set_up()
    assert rig.drive.info.rated_torque_n_m == 4.0


@pytest.mark.parametrize("state", POWERED[:3])
def test_a_drive_whose_power_stays_on_is_refused(state: DriveState) -> None:
    rig = in_process()
    rig.node._status = lambda extra: None
    rig.node.values[0x6041_00] = STATUS[state]
    with pytest.raises(ConfigurationError, match=rf"still on after \"disable voltage\"; given: {state.name}, 0x"):
        rig.set_up()


@pytest.mark.parametrize("share", [0.9985, 1.0015])
def test_a_rated_torque_that_is_lower_or_higher_than_described_is_refused(share: float) -> None:
    rig = in_process(settings=DriveSettings(rated_torque_n_m=4.0 * share))  # the drive has 4 N m
    with pytest.raises(ConfigurationError, match=r"another rated torque.*given: 4\.0 N m"):
        rig.set_up()


@pytest.mark.parametrize("share", [0.9995, 1.0, 1.0005])
def test_a_rated_torque_may_differ_by_its_rounding(share: float) -> None:
    rig = in_process(settings=DriveSettings(rated_torque_n_m=4.0 * share))
    rig.set_up()
    assert rig.drive.info.rated_torque_n_m == 4.0


def test_limit_deadline_and_error_code_are_those_of_the_drive() -> None:
    rig = in_process(settings=DriveSettings(max_torque_n_m=6.0))
    rig.set_up()
    assert rig.node.values[0x6072_00] == 1500  # 1/1000 of 4 N m
    assert rig.drive.info.max_torque_n_m == pytest.approx(6.0)
    assert rig.node.values[0x1400_05] == 50  # ms
    assert rig.drive.error_code == 0


@pytest.mark.parametrize("speed_rad_s", [5.0, -5.0])
def test_a_drive_turns_either_way_at_a_velocity(speed_rad_s: float) -> None:
    rig = in_process(servo=servo(), settings=DriveSettings(mode=OperationMode.CYCLIC_SYNC_VELOCITY))
    rig.set_up()
    rig.enable()
    for _ in range(200):
        rig.cycle(speed_rad_s)
    assert rig.plant.velocity_rad_s == pytest.approx(speed_rad_s, rel=0.02)


def test_an_interpolation_time_has_255_units_at_most() -> None:
    rig = in_process()
    with DeviceSetup(rig.master.network, 5, EDS_FOLDER / "servo_drive.eds") as device:
        device.set_interpolation_time(0.0255)
        assert (rig.node.values[0x60C2_01], rig.node.values[0x60C2_02]) == (255, -4)
        with pytest.raises(
            ConfigurationError, match=r"period cannot be expressed; given: 0\.0257 s; allowed: 1\.\.255"
        ):
            device.set_interpolation_time(0.0257)


@pytest.mark.parametrize("key", [0x608F_01, 0x6075_00, 0x6076_00])
def test_a_drive_without_resolution_rated_current_or_torque_is_refused(key: int) -> None:
    rig = in_process()
    rig.node.values[key] = 0
    with pytest.raises(ConfigurationError, match=r"0x608F, 0x6076, 0x6075: .* must be positive; given: .*\b0\.0 "):
        rig.set_up()
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED


# -- an independent SDO server ----------------------------------------------------------------------------------------


@pytest.fixture
def local_node() -> Iterator[tuple[SetupNetwork, canopen.LocalNode]]:
    """canopen's LocalNode behind its own Notifier thread, our set-up in front of a virtual bus."""
    before = threading.enumerate()
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    network.bus = open_bus(BusConfig("virtual", "test_local_node"))
    node = network.create_node(5, str(EDS_FOLDER / "servo_drive.eds"))
    network.connect()
    port = PythonCanPort(open_bus(BusConfig("virtual", "test_local_node")))
    yield SetupNetwork(port), node
    network.disconnect()
    port.close()
    assert [thread for thread in threading.enumerate() if thread not in before] == []


def test_set_up_against_canopens_server(local_node: tuple[SetupNetwork, canopen.LocalNode]) -> None:
    network, node = local_node
    with DeviceSetup(network, 5, EDS_FOLDER / "servo_drive.eds") as device:
        device.check_identity(402)
        device.set_interpolation_time(0.00025)
        assert (node.sdo[0x60C2][1].raw, node.sdo[0x60C2][2].raw) in ((25, -5), (250, -6))
        device.map_pdo(0x1800, FEEDBACK, 1, 0x185)
        assert [node.sdo[0x1A00][k].raw for k in range(4)] == [3, 0x60410010, 0x60640020, 0x60770010]
        assert node.sdo[0x1800][1].raw == 0x40000185
        with pytest.raises(ConfigurationError, match=r"0x6041:00 \(Statusword\): the device refuses.*0x06010002"):
            device.write(0x6041, 0, 1)
        with pytest.raises(ConfigurationError, match="EDS does not know the object"):
            device.read(0x5FFF)


def test_a_setting_that_reads_back_differently_is_refused(
    local_node: tuple[SetupNetwork, canopen.LocalNode],
) -> None:
    network, node = local_node
    node.add_read_callback(lambda index, subindex, od: 25 if index == 0x1006 else None)
    with (
        DeviceSetup(network, 5, EDS_FOLDER / "servo_drive.eds") as device,
        pytest.raises(ConfigurationError, match=r"0x1006:00 .*another value.*given: 20 \(0x14\).*keeps 25 \(0x19\)"),
    ):
        device.write(0x1006, 0, 20)


@pytest.mark.parametrize(
    ("index", "subindex"),
    [(0x1400, 5), (0x1016, 1), (0x1017, 0), (0x1006, 0), (0x1029, 1), (0x605A, 0), (0x605E, 0), (0x6007, 0),
     (0x6072, 0), (0x6085, 0), (0x1600, 0), (0x1600, 2), (0x1A00, 1), (0x1400, 1), (0x1800, 2)],
)  # fmt: skip
def test_every_setting_that_stops_the_axis_is_read_back(index: int, subindex: int) -> None:
    """A drive that acknowledges the write and keeps another value is refused, power stage off."""
    rig = in_process(settings=DriveSettings(max_torque_n_m=6.0, quick_stop_rad_s2=200.0))
    read = rig.node.dictionary.read

    def other(asked: int, sub: int) -> bytes:
        data = read(asked, sub)
        return bytes([data[0] ^ 0x40]) + data[1:] if (asked, sub) == (index, subindex) else data

    rig.node._sdo = SdoServer(other, rig.node.dictionary.write)
    with pytest.raises(ConfigurationError, match=f"0x{index:04X}:0{subindex}.*reads back another value"):
        rig.set_up()
    assert rig.node.state is DriveState.SWITCH_ON_DISABLED


# -- PDOs -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("communication", "flags"), [(0x1400, 0), (0x1800, 1 << 30)])
def test_a_pdo_is_invalid_while_it_is_mapped_and_valid_afterwards(communication: int, flags: int) -> None:
    """CiA 301, 7.5.2.36: invalid, number of entries 0, entries, number, valid; the order in which it is written."""
    rig = in_process()
    written: list[tuple[int, int, int]] = []
    write = rig.node.dictionary.write

    def seen(index: int, subindex: int, data: bytes) -> None:
        written.append((index, subindex, int.from_bytes(data, "little")))
        write(index, subindex, data)

    rig.node._sdo = SdoServer(rig.node.dictionary.read, seen)
    cob_id = communication - 0x1400 + 0x205 if communication < 0x1800 else 0x185
    with DeviceSetup(rig.master.network, 5, EDS_FOLDER / "servo_drive.eds") as device:
        entry = Entry(0x6060 if communication < 0x1800 else 0x6061, 0, 8, True)  # not the mapping it has
        device.map_pdo(communication, (entry,), 1, cob_id)
    mapping = communication + 0x200
    assert written == [
        (communication, 1, cob_id | flags | 1 << 31), (mapping, 0, 0), (mapping, 1, entry.word), (mapping, 0, 1),
        (communication, 2, 1), (communication, 1, cob_id | flags),
    ]  # fmt: skip


@pytest.mark.parametrize("held", [0, 1, 3])
def test_a_pdo_with_fewer_or_more_entries_than_wanted_is_mapped_again(held: int) -> None:
    rig = in_process()
    rig.node.values[0x1A00_00] = held
    for k, entry in enumerate(FEEDBACK, start=1):
        rig.node.values[0x1A00_00 + k] = entry.word
    with DeviceSetup(rig.master.network, 5, EDS_FOLDER / "servo_drive.eds") as device:
        device.map_pdo(0x1800, FEEDBACK[:2], 1, 0x185)
    assert rig.node.values[0x1A00_00] == 2


@pytest.fixture
def many_pdos(tmp_path: Path) -> Path:
    """EDS of a drive with PDOs at the ends of their ranges."""
    text = (EDS_FOLDER / "servo_drive.eds").read_text()
    parts = re.split(r"(?m)^(?=\[)", text)
    copies = (("[1401", "[1407"), ("[1601", "[1607"), ("[1401", "[19FF"), ("[1601", "[1BFF"))
    more = [part.replace(old, new) for old, new in copies for part in parts if part.startswith(old)]
    path = tmp_path / "many_pdos.eds"
    path.write_text(text + "\n" + "".join(more))
    return path


def test_pdos_that_are_not_used_are_invalid_whatever_the_drive_had(many_pdos: Path) -> None:
    bus = InProcessBus()
    port, node = bus.port(), SimulatedDrive(bus.port(), Mass(), eds=many_pdos)
    every = [
        key >> 8 for key in node.values if key & 0xFF == 1 and (0x14 <= key >> 16 < 0x16 or 0x18 <= key >> 16 < 0x1A)
    ]
    for index in every:
        node.values[index << 8 | 1] &= 0x7FFFFFFF
    CanopenDrive(CanopenMaster(port), DriveSettings(eds=many_pdos)).set_up()
    valid = [index for index in every if not node.values[index << 8 | 1] & 1 << 31]
    assert {0x1401, 0x1407, 0x19FF} <= set(every)
    assert sorted(valid) == [0x1400, 0x1800, 0x1801]  # set-points, feedback, the set-point that acts
