"""Try at set-up, power stage off, whether a drive notices that the heartbeat of its master ends (0x1016)."""

from typing import Final

from drivers.canopen_master import NMT_PRE_OPERATIONAL, NMT_START, CanopenMaster
from drivers.cia402 import state_of
from drivers.emcy import decode_emergency
from drivers.fault_reset import FAULTS, reset_fault
from drivers.object_index import ObjectIndex as Index
from drivers.sdo_setup import DeviceSetup, SettingRefused

_CONSUMER_MS: Final = 50  # heartbeat consumer time of the trial
_REPORT_S: Final = 0.2  # longest wait for the report
_COMMUNICATION: Final = 0x81  # upper byte of the EMCY's code; life guard or heartbeat error is 0x8130


def watches_master(device: DeviceSetup, master: CanopenMaster) -> bool | None:
    """Send one heartbeat and return whether the drive reports by an EMCY that no other follows; None: not tried.

    A consumer begins with the first heartbeat that it hears (CiA 301): one that hears none, or that listens to another
    node, watches nothing and does not say so. As in the loop the node is operational, but with no PDO and no reaction.
    """
    network, node_id = master.network, device.node_id
    reported: list[float] = []

    def on_emergency(can_id: int, data: bytes, now_s: float) -> None:
        if decode_emergency(data, now_s).code >> 8 == _COMMUNICATION:
            reported.append(now_s)

    had_fault = state_of(device.read(Index.STATUSWORD)) in FAULTS
    try:
        if not device.has(Index.CONSUMER_HEARTBEAT_TIME, 1):
            return None
        device.write(Index.CONSUMER_HEARTBEAT_TIME, 1, master.node_id << 16 | _CONSUMER_MS)
    except SettingRefused:
        return None
    device.prefer(Index.ABORT_CONNECTION_OPTION, 0, 0)
    master.port.listen(0x080 + node_id, on_emergency)
    master.nmt(NMT_START, node_id)
    master.beat(network.time_s)
    end_s = network.time_s + _REPORT_S
    while not reported and network.time_s < end_s:
        network.pump()
    master.port.ignore(0x080 + node_id, on_emergency)
    master.nmt(NMT_PRE_OPERATIONAL, node_id)
    device.write_only(Index.CONSUMER_HEARTBEAT_TIME, 1, 0)
    if not had_fault and state_of(device.read(Index.STATUSWORD)) in FAULTS:  # a drive that reacts all the same
        reset_fault(device)
    return bool(reported)
