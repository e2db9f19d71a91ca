"""CiA 402 drive state machine, pure and non-blocking (IEC 61800-7-201, CiA 402-2).

Statusword -> state, (state, goal) -> controlword, homing. Nothing waits, sends or reads a clock: the caller gives one
statusword per cycle and sends the returned controlword.
"""

from enum import IntEnum, IntFlag
from typing import Final


class DriveState(IntEnum):
    """States of the finite state automaton, CiA 402-2."""

    UNKNOWN = -1
    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7


# States in which the motor may produce torque. UNKNOWN: an undefined statusword tells nothing about the power stage.
POWERED: Final = (
    DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE, DriveState.UNKNOWN
)  # fmt: skip


class Statusword(IntFlag):
    """Object 0x6041, the bits beside those of the state (`state_of`). Bits 12 and 13 depend on the mode."""

    VOLTAGE_ENABLED = 1 << 4  # main voltage at the power stage
    QUICK_STOP = 1 << 5  # 0: a quick stop is asked for, by the controlword or by an input
    WARNING = 1 << 7
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    FOLLOWS_COMMAND = 1 << 12  # CSP, CSV, CST: the drive follows the command value
    HOMING_ATTAINED = 1 << 12  # homing mode
    HOMING_ERROR = 1 << 13  # homing mode


class Controlword(IntFlag):
    """Object 0x6040."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2  # 0 asks for a quick stop
    ENABLE_OPERATION = 1 << 3
    HOMING_START = 1 << 4  # homing mode: rising edge starts, 0 interrupts
    FAULT_RESET = 1 << 7  # rising edge
    HALT = 1 << 8


class OperationMode(IntEnum):
    """Modes of operation, objects 0x6060 and 0x6061."""

    NONE = 0
    HOMING = 6
    CYCLIC_SYNC_POSITION = 8
    CYCLIC_SYNC_VELOCITY = 9
    CYCLIC_SYNC_TORQUE = 10


# Commands, CiA 402-2 table "command coding".
DISABLE_VOLTAGE: Final = 0x00
QUICK_STOP: Final = int(Controlword.ENABLE_VOLTAGE)  # 0x02
SHUTDOWN: Final = int(Controlword.ENABLE_VOLTAGE | Controlword.QUICK_STOP)  # 0x06
SWITCH_ON: Final = SHUTDOWN | int(Controlword.SWITCH_ON)  # 0x07
ENABLE_OPERATION: Final = SWITCH_ON | int(Controlword.ENABLE_OPERATION)  # 0x0F
FAULT_RESET: Final = int(Controlword.FAULT_RESET)  # 0x80


def _decode(statusword: int) -> DriveState:
    """State from the low seven bits, CiA 402-2 table "state coding" (bit 4 is never looked at)."""
    if statusword & 0x4F == 0x40:
        return DriveState.SWITCH_ON_DISABLED
    if statusword & 0x4F == 0x0F:
        return DriveState.FAULT_REACTION_ACTIVE
    if statusword & 0x4F == 0x08:
        return DriveState.FAULT
    if statusword & 0x4F == 0x00:
        return DriveState.NOT_READY_TO_SWITCH_ON
    return {
        0x21: DriveState.READY_TO_SWITCH_ON,
        0x23: DriveState.SWITCHED_ON,
        0x27: DriveState.OPERATION_ENABLED,
        0x07: DriveState.QUICK_STOP_ACTIVE,
    }.get(statusword & 0x6F, DriveState.UNKNOWN)


# The state by the low seven bits of the statusword: one look-up in the loop.
STATE_BY_STATUS: Final = tuple(_decode(bits) for bits in range(128))


def state_of(statusword: int) -> DriveState:
    """State the drive is in; UNKNOWN for a combination CiA 402 does not define."""
    return STATE_BY_STATUS[statusword & 0x7F]


_TO_ENABLED: Final = {
    DriveState.SWITCH_ON_DISABLED: SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: SWITCH_ON,
    DriveState.SWITCHED_ON: ENABLE_OPERATION,
    DriveState.OPERATION_ENABLED: ENABLE_OPERATION,
}
_TO_READY: Final = {
    DriveState.SWITCH_ON_DISABLED: SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: SHUTDOWN,
    DriveState.SWITCHED_ON: SHUTDOWN,
    DriveState.OPERATION_ENABLED: SHUTDOWN,
}


def next_controlword(
    state: DriveState, *, enable: bool, quick_stop: bool = False, reset_fault: bool = False, previous: int = 0
) -> int:
    """Controlword that brings the drive one step nearer to the goal; call it once per cycle.

    enable: towards OPERATION ENABLED, else towards READY TO SWITCH ON. quick_stop wins over enable. A drive in quick
    stop is not re-enabled from there: disable voltage first (transition 12), then the usual way. reset_fault: bit 7 as
    a rising edge, so it is 0 in the cycle after one that held it (`previous` is the controlword sent last).
    """
    if state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
        rising = reset_fault and state is DriveState.FAULT and not previous & FAULT_RESET
        return FAULT_RESET if rising else DISABLE_VOLTAGE
    if quick_stop:
        # Only OPERATION ENABLED and QUICK STOP ACTIVE are under power; elsewhere bit 2 low is disable voltage.
        moving = state in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.UNKNOWN)
        return QUICK_STOP if moving else DISABLE_VOLTAGE
    if state is DriveState.QUICK_STOP_ACTIVE:
        return DISABLE_VOLTAGE
    return (_TO_ENABLED if enable else _TO_READY).get(state, DISABLE_VOLTAGE)


class HomingPhase(IntEnum):
    """Course of a homing run; bit 4 of the controlword is high in STARTED and RUNNING."""

    READY = 0  # bit 4 still low, so that setting it is an edge
    STARTED = 1  # bit 4 set, but "attained" is left over from an earlier run: not yet taken back
    RUNNING = 2  # an "attained" from here on is a new one
    DONE = 3  # proven: attained, target reached, no error, and at rest
    FAILED = 4  # homing error, or the drive left OPERATION ENABLED


def next_homing_phase(phase: HomingPhase, statusword: int, speed: float, standstill_speed: float) -> HomingPhase:
    """Compute a cycle of homing; speed and standstill_speed in the same unit, measured by the caller.

    "Attained" alone is not sufficient: it may be left over from an earlier run, or set while the axis still moves. DONE
    takes bit 12 seen low since the start, then bits 10 and 12 set, bit 13 not set, and |speed| <= standstill_speed.
    """
    if phase in (HomingPhase.DONE, HomingPhase.FAILED):
        return phase
    if state_of(statusword) is not DriveState.OPERATION_ENABLED:
        return HomingPhase.READY if phase is HomingPhase.READY else HomingPhase.FAILED
    if statusword & Statusword.HOMING_ERROR:
        # An error left over from an earlier run does not fail the one that has not begun.
        return HomingPhase.STARTED if phase in (HomingPhase.READY, HomingPhase.STARTED) else HomingPhase.FAILED
    attained = bool(statusword & Statusword.HOMING_ATTAINED)
    if phase in (HomingPhase.READY, HomingPhase.STARTED):
        return HomingPhase.STARTED if attained else HomingPhase.RUNNING
    at_rest = bool(statusword & Statusword.TARGET_REACHED) and abs(speed) <= standstill_speed
    return HomingPhase.DONE if attained and at_rest else HomingPhase.RUNNING
