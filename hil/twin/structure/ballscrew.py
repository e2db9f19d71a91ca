"""Ball-screw drive: stiffness of its parts, parameters of the 7-dof model, equivalent 2-dof model.

By the theory of elasticity (paper, appendix and Eq. 18):
    K_torsional = G J / L        K_axial = E A / L
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from hil.arrays import FloatArray

STEEL_YOUNG_PA = 2.06e11


def torsional_stiffness(rigidity_n_m2: float, length_m: float) -> float:
    """K = G J / L [N m/rad] of a bar in torsion with rigidity G J."""
    return rigidity_n_m2 / length_m


def axial_stiffness(rigidity_n: float, length_m: float) -> float:
    """K = E A / L [N/m] of a bar in tension or compression with rigidity E A."""
    return rigidity_n / length_m


def round_area(diameter_m: float) -> float:
    """A = pi d^2 / 4 [m^2] of a solid round section."""
    return pi * diameter_m**2 / 4.0


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


@dataclass(frozen=True)
class SevenDof:
    """Parameters of the 7-dof ball-screw drive of Fig. 4, masses and axial stiffnesses not yet reduced.

    `front_length_m` lies between the front bearing and the nut at nut position 0, `span_m` between the
    two bearings. Rigidities are G J [N m^2] and E A [N] of the screw, those of the appendix.
    """

    lead_m: float
    motor_inertia_kg_m2: float
    coupling_motor_side_inertia_kg_m2: float
    coupling_screw_side_inertia_kg_m2: float
    screw_inertia_kg_m2: float
    screw_mass_kg: float
    nut_mass_kg: float
    table_mass_kg: float
    motor_shaft_stiffness_n_m_rad: float
    coupling_stiffness_n_m_rad: float
    screw_torsional_rigidity_n_m2: float
    screw_axial_rigidity_n: float
    front_length_m: float
    span_m: float
    front_bearing_stiffness_n_m: float
    back_bearing_stiffness_n_m: float
    nut_stiffness_n_m: float
    nut_support_stiffness_n_m: float
    reference_nut_position_m: float

    def screw_lengths_m(self, nut_position_m: float | None = None) -> tuple[float, float]:
        """Lengths of screw before and behind the nut [m]; by default with the nut at its reference.

        Raises ValueError where the nut would lie outside the two bearings.
        """
        position = self.reference_nut_position_m if nut_position_m is None else nut_position_m
        front = self.front_length_m + position
        if not 0.0 < front < self.span_m:
            raise ValueError(
                f"nut_position_m must lie between {-self.front_length_m:g} and "
                f"{self.span_m - self.front_length_m:g} m (the bearings), got {position:g}"
            )
        return front, self.span_m - front

    def screw_torsion_n_m_rad(self, nut_position_m: float | None = None) -> float:
        """k_t3 = G J / L: only the screw between the front bearing and the nut is twisted (Sec. 3.1)."""
        front, _ = self.screw_lengths_m(nut_position_m)
        return torsional_stiffness(self.screw_torsional_rigidity_n_m2, front)

    def screw_axial_n_m(self, nut_position_m: float | None = None) -> float:
        """k_a4 by Eq. 18: each bearing in series with its side of the screw, the sides in parallel."""
        front, back = self.screw_lengths_m(nut_position_m)
        return supported_screw_stiffness(
            self.front_bearing_stiffness_n_m,
            axial_stiffness(self.screw_axial_rigidity_n, front),
            self.back_bearing_stiffness_n_m,
            axial_stiffness(self.screw_axial_rigidity_n, back),
        )

    def reduced(self, nut_position_m: float | None = None) -> tuple[FloatArray, FloatArray]:
        """Inertias J_1..J_7 [kg m^2] and stiffnesses k_t1..k_t6 [N m/rad] at the motor shaft (Eq. 13)."""
        r2 = (self.lead_m / (2.0 * pi)) ** 2
        inertias = np.array(
            [
                self.motor_inertia_kg_m2,
                self.coupling_motor_side_inertia_kg_m2,
                self.coupling_screw_side_inertia_kg_m2,
                self.screw_inertia_kg_m2,
                self.screw_mass_kg * r2,
                self.nut_mass_kg * r2,
                self.table_mass_kg * r2,
            ]
        )
        stiffnesses = np.array(
            [
                self.motor_shaft_stiffness_n_m_rad,
                self.coupling_stiffness_n_m_rad,
                self.screw_torsion_n_m_rad(nut_position_m),
                self.screw_axial_n_m(nut_position_m) * r2,
                self.nut_stiffness_n_m * r2,
                self.nut_support_stiffness_n_m * r2,
            ]
        )
        return inertias, stiffnesses


_SPAN_M = 0.42
_SCREW_AXIAL_RIGIDITY_N = STEEL_YOUNG_PA * round_area(0.032)

RECONSTRUCTED_TABLE_1 = SevenDof(
    lead_m=0.010,
    motor_inertia_kg_m2=335.0 * (0.010 / (2.0 * pi)) ** 2,
    coupling_motor_side_inertia_kg_m2=1.04e-4,
    coupling_screw_side_inertia_kg_m2=4.89e-5,
    screw_inertia_kg_m2=6.62e-4,
    screw_mass_kg=5.25,
    nut_mass_kg=3.49,
    table_mass_kg=58.8,
    motor_shaft_stiffness_n_m_rad=3.94e4,
    coupling_stiffness_n_m_rad=1.10e4,
    screw_torsional_rigidity_n_m2=4.17e3 * (_SPAN_M / 2.0),
    screw_axial_rigidity_n=_SCREW_AXIAL_RIGIDITY_N,
    front_length_m=0.010,
    span_m=_SPAN_M,
    # Eq. 18 solved for two equal bearings, so that k_a4 = 1.96e8 N/m with the nut in the middle
    front_bearing_stiffness_n_m=1.0 / (2.0 / 1.96e8 - _SPAN_M / 2.0 / _SCREW_AXIAL_RIGIDITY_N),
    back_bearing_stiffness_n_m=1.0 / (2.0 / 1.96e8 - _SPAN_M / 2.0 / _SCREW_AXIAL_RIGIDITY_N),
    nut_stiffness_n_m=6.40e8,
    nut_support_stiffness_n_m=6.53e7,
    reference_nut_position_m=0.200,
)
"""Reconstruction of the paper's Table 1, which is lost: NOT the authors' numbers.

