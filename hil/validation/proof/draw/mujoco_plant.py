"""Draw cases with MuJoCo as the plant: recordings of a two-mass axis by an independent simulator (`make peers`).

Controller and set-points are those of the other cases; encoders and current are modelled here, in numpy. The simulated
axis of `drivers.sim` is not used in these recordings, only for the size of the drawn effects.
"""

from math import pi

import numpy as np

from drivers.sim.effects import Effect
from hil.arrays import FloatArray
from hil.control import cascade
from hil.errors import HilError
from hil.motion.trajectory import Trajectory
from hil.recording.recording import Recording
from hil.validation.proof.draw.axes import DrawnAxis
from hil.validation.proof.draw.axis_kinds import Rng
from hil.validation.proof.draw.cases import CaseDraft, one, stage
from hil.validation.proof.draw.generator import RECORDINGS, DrawnCase, truth_of
from hil.validation.proof.draw.mujoco_model import EFFECTS, STEP_S, acting, sag_m, xml
from hil.validation.proof.draw.plan import MUJOCO
from hil.validation.proof.draw.tiers import VISIBLE

_STREAM = 1000  # offset of the random stream from those of the other tiers
_LOST_M = 0.1  # following error beyond which the simulation has diverged


def draw_mujoco(tier: str, number: int, seed: int) -> DrawnCase:
    """Draw the case of a tier, number and seed: one effect, each in turn, or only wrong parameters.

    Effects are drawn and sized as in the tier `single`. Raises HilError if MuJoCo is not installed, ValueError for
    other tiers than `single` and `parameters_only`.
    """
    if tier not in MUJOCO:
        raise ValueError(f"tier: must be one of {', '.join(MUJOCO)}, got {tier!r}")
    rng = np.random.default_rng([seed, number, _STREAM + tuple(MUJOCO).index(tier)])
    draft = _draft(EFFECTS[number % len(EFFECTS)] if tier == "single" else None, rng)
    effect = next((effect for effect, _ in draft.effects if isinstance(effect, Effect)), None)
    recordings = tuple(
        record_mujoco(draft.axis, effect, run, int(rng.integers(2**31)), name)
        for name, run in zip(RECORDINGS, draft.runs, strict=True)
    )
    name = f"case_{number:04d}"
    return DrawnCase(name, recordings, draft.axis.bench, truth_of(name, tier, number, seed, draft), draft)


def _draft(name: str | None, rng: Rng) -> CaseDraft:
    while True:
        on = stage(rng, "two_mass")
        if name is None:
            return CaseDraft(on.axis, on.runs, "parameter_error")
        draft = one(rng, on, name, VISIBLE)
        # the model has an attached mass only: a yielding base would move the encoders
        if draft is not None and draft.effects[0][0].form != "base":
            return draft


def record_mujoco(axis: DrawnAxis, effect: Effect | None, run: Trajectory, seed: int, name: str = "run") -> Recording:
    """Record a two-mass axis with at most one effect over set-points, from rest at the first one.

    Raises HilError if MuJoCo is not installed or the axis leaves its path, ValueError for another axis or effect.
    """
    if axis.kind != "two_mass" or (effect is not None and effect.id not in EFFECTS):
        raise ValueError(
            f"axis, effect: must be two_mass and none or one of {', '.join(EFFECTS)}, "
            f"got {axis.kind} and {effect.id if effect else None}"
        )
    try:
        import mujoco
    except ModuleNotFoundError as error:
        raise HilError(
            f"{error.name} is not installed, allowed is the simulated plant; install it with: make peers"
        ) from None
    model = mujoco.MjModel.from_xml_string(xml(axis, effect))
    data, act = mujoco.MjData(model), acting(axis, effect)
    gains, steps, count = axis.bench.gains, round(axis.period_s / STEP_S), len(run)
    motor_count, table_count = 2.0 * pi / axis.sensors.motor_counts_per_rev, axis.sensors.table_resolution_m
    sag = sag_m(axis, effect)
    data.qpos[:2] = run.position_m[0] / gains.ratio_m_rad, run.position_m[0] - sag
    state = cascade.init(float(data.qpos[0]), period_s=axis.period_s)
    motor, table, command = (np.zeros(count, dtype=np.float64) for _ in range(3))
    for k in range(count):
        motor[k] = motor_count * np.round(data.qpos[0] / motor_count)
        table[k] = table_count * np.round((data.qpos[1] + sag) / table_count)
        if not abs(table[k] - run.position_m[k]) < _LOST_M:
            raise HilError(
                f"MuJoCo loses the axis at {k * axis.period_s:.3g} s with {effect or 'no effect'}; "
                "take a shorter step or a weaker effect"
            )
        state, out = cascade.step(
            gains, state, cascade.Inputs(float(run.position_m[k]), float(run.velocity_m_s[k]), motor[k], table[k])
        )
        data.ctrl[0] = command[k] = out.torque_n_m
        if act is None:
            mujoco.mj_step(model, data, nstep=steps)
            continue
        for _ in range(steps):
            act(model, data)
            mujoco.mj_step(model, data)
    columns: dict[str, FloatArray] = {
        "time_s": np.arange(count, dtype=np.float64) * axis.period_s,
        "position_command_m": np.array(run.position_m),
        "velocity_command_m_s": np.array(run.velocity_m_s),
        "motor_position_rad": motor,
        "table_position_m": table,
        "torque_command_n_m": command,
        "torque_n_m": command + _torque_noise(axis, count, seed),
    }
    return Recording(name, columns, axis.period_s)


def _torque_noise(axis: DrawnAxis, count: int, seed: int) -> FloatArray:
    """Return noise of the current (count,), autoregressive of first order."""
    rho = axis.sensors.torque_noise_correlation
    noise = np.random.default_rng(seed).standard_normal(count)
    for k in range(1, count):
        noise[k] = rho * noise[k - 1] + (1.0 - rho**2) ** 0.5 * noise[k]
    return axis.sensors.torque_noise_n_m * noise
