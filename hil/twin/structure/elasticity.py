"""Stiffness of the parts of a ball-screw drive by the theory of elasticity (paper, appendix and Eq. 18-19).

K_torsional = G J / L        K_axial = E A / L        K_flexure = 3 E I / L^3
"""

from __future__ import annotations

from math import pi

STEEL_YOUNG_PA = 2.06e11
STEEL_SHEAR_PA = 7.93e10


def torsional_stiffness(rigidity_n_m2: float, length_m: float) -> float:
    """K = G J / L [N m/rad] of a bar in torsion with rigidity G J."""
    return rigidity_n_m2 / length_m


def axial_stiffness(rigidity_n: float, length_m: float) -> float:
    """K = E A / L [N/m] of a bar in tension or compression with rigidity E A."""
    return rigidity_n / length_m


def flexural_stiffness(rigidity_n_m2: float, length_m: float) -> float:
    """K = 3 E I / L^3 [N/m] of a cantilever with rigidity E I, loaded at its end."""
    return 3.0 * rigidity_n_m2 / length_m**3


def round_area(diameter_m: float) -> float:
    """A = pi d^2 / 4 [m^2] of a solid round section."""
    return pi * diameter_m**2 / 4.0


def round_axial_moment(diameter_m: float) -> float:
    """I = pi d^4 / 64 [m^4] of a solid round section about its diameter."""
    return pi * diameter_m**4 / 64.0


def round_polar_moment(diameter_m: float) -> float:
    """J = pi d^4 / 32 [m^4] of a solid round section."""
    return pi * diameter_m**4 / 32.0


def in_series(*stiffnesses: float) -> float:
    """1 / k = 1 / k_1 + 1 / k_2 + ... : springs that carry the same load, all in one unit."""
    return 1.0 / sum(1.0 / stiffness for stiffness in stiffnesses)


def supported_screw_stiffness(
    front_bearing_n_m: float, front_screw_n_m: float, back_bearing_n_m: float, back_screw_n_m: float
) -> float:
    """Axial stiffness k_a4 [N/m] of a screw held at both ends, seen from the nut (Eq. 18).

    Each bearing is in series with its side of the screw; the two sides act in parallel.
    """
    return in_series(front_bearing_n_m, front_screw_n_m) + in_series(back_bearing_n_m, back_screw_n_m)


def nut_support_stiffness(nut_n_m: float, support_n_m: float, fixing_screw_n_m: float, screws: int = 4) -> float:
    """Axial stiffness k_a6 [N/m] from the nut to the table (Eq. 19).

    Nut, nut support, and the bending of the fixing screws (in parallel to each other) are in series.
    """
    return in_series(nut_n_m, support_n_m, screws * fixing_screw_n_m)
