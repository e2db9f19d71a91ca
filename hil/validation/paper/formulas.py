"""Formulas of the source that do not hold as printed, and their comparison with the corrected ones."""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from hil.arrays import FloatArray
from hil.twin.structure import frequency
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1
from hil.twin.structure.frequency import ComplexArray, laplace
from hil.twin.structure.modal import modal
from hil.validation.paper import source
from hil.validation.paper.row import Row, row

Transfer = tuple[ComplexArray, ComplexArray]
BAND_HZ = np.geomspace(1.0, 4000.0, 3000)  # rigid body to above the highest mode


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


def recursive_transfer(
    inertia_kg_m2: FloatArray,
    stiffness_n_m_rad: FloatArray,
    damping_n_m_s_rad: FloatArray,
    frequency_hz: FloatArray,
    *,
    printed_sign: bool = False,
    printed_damper: bool = False,
) -> Transfer:
    """TF1 and TF2 of the 7-dof drive by the recursion of the appendix, from table to motor.

    Takes J_1..J_7, k_t1..k_t6 (`SevenDof.reduced`) and the dampers c_t1..c_t6 beside the springs. Two formulas are
    corrected unless asked for as printed: TF_3-4 has (c_t3 + c_t5) s, where c_t5 s is printed, and TF_4-5 a minus sign,
    since the nut spring acts on theta4 + theta5 - theta6. TF_4-5 and TF_5-6 are printed in terms of each other; here
    the pair is solved for TF_4-5.
    """
    s = laplace(frequency_hz)
    j1, j2, j3, j4, j5, j6, j7 = (j * s**2 for j in inertia_kg_m2)
    z1, z2, z3, z4, z5, z6 = (c * s + k for c, k in zip(damping_n_m_s_rad, stiffness_n_m_rad, strict=True))
    tf67 = z6 / (j7 + z6)
    nut = z5 / (j6 + z5 + z6 - z6 * tf67)  # theta6 / (theta4 + theta5)
    free = (j6 + j7 * tf67) / (j6 + z5 + z6 - z6 * tf67)  # 1 - nut, without cancellation
    tf45 = z5 * (1.0 + nut if printed_sign else -free) / (j5 + z4 + z5 * free)
    tf56 = nut * (1.0 / tf45 + 1.0)
    own = stiffness_n_m_rad[2] if printed_damper else z3
    tf34 = z3 / (j4 + own + z5 + z5 * tf45 * (1.0 - tf56))
    tf23 = z2 / (j3 + z2 + z3 - z3 * tf34)
    tf12 = z1 / (j2 + z1 + z2 - z2 * tf23)
    return 1.0 / (j1 + z1 - z1 * tf12), tf12 * tf23 * tf34 * tf45 * tf56 * tf67


def two_dof_formulas() -> Iterator[Row]:
    """Compare Eq. 1, 5, 6, 7 and 8 as printed with their corrected forms."""
    m1, m2 = source.MOTOR_MASS_KG, source.TABLE_MASS_KG
    mass = np.diag([m1, m2])
    modes = modal(source.chains()["2-dof"])
    shape = modes.shape * source.RATIO_M_RAD  # from angles to metres
    w, xi = float(modes.frequency_rad_s[1]), float(modes.damping_ratio[1])
    yield row("decay", xi * w, abs(pole_eq_8(w, xi).real))
    wrong = modal_matrix_eq_5(m1, m2)
    yield row("orthogonality", float(shape[:, 0] @ mass @ shape[:, 1]), float(wrong[:, 0] @ mass @ wrong[:, 1]))
    yield row("modal_force", 1.0 / (m1 + m2), rigid_acceleration_eq_6(shape))


def transfer_functions() -> Iterator[Row]:
    """Compare Eq. 16, 17 and the recursion of the appendix with the matrix form."""
    chain = source.chains()["7-dof"]
    modes = modal(chain)
    natural = frequency.natural_transfer(chain, frequency.modal_damping(chain, modes), BAND_HZ)
    yield row("transfer", _largest_deviation(natural, frequency.modal_transfer(modes, BAND_HZ)))
    inertia, stiffness = RECONSTRUCTED_TABLE_1.reduced()
    beta_s = 2e-5  # dampers in proportion to the springs, c = beta k
    elements = (inertia, stiffness, beta_s * stiffness, BAND_HZ)
    natural = frequency.natural_transfer(chain, beta_s * chain.stiffness_n_m_rad, BAND_HZ)
    corrected = recursive_transfer(*elements)
    yield row("recursion", _largest_deviation(natural, corrected))
    _, plus = recursive_transfer(*elements, printed_sign=True)
    yield row("sign", abs(corrected[1][0]), float(abs(plus[0])))
    tf1, _ = recursive_transfer(*elements, printed_damper=True)
    yield row("damper", np.max(np.abs(20.0 * np.log10(np.abs(tf1 / corrected[0])))))


def _largest_deviation(expected: Transfer, found: Transfer) -> float:
    return max(float(np.max(np.abs(b / a - 1.0))) for a, b in zip(expected, found, strict=True))
