"""Feedback or torque of the wrong sign: on every bench that runs, in every mode, with and without a table encoder.

In the loop: the drive itself is sound, and its own ramp stops the axis. In the drive (phase order, encoder): its ramp
accelerates, and friction alone stops the axis once its power is off.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from observed_run import END_M, PERIOD_S, Handles, Observed
from reach import ANSWER_S, REST_M

from drivers.cia402 import DriveState
from drivers.port import PlantLike
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode
from hil.loop.bounds import make_bounds
from hil.loop.devices import Rig
from hil.loop.simulated_bench import load_simulated
from hil.loop.stall import acceleration_m_s2

BENCHES = ("reference", "reference_7dof", "emps")
# from arming on, in the move, in a stop of the drive (not in its fault reaction, which takes no command)
STATES = (DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED, DriveState.OPERATION_ENABLED,
          DriveState.QUICK_STOP_ACTIVE)  # fmt: skip
FIRST_MOTION_M = 1e-3  # within which the first motion after arming shows a wrong sign
DIVERGES = 5.0  # time constants J / Kp of the drive's velocity loop until it shows
ANSWERS = 11  # periods of full torque until the drive takes "disable voltage": nine speeds, one each way


class TurnedPlant:
    """A plant whose motor encoder counts backwards from now on, or whose torque acts backwards. The torque is shown
    as commanded, which is what a drive measures as its current."""

    def __init__(self, plant: PlantLike, *, encoder: bool) -> None:
        self._plant, self._encoder, self._start = plant, encoder, plant.motor_position_rad

    @property
    def motor_position_rad(self) -> float:
        position = self._plant.motor_position_rad
        return 2.0 * self._start - position if self._encoder else position

    @property
    def table_position_m(self) -> float:
        return self._plant.table_position_m

    @property
    def torque_n_m(self) -> float:
        return self._plant.torque_n_m if self._encoder else -self._plant.torque_n_m

    def advance(self, torque_command_n_m: float, period_s: float) -> None:
        self._plant.advance(torque_command_n_m if self._encoder else -torque_command_n_m, period_s)


def in_the_drive(*, encoder: bool) -> Callable[[Handles], None]:
    def act(h: Handles) -> None:
        h.drive.plant = h.drive._loops._plant = TurnedPlant(h.drive.plant, encoder=encoder)

    return act


def encoder_in_the_loop(h: Handles) -> None:
    """The positions that the drive sends are turned, its own are not."""
    read, start = h.rig.drive.read, []

    def turned(now_s: float) -> Any:
        sample = read(now_s)
        start.append(sample.motor_position_rad)
        return sample._replace(motor_position_rad=2.0 * start[0] - sample.motor_position_rad)

    h.rig.drive.read = turned


def torque_in_the_loop(h: Handles) -> None:
    """The set-points arrive turned, as by a wrong polarity of the torque (0x607E); CST alone."""
    command = h.rig.drive.command
    h.rig.drive.command = lambda now_s, setpoint: command(now_s, -setpoint)


def drawn_bench(rng: random.Random, *, cst: bool) -> tuple[Bench, str]:
    """A bench, and what it is. cst: of this mode."""
    name = rng.choice(BENCHES)
    data = load_simulated(name).model_dump()
    mode = "cst" if cst else rng.choice(list(DriveMode)).value
    data["drive"]["mode"], data["simulation"]["seed"] = mode, rng.randrange(1000)
    feedback = "-"
    if name != "emps":
        data["drive"]["command_deadline_s"] = None
        feedback = rng.choice(
            ("no table encoder", "motor", "table") if mode != "csp" else ("no table encoder", "motor")
        )
        if feedback == "no table encoder":
            data["encoders"]["table"] = None
        else:
            data["control"]["position_feedback"] = feedback
    return Bench.model_validate(data), f"{name}, {mode}, {feedback}"


def detection_way_m(seen: Observed) -> float:
    """Way of the table from the fault, or from arming, to the detection."""
    assert seen.injected is not None
    assert seen.detected is not None
    return abs(seen.ticks[seen.detected].table_m - seen.ticks[seen.injected].table_m)


def reach_m(seen: Observed, *, in_drive: bool) -> float:
    """Longest way from detection to rest, from the speed that the axis has then; see SAFETY.md."""
    rig: Rig = seen.rig
    bench, gains, at = rig.bench, rig.bench.gains, seen.detected
    full = acceleration_m_s2(bench, min(gains.torque_limit_n_m, make_bounds(rig, None).drive_torque))
    speed = max(abs(seen.ticks[k].table_m - seen.ticks[k - 1].table_m) for k in range(at - 3, at + 1)) / PERIOD_S
    speed += full * 3.0 * PERIOD_S  # until the drive takes the stop
    ramp = gains.ratio_m_rad * rig.drive.info.quick_stop_rad_s2
    if not in_drive:
        return speed * ANSWER_S + speed**2 / (2.0 * min(ramp, full)) + REST_M
    inertia = gains.ratio_m_rad / acceleration_m_s2(bench, 1.0)
    diverges_s = DIVERGES * inertia / gains.velocity_gain_n_m_s_rad
    speed += gains.ratio_m_rad * rig.drive.stop_margin + full * ANSWERS * PERIOD_S
    physics = bench.axis.physics()
    alone = acceleration_m_s2(bench, physics.coulomb_n_m)
    return speed * (diverges_s + ANSWER_S) + speed**2 / (2.0 * alone) + REST_M


def sign_violations(place: str, state: DriveState, seen: Observed) -> list[str]:
    """What is wrong with a run whose loop or drive acts with the wrong sign."""
    wrong: list[str] = []
    if seen.injected is None:
        return wrong
    if seen.powered_at_end or seen.still_powered:
        wrong.append("power is on at the end")
    if state is DriveState.QUICK_STOP_ACTIVE:
        return wrong
    if seen.detected is None:
        assert seen.rig is not None
        passed = abs(seen.end_m - END_M) < seen.rig.section.following_error_m  # struck near the end of the move
        return wrong if passed else [*wrong, "not detected"]
    way_m, allowed_m = seen.travel_m, reach_m(seen, in_drive=place == "drive")
    if way_m > allowed_m:
        wrong.append(f"travelled {1e3 * way_m:.1f} mm from detection, allowed {1e3 * allowed_m:.1f} mm")
    first_m = detection_way_m(seen)
    if state is DriveState.SWITCHED_ON and first_m > FIRST_MOTION_M:
        wrong.append(f"first motion of {1e3 * first_m:.2f} mm, allowed {1e3 * FIRST_MOTION_M:.0f} mm")
    return wrong
