"""Find the faults at a tick of the loop, and decide if the loop can still stop the axis under control."""

from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import NamedTuple

from drivers.port import Condition, DriverError, EncoderSample
from hil.loop.cycle import Limit
from hil.loop.devices import Devices

# Conditions that make a linear encoder unusable; a late sample or a damaged frame does not.
_ENCODER_LOST = (Condition.STALE | Condition.HEARTBEAT_LOST | Condition.BUS_OFF | Condition.NOT_OPERATIONAL
                 | Condition.ALARM | Condition.LINE_LOST)  # fmt: skip


class Ending(StrEnum):
    """Reason of the end of a run."""

    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    DRIVE_FAULT = "drive fault"
    ENCODER_FAULT = "encoder fault"
    FOLLOWING_ERROR = "following error"
    TRAVEL_LIMIT = "travel limit"
    OVERRUN = "loop too late"


class StopCause(NamedTuple):
    """Ending of the run, its reason in words, and True if only the drive's own ramp can stop the axis."""

    ending: Ending
    reason: str
    quick: bool


def find(
    rig: Devices, seen: EncoderSample, passed: int, lateness_s: float, stops_asked: int, *, stopping: bool
) -> Iterator[StopCause]:
    """Yield the faults, the gravest first. passed: the `Limit`s; lateness_s of the tick; stopping: under control."""
    section, gains = rig.section, rig.bench.gains
    if rig.drive.tripped:
        yield StopCause(Ending.DRIVE_FAULT, _text(rig.drive.check), True)
    if seen.condition & _ENCODER_LOST and rig.encoder is not None:
        yield StopCause(Ending.ENCODER_FAULT, _text(rig.encoder.check), gains.position_from_table)
    if passed & Limit.FOLLOWING_ERROR:
        yield StopCause(
            Ending.FOLLOWING_ERROR,
            f"the axis is more than {section.following_error_m} m from its set-point "
            "(drive.following_error_m): blocked, overloaded, or badly tuned",
            stopping,
        )
    if passed & Limit.TRAVEL:
        yield StopCause(
            Ending.TRAVEL_LIMIT,
            f"the axis left {section.travel_m} m (drive.travel_m): correct the profile or home the axis",
            False,
        )
    if stops_asked:
        yield StopCause(Ending.INTERRUPTED, "stopped by the user", stops_asked > 1)
    if lateness_s > section.overrun_s:
        yield StopCause(
            Ending.OVERRUN,
            f"the loop was {lateness_s:.3f} s late, allowed {section.overrun_s} s "
            "(drive.overrun_s): take load off the machine",
            False,
        )


def _text(check: Callable[[], None]) -> str:
    try:
        check()
    except DriverError as error:
        return str(error)
    return "it recovered by itself"
