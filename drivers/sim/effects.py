"""Catalogue of the effects of a simulated axis: ids, parameters, units, allowed ranges, forms.

CATALOGUE: effects that the library of the diagnosis contains. NOVEL: effects that it lacks. EFFECTS: both.

On a linear axis n_m means N, rad means m, n_m_s_rad means N s/m; angles of the screw stay angles.
Equations: contact.py (friction, nut), drive_path.py, sensors.py and kernel.py (table).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from types import MappingProxyType


@dataclass(frozen=True)
class ParameterRange:
    """Allowed range [low, high] and, if it is optional, its default."""

    low: float = -inf
    high: float = inf
    default: float | None = None


@dataclass(frozen=True)
class Definition:
    """Physics in one sentence, parameters by name, forms (the first is the default)."""

    physics: str
    parameters: Mapping[str, ParameterRange]
    forms: tuple[str, ...] = ("",)


_ANY = ParameterRange()
_POSITIVE = ParameterRange(low=1e-12)
_AT_LEAST_0 = ParameterRange(low=0.0)
_PHASE = ParameterRange()
_PHASE_0 = ParameterRange(default=0.0)
_OFF = ParameterRange(default=0.0)
_DELAY = ParameterRange(low=0.0, high=0.1)
_DRIVE_FORMS = ("visible", "hidden")  # hidden: absent from the measured current

CATALOGUE: Mapping[str, Definition] = MappingProxyType({
    # motor side
    "asymmetric_friction": Definition(
        "friction = F sign(v) + offset while sliding; it holds within [-F + offset, F + offset]",
        {"offset_torque_n_m": _ANY}),
    "constant_load": Definition("constant torque against positive motion (weight)", {"load_torque_n_m": _ANY}),
    "stribeck_friction": Definition(
        "F(v) = Fc + (Fs - Fc) s(v/vs); s = exp(-u^2), exp(-|u|) or 1 - 2/pi atan|u|",
        {"static_torque_n_m": _AT_LEAST_0, "stribeck_velocity_rad_s": _POSITIVE},
        ("gaussian", "exponential", "atan")),
    "presliding_hysteresis": Definition(
        "elastic micro-motion before sliding; damping (lugre only, < 0: chosen for half-critical motor motion)",
        {"stiffness_n_m_rad": _POSITIVE, "damping_n_m_s_rad": ParameterRange(default=-1.0)},
        ("dahl", "lugre", "gms")),
    "position_dependent_friction": Definition(
        "Coulomb and static friction times 1 + fraction sin(2 pi x / period + phase)",
        {"fraction": ParameterRange(-1.0, 1.0), "period_m": _POSITIVE, "phase_rad": _PHASE_0}),
    "friction_gradient": Definition(
        "Coulomb and static friction times 1 + slope x, at least 0", {"slope_1_m": _ANY}),
    "local_friction": Definition(
        "Coulomb and static friction times 1 + fraction r((x - from) / flank) r((to - x) / flank), "
        "r a ramp from 0 to 1 over -1/2 to 1/2",
        {"fraction": ParameterRange(low=-1.0), "begin_m": _ANY, "end_m": _ANY, "flank_m": _POSITIVE}),
    "load_dependent_friction": Definition(
        "Coulomb and static friction plus share |torque of the motor - friction|", {"share": ParameterRange(0.0, 0.5)}),
    "nonlinear_viscous_friction": Definition("drag quadratic v |v|", {"quadratic_n_m_s2_rad2": _AT_LEAST_0}),
    "friction_drift": Definition(
        "all friction, or the viscous friction alone, times 1 + fraction (1 - exp(-t / time_constant))",
        {"fraction": ParameterRange(low=-1.0), "time_constant_s": _POSITIVE},
        ("", "viscous")),
    "cogging_torque": Definition(
        "motor torque + amplitude sin(cycles theta + phase)",
        {"amplitude_n_m": _AT_LEAST_0, "cycles_per_rev": _POSITIVE, "phase_rad": _PHASE}),
    # table
    "table_side_friction": Definition(
        "this share of the Coulomb and viscous friction acts on the table", {"share": ParameterRange(0.0, 1.0)}),
    "table_side_viscous_friction": Definition(
        "takes |share| of the viscous friction from the motor to the table, or back if share < 0",
        {"share": ParameterRange(-1.0, 1.0)}),
    "structural_mode": Definition(
        "attached: a mass on a spring on the table; base: the machine base under the axis yields",
        {"frequency_hz": _POSITIVE, "damping_ratio": ParameterRange(0.0, 2.0),
         "mass_ratio": ParameterRange(1e-6, 1e3, default=0.2)},
        ("attached", "base")),
    "external_force": Definition(
        "force on the table while start <= t < end", {"force_n": _ANY, "start_s": _ANY, "end_s": _ANY}),
    "periodic_force": Definition(
        "force on the table all the time, as of a rotor out of balance: the projection of a vector that turns",
        {"force_n": _AT_LEAST_0, "frequency_hz": _POSITIVE, "phase_rad": _PHASE}),
    "spring_load": Definition(
        "-stiffness (x - rest) on the table", {"stiffness_n_m": _AT_LEAST_0, "rest_position_m": _ANY}),
    "end_stop": Definition(
        "elastic stop on the table: -stiffness (x - edge) beyond the edge, 0 before it; upper or lower end",
        {"stiffness_n_m": _AT_LEAST_0, "edge_m": _ANY}, ("upper end", "lower end")),
    "gravity_torque": Definition(
        "-m g r sin(angle + offset) on a load that turns, its angle [rad] the position of the table",
        {"gravity_torque_n_m": _AT_LEAST_0, "angle_rad": _PHASE}),
    # transmission
    "backlash": Definition("no force within +-gap/2 of stretch; contacts push only", {"gap_m": _AT_LEAST_0}),
    "preload_loss": Definition(
        "stiffness times stiffness_ratio within +-zone/2 of stretch, full beyond, force continuous",
        {"zone_m": _AT_LEAST_0, "stiffness_ratio": ParameterRange(0.0, 1.0)}),
    "position_dependent_stiffness": Definition(
        "k (1 + relative_slope x), x the table position; relative_slope in 1/m", {"relative_slope": _ANY}),
    "periodic_lead_error": Definition(
        "table = r theta + sum over harmonics h of amplitude_h sin(h theta + phase_h)",
        {"amplitude_m": _AT_LEAST_0, "phase_rad": _PHASE, "amplitude_2_m": _OFF, "phase_2_rad": _OFF,
         "amplitude_3_m": _OFF, "phase_3_rad": _OFF}),
    "cumulative_lead_error": Definition("table = r theta (1 + slope)", {"slope_m_m": _ANY}),
    "thermal_growth": Definition(
        "table = r theta + relative_growth (1 - exp(-t / time_constant)) (r theta - bearing)",
        {"relative_growth": _ANY, "time_constant_s": _POSITIVE, "bearing_m": _OFF}),
    # drive
    "torque_ripple": Definition(
        "torque times 1 + fraction sin(cycles theta + phase), unseen by the current",
        {"fraction": ParameterRange(0.0, 1.0), "cycles_per_rev": _POSITIVE, "phase_rad": _PHASE_0}),
    "local_torque_constant": Definition(
        "torque times 1 + fraction s(x) as local_friction, unseen by the current",
        {"fraction": ParameterRange(-1.0, 1.0), "begin_m": _ANY, "end_m": _ANY, "flank_m": _POSITIVE}),
    "torque_constant_drift": Definition(
        "torque times 1 + fraction (1 - exp(-t / time_constant)), unseen by the current",
        {"fraction": ParameterRange(-1.0, 1.0), "time_constant_s": _POSITIVE}),
    "torque_constant_gradient": Definition(
        "torque times 1 + slope r theta, at least 0, unseen by the current", {"slope_1_m": _ANY}),
    "torque_constant_saturation": Definition(
        "torque = u (1 - c u^2), unseen by the current, held at its maximum beyond it",
        {"coefficient_1_n2_m2": _AT_LEAST_0}),
    "torque_saturation": Definition("torque within +-limit", {"limit_n_m": _AT_LEAST_0}, _DRIVE_FORMS),
    "torque_dead_zone": Definition(
        "0 within +-half_width, else the command less half_width", {"half_width_n_m": _AT_LEAST_0}, _DRIVE_FORMS),
    "current_loop_lag": Definition("first-order lag of the torque", {"time_constant_s": _POSITIVE}, _DRIVE_FORMS),
    "transport_delay": Definition("the command acts late", {"delay_s": _DELAY}, _DRIVE_FORMS),
    # controller
    "velocity_filter_lag": Definition(
        "first-order filter on the velocity feedback", {"time_constant_s": _POSITIVE}),
    # sensor
    "channel_time_skew": Definition(
        "one recorded channel is late; the control loop sees it in time",
        {"delay_s": _DELAY}, ("table_position", "motor_position", "torque")),
    "encoder_eccentricity": Definition(
        "motor encoder reads theta + amplitude sin(theta + phase)",
        {"amplitude_rad": _AT_LEAST_0, "phase_rad": _PHASE}),
    "load_encoder_eccentricity": Definition(
        "table encoder of a load that turns: one head; its graduation is off centre by amplitude times its radius",
        {"amplitude_rad": ParameterRange(0.0, 0.9), "phase_rad": _PHASE}),
    "scale_interpolation_error": Definition(
        "linear encoder reads x + amplitude sin(2 pi x / period + phase)",
        {"amplitude_m": _AT_LEAST_0, "period_m": _POSITIVE, "phase_rad": _PHASE_0}),
})  # fmt: skip

# Physics that the library of the diagnosis does not have: a diagnosis that names it is wrong.
NOVEL: Mapping[str, Definition] = MappingProxyType({
    "novel_friction_bump": Definition(
        "Coulomb and static friction times 1 + fraction exp(-((x - centre) / width)^2 / 2): a tight spot",
        {"fraction": ParameterRange(low=-1.0), "centre_m": _ANY, "width_m": _POSITIVE}),
    "novel_friction_wander": Definition(
        "all friction times 1 + fraction w(t / period), w four sines of incommensurate periods, rms 1",
        {"fraction": ParameterRange(0.0, 0.3), "period_s": _POSITIVE, "phase_rad": _PHASE}),
    "novel_pitch_bump": Definition(
        "table = r theta + height exp(-((r theta - centre) / width)^2 / 2): a dent in the thread",
        {"height_m": _ANY, "centre_m": _ANY, "width_m": _POSITIVE}),
    "novel_mass_change": Definition(
        "from start_s on the table weighs 1 + fraction of its mass: a workpiece is put down or taken away",
        {"fraction": ParameterRange(low=-0.9), "start_s": _ANY}),
    "novel_vibration": Definition(
        "force on the table force (sin(2 pi f t + phase) + ratio sin(2 pi f2 t)): a machine beside it",
        {"force_n": _AT_LEAST_0, "frequency_hz": _POSITIVE, "phase_rad": _PHASE, "ratio": ParameterRange(0.0, 1.0),
         "frequency_2_hz": _POSITIVE}),
    "novel_hammering": Definition(
        "force on the table in pulses of width_s every period_s from start_s on",
        {"force_n": _ANY, "start_s": _ANY, "period_s": _POSITIVE, "width_s": _POSITIVE}),
})  # fmt: skip
EFFECTS: Mapping[str, Definition] = MappingProxyType({**CATALOGUE, **NOVEL})


@dataclass(frozen=True)
class Effect:
    """One effect with its parameters. Raises ValueError for an unknown id, parameter or form, a missing
    parameter, or a value out of range; the message lists what is allowed."""

    id: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    form: str = ""

    def __post_init__(self) -> None:
        if self.id not in EFFECTS:
            raise ValueError(f"effect {self.id!r}: unknown; allowed: {', '.join(EFFECTS)}")
        definition = EFFECTS[self.id]
        allowed = definition.parameters
        unknown = sorted(set(self.parameters) - set(allowed))
        missing = sorted(name for name, p in allowed.items() if p.default is None and name not in self.parameters)
        if unknown or missing:
            fault = f"unknown {', '.join(unknown)}" if unknown else f"missing {', '.join(missing)}"
            raise ValueError(f"effect {self.id}: parameter {fault}; allowed: {', '.join(allowed)}")
        for name, value in self.parameters.items():
            low, high = allowed[name].low, allowed[name].high
            if not isfinite(value) or not low <= value <= high:
                raise ValueError(f"effect {self.id}: {name} must be in [{low:g}, {high:g}], got {value!r}")
        if self.form and self.form not in definition.forms:
            choices = ", ".join(form for form in definition.forms if form) or "none"
            raise ValueError(f"effect {self.id}: unknown form {self.form!r}; allowed: {choices}")
        defaults = {name: p.default for name, p in allowed.items() if p.default is not None}
        object.__setattr__(self, "parameters", {**defaults, **self.parameters})  # a dict can be pickled

    @property
    def delays_feedback(self) -> bool:
        """True if the motor encoder is delayed, which a loop on the bus sees as well."""
        return self.id == "channel_time_skew" and self.form == "motor_position"

    @property
    def form_index(self) -> int:
        """Index of the form within the catalogue's forms; 0 is the default."""
        return EFFECTS[self.id].forms.index(self.form) if self.form else 0


def by_id(effects: Sequence[Effect]) -> dict[str, Effect]:
    """Effects by id. Raises ValueError when one is given twice."""
    found: dict[str, Effect] = {}
    for effect in effects:
        if effect.id in found:
            raise ValueError(f"effect {effect.id}: given twice; give each effect once")
        found[effect.id] = effect
    return found
