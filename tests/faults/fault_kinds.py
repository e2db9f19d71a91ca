"""The faults of the matrix: what happens, what the run may end with, and within how many cycles it must be detected.

A bound is counted from the fault. Where a rule of docs/supervision.md counts from the passing of a bound,
the time until the move can pass it is added (`MOVING_CYCLES`). None: nothing has to be detected.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from observed_run import Handles
from wrong_signs import encoder_in_the_loop, in_the_drive, torque_in_the_loop

from drivers.bus import BusState
from drivers.cia402 import DriveState
from drivers.modelled_bus import Fault, FaultKind
from drivers.port import BusError
from hil.errors import HilError

SYNC, RPDO, DRIVE_TPDO, ENCODER_TPDO = 0x080, 0x205, 0x185, 0x186
DRIVE_BEAT, ENCODER_BEAT, MASTER_BEAT = 0x705, 0x706, 0x701
MANY = 1_000_000
STALE_CYCLES = 3 + 2  # missed_answers + 2
BEAT_CYCLES = 3 * 20 + 20 + 1  # heartbeat time-out, counted from the last one, + 1
DEADLINE_CYCLES = 50 + 16 + 1  # of the RPDO in the drive, or the smoothing of the acting set-point, whichever is first
MOVING_CYCLES = 160  # the whole move: an encoder that deviates is seen once the axis has moved by its bound
COMPLETE = "complete"
DRIVE, ENCODER, HIL = "drive fault", "encoder fault", "HilError"
SETTLING_CYCLES = 40 + 82 + 2  # a stall that passes, three time constants of the position loop
SETPOINT_CYCLES = 3 + 4  # missed_answers + 4
FOLLOWING, LATE, ASKED, NAN = "following error", "loop too late", "interrupted", "not a number"
MEASURED = frozenset(
    {ENCODER, FOLLOWING, "velocity", "torque", DRIVE, "travel limit", "wrong sign", "stop without effect"}
)


@dataclass(frozen=True)
class Kind:
    """A fault. endings: allowed where it strikes an enabled drive, COMPLETE if it may pass; cycles: bound of detection.

    hears: False where no stop command can reach the drive, whose own watchdogs stop it then.
    """

    name: str
    act: Callable[[Handles], None]
    endings: frozenset[str]
    cycles: int | None = None
    hears: bool = True
    coasts: bool = False  # power goes off at once: friction alone stops the axis
    stalls: bool = False  # the loop does nothing for a time: the way counts from the fault
    sign: str = ""  # what acts with the wrong sign: "loop", or "drive", whose own ramp accelerates then
    cst: bool = False  # in this mode alone


def _bus(kind: FaultKind, can_id: int, count: Callable[[Handles], int], **more: Any) -> Callable[[Handles], None]:
    return lambda h: h.bus.inject(Fault(kind, can_id, count=count(h), **more))


def _few(h: Handles) -> int:
    return h.rng.randint(1, 3)


def _many(h: Handles) -> int:
    return MANY


def _corrupt(can_id: int, size: int) -> Callable[[Handles], None]:
    return lambda h: h.bus.inject(
        Fault(FaultKind.CORRUPT, can_id, count=h.rng.randint(1, 3), byte=h.rng.randrange(size))
    )


def _late(can_id: int) -> Callable[[Handles], None]:
    return lambda h: h.bus.inject(Fault(FaultKind.DELAY, can_id, count=_few(h), delay_s=h.rng.uniform(1e-4, 9e-4)))


def _reordered(can_id: int) -> Callable[[Handles], None]:
    return lambda h: h.bus.inject(Fault(FaultKind.DELAY, can_id, count=1, delay_s=h.rng.uniform(1.1e-3, 2.5e-3)))


def _no_buffer(h: Handles) -> None:
    """ENOBUFS: the transmit queue is full for some frames; `PythonCanPort.send` counts them as lost."""
    left, health = [h.rng.randint(1, 6)], h.rig.master.health

    def full(send: Callable[..., None]) -> Callable[..., None]:
        def sent(can_id: int, data: bytes, now_s: float) -> None:
            if left[0] > 0:
                left[0] -= 1
                health.frames_lost += 1
                health.last_error = "Transmit buffer full"
            else:
                send(can_id, data, now_s)

        return sent

    h.rig.master._send, h.rig.drive._send = full(h.rig.master._send), full(h.rig.drive._send)


def _receive(h: Handles) -> None:
    poll, left = h.rig.master.poll, [h.rng.choice((1, 3, MANY))]

    def failing(now_s: float, timeout_s: float = 0.0) -> None:
        if left[0] > 0:
            left[0] -= 1
            raise BusError("receiving failed (Network is down)", where="bus socketcan:can0")
        poll(now_s, timeout_s)

    h.rig.master.poll = failing


def _emcy(h: Handles) -> None:
    data = b"\x10\x23" + h.rng.randbytes(6)
    h.drive.port.send(0x085, data[: h.rng.randint(2, 8)], h.tick * 1e-3)


def _short_emcy(h: Handles) -> None:
    """0 or 1 byte: the upper byte of the code, which tells an error, is missing."""
    h.drive.port.send(0x085, b"\x10"[: h.rng.randint(0, 1)], h.tick * 1e-3)


def _mute(h: Handles) -> None:
    h.drive.mute = True


def _off(h: Handles) -> None:
    h.drive.values[0x6007_00] = 2  # abort connection: disable voltage
    h.drive.communication_lost(h.tick * 1e-3)


def _deaf(h: Handles) -> None:
    h.drive._take_controlword = lambda now_s: None


def _sensor(device: str, change: Callable[[float, float, int, Handles], float]) -> Callable[[Handles], None]:
    """Change the positions that an encoder gives: (value, value at the fault, samples since, handles) -> reading."""

    def act(h: Handles) -> None:
        owner, name = getattr(h.rig, device), "motor_position_rad" if device == "drive" else "position_m"
        read, start, unit = owner.read, [], (2.0 * math.pi / 0.01 if device == "drive" else 1.0)

        def faulty(now_s: float) -> Any:
            sample = read(now_s)
            value = getattr(sample, name) / unit
            start.append(value)
            return sample._replace(**{name: unit * change(value, start[0], len(start), h)})

        owner.read = faulty

    return act


def _frozen(value: float, start: float, count: int, h: Handles) -> float:
    return start


def _jump(value: float, start: float, count: int, h: Handles) -> float:
    return value + 0.03


def _wrap(value: float, start: float, count: int, h: Handles) -> float:
    """A counter of 16 bit that nobody unwraps."""
    return value - 0.0327675


def _noisy(value: float, start: float, count: int, h: Handles) -> float:
    return value + h.rng.gauss(0.0, 0.004)


def _reversed(value: float, start: float, count: int, h: Handles) -> float:
    return 2.0 * start - value


def _nan(value: float, start: float, count: int, h: Handles) -> float:
    return h.rng.choice((math.nan, math.inf, -math.inf))


def _late_cycle(low_s: float, high_s: float) -> Callable[[Handles], None]:
    return lambda h: h.late_s.update({0: h.rng.uniform(low_s, high_s)})


def _stall_within(low_s: float, high_s: float) -> Callable[[Handles], None]:
    """The tick is met in time, and the loop stands still after its SYNC, while the drive's own time goes on."""

    def act(h: Handles) -> None:
        span_s, poll = h.rng.uniform(low_s, high_s), h.rig.master.poll
        h.stalled_s[0], h.late_s[1] = span_s, span_s - 1e-3

        def stalled(now_s: float, timeout_s: float = 0.0) -> None:
            h.rig.master.poll = poll
            poll(now_s, timeout_s)
            for ms in range(1, math.ceil(1e3 * span_s) + 1):
                h.drive.tick(h.tick * 1e-3 + min(1e-3 * ms, span_s))
            poll(h.tick * 1e-3 + span_s + 1e-3)

        h.rig.master.poll = stalled

    return act


