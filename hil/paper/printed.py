"""Formulas of the source exactly as printed, where they do not hold: to show what each would give."""

from __future__ import annotations

from math import sqrt

import numpy as np

from hil.arrays import FloatArray
from hil.twin.structure.frequency import ComplexArray, laplace


def modal_matrix_eq_5(m1: float, m2: float) -> FloatArray:
    """[phi] of Eq. 5, its (1, 2) entry with the printed minus sign; Eq. 10 uses a plus there."""
    total = m1 + m2
    return np.array(
        [
            [1.0 / np.sqrt(total), -np.sqrt(m2 / (m1 * total))],
            [1.0 / np.sqrt(total), -np.sqrt(m1 / (m2 * total))],
        ]
    )


def rigid_acceleration_eq_6(shape: FloatArray) -> float:
    """Acceleration of mass 1 as a rigid body per unit force on it, with {f} = [phi]{g} of Eq. 6."""
    force = np.zeros(len(shape))
    force[0] = 1.0
    return float(shape[0, 0] * np.linalg.solve(shape, force)[0])


def pole_eq_8(frequency_rad_s: float, damping_ratio: float) -> complex:
    """Upper pole [1/s] of delta'' + 2 xi w delta + w^2 delta = g: Eq. 8 with damping on the position."""
    return complex(0.0, sqrt(frequency_rad_s**2 + 2.0 * damping_ratio * frequency_rad_s))


def recursion(
    inertia_kg_m2: FloatArray,
    stiffness_n_m_rad: FloatArray,
    damping_n_m_s_rad: FloatArray,
    frequency_hz: FloatArray,
    *,
    nut_sign: float = 1.0,
    screw_damper: float = 0.0,
) -> tuple[ComplexArray, ComplexArray]:
    """TF1 and TF2 by the appendix.

    `nut_sign` is the sign of TF_4-5, printed +1 (-1 holds). `screw_damper` is the share of c_t3 in
    the denominator of TF_3-4, printed 0 (1 holds). TF_4-5 and TF_5-6 are solved together.
    """
    s = laplace(frequency_hz)
    z = [c * s + k for c, k in zip(damping_n_m_s_rad, stiffness_n_m_rad, strict=True)]
    j = [inertia * s**2 for inertia in inertia_kg_m2]
    tf67 = z[5] / (j[6] + z[5])
    nut = z[4] / (j[5] + z[4] + z[5] - z[5] * tf67)
    tf45 = z[4] * (nut_sign + nut) / (j[4] + z[3] + z[4] - z[4] * nut)
    tf56 = nut * (1.0 / tf45 + 1.0)
    own = screw_damper * damping_n_m_s_rad[2] * s + stiffness_n_m_rad[2]
    tf34 = z[2] / (j[3] + own + z[4] + tf45 * z[4] * (1.0 - tf56))
    tf23 = z[1] / (j[2] + z[1] + z[2] - z[2] * tf34)
    tf12 = z[0] / (j[1] + z[0] + z[1] - z[1] * tf23)
    return 1.0 / (j[0] + z[0] - z[0] * tf12), tf12 * tf23 * tf34 * tf45 * tf56 * tf67
