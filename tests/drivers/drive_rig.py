"""A rig for the driver tests: master, drive client and simulated nodes on one bus, and a loop in virtual time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from drivers.bus import CanPort
from drivers.canopen_drive import CanopenDrive, DriveSettings
from drivers.canopen_encoder import CanopenEncoder, EncoderSettings
from drivers.canopen_master import CanopenMaster
from drivers.inprocess import InProcessBus
from drivers.modelled_bus import ModelledBus
from drivers.port import Condition, DriveGoal, DriveSample, ServoLike
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.encoder_node import SimulatedEncoder
from drivers.sim.servo import DriveServo, Servo


@dataclass
class Mass:
    """A rigid axis without friction, exact under a constant torque: the simplest thing a drive can move."""

    inertia_kg_m2: float = 0.01
    lead_m: float = 0.01
    motor_position_rad: float = 0.0
    velocity_rad_s: float = 0.0
    torque_n_m: float = 0.0

    @property
    def table_position_m(self) -> float:
        return self.motor_position_rad * self.lead_m / 6.283185307179586

    def advance(self, torque_command_n_m: float, period_s: float) -> None:
        self.torque_n_m = torque_command_n_m
        acceleration = torque_command_n_m / self.inertia_kg_m2
        self.motor_position_rad += self.velocity_rad_s * period_s + acceleration * period_s**2 / 2
        self.velocity_rad_s += acceleration * period_s


@dataclass
class Rig:
    """`node_port` None: the nodes share the client's kind of port, made by `new_port`."""

    port: CanPort
    node_port: CanPort
    settings: DriveSettings = field(default_factory=DriveSettings)
    plant: Mass = field(default_factory=Mass)
    servo: ServoLike | None = None
    reply_s: float = 0.0  # time within a cycle after which the samples are read

    def __post_init__(self) -> None:
        self.node = SimulatedDrive(self.node_port, self.plant, servo=self.servo)
        self.encoder_node = SimulatedEncoder(self.node_port, self.plant)
        self.master = CanopenMaster(self.port)
        self.drive = CanopenDrive(self.master, self.settings)
        self.encoder = CanopenEncoder(self.master, EncoderSettings())
        self.tick = 0

    def set_up(self) -> None:
        self.drive.set_up()
        self.encoder.set_up()
        self.master.start(self.now_s)

    @property
    def now_s(self) -> float:
        return self.tick * self.settings.period_s

    def cycle(self, setpoint: float = 0.0) -> DriveSample:
        now_s = self.now_s
        self.master.sync(now_s)
        self.master.poll(now_s + self.reply_s)
        self.node.clock(now_s + self.reply_s)  # it has a clock of its own, where no SYNC comes
        sample = self.drive.read(now_s + self.reply_s)
        self.encoder_sample = self.encoder.read(now_s + self.reply_s)
        self.drive.command(now_s + self.reply_s, setpoint)
        self.tick += 1
        return sample

    def enable(self, cycles: int = 20) -> DriveSample:
        self.drive.goal = DriveGoal.ENABLED
        for _ in range(cycles):
            sample = self.cycle(self.drive.read(self.now_s).motor_position_rad if self._csp else 0.0)
            if sample.enabled:
                return sample
        raise AssertionError(f"not enabled after {cycles} cycles: {sample}")

    @property
    def _csp(self) -> bool:
        return self.settings.mode == 8


def in_process(**options: Any) -> Rig:
    """A rig on a bus within the process."""
    bus = InProcessBus()
    return Rig(bus.port(), bus.port(), **options)


def servo() -> DriveServo:
    """Loops inside the drive."""
    return DriveServo(
        Servo(velocity_gain_n_m_s_rad=1.0, velocity_integral_time_s=0.02, position_every=1), 0.01 / (2 * math.pi)
    )


def running(**options: Any) -> tuple[ModelledBus, Rig]:
    """Enabled and turning at about 10 rad/s."""
    bus = ModelledBus(1_000_000)
    rig = Rig(bus.port(), bus.port(), reply_s=0.0006, servo=servo(), **options)
    rig.set_up()
    rig.enable()
    for _ in range(50):
        rig.cycle(2.0)
    assert rig.cycle(0.0).condition is Condition.OK
    return bus, rig