def _recorder(h: Handles) -> None:
    h.rows.fail = HilError("the recorder process ended")


def _wall_clock(h: Handles) -> None:
    """CLOCK_REALTIME steps by up to a year and back again and again, for all that reads it in Python."""
    names = ("time", "time_ns", "clock_gettime", "clock_gettime_ns")
    kept = {name: getattr(time, name) for name in names}
    steps = {"s": 0.0}

    def stepped(name: str) -> Callable[..., Any]:
        read, unit = kept[name], 1e9 if name.endswith("_ns") else 1.0

        def now(*clock: int) -> Any:
            shift = steps["s"] if not clock or clock[0] == time.CLOCK_REALTIME else 0.0
            return read(*clock) + type(read(*clock))(unit * shift)

        return now

    h.each.append(lambda: steps.update(s=h.rng.choice((-1.0, 1.0)) * 10.0 ** h.rng.uniform(-3.0, 7.5)))
    for name in names:
        setattr(time, name, stepped(name))
    h.undo.append(lambda: [setattr(time, name, kept[name]) for name in names] and None)


def _other_setpoint(h: Handles) -> None:
    """An offset left in the drive (0x60B2, 0x60B1, 0x60B0) adds half the rated torque, 3 rev/s or a fifth of a turn."""
    drive, sign = h.drive, h.rng.choice((-1, 1))
    turn = drive._counts_per_rev

    received = drive.process_rpdo

    def shift(now_s: float) -> None:
        received(now_s)
        if drive.state is not DriveState.OPERATION_ENABLED:
            return
        if drive._direct:
            drive.values[0x6074_00] = drive.values[0x6071_00] + sign * 500
            drive._torque_n_m = drive.values[0x6074_00] * drive._n_m_per_mille
        else:
            drive.values[0x60FF_00] += sign * 3 * turn
            drive.values[0x607A_00] += sign * turn // 5

    drive.pdo._received = shift
    drive.pdo.configure(operational=drive.nmt_state == 5)


