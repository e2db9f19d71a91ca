"""canopen's own, unmodified client against the simulated nodes: an independent judge of the wire."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import canopen
import pytest
from canopen.sdo import SdoAbortedError
from drive_rig import Mass
from processes import wait_for

from drivers.bus import BusConfig, PythonCanPort, open_bus
from drivers.inprocess import AsBusABC, InProcessBus
from drivers.sdo_setup import EDS_FOLDER
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.encoder_node import SimulatedEncoder
from drivers.sim.node import serve

DRIVE, ENCODER = str(EDS_FOLDER / "servo_drive.eds"), str(EDS_FOLDER / "linear_encoder.eds")


@pytest.fixture(params=["virtual", "in-process"])
def network(request: pytest.FixtureRequest) -> Iterator[canopen.Network]:
    """canopen's Network with its Notifier thread; the nodes answer from a thread (virtual) or inside `send`."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    if request.param == "in-process":
        bus = InProcessBus()
        network.bus = AsBusABC(bus.port())
        node_port = bus.port()
        network.drive_node = SimulatedDrive(node_port, Mass())
        network.encoder_node = SimulatedEncoder(node_port, network.drive_node.plant)
        network.connect()
        yield network
        network.disconnect()
        return
    port = PythonCanPort(open_bus(BusConfig("virtual", "test_canopen_client")))
    network.bus = open_bus(BusConfig("virtual", "test_canopen_client"))
    network.drive_node = SimulatedDrive(port, Mass())
    network.encoder_node = SimulatedEncoder(port, network.drive_node.plant)
    stop = threading.Event()
    thread = threading.Thread(target=serve, args=(port, (network.drive_node, network.encoder_node), stop))
    thread.start()
    network.connect()
    yield network
    network.disconnect()
    stop.set()
    thread.join()
    port.close()


def test_sdo_expedited_segmented_and_limits(network: canopen.Network) -> None:
    node = network.add_node(5, DRIVE)
    assert node.sdo[0x1018][1].raw == 0x7FF
    assert node.sdo[0x1008].raw == "Simulated servo drive"  # 21 bytes: segmented
    node.sdo[0x6085].raw = 123456
    assert node.sdo[0x6085].raw == 123456
    node.sdo[0x60C2][2].raw = -3
    assert node.sdo[0x60C2][2].raw == -3
    node.sdo.download(0x6085, 0, (7).to_bytes(4, "little"), force_segment=True)
    assert node.sdo[0x6085].raw == 7


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x5FFF, 0, b"\0", 0x06020000),            # no such object
        (0x1018, 9, b"\0\0\0\0", 0x06090011),      # no such sub-index
        (0x6041, 0, b"\0\0", 0x06010002),          # read only
        (0x6085, 0, b"\0\0", 0x06070010),          # length
        (0x605A, 0, b"\x07\0", 0x06090031),        # above its limit
        (0x605A, 0, b"\x01\0", 0x06090032),        # below its limit
        (0x6060, 0, b"\x01", 0x06090030),          # profile position: not offered
        (0x1800, 2, b"\xfa", 0x06090030),          # reserved transmission type
        (0x1A00, 1, b"\0\0\0\0", 0x08000022),      # mapping while the PDO is valid
    ],
)  # fmt: skip
def test_sdo_refusals_have_the_codes_of_cia_301(
    network: canopen.Network, index: int, subindex: int, data: bytes, code: int
) -> None:
    node = network.add_node(5, DRIVE)
    with pytest.raises(SdoAbortedError) as refused:
        node.sdo.download(index, subindex, data)
    assert refused.value.code == code


def test_pdo_mapping_by_canopen_and_sync_driven_tpdo(network: canopen.Network) -> None:
    node = network.add_node(5, DRIVE)
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.tpdo[1].clear()
    node.tpdo[1].add_variable(0x6041)
    node.tpdo[1].add_variable(0x6064)
    node.tpdo[1].trans_type = 1
    node.tpdo[1].enabled = True
    node.tpdo[1].save()
    node.rpdo.read()
    node.nmt.state = "OPERATIONAL"
    wait_for(lambda: network.drive_node.nmt_state == 5)
    network.drive_node.plant.motor_position_rad = 3.141592653589793
    node.tpdo[1].is_received = False
    network.sync.transmit()
    wait_for(lambda: node.tpdo[1].is_received)
    assert node.tpdo[1][0x6041].raw & 0x6F == 0x40
    assert node.tpdo[1][0x6064].raw == 1 << 19
    node.rpdo[1][0x6040].raw = 6
    node.rpdo[1].transmit()
    wait_for(lambda: network.drive_node.state == 2)


def test_object_that_cannot_be_mapped_is_refused(network: canopen.Network) -> None:
    node = network.add_node(5, DRIVE)
    node.sdo[0x1A00 - 0x200][1].raw = 0x80000185
    node.sdo[0x1A00][0].raw = 0
    for word in (0x60850020, 0x60410020, 0x10080008):  # not mappable, wrong length, a string
        with pytest.raises(SdoAbortedError, match="0x06040041"):
            node.sdo[0x1A00][1].raw = word
    for k in (1, 2, 3):
        node.sdo[0x1A00][k].raw = 0x60640020
    with pytest.raises(SdoAbortedError, match="0x06040042"):
        node.sdo[0x1A00][0].raw = 3


def test_nmt_boot_up_and_heartbeat(network: canopen.Network) -> None:
    node = network.add_node(5, DRIVE)
    states: list[int] = []
    node.nmt.add_heartbeat_callback(states.append)
    node.nmt.state = "RESET"
    wait_for(lambda: states == [0])
    node.sdo[0x1017].raw = 5
    assert node.sdo[0x1017].raw == 5
    node.nmt.state = "OPERATIONAL"
    if isinstance(network.bus, AsBusABC):  # no thread: somebody has to move the time
        network.drive_node.tick(1e9)
    wait_for(lambda: 5 in states)


def test_emcy_is_read_by_canopen_and_kept_in_the_history(network: canopen.Network) -> None:
    node = network.add_node(5, DRIVE)
    network.drive_node.trip(0x3210, 0x05, 0.0)
    wait_for(lambda: len(node.emcy.log) == 1)
    assert node.emcy.log[0].code == 0x3210
    assert node.sdo[0x1003][1].raw == 0x3210
    assert node.sdo[0x1001].raw == 0x05
    assert node.sdo[0x603F].raw == 0x3210


def test_encoder_preset_direction_and_range(network: canopen.Network) -> None:
    node = network.add_node(6, ENCODER)
    network.drive_node.plant.motor_position_rad = 2 * 6.283185307179586  # 20 mm at 0.5 um: 40000 counts
    node.sdo[0x6000].raw = 0
    assert node.sdo[0x6004].raw == 40_000
    node.sdo[0x6000].raw = 8
    assert node.sdo[0x6004].raw == -40_000
    node.sdo[0x6003].raw = 1234
    assert node.sdo[0x6004].raw == 1234
    node.sdo[0x6002].raw = 1000
    assert node.sdo[0x6004].raw == 234
