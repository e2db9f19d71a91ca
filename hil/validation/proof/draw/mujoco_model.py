"""MuJoCo model of a two-mass axis with a concealed effect.

A hinge (motor) and a slide (table) are joined by a tendon with stiffness and damping (screw and nut). MuJoCo itself has
friction loss, damping, springs, weight by gravity, play by joint limits, and bodies on springs. Other effects act as
applied forces, or change a parameter of the model at each step.

Friction loss is a soft constraint: at standstill MuJoCo creeps at

    v = (1 - d) t / 2 x f / J        d: solimp, t: time constant of solref, f: torque held, J: inertia

With the values below that is 2e-9 s x f / J, a nanometre per second at the table; joint limits yield alike.
Its integrator is of first order: positions are half a step ahead, 10 us, which encoders see as a following error of
half a step times the feed. Against this project's twin with the true parameters, a recording of the nominal axis leaves
as much of torque and table in closed loop as one of `drivers.sim`, within 2 %
(`tests/hil/validation/proof/test_mujoco_plant.py`).
"""

from collections.abc import Callable, Mapping
from math import atan, cos, exp, pi, sin
from typing import Any

from drivers.sim.effects import Effect
from hil.validation.proof.draw.axes import DrawnAxis

Acting = Callable[[Any, Any], None]  # on a model and its state, before each step

STEP_S = 2e-5
_HARD = 0.9999  # of solimp: the most that MuJoCo takes
_NUT = 0.01  # of the table's mass: the nut, where it has play
_MOTOR, _TABLE, _SCREW = 0, 1, 0  # as MuJoCo counts joints and tendons
EFFECTS = (
    "constant_load",
    "stribeck_friction",
    "position_dependent_friction",
    "nonlinear_viscous_friction",
    "friction_drift",
    "cogging_torque",
    "table_side_friction",
    "backlash",
    "position_dependent_stiffness",
    "cumulative_lead_error",
    "periodic_lead_error",
    "torque_ripple",
    "structural_mode",
    "external_force",
    "spring_load",
)


def xml(axis: DrawnAxis, effect: Effect | None) -> str:
    """Return the model with those effects that MuJoCo has."""
    stiff = f'"{2.0 * STEP_S} 1"'  # solref: the least time constant that is stable
    name = effect.id if effect is not None else None
    true, ratio = axis.true, axis.truth.screw_ratio_m_rad
    motor, table = true["motor_mass_kg"] * ratio**2, true["table_mass_kg"]
    reduced = 1.0 / (1.0 / true["motor_mass_kg"] + 1.0 / table)
    damping = 2.0 * true["damping_ratio"] * (true["stiffness_n_m"] * reduced) ** 0.5
    share = _own(effect, "table_side_friction", "share")
    coulomb, viscous = true["coulomb_torque_n_m"], true["viscous_torque_n_m_s_rad"]
    nut = mode = nut_end = ""
    if name == "backlash":
        half, table = 0.5 * _own(effect, "backlash", "gap_m"), (1.0 - _NUT) * table
        nut = (
            f'<body><joint name="nut" type="slide" axis="1 0 0" limited="true" range="{-half} {half}" '
            f'solreflimit={stiff} solimplimit="{_HARD} {_HARD} 1e-6"/>{_inertial(_NUT / (1 - _NUT) * table)}'
            "</body>"
        )
        nut_end = '<joint joint="nut" coef="-1"/>'
    if name == "structural_mode":
        mass = _own(effect, "structural_mode", "mass_ratio") * true["table_mass_kg"]
        omega = 2.0 * pi * _own(effect, "structural_mode", "frequency_hz")
        mode = (
            f'<body><joint name="mode" type="slide" axis="1 0 0" stiffness="{mass * omega**2}" '
            f'damping="{2.0 * _own(effect, "structural_mode", "damping_ratio") * mass * omega}"/>{_inertial(mass)}'
            "</body>"
        )
    weight = _own(effect, "constant_load", "load_torque_n_m") / ratio / table
    friction = f'solreffriction={stiff} solimpfriction="{_HARD} {_HARD} 1"'
    return f"""<mujoco><option timestep="{STEP_S}" gravity="{-weight} 0 0" integrator="implicitfast" solver="Newton"
    iterations="50" tolerance="1e-12"><flag autoreset="disable"/></option><compiler autolimits="false"/><worldbody>
  <body><joint name="motor" type="hinge" axis="1 0 0" damping="{(1.0 - share) * viscous}"
    frictionloss="{(1.0 - share) * coulomb}" {friction}/>{_inertial(1e-3, motor)}</body>
  <body name="table"><joint name="table" type="slide" axis="1 0 0" damping="{share * viscous / ratio**2}"
    frictionloss="{share * coulomb / ratio}" {friction} stiffness="{_own(effect, "spring_load", "stiffness_n_m")}"
    springref="{_own(effect, "spring_load", "rest_position_m")}"/>{_inertial(table)}{nut}{mode}</body></worldbody>
  <tendon><fixed name="screw" stiffness="{true["stiffness_n_m"]}" damping="{damping}" springlength="0">
    <joint joint="motor" coef="{ratio * (1.0 + _own(effect, "cumulative_lead_error", "slope_m_m"))}"/>
    <joint joint="table" coef="-1"/>{nut_end}</fixed></tendon>
  <actuator><motor joint="motor"/></actuator></mujoco>"""


