"""The hardware sections of a bench file: `drive` (bus, drive, encoder, limits) and `simulation` (true parameters and
effects). Plain data: `hil.loop.devices` makes the devices of it, `hil.loop.simulated_bench` the simulated ones."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field, model_validator

from hil.bench.axis_fields import BenchSection, NotNegative, Positive
from hil.bench.supervision_section import SupervisionSection
from hil.errors import FieldError

NodeId = Annotated[int, Field(ge=1, le=127, description="CANopen node-ID")]
Share = Annotated[float, Field(gt=0.0, le=1.0)]


class DriveMode(StrEnum):
    """Mode of the drive: both loops run in this program (CST), only the position loop (CSV), or none (CSP)."""

    CST = "cst"
    CSV = "csv"
    CSP = "csp"


class EncoderConnection(BenchSection):
    """Connection of the linear encoder; its resolution is in the section `encoders`."""

    interface: Literal["canopen", "serial", "none"] = Field("canopen", description="how the encoder is read")
    node_id: NodeId = 6
    eds: str | None = Field(None, description="EDS file of the encoder; absent: the shipped one")
    serial_number: int | None = Field(None, description="object 0x1018:4; absent: any")
    device: str | None = Field(None, description="serial line, as /dev/ttyUSB0; simulated: absent")
    baudrate: Annotated[int, Field(gt=0, description="of the serial line [bit/s]")] = 921_600
    format: Literal["binary", "ascii"] = Field("binary", description="frames of the serial line")
    latency_s: NotNegative = Field(0.0, description="age of a reading when it arrives")


class SetPointLimits(BenchSection):
    """Limits of every set-point on this bench; a profile beyond them is refused."""

    velocity_m_s: Positive = Field(description="largest velocity")
    acceleration_m_s2: Positive = Field(description="largest acceleration")
    jerk_m_s3: Positive = Field(description="largest jerk")


class DriveSection(BenchSection):
    """Bus, drive and linear encoder, and what the loop allows before it stops the axis."""

    protocol: str = Field("canopen", description="protocol of the drive, a key of hil.loop.devices.PROTOCOLS")
    interface: Literal["inprocess", "virtual", "udp_multicast", "socketcan"] = Field(
        "inprocess", description="bus: socketcan for hardware, the others for simulated devices"
    )
    channel: str = Field("hil", description="socketcan: can0; udp_multicast: an IPv4 group, heard on this PC alone")
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000, description="of the bus [bit/s]")] = 1_000_000
    mode: DriveMode = Field(DriveMode.CST, description="set-point of the drive: torque, velocity or position")
    node_id: NodeId = 5
    master_node_id: NodeId = 1
    eds: str | None = Field(None, description="EDS file of the drive; absent: the shipped one")
    serial_number: int | None = Field(None, description="object 0x1018:4; absent: any")
    rated_torque_n_m: Positive | None = Field(
        None, description="object 0x6076, whose 1/1000 is the resolution of torque; absent: as the drive says [N m, N]"
    )
    heartbeat_s: Annotated[float, Field(ge=0.001, le=21.845)] = Field(
        0.02,
        description="between two heartbeats, of the master and of each device; three without one are a fault: whole "
        "ms in objects of 16 bit [s]",
    )
    watch_setpoint: bool = Field(
        True,
        description="compare the set-point that acts in the drive (object 0x6074, 0x606B or 0x6062 in a second "
        "TPDO, if the EDS has it) with those commanded",
    )
    encoder: EncoderConnection = Field(EncoderConnection(), description="connection of the linear encoder")
    travel_m: tuple[float, float] | None = Field(None, description="the axis is stopped outside [m]")
    limits: SetPointLimits | None = Field(
        None,
        description="of every set-point; absent: those of the profile alone, "
        "and designed experiments keep to what was recorded",
    )
    following_error_m: Positive = Field(0.005, description="the axis is stopped beyond [m]")
    response: Share = Field(0.4, description="share of the period within which the answers to a SYNC are awaited")
    missed_answers: Annotated[int, Field(ge=0, le=100)] = Field(3, description="in a row, before data count as stale")
    jitter_p99: Share = Field(0.5, description="share of the period; lateness beyond: not armed")
    overrun_s: Positive = Field(
        0.05,
        description="lateness at which the axis is stopped; at most the deadline of the "
        "set-points or two heartbeats, less two periods [s]",
    )
    command_deadline_s: Annotated[float, Field(gt=0.0, le=65.535)] | None = Field(
        None,
        description="without a set-point for longer the drive stops by itself (object 0x1400:5); absent: in cst "
        "the time in which the torque limit moves the axis by following_error_m, at most 0.05 (without a torque limit "
        "three periods); else 0.05 [s]",
    )
    supervision: SupervisionSection = Field(SupervisionSection(), description="bounds of the checks in each cycle")
    bus_load: Share = Field(0.7, description="largest share of the bus's time at which the drive is armed")
    over_budget: Literal["refuse", "arm"] = Field(
        "refuse",
        description="jitter_p99 or bus_load exceeded, or a drive that does not report a missing heartbeat: arm or not; "
        "the recording says so",
    )

    @model_validator(mode="after")
    def _consistent(self) -> DriveSection:
        if self.travel_m is not None and self.travel_m[0] >= self.travel_m[1]:
            raise FieldError(("travel_m",), f"given {list(self.travel_m)}, allowed [lower, upper]; swap them")
        ids = [self.node_id, self.master_node_id]
        ids += [self.encoder.node_id] if self.encoder.interface == "canopen" else []
        if len(set(ids)) != len(ids):
            raise FieldError(
                ("node_id",),
                f"given the node-IDs {ids} of drive, master and encoder, allowed different ones; change one",
            )
        return self


class SimulatedEffect(BenchSection):
    """A concealed effect of the simulated axis: ids, forms and parameters as drivers/sim/effects.py lists them."""

    effect: str = Field(description="id of the effect, as the reference of effects lists them")
    form: str = Field("", description="its form; absent: the first one")
    parameters: dict[str, float] = Field({}, description="SI values by name")


class SimulationSection(BenchSection):
    """True parameters and effects of a simulated bench. If the section is present, the devices are simulated."""

    axis: dict[str, float] = Field({}, description="true values of keys of `axis`, where they differ")
    effects: tuple[SimulatedEffect, ...] = Field((), description="what the axis does and the owner does not know")
    sensors: dict[str, float] = Field({}, description="as drivers/sim/sensors.py: offsets and noise")
    seed: Annotated[int, Field(ge=0, description="of the noise of the sensors")] = 1
    # shorter ones change nothing that a sensor shows, and take minutes for a second of motion
    step_s: Annotated[float, Field(ge=1e-7, le=1e-2, description="internal step of the simulated axis [s]")] = 1e-5
