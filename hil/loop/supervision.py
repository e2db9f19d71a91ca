"""The rules of supervision: what stops the axis at a tick, how, how fast, and with which words.

A rule holds if one of its bits is set: `Limit` (compiled checks of the tick), conditions of the drive or of the linear
encoder, or a sign of the loop itself. The first rule in `RULES` that holds names the end of a run; any that holds may
require a quick stop. docs/supervision.md shows the table; a test compares them.
"""

from collections.abc import Callable, Iterator
from enum import IntFlag, StrEnum
from typing import NamedTuple

from drivers.port import Condition, DriverError, EncoderSample
from hil.bench.hardware import DriveSection
from hil.loop.devices import Devices
from hil.loop.limits import Limit
from hil.loop.stall import NO_STALL, Stall


class Ending(StrEnum):
    """Reason for the end of a run."""

    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    DRIVE_FAULT = "drive fault"
    ENCODER_FAULT = "encoder fault"
    FOLLOWING_ERROR = "following error"
    TRAVEL_LIMIT = "travel limit"
    OVERRUN = "loop too late"
    NOT_FINITE = "not a number"
    VELOCITY = "velocity"
    TORQUE = "torque"
    RESIDUAL = "twin's residual"
    SIGN = "wrong sign"
    STOP_FAILS = "stop without effect"


class Reaction(StrEnum):
    """How the axis is stopped: by the loop within the limits of the profile, or by the drive with its own ramp."""

    STOP = "controlled stop"
    QUICK_STOP = "quick stop"
    BY_FEEDBACK = "quick stop if fed back, else controlled stop"
    TWICE = "controlled stop; again: quick stop"


class LoopSign(IntFlag):
    """Signs of the loop itself."""

    NONE = 0
    ASKED = 1  # by the user
    LATE = 2
    STALLED = 4  # a short time ago: the axis did not get the set-points of the ticks left out


class Trip(NamedTuple):
    """A line of the table. cycles: from the fault (bound passed, last good frame) to the reaction, at most, as text."""

    name: str
    ending: Ending
    condition: str
    reaction: Reaction
    cycles: str
    reason: str  # {text}: of the device; fields of the section `drive` by name
    limit: Limit = Limit.NONE
    drive: Condition = Condition.OK
    encoder: Condition = Condition.OK
    loop: LoopSign = LoopSign.NONE


class StopCause(NamedTuple):
    """Ending of the run, its reason in words, and True if only the drive's own ramp can stop the axis."""

    ending: Ending
    reason: str
    quick: bool
    rule: str


# Bounds that an axis breaks to which set-points did not come; those that compare encoders are none
_RESIDUAL = Limit.RESIDUAL_ENCODER | Limit.RESIDUAL_DRIVE | Limit.RESIDUAL_LOAD
AFTER_STALL = (Limit.FOLLOWING_ERROR | Limit.VELOCITY | Limit.TORQUE | Limit.TRAVEL | Limit.STOPPING_DISTANCE
               | Limit.ACTING_TORQUE | _RESIDUAL)  # fmt: skip
STALL_SHARE = 0.2  # of a bound: a stall that moves the axis by less is not why it is passed

_E, _R, _L, _C = Ending, Reaction, Limit, Condition
_STALE = "missed_answers + 2"
_BEAT = "heartbeat time-out + 1"