def sag_m(axis: DrawnAxis, effect: Effect | None) -> float:
    """Return the stretch [m] of the screw by a weight before the encoders are set to zero."""
    load = _own(effect, "constant_load", "load_torque_n_m")
    return load / axis.truth.screw_ratio_m_rad / float(axis.true["stiffness_n_m"])


def _own(effect: Effect | None, name: str, parameter: str) -> float:
    """Return a parameter of the concealed effect; zero for all other effects."""
    return effect.parameters[parameter] if effect is not None and effect.id == name else 0.0


def _inertial(mass_kg: float, inertia_kg_m2: float = 1.0) -> str:
    about = " ".join([f"{inertia_kg_m2:.17g}"] * 3)
    return f'<inertial pos="0 0 0" mass="{mass_kg:.17g}" diaginertia="{about}"/>'


def acting(axis: DrawnAxis, effect: Effect | None) -> Acting | None:
    """Return the function to call before each step for an effect that MuJoCo lacks; None for the others."""
    return _ACTING[effect.id](axis, effect.parameters, effect.form) if effect and effect.id in _ACTING else None


Values = Mapping[str, float]


def _motor_torque(torque: Callable[[Any], float]) -> Acting:
    """Apply a torque [N m] of the state to the motor."""

    def act(model: Any, data: Any) -> None:
        data.qfrc_applied[_MOTOR] = torque(data)

    return act


def _coulomb_friction(level: Callable[[Any], float]) -> Acting:
    """Set the friction loss [N m] of the motor from the state."""

    def act(model: Any, data: Any) -> None:
        model.dof_frictionloss[_MOTOR] = level(data)

    return act


def _stribeck_friction(axis: DrawnAxis, p: Values, form: str) -> Acting:
    coulomb, static, slow = axis.coulomb, p["static_torque_n_m"], p["stribeck_velocity_rad_s"]
    shares: Mapping[str, Callable[[float], float]] = {
        "gaussian": lambda u: exp(-u * u),
        "exponential": lambda u: exp(-u),
        "atan": lambda u: 1.0 - 2.0 / pi * atan(u),
    }
    share = shares[form]
    return _coulomb_friction(lambda data: coulomb + (static - coulomb) * share(abs(data.qvel[_MOTOR]) / slow))


