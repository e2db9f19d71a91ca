"""Measured less simulated: of the whole axis in closed loop, and block by block.

Velocity, acceleration and jerk are derivatives of the table position (of the motor position without a linear encoder),
measured and simulated alike low-passed first: Butterworth, 4th order, 100 Hz, forwards and backwards.

Block by block, each block of the bench is fed measured inputs, so that a mismatch shows only in its own block.

    controller          set-points and measured positions   -> torque command
    drive               measured torque command             -> torque
    motor and load      measured torque                     -> that torque less what the twin's mechanics lack
    transmission        measured motor position             -> table less motor position

Controller and drive are the block residuals that the diagnosis fits. Motor and transmission come from the same kernel
(`hil.twin.stepping.loops.observe`), but are fed the measured torque instead of that of the twin's drive. The
innovation e of the motor's observer is given as the torque d = e J / tau^2, with the inertia J of the whole axis and
the observer's time constant tau.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset
from hil.identification.hypothesis import Hypothesis
from hil.identification.measured import Measured
from hil.identification.noise_floor import rms
from hil.identification.residual_scales import inertia
from hil.identification.residuals import differences
from hil.identification.terms import Term
from hil.twin.axis import Response, Steps
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage
from hil.twin.physics import Active
from hil.twin.stepping.loops import INTEGRATOR_S
from hil.twin.stepping.stages import stage_of

LOW_PASS_HZ, LOW_PASS_ORDER = 100.0, 4  # as in the inverse-dynamics identification of EMPS
CONTROLLER_BLOCK, MOTOR_BLOCK, TABLE_BLOCK = "controller", "motor and load", "transmission and table"
_IN_TORQUE = (Stage.CURRENT, Stage.CHANNEL, Stage.ANSWER)


@dataclass(frozen=True, eq=False)
class Deviation:
    """A channel (n,), measured and simulated, with the rows that are evaluated."""

    name: str
    label: str
    unit: str
    measured: FloatArray
    simulated: FloatArray
    evaluated: slice

    @property
    def values(self) -> FloatArray:
        """Measured less simulated (n,)."""
        return self.measured - self.simulated

    @cached_property
    def rms(self) -> float:
        """Root mean square of measured less simulated."""
        return rms(self.values[self.evaluated])

    @cached_property
    def peak(self) -> float:
        """Largest absolute deviation."""
        return float(np.max(np.abs(self.values[self.evaluated])))

    @cached_property
    def relative(self) -> float:
        """rms of the deviation over rms of the measured channel; 0 where the channel is 0 throughout."""
        return self.rms / (rms(self.measured[self.evaluated]) or np.inf)


@dataclass(frozen=True, eq=False)
class BlockDeviation:
    """Deviation of the output of one block that is fed with measured inputs."""

    deviation: Deviation  # named after the block, labelled by its output
    inputs: str
    noise: float  # standard deviation at the noise floor; 0 if not known
    remark: str = ""


def compare_blocks(hypothesis: Hypothesis, data: Dataset) -> tuple[BlockDeviation, ...]:
    """Compare the blocks of a hypothesis with the first run of a data set."""
    run, left, scale = data.runs[0], hypothesis.residuals(data).channels[0], data.noise[0]
    bench = hypothesis.resolved.bench
    name, unit = ("force", "N") if bench.axis.linear else ("torque", "N m")
    if not np.any(left["command"]):
        remark = "the replay is bit-identical to the recording"
    elif bench.gains.integral_gain_n_m_rad:
        remark = (
            f"the integrator is corrected to the recording within {INTEGRATOR_S:g} s: rounded set-points accumulate"
        )
    else:
        remark = ""
    evaluated = run.evaluated
    command = run.torque_command - left["command"]
    controller = Deviation(CONTROLLER_BLOCK, f"{name} command", unit, run.torque_command, command, evaluated)
    blocks = [BlockDeviation(controller, "set-points, measured positions", 0.0, remark)]
    if run.observability.torque_and_command:
        drive = Deviation("drive", name, unit, run.torque, run.torque - left["torque"], evaluated)
        blocks.append(BlockDeviation(drive, f"measured {name} command", run.noise.torque))
    held = differences(*held_on_motor(hypothesis, run, data.observer_s, data.steps), hypothesis.bench, evaluated)
    torque = inertia(data.bench) / data.observer_s**2  # torque per innovation
    motor = Deviation(MOTOR_BLOCK, name, unit, run.torque, run.torque + torque * held["motor"], evaluated)
    inputs = f"measured {name}, held on the measured motor position"
    remark = f"deviation: {name} missing in the twin's mechanics, up to {0.5 / np.pi / data.observer_s:.0f} Hz"
    blocks.append(BlockDeviation(motor, inputs, torque * rms(scale["motor"][evaluated]), remark))
    if "table" in held:
        stretch = run.table_m - bench.axis.ratio_m_rad * run.motor
        stretch = stretch - np.mean(stretch[evaluated])
        label = "table less motor position"
        table = Deviation(TABLE_BLOCK, label, "m", stretch, stretch - held["table"], evaluated)
        blocks.append(BlockDeviation(table, "measured motor position (twin held on it)", run.noise.table_m))
    return tuple(blocks)


def held_on_motor(
    hypothesis: Hypothesis, run: Measured, observer_s: float, steps: Steps, more: FloatArray | float = 0.0
) -> tuple[Response, Response]:
    """Measured channels, lateness undone, and those of the twin held on the motor, driven by the measured torque.

    It gets `more` torque (n,), by default none. Mechanisms of the drive and of the recorded channels are omitted: the
    measured torque already contains them.
    """
    twin = hypothesis.twin(observer_s, steps, run)
    measured = hypothesis.undelayed(twin, run)
    mechanical = tuple(active for active in twin.active if not in_measured_torque(active))
    driven = measured.torque + more
    inputs = measured._replace(torque=driven, torque_command=driven)
    held = replace(twin, active=mechanical).observe(run.position_command_m, run.velocity_command_m_s, inputs, run.start)
    return measured, held


def in_measured_torque(of: Term | Active) -> bool:
    """True for a mechanism of the drive or of a recorded channel: the measured torque contains it already."""
    return stage_of(BY_ID[of.effect], of.variant) in _IN_TORQUE


def low_pass(values: FloatArray, period_s: float) -> FloatArray:
    """Low-pass values (n,) forwards and backwards; the corner is at most 0.4 of the sampling rate."""
    corner = min(2.0 * LOW_PASS_HZ * period_s, 0.8)
    return np.asarray(sosfiltfilt(butter(LOW_PASS_ORDER, corner, output="sos"), values), dtype=np.float64)


def motion_channels(measured: Measured, position: FloatArray, simulated: FloatArray) -> list[Deviation]:
    """Position, following error, velocity, acceleration and jerk from positions (n,) [m], measured and simulated."""
    where = "table" if measured.table_m.size else "motor"
    command, period_s = measured.position_command_m, measured.period_s
    entries = [
        (f"{where}_position_m", f"{where} position", "m", position, simulated),
        ("following_error_m", "following error", "m", command - position, command - simulated),
    ]
    pair = [low_pass(position, period_s), low_pass(simulated, period_s)]
    for name, label, unit in (
        ("velocity_m_s", "velocity", "m/s"),
        ("acceleration_m_s2", "acceleration", "m/s^2"),
        ("jerk_m_s3", "jerk", "m/s^3"),
    ):
        pair = [np.gradient(values, period_s) for values in pair]
        entries.append((name, label, unit, pair[0], pair[1]))
    return [Deviation(*entry, measured.evaluated) for entry in entries]