def _interrupt(h: Handles) -> None:
    h.session.ask_stop()


def _passive(h: Handles) -> None:
    h.rig.master.health.state = BusState.PASSIVE


def _ends(*names: str) -> frozenset[str]:
    return frozenset(names)


_PASSES = _ends(COMPLETE)
_D, _E = _ends(DRIVE), _ends(ENCODER)
KINDS: tuple[Kind, ...] = (
    *(Kind(f"{name} lost, 1 to 3", _bus(FaultKind.DROP, i, _few), _PASSES) for name, i in
      (("RPDO", RPDO), ("TPDO of the drive", DRIVE_TPDO), ("TPDO of the encoder", ENCODER_TPDO), ("SYNC", SYNC))),
    Kind("RPDO lost for good", _bus(FaultKind.DROP, RPDO, _many), _ends(DRIVE, FOLLOWING), DEADLINE_CYCLES, False),
    Kind("TPDO of the drive lost for good", _bus(FaultKind.DROP, DRIVE_TPDO, _many), _D, STALE_CYCLES),
    Kind("TPDO of the encoder lost for good", _bus(FaultKind.DROP, ENCODER_TPDO, _many), _E, STALE_CYCLES),
    Kind("SYNC lost for good", _bus(FaultKind.DROP, SYNC, _many), _D, STALE_CYCLES),
    Kind("heartbeat of the drive lost", _bus(FaultKind.DROP, DRIVE_BEAT, _many), _D, BEAT_CYCLES),
    Kind("heartbeat of the encoder lost", _bus(FaultKind.DROP, ENCODER_BEAT, _many), _E, BEAT_CYCLES),
    Kind("heartbeat of the master lost", _bus(FaultKind.DROP, MASTER_BEAT, _many), _D, BEAT_CYCLES),
    *(Kind(f"{name} late", _late(i), _PASSES) for name, i in
      (("RPDO", RPDO), ("TPDO of the drive", DRIVE_TPDO), ("TPDO of the encoder", ENCODER_TPDO), ("SYNC", SYNC))),
    *(Kind(f"{name} duplicated", _bus(FaultKind.DUPLICATE, i, _few), _PASSES) for name, i in
      (("RPDO", RPDO), ("TPDO of the drive", DRIVE_TPDO), ("TPDO of the encoder", ENCODER_TPDO))),
    *(Kind(f"{name} reordered", _reordered(i), _PASSES) for name, i in
      (("RPDO", RPDO), ("TPDO of the drive", DRIVE_TPDO), ("TPDO of the encoder", ENCODER_TPDO))),
    Kind("RPDO corrupted", _corrupt(RPDO, 4), MEASURED | _PASSES, 3 + SETPOINT_CYCLES, coasts=True),
    Kind("TPDO of the drive corrupted", _corrupt(DRIVE_TPDO, 8), MEASURED | _PASSES, 3 + 2),
    Kind("TPDO of the encoder corrupted", _corrupt(ENCODER_TPDO, 4), MEASURED | _PASSES, 3 + 2),
    Kind("RPDO cut", _bus(FaultKind.TRUNCATE, RPDO, _few), _D, 3),
    Kind("ENOBUFS, 1 to 6 frames", _no_buffer, _ends(COMPLETE, DRIVE), 6 + STALE_CYCLES),
    Kind("receive exception", _receive, _ends(HIL), 1),
    Kind("bus passive", _passive, _PASSES),
    Kind("bus-off", _bus(FaultKind.BUS_OFF, SYNC, _few), _D, 1, False),
    Kind("drive silent", _mute, _D, STALE_CYCLES),
    Kind("drive reboots", lambda h: h.drive.reset(h.tick * 1e-3), _D, 2, coasts=True),
    Kind("drive switches off", _off, _D, 2, coasts=True),
    Kind("drive ignores controlwords", _deaf, _ends(COMPLETE, DRIVE), None, False),
    Kind("EMCY of 2 to 8 bytes", _emcy, _D, 2),
    Kind("EMCY of 0 or 1 byte", _short_emcy, _PASSES),
    *(Kind(f"{name} encoder frozen", _sensor(d, _frozen), MEASURED | _PASSES, MOVING_CYCLES) for name, d in
      (("motor", "drive"), ("table", "encoder"))),
    *(Kind(f"{name} encoder jumps", _sensor(d, _jump), MEASURED, 2) for name, d in
      (("motor", "drive"), ("table", "encoder"))),
    *(Kind(f"{name} encoder wraps", _sensor(d, _wrap), MEASURED, 2) for name, d in
      (("motor", "drive"), ("table", "encoder"))),
    *(Kind(f"{name} encoder noisy", _sensor(d, _noisy), MEASURED, 20) for name, d in
      (("motor", "drive"), ("table", "encoder"))),
    *(Kind(f"{name} encoder reversed", _sensor(d, _reversed), MEASURED | _PASSES, MOVING_CYCLES) for name, d in
      (("motor", "drive"), ("table", "encoder"))),
    *(Kind(f"{name} encoder gives NaN or infinity", _sensor(d, _nan), _ends(NAN), 2) for name, d in
      (("motor", "drive"), ("table", "encoder"))),
    Kind("cycle late, 1 to 51 ms", _late_cycle(0.001, 0.051), _ends(COMPLETE, LATE), SETTLING_CYCLES, stalls=True),
    Kind("cycle late, 51 to 300 ms", _late_cycle(0.051, 0.3), _ends(LATE), 2, stalls=True),
    Kind("cycle stalls, 2 to 51 ms", _stall_within(0.002, 0.051), _ends(COMPLETE, LATE), SETTLING_CYCLES, stalls=True),
    Kind("cycle stalls, 52 to 300 ms", _stall_within(0.052, 0.3), _ends(LATE), 3, stalls=True),
    Kind("wrong sign of the motor encoder in the loop", encoder_in_the_loop, MEASURED | _PASSES, sign="loop"),
    Kind("wrong sign of the torque in the loop", torque_in_the_loop, MEASURED | _PASSES, sign="loop", cst=True),
    *(Kind(f"wrong sign of the {name} in the drive", in_the_drive(encoder=name == "motor encoder"), MEASURED | _PASSES,
           sign="drive") for name in ("motor encoder", "torque")),
    Kind("wall clock steps", _wall_clock, _PASSES),
    Kind("another set-point acts", _other_setpoint, _D, SETPOINT_CYCLES),
    Kind("recorder dead", _recorder, _ends(HIL), 2),
    Kind("stop asked", _interrupt, _ends(ASKED), 2),
)  # fmt: skip