def _position_dependent_friction(axis: DrawnAxis, p: Values, form: str) -> Acting:
    coulomb, wave, ratio = axis.coulomb, 2.0 * pi / p["period_m"], axis.truth.screw_ratio_m_rad
    return _coulomb_friction(
        lambda data: coulomb * (1.0 + p["fraction"] * sin(wave * ratio * data.qpos[_MOTOR] + p["phase_rad"]))
    )


def _friction_drift(axis: DrawnAxis, p: Values, form: str) -> Acting:
    coulomb, viscous = axis.coulomb, axis.true["viscous_torque_n_m_s_rad"]

    def act(model: Any, data: Any) -> None:
        scale = 1.0 + p["fraction"] * (1.0 - exp(-data.time / p["time_constant_s"]))
        model.dof_frictionloss[_MOTOR] = coulomb if form == "viscous" else scale * coulomb
        data.qfrc_applied[_MOTOR] = (1.0 - scale) * viscous * data.qvel[_MOTOR]

    return act


def _torque_ripple(axis: DrawnAxis, p: Values, form: str) -> Acting:
    def torque(data: Any) -> float:
        wave = sin(p["cycles_per_rev"] * data.qpos[_MOTOR] + p["phase_rad"])
        return float(p["fraction"] * wave * data.ctrl[0])

    return _motor_torque(torque)


def _position_dependent_stiffness(axis: DrawnAxis, p: Values, form: str) -> Acting:
    stiffness = axis.true["stiffness_n_m"]

    def act(model: Any, data: Any) -> None:
        model.tendon_stiffness[_SCREW] = stiffness * (1.0 + p["relative_slope"] * data.qpos[_TABLE])

    return act


def _periodic_lead_error(axis: DrawnAxis, p: Values, form: str) -> Acting:
    """Return the forces by virtual work.

    With the error e(theta), tendon length L and its force F, the force of the stretch L + e is F + k e; it acts on the
    motor with the lever r + e'. The damper remains that of L.
    """
    stiffness, ratio = axis.true["stiffness_n_m"], axis.truth.screw_ratio_m_rad
    waves = [
        (1, p["amplitude_m"], p["phase_rad"]),
        (2, p["amplitude_2_m"], p["phase_2_rad"]),
        (3, p["amplitude_3_m"], p["phase_3_rad"]),
    ]

    def act(model: Any, data: Any) -> None:
        angle, table = data.qpos[_MOTOR], data.qpos[_TABLE]
        error = sum(size * sin(order * angle + phase) for order, size, phase in waves)
        slope = sum(order * size * cos(order * angle + phase) for order, size, phase in waves)
        length = ratio * angle - table
        data.qfrc_applied[_MOTOR] = -stiffness * (error * (ratio + slope) + length * slope)
        data.qfrc_applied[_TABLE] = stiffness * error

    return act


def _external_force(axis: DrawnAxis, p: Values, form: str) -> Acting:
    def act(model: Any, data: Any) -> None:
        data.qfrc_applied[_TABLE] = p["force_n"] if p["start_s"] <= data.time < p["end_s"] else 0.0

    return act


_ACTING: Mapping[str, Callable[[DrawnAxis, Values, str], Acting]] = {
    "stribeck_friction": _stribeck_friction,
    "position_dependent_friction": _position_dependent_friction,
    "friction_drift": _friction_drift,
    "nonlinear_viscous_friction": lambda axis, p, form: _motor_torque(
        lambda data: -p["quadratic_n_m_s2_rad2"] * data.qvel[_MOTOR] * abs(data.qvel[_MOTOR])
    ),
    "cogging_torque": lambda axis, p, form: _motor_torque(
        lambda data: p["amplitude_n_m"] * sin(p["cycles_per_rev"] * data.qpos[_MOTOR] + p["phase_rad"])
    ),
    "torque_ripple": _torque_ripple,
    "position_dependent_stiffness": _position_dependent_stiffness,
    "periodic_lead_error": _periodic_lead_error,
    "external_force": _external_force,
}
