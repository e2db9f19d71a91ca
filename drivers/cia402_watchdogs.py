"""What a drive does by itself: reactions to a stop and to a lost master, its cycle times, its watchdogs.

A drive may refuse these settings or not have them. It is taken with its own ones if it still brakes at a quick stop and
notices a lost master in one way or another; `DeviceSetup.kept` tells them.
"""

import math
from typing import Final, NamedTuple

from drivers.cia402 import OperationMode
from drivers.object_index import ObjectIndex as Index
from drivers.port import ConfigurationError
from drivers.sdo_setup import DeviceSetup, SettingRefused

_RPDO_EVENT_TIMER: Final = 5  # sub-index of 0x1400; CiA 301: of an RPDO it is a deadline in ms
_SYNC_BITS: Final = 0x4000_07FF  # of 0x1005: the device generates SYNC; identifier
_SYNC: Final = 0x080


class Watchdogs(NamedTuple):
    """heartbeat_s: that the drive sends, inf: none. supervises_commands: it has a deadline of the RPDO."""

    heartbeat_s: float
    supervises_commands: bool


def write_reactions(device: DeviceSetup) -> None:
    """Set the reactions to a quick stop, a fault and a lost master. Raises ConfigurationError if one must not stay."""
    quick_stop = device.prefer(Index.QUICK_STOP_OPTION, 0, 2)  # ramp, then SWITCH ON DISABLED
    device.prefer(Index.FAULT_REACTION_OPTION, 0, 2)  # the same ramp, then FAULT
    lost = device.prefer(Index.ABORT_CONNECTION_OPTION, 0, 1)  # fault
    device.prefer(Index.ERROR_BEHAVIOUR, 1, 1)  # and stay operational, so that the master sees it
    if quick_stop == 0:
        raise _must_not_stay(device, "would not brake at a quick stop", "0x605A", "1 to 8")
    if lost == 0:
        raise _must_not_stay(device, "does nothing when its master is lost", "0x6007", "1 to 3")


def _must_not_stay(device: DeviceSetup, what: str, index: str, allowed: str) -> ConfigurationError:
    return ConfigurationError(
        f"the drive {what}", where=f"drive node {device.node_id}, object {index}", given="0, and it refuses another",
        allowed=allowed, advice="Set it with the drive's commissioning tool.",
    )  # fmt: skip


def write_timing(device: DeviceSetup, period_s: float, mode: OperationMode) -> None:
    """Set SYNC without counter, its period, and the interpolation time, which CST does not need."""
    if (device.peek(Index.SYNC_COB_ID) or _SYNC) & _SYNC_BITS != _SYNC:
        device.write(Index.SYNC_COB_ID, 0, _SYNC, mask=_SYNC_BITS)
    if device.peek(Index.SYNC_COUNTER_OVERFLOW):
        device.write(Index.COMMUNICATION_CYCLE_PERIOD, 0, 0)  # CiA 301: else 0x1019 is locked
        device.write(Index.SYNC_COUNTER_OVERFLOW, 0, 0)
    device.prefer(Index.COMMUNICATION_CYCLE_PERIOD, 0, round(period_s * 1e6))
    if not device.has(Index.INTERPOLATION_TIME, 1):
        return
    try:
        device.set_interpolation_time(period_s)
    except SettingRefused:
        units, exponent = (device.peek(Index.INTERPOLATION_TIME, k) for k in (1, 2))
        held_s = math.nan if units is None or exponent is None else units * 10.0**exponent
        if math.isclose(held_s, period_s):
            return
        if mode is not OperationMode.CYCLIC_SYNC_TORQUE:
            raise
        device.kept.append(f"0x60C2 (interpolation time) {held_s:g} s instead of {period_s:g} s")


def write_watchdogs(
    device: DeviceSetup, master_id: int, master_lost_s: float, heartbeat_s: float, deadline_s: float
) -> Watchdogs:
    """Set heartbeats both ways and the deadline of the RPDO. Raises ConfigurationError if the drive has no watchdog."""
    consumer = device.prefer(Index.CONSUMER_HEARTBEAT_TIME, 1, master_id << 16 | round(1000 * master_lost_s))
    watches_master = bool(consumer and consumer >> 16 & 0x7F == master_id and consumer & 0xFFFF)
    sent_ms = device.prefer(Index.PRODUCER_HEARTBEAT_TIME, 0, round(1000 * heartbeat_s))
    deadline_ms = max(1, math.floor(round(1000 * deadline_s, 6)))
    supervised = bool(device.prefer(Index.RPDO_COMMUNICATION, _RPDO_EVENT_TIMER, deadline_ms))
    if not watches_master and not supervised:
        raise ConfigurationError(
            "the drive would not notice that its commands stop",
            where=f"drive node {device.node_id}, objects 0x1016:01 and 0x1400:05", given=", ".join(device.kept),
            allowed="a heartbeat of the master that it awaits, or a deadline of its RPDO",
            advice="Set one of them with the drive's commissioning tool; the EDS must have it.",
        )  # fmt: skip
    return Watchdogs(sent_ms / 1000 if sent_ms else math.inf, supervised)
