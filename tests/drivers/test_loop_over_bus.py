"""The bus adds nothing to the loop but the resolution of its numbers: servo over CANopen against servo on the plant."""

from __future__ import annotations

import numpy as np
import pytest
from drive_rig import Rig

from drivers.inprocess import InProcessBus
from drivers.port import ServoTarget
from drivers.sim.axis import two_mass
from drivers.sim.plant import Plant
from drivers.sim.servo import DriveServo, Servo


def test_a_servo_over_the_bus_moves_the_axis_as_one_wired_to_it() -> None:
    axis = two_mass()
    ratio_m_rad = axis.drive_ratio_m_rad
    time_s = np.arange(800) * 1e-3
    velocity_m_s = 0.05 * np.sin(np.pi * np.clip((time_s - 0.05) / 0.6, 0, 1)) ** 2
    position_m = np.cumsum(velocity_m_s) * 1e-3

    bus = InProcessBus()
    rig = Rig(bus.port(), bus.port(), plant=Plant(axis, seed=3))  # type: ignore[arg-type]
    rig.set_up()
    idle = 0
    rig.drive.goal = rig.drive.goal.ENABLED
    while not rig.cycle().enabled:
        idle += 1
    over_bus = DriveServo(Servo(), ratio_m_rad)
    over_bus.reset(0.0)

    wired, plant = DriveServo(Servo(), ratio_m_rad), Plant(axis, seed=3)
    for _ in range(idle + 2):  # the noise of the sensors goes on while the power stage is off
        plant.advance(0.0, 1e-3)
    wired.reset(0.0)

    rig.master.sync(rig.now_s)
    for k in range(time_s.size):
        sample, table = rig.drive.read(rig.now_s), rig.encoder.read(rig.now_s)
        target = ServoTarget(velocity_m_s[k] / ratio_m_rad, position_m[k] / ratio_m_rad)
        assert sample.motor_position_rad == pytest.approx(plant.motor_position_rad, abs=1e-9)
        assert table.position_m == pytest.approx(plant.table_position_m, abs=1e-12)
        assert sample.torque_n_m == pytest.approx(plant.torque_n_m, abs=0.002 + 1e-9)
        rig.drive.command(rig.now_s, over_bus.torque(target, sample.motor_position_rad, 1e-3))
        resolution_n_m = rig.drive.info.torque_resolution_n_m
        torque_n_m = wired.torque(target, plant.motor_position_rad, 1e-3)
        plant.advance(round(torque_n_m / resolution_n_m) * resolution_n_m, 1e-3)
        rig.tick += 1
        rig.master.sync(rig.now_s)
    assert sample.motor_position_rad * ratio_m_rad > 0.014
