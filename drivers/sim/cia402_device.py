"""State machine of CiA 402 in the drive: next state after a controlword, and the statusword of each state."""

from collections.abc import Callable
from typing import Final

from drivers.cia402 import Controlword, DriveState, Statusword
from drivers.object_index import ObjectIndex as Index
from drivers.sim.sdo_server import AbortCode, SdoAbort

_S = DriveState

# Statusword bits of each state (CiA 402-2, table "state coding"), with voltage enabled where the power stage is on.
STATUS: Final = {
    _S.NOT_READY_TO_SWITCH_ON: 0x00,
    _S.SWITCH_ON_DISABLED: 0x40,
    _S.READY_TO_SWITCH_ON: 0x31,
    _S.SWITCHED_ON: 0x33,
    _S.OPERATION_ENABLED: 0x37,
    _S.QUICK_STOP_ACTIVE: 0x17,
    _S.FAULT_REACTION_ACTIVE: 0x1F,
    _S.FAULT: 0x08,
}
REMOTE: Final = int(Statusword.REMOTE)

# (state, command) -> state; transition numbers of CiA 402-2 in the comments. Commands not listed change nothing.
_SHUTDOWN, _SWITCH_ON, _ENABLE, _QUICK_STOP, _DISABLE_VOLTAGE = range(5)
_TRANSITIONS: Final = {
    (_S.SWITCH_ON_DISABLED, _SHUTDOWN): _S.READY_TO_SWITCH_ON,          # 2
    (_S.READY_TO_SWITCH_ON, _SWITCH_ON): _S.SWITCHED_ON,                # 3
    (_S.READY_TO_SWITCH_ON, _ENABLE): _S.SWITCHED_ON,                   # 3, then 4 with the next controlword
    (_S.READY_TO_SWITCH_ON, _DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,   # 7
    (_S.READY_TO_SWITCH_ON, _QUICK_STOP): _S.SWITCH_ON_DISABLED,        # 7
    (_S.SWITCHED_ON, _ENABLE): _S.OPERATION_ENABLED,                    # 4
    (_S.SWITCHED_ON, _SHUTDOWN): _S.READY_TO_SWITCH_ON,                 # 6
    (_S.SWITCHED_ON, _DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,          # 10
    (_S.SWITCHED_ON, _QUICK_STOP): _S.SWITCH_ON_DISABLED,               # 10
    (_S.OPERATION_ENABLED, _SWITCH_ON): _S.SWITCHED_ON,                 # 5
    (_S.OPERATION_ENABLED, _SHUTDOWN): _S.READY_TO_SWITCH_ON,           # 8
    (_S.OPERATION_ENABLED, _DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,    # 9
    (_S.OPERATION_ENABLED, _QUICK_STOP): _S.QUICK_STOP_ACTIVE,          # 11
    (_S.QUICK_STOP_ACTIVE, _DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,    # 12
}  # fmt: skip


def _command(controlword: int) -> int:
    """Command coding of CiA 402-2; bit 3 counts only with bits 0..2 set."""
    if not controlword & Controlword.ENABLE_VOLTAGE:
        return _DISABLE_VOLTAGE
    if not controlword & Controlword.QUICK_STOP:
        return _QUICK_STOP
    if not controlword & Controlword.SWITCH_ON:
        return _SHUTDOWN
    return _ENABLE if controlword & Controlword.ENABLE_OPERATION else _SWITCH_ON


def next_state(state: DriveState, controlword: int, previous: int, *, cause_gone: bool = True) -> DriveState:
    """State after a controlword. A fault is left (15) by a rising edge of bit 7, if its cause is gone."""
    if state is _S.FAULT:
        rising = controlword & ~previous & Controlword.FAULT_RESET
        return _S.SWITCH_ON_DISABLED if rising and cause_gone else _S.FAULT
    return _TRANSITIONS.get((state, _command(controlword)), state)


def interpolation_time_s(number: Callable[[int, int], int], subindex: int, value: int) -> float:
    """0x60C2 after a write of `value`: sub-index 1 x 10^(sub-index 2) seconds. SdoAbort for 0."""
    units = value if subindex == 1 else number(Index.INTERPOLATION_TIME, 1)
    exponent = number(Index.INTERPOLATION_TIME, 2) if subindex == 1 else value
    if units == 0:
        raise SdoAbort(AbortCode.INVALID_VALUE)
    return float(units * 10**exponent) if exponent >= 0 else units / 10**-exponent