It keeps m1 = 335 kg and m2 = 384 kg of Eq. 22 and k of Eq. 23 and gives the frequencies of Eq. 20 within
0.25 %. The screw (32 mm steel) and its span are assumed too: the paper says that the nut at 200 mm is the
middle and that torsion at 100 mm and below is about twice as stiff or more, so that lengths count from
the front bearing. The torsional rigidity follows from k_t3 and is far below that of a solid 32 mm shaft.
"""


@dataclass(frozen=True)
class EquivalentTwoMass:
    """Masses [kg] of Eq. 22 and stiffness [N/m] of Eq. 23, seen at the table.

    `stiffness_parallel_n_m` is Eq. 23 as printed: torsion and axial stiffness of the screw side by side.
    In the 7-dof model both carry the whole load one after the other, as k_t3 turns the screw at the nut
    and k_a4 lets it slide, so that the static stiffness of the 7-dof chain is `stiffness_series_n_m`.
    """

    motor_mass_kg: float
    table_mass_kg: float
    stiffness_parallel_n_m: float
    stiffness_series_n_m: float


def equivalent_two_mass(parameters: SevenDof, nut_position_m: float | None = None) -> EquivalentTwoMass:
    """Reduce a 7-dof model to a 2-dof one (Eq. 22-23), without the screw's axial mass m5."""
    r2 = (parameters.lead_m / (2.0 * pi)) ** 2
    inertias, stiffnesses = parameters.reduced(nut_position_m)
    torsion, axial = stiffnesses[2], stiffnesses[3]
    others = stiffnesses[[0, 1, 4, 5]]
    return EquivalentTwoMass(
        motor_mass_kg=float(inertias[0] / r2),
        table_mass_kg=float((inertias[5:].sum() + inertias[1:4].sum()) / r2),
        stiffness_parallel_n_m=float(in_series(torsion + axial, *others) / r2),
        stiffness_series_n_m=float(in_series(torsion, axial, *others) / r2),
    )
