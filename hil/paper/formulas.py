"""Formulas of the source that do not hold as printed, and their comparison with the corrected ones."""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from hil.arrays import FloatArray
from hil.paper import source
from hil.paper.row import Row
from hil.twin.structure import frequency
from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1
from hil.twin.structure.frequency import ComplexArray, laplace
from hil.twin.structure.modal import modal

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


def two_dof_formulas() -> Iterator[Row]:
    """Compare Eq. 1, 5, 6, 7 and 8 as printed with their corrected forms."""
    m1, m2 = source.MOTOR_MASS_KG, source.TABLE_MASS_KG
    mass = np.diag([m1, m2])
    modes = modal(source.chains()["2-dof"])
    shape = modes.shape * source.RATIO_M_RAD  # from angles to metres
    w, xi = float(modes.frequency_rad_s[1]), float(modes.damping_ratio[1])
    yield Row(
        "Eq. 1, 7, 8",
        "decay rate of the elastic mode (printed: of the formula as it stands)",
        "1/s",
        abs(pole_eq_8(w, xi).real),
        xi * w,
        0.01,
        "printed, the damping multiplies the position and damps nothing; it multiplies the velocity",
    )
    wrong = modal_matrix_eq_5(m1, m2)
    yield Row(
        "Eq. 5",
        "phi_1^T [M] phi_2, rigid and elastic mode (printed: of the matrix as it stands)",
        "1",
        float(wrong[:, 0] @ mass @ wrong[:, 1]),
        float(shape[:, 0] @ mass @ shape[:, 1]),
        0.01,
        "the (1, 2) entry is + sqrt(m2/(m1 mt)), as Eq. 10 uses; with the printed sign the modes are not orthogonal",
    )
    yield Row(
        "Eq. 6",
        "rigid-body acceleration per newton (printed: of the formula as it stands)",
        "m/s^2/N",
        rigid_acceleration_eq_6(shape),
        1.0 / (m1 + m2),
        0.01,
        "the modal force is {g} = [phi]^T {f} with mass-normalised modes, not {f} = [phi]{g}",
    )


def transfer_functions() -> Iterator[Row]:
    """Compare Eq. 16, 17 and the recursion of the appendix with the matrix form."""
    chain = source.chains()["7-dof"]
    modes = modal(chain)
    natural = frequency.natural_transfer(chain, frequency.modal_damping(chain, modes), BAND_HZ)
    worst = _largest_deviation(natural, frequency.modal_transfer(modes, BAND_HZ))
    yield Row(
        "Eq. 16, 17",
        "largest relative deviation of TF1 and TF2, natural against modal, 1-4000 Hz",
        "1",
        0.0,
        worst,
        1e-9,
        "the two forms are the same function; the rest is rounding",
    )
    inertia, stiffness = RECONSTRUCTED_TABLE_1.reduced()
    beta_s = 2e-5  # dampers in proportion to the springs, c = beta k
    natural = frequency.natural_transfer(chain, beta_s * chain.stiffness_n_m_rad, BAND_HZ)
    recursive = frequency.recursive_transfer(inertia, stiffness, beta_s * stiffness, BAND_HZ)
    yield Row(
        "Appendix",
        "largest relative deviation of TF1 and TF2, corrected recursion against matrices",
        "1",
        0.0,
        _largest_deviation(natural, recursive),
        1e-9,
        "TF_5-6 and TF_6-7 hold as printed; TF_3-4 and TF_4-5 after the corrections of the next rows",
    )
    _, plus = recursion(inertia, stiffness, beta_s * stiffness, BAND_HZ, screw_damper=1.0)
    yield Row(
        "Appendix, TF_4-5",
        "|TF2| at 1 Hz (printed: with the sign as it stands)",
        "1",
        float(abs(plus[0])),
        float(abs(recursive[1][0])),
        0.01,
        "a minus sign is missing: the nut spring acts on theta4 + theta5 - theta6. At 1 Hz the table "
        "must follow the motor",
    )
    tf1, _ = recursion(inertia, stiffness, beta_s * stiffness, BAND_HZ, nut_sign=-1.0)
    yield Row(
        "Appendix, TF_3-4",
        "largest change of |TF1| by the damper c_t3 missing in the denominator",
        "dB",
        0.0,
        float(np.max(np.abs(20.0 * np.log10(np.abs(tf1 / recursive[0]))))),
        0.1,
        "the denominator holds (c_t3 + c_t5) s, where c_t5 s is printed; with c = 20 us x k",
    )


Transfer = tuple[frequency.ComplexArray, frequency.ComplexArray]


def _largest_deviation(expected: Transfer, found: Transfer) -> float:
    return max(float(np.max(np.abs(b / a - 1.0))) for a, b in zip(expected, found, strict=True))