RULES: tuple[Trip, ...] = (
    # first, because a late loop has the drive trip by its own watchdog
    Trip("loop late", _E.OVERRUN, "lateness > overrun_s, or > deadline of the RPDO or two heartbeats, less two periods",
         _R.STOP, "1", "the loop was {lateness_s:.3f} s late, allowed {late_limit_s:.3f} s (drive.overrun_s, "
         "drive.command_deadline_s, drive.heartbeat_s): take load off the machine", loop=LoopSign.LATE),
    Trip("after a stall", _E.OVERRUN, "ticks were left out less than three time constants of the position loop ago; "
         "only bounds are passed that this can break, and it moved the axis by a fifth of them or more", _R.TWICE, "1",
         "the axis did not follow because the loop had been {stall_s:.3f} s late: take load off the machine",
         loop=LoopSign.STALLED),
    Trip("drive bus-off", _E.DRIVE_FAULT, "the controller left the bus", _R.QUICK_STOP, "1", "{text}",
         drive=_C.BUS_OFF),
    Trip("drive heartbeat lost", _E.DRIVE_FAULT, "no heartbeat of the drive", _R.QUICK_STOP, _BEAT, "{text}",
         drive=_C.HEARTBEAT_LOST),
    Trip("drive not operational", _E.DRIVE_FAULT, "the drive left NMT operational", _R.QUICK_STOP, "1", "{text}",
         drive=_C.NOT_OPERATIONAL),
    Trip("drive emergency", _E.DRIVE_FAULT, "EMCY with an error code", _R.QUICK_STOP, "1", "{text}",
         drive=_C.EMERGENCY),
    Trip("drive fault", _E.DRIVE_FAULT, "state FAULT or FAULT REACTION ACTIVE", _R.QUICK_STOP, "1", "{text}",
         drive=_C.FAULT),
    Trip("drive switched off", _E.DRIVE_FAULT, "left OPERATION ENABLED by itself", _R.QUICK_STOP, "1", "{text}",
         drive=_C.DISABLED),
    Trip("drive unanswered", _E.DRIVE_FAULT, "does not follow its controlword", _R.QUICK_STOP, "1", "{text}",
         drive=_C.UNANSWERED),
    Trip("drive set-point", _E.DRIVE_FAULT, "the set-point that acts (0x6074, 0x606B, 0x6062) is none of those of the "
         "last missed_answers + 3 cycles", _R.QUICK_STOP, "missed_answers + 4", "{text}", drive=_C.OTHER_SETPOINT),
    Trip("drive stale", _E.DRIVE_FAULT, "SYNC or answers lost: more than missed_answers in a row", _R.QUICK_STOP,
         _STALE, "{text}", drive=_C.STALE),
    Trip("table encoder bus-off", _E.ENCODER_FAULT, "the controller left the bus", _R.BY_FEEDBACK, "1", "{text}",
         encoder=_C.BUS_OFF),
    Trip("table encoder heartbeat lost", _E.ENCODER_FAULT, "no heartbeat of the encoder", _R.BY_FEEDBACK, _BEAT,
         "{text}", encoder=_C.HEARTBEAT_LOST),
    Trip("table encoder not operational", _E.ENCODER_FAULT, "the encoder left NMT operational", _R.BY_FEEDBACK, "1",
         "{text}", encoder=_C.NOT_OPERATIONAL),
    Trip("table encoder alarm", _E.ENCODER_FAULT, "alarm of the encoder", _R.BY_FEEDBACK, "1", "{text}",
         encoder=_C.ALARM),
    Trip("table encoder line lost", _E.ENCODER_FAULT, "serial line gone", _R.BY_FEEDBACK, "1", "{text}",
         encoder=_C.LINE_LOST),
    Trip("table encoder stale", _E.ENCODER_FAULT, "more than missed_answers in a row", _R.BY_FEEDBACK, _STALE, "{text}",
         encoder=_C.STALE),
    Trip("not a number", _E.NOT_FINITE, "NaN or infinity in set-point, sample, command or twin", _R.QUICK_STOP, "1",
         "a set-point, sample, command or value of the twin is NaN or infinite", _L.NOT_FINITE),
    Trip("motor encoder jump", _E.ENCODER_FAULT, "step > velocity bound x time + frozen_m", _R.QUICK_STOP, "1",
         "the motor encoder jumped further than the axis can move: check encoder and cable", _L.MOTOR_JUMP),
    Trip("table encoder jump", _E.ENCODER_FAULT, "step > velocity bound x time + frozen_m", _R.BY_FEEDBACK, "1",
         "the table encoder jumped further than the axis can move: check encoder and cable", _L.TABLE_JUMP),
    Trip("wrong sign", _E.SIGN, "faster by runaway_m_s while the torque, > load_torque, is against the motion; or the "
         "first motion is against the set-points by > sign_m", _R.QUICK_STOP, "1",
         "feedback or torque acts with the wrong sign: the axis moves against its torque or its set-points; correct "
         "the phase order of the motor, the direction of its encoder or the polarity (0x607E)", _L.SIGN),
    Trip("stop without effect", _E.STOP_FAILS, "in a controlled stop: faster by runaway_m_s than at its begin, or "
         "backwards by it; and more by what the loop may overshoot", _R.QUICK_STOP, "1",
         "the axis got faster while the loop stopped it: feedback or torque acts with the wrong sign, the loop is "
         "unstable, or a force from outside drives the axis", _L.STOP_FAILS),
    Trip("motor encoder frozen", _E.ENCODER_FAULT,
         "value repeats; table moved > frozen_m or measured torque changed > frozen_torque (CST)", _R.QUICK_STOP, "1",
         "the motor encoder is frozen, or the axis blocked: its value repeats while table or torque change",
         _L.MOTOR_FROZEN),
    Trip("table encoder frozen", _E.ENCODER_FAULT, "value repeats; motor moved > frozen_m", _R.BY_FEEDBACK, "1",
         "the table encoder is frozen: its value repeats while the motor moves", _L.TABLE_FROZEN),
    Trip("motor encoder reversed", _E.ENCODER_FAULT, "against the table and the set-points by > "
         "frozen_m, since they agreed", _R.QUICK_STOP, "1",
         "the motor encoder counts against the table encoder and the set-points: correct its "
         "direction", _L.MOTOR_REVERSED),
    Trip("table encoder reversed", _E.ENCODER_FAULT, "against the motor by > frozen_m, since they agreed",
         _R.BY_FEEDBACK, "1",
         "the table encoder counts against the motor encoder: correct encoders.table.direction", _L.TABLE_REVERSED),
    Trip("encoder difference", _E.ENCODER_FAULT, "motor and table differ by > encoder_difference_m", _R.BY_FEEDBACK,
         "1", "motor encoder and table encoder differ by more than the transmission allows "
         "(drive.supervision.encoder_difference_m): one counts wrong or the coupling slips", _L.ENCODER_DIFFERENCE),
    Trip("velocity", _E.VELOCITY, "smoothed velocity > velocity_m_s", _R.QUICK_STOP, "16",
         "the motor is faster than its bound (drive.supervision.velocity_m_s)", _L.VELOCITY),
    Trip("acting set-point", _E.DRIVE_FAULT, "smoothed measured less commanded torque > torque_difference (CST)",
         _R.QUICK_STOP, "16", "the torque differs from its command (drive.supervision.torque_difference): set-points "
         "do not reach the drive, or it limits them or turns their sign", _L.ACTING_TORQUE),
    Trip("torque", _E.TORQUE, "measured torque > torque", _R.QUICK_STOP, "3",
         "the torque exceeds its bound (drive.supervision.torque)", _L.TORQUE),
    Trip("following error", _E.FOLLOWING_ERROR,
         "set-point less fed-back position > following_error_m + following_error_s x speed", _R.TWICE, "1",
         "the axis is more than {following_error_m} m from its set-point (drive.following_error_m): blocked, "
         "overloaded, or badly tuned", _L.FOLLOWING_ERROR),
    Trip("travel", _E.TRAVEL_LIMIT, "fed-back position outside travel_m", _R.STOP, "1",
         "the axis left {travel_m} m (drive.travel_m): correct the profile or home the axis", _L.TRAVEL),
    Trip("stopping distance", _E.TRAVEL_LIMIT, "place of a stop from now outside travel_m by > following_error_m",
         _R.STOP, "16", "the axis is too fast to stop inside {travel_m} m (drive.travel_m)", _L.STOPPING_DISTANCE),
    Trip("torque over time", _E.TORQUE, "mean square over thermal_time_s > continuous_torque squared", _R.STOP, "1",
         "the torque over time exceeds drive.supervision.continuous_torque: let the motor cool, lower the "
         "accelerations", _L.TORQUE_TIME),
    Trip("residual: encoder", _E.RESIDUAL, "one position leaves the twin, torque does not", _R.STOP, "20",
         "the axis deviates from its twin; suspect: encoder (one position alone)", _L.RESIDUAL_ENCODER),
    Trip("residual: drive", _E.RESIDUAL, "torque leaves the twin and its command", _R.STOP, "20",
         "the axis deviates from its twin; suspect: drive (torque differs from its command)", _L.RESIDUAL_DRIVE),
    Trip("residual: load", _E.RESIDUAL, "torque or both positions leave the twin", _R.STOP, "20",
         "the axis deviates from its twin; suspect: load (friction, mass, external force)", _L.RESIDUAL_LOAD),
    Trip("stop asked", _E.INTERRUPTED, "ctrl-C or a signal", _R.TWICE, "1", "stopped by the user",
         loop=LoopSign.ASKED),
)  # fmt: skip
# Conditions that stop the axis; a late sample or a damaged frame of an encoder does not.
_ENCODER_LOST = Condition(sum(rule.encoder for rule in RULES))


