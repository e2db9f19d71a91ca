"""The right answer about a concealed effect: its ids, its block, its place, and the parameters that can be compared.

A form that the library lacks (damped bristles, an atan Stribeck curve) or has with other details (GMS with other knees)
keeps the name of its mechanism; only parameters with the same meaning in both laws are compared.
"""

from collections.abc import Mapping
from math import sqrt

from drivers.sim.axis import AxisTruth
from drivers.sim.effects import Effect
from hil.twin.library import BY_ID
from hil.validation.proof.draw.axes import DrawnAxis
from hil.validation.proof.draw.unknown_effects import BLOCKS, EncoderFault

# Two names for one law: friction that differs by direction shifts its band as a weight does, also at standstill.
SAME_LAW = (frozenset({"asymmetric_friction", "constant_load"}),)
# Physics that the library lacks, and the mechanism of the library that is another form of it: its name is right too.
OTHER_FORM: Mapping[str, str] = {"novel_friction_bump": "local_friction"}
# The same, and another verdict that says what it is.
OTHER_VERDICT: Mapping[str, str] = {"novel_mass_change": "axis_changed"}


def same_law(effect: str) -> tuple[str, ...]:
    """Return the ids of the library for the same law, with its own; empty for physics that the library lacks."""
    if effect not in BY_ID:
        return ()
    return tuple(sorted(next((law for law in SAME_LAW if effect in law), {effect})))


def inseparable(effect: str) -> frozenset[str]:
    """Return the ids of the library that no motion separates from this effect: the same law, and spring and constant
    torque, which shifts the rest position of the spring."""
    own = frozenset(same_law(effect))
    constant = next(law for law in SAME_LAW if "constant_load" in law)
    return own | constant if effect == "spring_load" else own | {"spring_load"} if own & constant else own


def block(effect: str) -> str:
    """Return the block of the chain to which an effect belongs."""
    return str(BY_ID[effect].block) if effect in BY_ID else BLOCKS[effect]


def compared(effect: Effect | EncoderFault, axis: DrawnAxis) -> dict[str, float]:
    """Return the true values of the parameters of the library's law that can be compared."""
    values = effect.parameters
    if effect.id == "structural_mode":
        return _mode(values, effect.form, axis.truth)
    if effect.id in ("asymmetric_friction", "constant_load"):
        (torque,) = values.values()
        return {"offset_torque_n_m": torque, "load_torque_n_m": torque}
    if effect.form in ("exponential", "atan", "gms", "lugre") or effect.id not in BY_ID:
        return {}
    return {name: values[name] for name in BY_ID[effect.id].names if name in values}


def place(effect: Effect | EncoderFault, axis: DrawnAxis) -> dict[str, float | tuple[float, float]]:
    """Return the place of an effect (window_s, period_m, frequency_hz or position_m); empty if it has none."""
    lead_m, values = axis.truth.lead_m, effect.parameters
    if "cycles_per_rev" in values:
        return {"period_m": lead_m / values["cycles_per_rev"]}
    if effect.id in ("periodic_lead_error", "encoder_eccentricity"):
        return {"period_m": lead_m}
    if "period_m" in values:
        return {"period_m": values["period_m"]}
    if "end_s" in values:
        return {"window_s": (values["start_s"], values["end_s"])}
    if effect.id == "structural_mode":
        return {"frequency_hz": compared(effect, axis)["frequency_hz"]}
    if effect.id in ("periodic_force", "novel_vibration"):
        return {"frequency_hz": values["frequency_hz"]}
    if effect.id == "novel_hammering":
        return {"frequency_hz": 1.0 / values["period_s"]}
    if "centre_m" in values:
        return {
            "position_m": (values["centre_m"] - 2.0 * values["width_m"], values["centre_m"] + 2.0 * values["width_m"])
        }
    return {}


def _mode(values: Mapping[str, float], form: str, truth: AxisTruth) -> dict[str, float]:
    """Return frequency and mass ratio of the mass on the table that is equivalent to this mode for the drive.

    A base m_b on a spring k_b under an axis that moves m_t against it: between their relative motion x and the force,

        F = m_t x'' [mu_r + (1 - mu_r) w^2 / (w^2 + s^2)],  mu_r = m_b / (m_b + m_t),  w^2 = k_b / (m_b + m_t)

    which is a table of mass mu_r m_t with a mass (1 - mu_r) m_t on a spring of frequency w.
    """
    frequency_hz, ratio = values["frequency_hz"], values["mass_ratio"]
    if form == "attached":
        return {"frequency_hz": frequency_hz, "mass_ratio": ratio}
    table = truth.mass_kg[-1]
    with_base = with_table = 0.0
    if truth.nut is not None and truth.nut.axial >= 0:
        with_base, with_table = truth.mass_kg[truth.nut.axial], truth.mass_kg[truth.nut.table_side]
    base, moving = ratio * table + with_base, table + with_table
    share = base / (base + moving)
    return {
        "frequency_hz": frequency_hz * sqrt(ratio * table / (base + moving)),
        "mass_ratio": (1.0 - share) * moving / (share * moving - with_table),
    }
