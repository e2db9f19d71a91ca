"""Simulate the two-mass axis with friction and its cascade in other simulators.

The elastic axis of the reference bench over the first second of the moves, in closed loop. Continuous solvers get the
loops in continuous time and friction as Fc tanh(v / vs), as is usual there; MuJoCo gets dry friction as its own
constraint (`frictionloss`) and the loops at their periods. Each is optional and measured only if installed.
"""

from collections.abc import Callable
from math import tanh
from typing import Any

import numpy as np

from hil.arrays import FloatArray
from hil.bench.axis_models import TwoMass
from hil.control import cascade as law
from hil.motion.trajectory import Trajectory
from hil.validation.benchmarks.axis import trajectory, two_mass
from hil.validation.benchmarks.figure import Figure, Reference, ReferenceKind, best_of

DURATION_S = 1.0
SMOOTHING_RAD_S = 0.1  # vs of the smoothed friction: 1 % of the speed at 7 m/min
MUJOCO_STEP_S = 1e-4
TOLERANCE = 1e-6
_Peer = Callable[["PeerAxis", Trajectory], FloatArray]


class PeerAxis:
    """Parameters of the axis at the motor shaft, and its gains."""

    def __init__(self) -> None:
        bench = two_mass()
        axis = bench.axis
        assert isinstance(axis, TwoMass)
        self.gains = bench.gains
        self.ratio = axis.ratio_m_rad
        self.motor, self.table = axis.motor_mass_kg * self.ratio**2, axis.table_mass_kg * self.ratio**2
        self.stiffness = axis.stiffness_n_m * self.ratio**2
        reduced = self.motor * self.table / (self.motor + self.table)
        self.damping = 2.0 * axis.damping_ratio * (self.stiffness * reduced) ** 0.5
        self.coulomb, self.viscous = axis.coulomb_torque_n_m, axis.viscous_torque_n_m_s_rad
        self.twin = bench.twin()

    def rates(self, state: Any, position_m: float, velocity_m_s: float) -> list[float]:
        """d/dt of motor angle and speed, table angle and speed, integrator, under the continuous cascade."""
        motor, motor_speed, table, table_speed, integral = state
        gains = self.gains
        reference = (
            gains.position_gain_1_s * (position_m - self.ratio * motor) + gains.velocity_feedforward * velocity_m_s
        )
        error = reference / self.ratio - motor_speed
        torque = gains.velocity_gain_n_m_s_rad * error + integral
        friction = self.coulomb * tanh(motor_speed / SMOOTHING_RAD_S) + self.viscous * motor_speed
        spring = self.stiffness * (motor - table) + self.damping * (motor_speed - table_speed)
        return [
            motor_speed,
            (torque - friction - spring) / self.motor,
            table_speed,
            spring / self.table,
            gains.integral_gain_n_m_rad * error,
        ]


def solve_ivp(axis: PeerAxis, motion: Trajectory) -> FloatArray:
    """scipy.integrate.solve_ivp, LSODA: table position (n,)."""
    from scipy.integrate import solve_ivp as integrate

    time_s, position, velocity = motion.time_s, motion.position_m, motion.velocity_m_s

    def rates(now_s: float, state: Any) -> list[float]:
        return axis.rates(state, float(np.interp(now_s, time_s, position)), float(np.interp(now_s, time_s, velocity)))

    answer = integrate(
        rates, (0.0, time_s[-1]), np.zeros(5), method="LSODA", t_eval=time_s, rtol=TOLERANCE, atol=1e-9, max_step=0.01
    )
    return np.asarray(answer.y[2] * axis.ratio)


def python_control(axis: PeerAxis, motion: Trajectory) -> FloatArray:
    """control.input_output_response of a nonlinear system, its defaults but for the tolerance: table position (n,)."""
    import control

    system = control.nlsys(
        lambda t, x, u, params: axis.rates(x, u[0], u[1]),
        lambda t, x, u, params: x[2] * axis.ratio,
        inputs=2,
        outputs=1,
        states=5,
    )
    response = control.input_output_response(
        system,
        motion.time_s,
        np.vstack([motion.position_m, motion.velocity_m_s]),
        np.zeros(5),
        solve_ivp_kwargs={"rtol": TOLERANCE, "atol": 1e-9},
    )
    return np.asarray(response.outputs)


def mujoco(axis: PeerAxis, motion: Trajectory) -> FloatArray:
    """MuJoCo: two hinges joined by a spring, dry friction as a constraint, the project's control law: (n,)."""
    import mujoco as engine

    def inertia(value: float) -> str:
        return f'<inertial pos="0 0 0" mass="1" diaginertia="{value:.9g} {value:.9g} {value:.9g}"/>'

    model = engine.MjModel.from_xml_string(f"""
<mujoco><option timestep="{MUJOCO_STEP_S}" gravity="0 0 0" integrator="implicitfast"/><worldbody>
  <body name="motor"><joint name="motor" type="hinge" axis="0 0 1" damping="{axis.viscous}"
    frictionloss="{axis.coulomb}" solreffriction="{2 * MUJOCO_STEP_S} 1"/>{inertia(axis.motor)}</body>
  <body name="table"><joint name="table" type="hinge" axis="0 0 1"/>{inertia(axis.table)}</body></worldbody>
  <tendon><fixed name="screw" stiffness="{axis.stiffness}" damping="{axis.damping}" springlength="0">
    <joint joint="motor" coef="1"/><joint joint="table" coef="-1"/></fixed></tendon>
  <actuator><motor joint="motor" gear="1"/></actuator></mujoco>""")
    data = engine.MjData(model)
    gains, state = axis.gains, law.init(0.0)
    steps = round(gains.period_s / MUJOCO_STEP_S)
    table = np.empty(len(motion))
    for k in range(len(motion)):
        table[k] = data.qpos[1] * axis.ratio
        inputs = law.Inputs(motion.position_m[k], motion.velocity_m_s[k], float(data.qpos[0]), float(table[k]))
        state, out = law.step(gains, state, inputs)
        data.ctrl[0] = out.torque_n_m
        engine.mj_step(model, data, nstep=steps)
    return table


PEERS: tuple[tuple[str, _Peer], ...] = (
    ("scipy solve_ivp", solve_ivp),
    ("python-control", python_control),
    ("MuJoCo", mujoco),
)


def figures() -> list[Figure]:
    """Speed of the twin beside that of each peer that is installed."""
    axis, motion = PeerAxis(), trajectory(two_mass().gains.period_s)
    motion = motion.first(round(DURATION_S / motion.period_s) + 1)

    def simulate() -> FloatArray:
        return axis.twin.simulate(motion.position_m, motion.velocity_m_s).table_position_m

    table, beside, notes = simulate(), [], []
    for name, peer in PEERS:
        try:
            answer = peer(axis, motion)
        except ModuleNotFoundError as error:
            notes.append(f"{name} not measured: {error.name} is not installed (make peers)")
            continue
        took_s = best_of(lambda peer=peer: peer(axis, motion), 2)  # type: ignore[misc]
        beside.append(Reference(name, ReferenceKind.PEER, motion.duration_s / took_s))
        apart_m = float(np.sqrt(np.mean((answer - table) ** 2)))
        notes.append(f"{name} {1e6 * apart_m:.2f} um rms from the twin's table")
    return [
        Figure(
            "two-mass axis with friction: twin",
            "twin, 2 masses",
            motion.duration_s / best_of(simulate, 20),
            "x real time",
            detail="; ".join(("exact modes, dry friction, sampled loops", *notes)),
            beside=tuple(beside),
        )
    ]
