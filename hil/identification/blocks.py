"""Block by block: each block of the bench is fed measured inputs, so that its deviation shows in it alone.

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

import numpy as np

from hil.arrays import FloatArray
from hil.identification.dataset import Dataset, Measured, inertia
from hil.identification.hypothesis import Hypothesis
from hil.identification.noise_floor import rms
from hil.identification.residuals import differences
from hil.twin.library import BY_ID
from hil.twin.mechanism import Stage
from hil.twin.stepping.loops import INTEGRATOR_S
from hil.twin.stepping.stages import stage_of

_DRIVE = (Stage.CURRENT, Stage.CHANNEL)


@dataclass(frozen=True, eq=False)
class BlockDeviation:
    """Output of one block (n,), measured and by the twin's block fed with measured inputs."""

    block: str
    inputs: str
    output: str
    unit: str
    measured: FloatArray
    simulated: FloatArray
    noise: float  # standard deviation at the noise floor; 0 if not known
    remark: str = ""

    @property
    def deviation(self) -> FloatArray:
        """Measured less simulated (n,)."""
        return np.asarray(self.measured - self.simulated)


def compare_blocks(hypothesis: Hypothesis, data: Dataset) -> tuple[BlockDeviation, ...]:
    """The blocks that the first run of a data set distinguishes."""
    run, left, scale = data.runs[0], hypothesis.residuals(data).channels[0], data.noise[0]
    bench = hypothesis.resolved.bench
    name, unit = ("force", "N") if bench.axis.linear else ("torque", "N m")
    if not np.any(left["command"]):
        remark = "the replay is bit-identical to the recording"
    elif bench.gains.integral_gain_n_m_rad:
        remark = f"the integrator follows the recording within {INTEGRATOR_S:g} s: rounded set-points add up in it"
    else:
        remark = ""
    command = run.torque_command - left["command"]
    inputs = "set-points, measured positions"
    blocks = [BlockDeviation("controller", inputs, f"{name} command", unit, run.torque_command, command, 0.0, remark)]
    if not run.torque_is_command:
        simulated = run.torque - left["torque"]
        noise = run.noise.torque
        blocks.append(BlockDeviation("drive", f"measured {name} command", name, unit, run.torque, simulated, noise))
    held = _mechanics(hypothesis, run, data.observer_s)
    torque = inertia(data.bench) / data.observer_s**2  # of an innovation
    blocks.append(
        BlockDeviation(
            "motor and load",
            f"measured {name}, held on the measured motor position",
            name,
            unit,
            run.torque,
            run.torque + torque * held["motor"],
            torque * rms(scale["motor"][run.judged]),
            f"deviation: what the twin's mechanics need less or more, up to {0.5 / np.pi / data.observer_s:.0f} Hz",
        )
    )
    if "table" in held:
        stretch = run.table_m - bench.axis.ratio_m_rad * run.motor
        stretch = stretch - np.mean(stretch[run.judged])
        blocks.append(
            BlockDeviation(
                "transmission and table",
                "measured motor position (twin held on it)",
                "table less motor position",
                "m",
                stretch,
                stretch - held["table"],
                run.noise.table_m,
            )
        )
    return tuple(blocks)


def _mechanics(hypothesis: Hypothesis, run: Measured, observer_s: float) -> dict[str, FloatArray]:
    """Residuals (n,) of motor and table with the measured torque as input.

    Mechanisms of the drive and of the recorded channels are left out: the measured torque contains them already.
    """
    twin = hypothesis.twin(observer_s)
    measured = twin.undelayed(run.response)
    mechanical = tuple(active for active in twin.active if stage_of(BY_ID[active.effect], active.variant) not in _DRIVE)
    inputs = measured._replace(torque_command=measured.torque)
    held = replace(twin, active=mechanical).observe(run.position_command_m, run.velocity_command_m_s, inputs, run.start)
    return differences(measured, held, hypothesis.bench, run.judged)
