"""Numbers and sentences as an engineer says them, and the units of parameters."""

from __future__ import annotations

import math

from hil.bench.bench_file import Bench
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.twin.mechanism import Dimension, Role

# Dimension -> (from this magnitude on, factor, unit), largest first
_SAID: dict[Dimension, tuple[tuple[float, float, str], ...]] = {
    Dimension.LENGTH: ((1.0, 1.0, "m"), (1e-3, 1e3, "mm"), (0.0, 1e6, "µm")),
    Dimension.TIME: ((1.0, 1.0, "s"), (1e-3, 1e3, "ms"), (0.0, 1e6, "µs")),
    Dimension.ANGLE: ((1e-2, 1.0, "rad"), (0.0, 1e6, "µrad")),
    Dimension.RATIO: ((0.0, 100.0, "%"),),
    Dimension.COUNT: ((0.0, 1.0, ""),),  # sentences say what is counted
}

# Units of the nominal parameters, which their names hold in short
NOMINAL_UNITS = {
    "motor_mass_kg": "kg",
    "table_mass_kg": "kg",
    "mass_kg": "kg",
    "motor_inertia_kg_m2": "kg m^2",
    "stiffness_n_m": "N/m",
    "nut_support_stiffness_n_m": "N/m",
    "nut_stiffness_n_m": "N/m",
    "coupling_stiffness_n_m_rad": "N m/rad",
    "damping_ratio": "1",
    "inertia_scale": "1",
    "stiffness_scale": "1",
    "coulomb_torque_n_m": "N m",
    "viscous_torque_n_m_s_rad": "N m s/rad",
    "coulomb_force_n": "N",
    "viscous_force_n_s_m": "N s/m",
}


def number(value: float) -> str:
    """Three significant digits, without exponent where that is readable."""
    if value == 0.0:
        return "0"
    if 1e-3 <= abs(value) < 1e6:
        return f"{value:.{max(2 - math.floor(math.log10(abs(value))), 0)}f}"
    return f"{value:.2e}"


def said(value: float, dimension: Dimension, linear: bool = False) -> str:
    """A parameter's value with its unit, such as "24.7 µm"."""
    unit = dimension.unit(linear)
    for start, factor, text in _SAID.get(dimension, ((0.0, 1.0, unit),)):
        if abs(value) >= start:
            return f"{number(value * factor)} {text}".rstrip()
    raise AssertionError(dimension)


def sentence(term: Term, bench: Bench) -> str:
    """The mechanism's sentence with its values, and the variant that it takes."""
    mechanism, linear = BY_ID[term.effect], bench.axis.linear
    values = {
        parameter.name: said(value, parameter.dimension, linear)
        for parameter, value in zip(mechanism.parameters, term.values, strict=True)
    }
    values["viscous_speed"] = said(bench.axis.physics().viscous_speed, Dimension.MOTOR_SPEED, linear)
    variant = mechanism.variants[term.variant]
    text = (variant.sentence or mechanism.sentence).format(**values)
    return f"{text.removesuffix('.')} ({variant.name})." if variant.name else text


def label(term: Term) -> str:
    """An effect's id as words, with the period or order where it may act more than once."""
    mechanism = BY_ID[term.effect]
    if mechanism.most == 1:
        return title(term.effect)
    period_m, order = (mechanism.named(role, term.values) for role in (Role.PERIOD, Role.ORDER))
    if period_m is not None:
        return f"{title(term.effect)}, every {said(period_m, Dimension.LENGTH)}"
    return title(term.effect) if order is None else f"{title(term.effect)}, {number(order)} times per revolution"


def title(effect: str) -> str:
    """An effect's id as words."""
    return effect.replace("_", " ")
