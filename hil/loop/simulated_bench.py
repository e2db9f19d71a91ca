"""Build the simulated bench: the `simulation` section of a bench file as plant, drive node and encoder node.

The only module that passes parameters of a bench file to the simulated axis; they share no formula. The diagnosis must
not import it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, SupportsIndex

from pydantic import ValidationError, model_validator

from drivers.bus import CanPort
from drivers.port import PlantLike
from drivers.serial_encoder import SerialFormat
from drivers.sim import axis as truth
from drivers.sim.axis import AxisTruth
from drivers.sim.drive_node import SimulatedDrive
from drivers.sim.effects import Effect
from drivers.sim.encoder_node import SimulatedEncoder
from drivers.sim.plant import Plant
from drivers.sim.sensors import Sensors
from drivers.sim.serial_line import SimulatedSerialEncoder
from drivers.sim.servo import DriveServo, PositionFeedback, Servo, VelocityEstimate
from hil.bench.axis_models import Axis, OneMass, Rigid, SerialChain, SevenDofAxis, TwoMass
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveSection, EncoderConnection, SimulationSection
from hil.bench.turning_axes import DcMotor, Rotary, RotaryTwoMass
from hil.errors import FieldError
from hil.files.shipped import given_or_shipped
from hil.files.yaml_model import load_model

RATED_TORQUE_N_M = 4.0  # of the simulated drive if the bench gives none
MOST_COUNTS = 0xFFFF_FFFF  # per revolution: object 0x608F is UNSIGNED32


class _Simulated(Bench):
    """A bench whose simulated axis can be built; validation names the field that drivers.sim refuses."""

    @model_validator(mode="after")
    def _can_be_simulated(self) -> _Simulated:
        if self.simulation is not None:
            make_plant(self)
        return self


def load_simulated(source: str | Path) -> Bench:
    """Load a bench file and check its simulated axis. Raises InputError with file, line and field."""
    path = given_or_shipped(source, "bench")
    bench = load_model(path, _Simulated)
    return bench if bench.name else bench.model_copy(update={"name": path.stem})


def simulated_copy(bench: Bench) -> Bench:
    """Return the bench with a simulated CANopen drive and encoder on an in-process bus, without files of devices."""
    simulated = {"protocol": "canopen", "interface": "inprocess", "encoder": EncoderConnection()}
    drive = (bench.drive or DriveSection()).model_copy(update=simulated | {"eds": None, "serial_number": None})
    return bench.model_copy(update={"drive": drive, "simulation": bench.simulation or SimulationSection()})


def make_plant(bench: Bench, seed: int | None = None) -> Plant:
    """Build the simulated axis at rest at 0. Raises FieldError at an invalid field."""
    simulation = bench.simulation or SimulationSection()
    seed = simulation.seed if seed is None else seed
    if not isinstance(seed, SupportsIndex) or seed.__index__() < 0:
        raise FieldError(("simulation", "seed"), f"given {seed!r}, allowed a whole number, 0 or more; correct it")
    axis = true_axis(bench.axis, simulation)
    effects = []
    for number, entry in enumerate(simulation.effects):
        at = ("simulation", "effects", number)
        try:
            effects.append(Effect(entry.effect, entry.parameters, entry.form))
        except ValueError as error:
            raise FieldError(at, f"given {entry.effect}: {error}") from None
        if effects[-1].delays_feedback:
            raise FieldError(
                (*at, "form"),
                "given motor_position, allowed table_position or torque: on the bus the "
                "loop sees what is recorded; a late motor encoder would be late for the loop as well",
            )
    try:
        resolutions = {"motor_counts_per_rev": _counts_per_lead(bench, axis)} | _table(bench)
        sensors = Sensors(**(resolutions | simulation.sensors))
    except (TypeError, ValueError) as error:
        raise FieldError(("simulation", "sensors"), f"given {simulation.sensors}: {error}") from None
    try:
        return Plant(axis, sensors, effects, seed, simulation.step_s)
    except ValueError as error:
        raise FieldError(("simulation",), str(error)) from None


class SimulatedNodes:
    """Drive and encoder of a bench on one port and their plant; the encoder receives a SYNC after the drive."""

    def __init__(self, bench: Bench, port: CanPort, seed: int | None = None, plant: PlantLike | None = None) -> None:
        section = bench.drive or DriveSection()
        self.plant: PlantLike = plant or make_plant(bench, seed)
        counts = round(_counts_per_turn(bench))
        if not 1 <= counts <= MOST_COUNTS:
            raise FieldError(
                ("encoders", "motor"), f"given {counts:.3g} counts per revolution, allowed 1 to {MOST_COUNTS}"
            )
        self.drive = SimulatedDrive(
            port, self.plant, node_id=section.node_id, servo=_servo(bench), period_s=bench.gains.period_s,
            rated_torque_n_m=section.rated_torque_n_m or RATED_TORQUE_N_M,
            counts_per_rev=counts)  # fmt: skip
        self.encoder: SimulatedEncoder | None = None
        self.serial: SimulatedSerialEncoder | None = None
        if not bench.has_table_encoder or bench.encoders.table is None:
            return
        step_m = bench.encoders.table.resolution_m
        if section.encoder.interface == "canopen":
            self.encoder = SimulatedEncoder(port, self.plant, node_id=section.encoder.node_id, step_m=step_m)
        elif section.encoder.interface == "serial":
            self.serial = SimulatedSerialEncoder(self.plant, step_m=step_m, format=SerialFormat(section.encoder.format))
            port.listen(0x080, self._on_sync)

    def _on_sync(self, can_id: int, data: bytes, now_s: float) -> None:
        if self.serial is not None:
            self.serial.send(now_s)

    def close(self) -> None:
        """Close the serial line, if there is one."""
        if self.serial is not None:
            self.serial.close()


def true_axis(believed: Axis, simulation: SimulationSection) -> AxisTruth:
    """Return the simulated axis: that of the bench file with the true values of `simulation`."""
    try:
        axis = type(believed).model_validate(believed.model_dump() | simulation.axis)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise FieldError(
            ("simulation", "axis", *first["loc"]),
            f"given {simulation.axis}: {first['msg']}; allowed the numbers of {believed.model}",
        ) from None
    if isinstance(axis, OneMass):
        lead_m = axis.screw_lead_m or 2.0 * math.pi
        return truth.one_mass(axis.mass_kg, axis.coulomb_force_n, axis.viscous_force_n_s_m, lead_m)
    if isinstance(axis, DcMotor):
        raise FieldError(
            ("axis", "model"),
            "given dc_motor, allowed a kind of axis in N m: the simulated drive gives a torque; use rotary",
        )
    friction: dict[str, Any] = {
        "lead_m": axis.lead_m,
        "coulomb_torque_n_m": axis.coulomb_torque_n_m,
        "viscous_torque_n_m_s_rad": axis.viscous_torque_n_m_s_rad,
    }
    if isinstance(axis, Rigid):
        return AxisTruth((axis.mass_kg,), (), None, **friction)
    if isinstance(axis, Rotary):
        return AxisTruth((axis.inertia_kg_m2 / axis.ratio_m_rad**2,), (), None, **friction)
    if isinstance(axis, RotaryTwoMass):
        return truth.two_mass(
            motor_mass_kg=axis.motor_inertia_kg_m2 / axis.ratio_m_rad**2,
            table_mass_kg=axis.load_inertia_kg_m2,
            stiffness_n_m=axis.stiffness_n_m_rad,
            damping_ratio=axis.damping_ratio,
            **friction,
        )
    if isinstance(axis, TwoMass):
        return truth.two_mass(
            motor_mass_kg=axis.motor_mass_kg,
            table_mass_kg=axis.table_mass_kg,
            stiffness_n_m=axis.stiffness_n_m,
            damping_ratio=axis.damping_ratio,
            **friction,
        )
    if isinstance(axis, SerialChain):
        square = axis.ratio_m_rad**2
        return truth.serial_chain(
            [axis.inertia_scale * value / square for value in axis.inertias_kg_m2],
            [axis.stiffness_scale * value / square for value in axis.stiffnesses_n_m_rad],
            damping_ratio=axis.damping_ratio,
            **friction,
        )
    return _seven_dof(axis, friction)


def _seven_dof(axis: SevenDofAxis, friction: dict[str, Any]) -> AxisTruth:
    if axis.nut_position_m is not None:
        raise FieldError(
            ("axis", "nut_position_m"),
            f"given {axis.nut_position_m} m, allowed null on a simulated "
            "bench: its stiffnesses are those with the nut in the middle; the effect "
            "position_dependent_stiffness varies them",
        )
    # parameters absent from the bench file: reconstruction of the source's Table 1
    return truth.seven_dof(
        inertia_kg_m2=(axis.motor_inertia_kg_m2, 1.04e-4, 4.89e-5, 6.62e-4),
        axial_mass_kg=(5.25, 3.49, axis.table_mass_kg),
        torsional_stiffness_n_m_rad=(3.94e4, axis.coupling_stiffness_n_m_rad, 4.17e3),
        axial_stiffness_n_m=(1.96e8, axis.nut_stiffness_n_m, axis.nut_support_stiffness_n_m),
        damping_ratio=axis.damping_ratio, **friction)  # fmt: skip


def _servo(bench: Bench) -> DriveServo:
    """Loops inside the simulated drive, for CSV, CSP and stops: the law of the bench on the motor encoder."""
    control, gains = bench.known_control, bench.gains
    integral = gains.integral_gain_n_m_rad
    servo = Servo(
        position_gain_1_s=gains.position_gain_1_s, velocity_feedforward=gains.velocity_feedforward,
        velocity_gain_n_m_s_rad=gains.velocity_gain_n_m_s_rad,
        velocity_integral_time_s=gains.velocity_gain_n_m_s_rad / integral if integral else math.inf,
        torque_limit_n_m=gains.torque_limit_n_m, position_every=gains.position_ticks,
        velocity_filter_s=control.velocity_filter_time_constant_s,
        velocity_estimate=VelocityEstimate(control.velocity_estimate), feedback=PositionFeedback.MOTOR)  # fmt: skip
    return DriveServo(servo, gains.ratio_m_rad)


def _counts_per_turn(bench: Bench) -> float:
    """Counts of the motor encoder per 2 pi of the motor's unit: per revolution, or per 2 pi metres."""
    motor = bench.encoders.motor
    if bench.axis.linear and motor.resolution_m is not None:
        return 2.0 * math.pi / motor.resolution_m
    return float(motor.counts_per_rev)


def _counts_per_lead(bench: Bench, axis: AxisTruth) -> float:
    turns_per_lead = axis.screw_ratio_m_rad if axis.linear else 1.0
    return _counts_per_turn(bench) * turns_per_lead


def _table(bench: Bench) -> dict[str, Any]:
    table = bench.encoders.table
    return {"table_resolution_m": table.resolution_m} if table is not None else {}