def find(
    rig: Devices,
    seen: EncoderSample,
    passed: int,
    lateness_s: float,
    stops_asked: int,
    *,
    stopping: bool,
    stall: Stall = NO_STALL,
) -> Iterator[StopCause]:
    """Yield the faults, the gravest first. passed: the `Limit`s; lateness_s of the tick; stopping: under control;
    stall: a short time ago."""
    section, tripped = rig.section, rig.drive.tripped
    lost = seen.condition & _ENCODER_LOST if rig.encoder is not None else Condition.OK
    loop = LoopSign.ASKED if stops_asked else LoopSign.NONE
    if lateness_s > rig.late_limit_s:
        loop |= LoopSign.LATE
    if not tripped and not lost and _explains(stall, passed, section):
        loop |= LoopSign.STALLED
    for rule in RULES:
        if not (rule.limit & passed or rule.drive & tripped or rule.encoder & lost or rule.loop & loop):
            continue
        text = ""
        if rule.drive:
            text = _text(rig.drive.check)
        elif rule.encoder and rig.encoder is not None:
            text = _text(rig.encoder.check)
        reason = rule.reason.format(
            text=text, lateness_s=lateness_s, late_limit_s=rig.late_limit_s, stall_s=stall.lateness_s,
            travel_m=section.travel_m, following_error_m=section.following_error_m)  # fmt: skip
        again = stops_asked > 1 if rule.loop & LoopSign.ASKED else stopping
        quick = {
            Reaction.STOP: False,
            Reaction.QUICK_STOP: True,
            Reaction.BY_FEEDBACK: rig.bench.gains.position_from_table,
            Reaction.TWICE: again,
        }[rule.reaction]
        yield StopCause(rule.ending, reason, quick, rule.name)


def _explains(stall: Stall, passed: int, section: DriveSection) -> bool:
    """Return True if a stall breaks bounds of this kind, and no others are passed."""
    bounds_m = [section.following_error_m]
    if passed & _RESIDUAL and (residual := section.supervision.residual):
        bounds_m += [residual.motor_m, residual.table_m or residual.motor_m]
    return bool(passed) and not passed & ~AFTER_STALL and stall.deviation_m >= STALL_SHARE * min(bounds_m)


def rules_table() -> str:
    """Return the rules as the table of docs/supervision.md."""
    lines = ["| rule | condition | reaction | cycles | ending |", "|---|---|---|---|---|"]
    lines += [f"| {r.name} | {r.condition} | {r.reaction} | {r.cycles} | {r.ending} |" for r in RULES]
    return "\n".join(lines) + "\n"


def _text(check: Callable[[], None]) -> str:
    try:
        check()
    except DriverError as error:
        return str(error)
    return "it recovered by itself"
