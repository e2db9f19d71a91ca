"""Reset of a latched fault (CiA 402) by SDO, power stage off."""

from typing import Final

from drivers.cia402 import FAULT_RESET, DriveState, state_of
from drivers.object_index import ObjectIndex as Index
from drivers.sdo_setup import DeviceSetup

FAULTS: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
RESET_LIMIT_S: Final = 3.0
_REACTION_LIMIT_S: Final = 1.0


def reset_fault(device: DeviceSetup) -> int:
    """Send one rising edge of "fault reset" and wait, RESET_LIMIT_S at most. Returns the statusword."""
    device.write_only(Index.CONTROLWORD, 0, 0)
    device.wait(
        Index.STATUSWORD, lambda word: state_of(word) is not DriveState.FAULT_REACTION_ACTIVE, _REACTION_LIMIT_S
    )
    device.write_only(Index.CONTROLWORD, 0, FAULT_RESET)
    statusword = device.wait(Index.STATUSWORD, lambda word: state_of(word) not in FAULTS, RESET_LIMIT_S)
    device.write_only(Index.CONTROLWORD, 0, 0)
    return statusword
