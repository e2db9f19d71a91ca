"""Inverse-dynamics identification of an axis as one mass, as published for EMPS.

    F = M a + F_v v + F_c sign(v) + F_0                        least squares over the whole record

after A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, 2019. Steps: the position is filtered
forwards and backwards by a Butterworth filter; velocity and acceleration are central differences; then the
unfiltered force and all four regressors are low-passed alike and decimated. On a rotary axis the same in kg m^2,
N m s/rad, N m.

Sensitivity of the published figures to each step, changed alone (computed on the EMPS record):

                                                  M kg     F_v N s/m   F_c N    F_0 N     error
    as published and as computed here             95.109   203.503     20.393   -3.165    4.083 %
    no samples cut at the start                   95.117   202.687     20.475   -3.148    4.469 %
    as many cut at the end too                    95.116   203.372     20.409   -3.170    4.039 %
    Butterworth filter of order 2                 95.127   203.501     20.394   -3.165    4.063 %
    Butterworth filter at 50 Hz                   94.943   202.582     20.504   -3.204    5.203 %
    force filtered like the position              95.109   203.503     20.393   -3.165    4.083 %
    padding 3 (order + 1), scipy's default        95.102   203.099     20.442   -3.181    4.139 %
    sign of the decimated velocity                95.283   211.370     19.397   -3.170    5.960 %
    every tenth sample, not low-passed            95.273   203.839     20.390   -3.160    4.433 %
    |v| > 10 mm/s only                            94.798   198.408     20.902   -3.264    3.778 %

Therefore sign(v) is taken at the full rate and low-passed with the other columns, and the start of the record is cut.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, cheby1, sosfiltfilt

from hil.arrays import FloatArray
from hil.channels import AxisKind
from hil.errors import InputError
from hil.identification.derivatives import MeasuredMotion
from hil.identification.least_squares import Columns, least_squares
from hil.identification.plain_model import plain_columns
from hil.recording.recording import Recording

BUTTERWORTH_ORDER = 4
CHEBYSHEV_ORDER, RIPPLE_DB, CORNER = 8, 0.05, 0.8  # corner in parts of the Nyquist frequency after decimation
CUT_AT_START = 49  # samples in which the differences and filters settle


@dataclass(frozen=True)
class InverseDynamics:
    """Result: inertia [kg], viscous [N s/m], coulomb [N], offset [N]; rotary [kg m^2], [N m s/rad], [N m], [N m].

    `relative_error` is |F - fit| / |F|, Euclidean norms of the decimated columns; the standard errors are those of
    `least_squares`, which count correlated residuals.
    """

    kind: AxisKind
    inertia: float
    viscous: float
    coulomb: float
    offset: float
    inertia_std_error: float
    viscous_std_error: float
    coulomb_std_error: float
    offset_std_error: float
    relative_error: float


def fit_inverse_dynamics(
    recording: Recording, *, cutoff_hz: float = 100.0, decimation: int = 10, cut_at_end: int = 0
) -> InverseDynamics:
    """Fit motor torque (linear axis: force) over the motion of the motor encoder.

    The published evaluation keeps the end of the record, where the filters have not settled; `cut_at_end` = 49 samples
    is better for a record that ends in motion.

    Raises InputError if the record is too short, sampled too slowly, or does not move both ways.
    """
    if recording.period_s * 2 * cutoff_hz >= 1:
        raise InputError(
            f"{recording.name}: given a period of {recording.period_s:g} s, allowed less than "
            f"{0.5 / cutoff_hz:g} s for a filter at {cutoff_hz:g} Hz; give a lower cutoff_hz"
        )
    if len(recording) < CUT_AT_START + 100 * decimation:
        raise InputError(
            f"{recording.name}: given {len(recording)} rows, allowed "
            f"{CUT_AT_START + 100 * decimation} or more; give a longer recording"
        )
    columns, force = inverse_dynamics_columns(recording, cutoff_hz, decimation, cut_at_end)
    fit = least_squares(columns, force)
    figures = np.concatenate([fit.values, fit.std_errors, [fit.relative_error]])
    return InverseDynamics(recording.kind, *figures.tolist())


def inverse_dynamics_columns(
    recording: Recording, cutoff_hz: float, decimation: int, cut_at_end: int = 0
) -> tuple[Columns, FloatArray]:
    """Columns of the plain model and torque or force (n,), filtered and decimated as in the source.

    Raises InputError if the record does not move both ways.
    """
    position, force = recording[recording.axis.motor_position], recording[recording.axis.torque]
    butterworth = butter(BUTTERWORTH_ORDER, 2 * cutoff_hz * recording.period_s, output="sos")
    velocity = np.gradient(_forwards_and_backwards(butterworth, position), recording.period_s)
    if not (velocity.min() < 0 < velocity.max()):
        raise InputError(
            f"{recording.name}: {recording.axis.motor_position}: given motion in one direction, allowed "
            "both; Coulomb friction and offset are not separable in one direction: record a return move"
        )
    moved = MeasuredMotion(position, velocity, np.gradient(velocity, recording.period_s), np.sign(velocity))
    # every column is filtered, the offset too: the filter's gain at low frequencies is 0.989, not 1
    settled = slice(CUT_AT_START, len(recording) - cut_at_end)
    filtered = {name: _decimate(column[settled], decimation) for name, column in plain_columns(moved).items()}
    return filtered, _decimate(force[settled], decimation)


def _forwards_and_backwards(sections: FloatArray, values: FloatArray) -> FloatArray:
    """Filter without phase, the ends padded by three times the order of the filter, an even one."""
    return np.asarray(sosfiltfilt(sections, values, padlen=6 * len(sections)), dtype=np.float64)


def _decimate(values: FloatArray, decimation: int) -> FloatArray:
    """Low-pass and decimate values (n,), counted from the end so that the last sample is kept."""
    chebyshev = cheby1(CHEBYSHEV_ORDER, RIPPLE_DB, CORNER / decimation, output="sos")
    return _forwards_and_backwards(chebyshev, values)[(values.size - 1) % decimation :: decimation]
