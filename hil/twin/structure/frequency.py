"""Frequency responses of a chain and of the axis under control.

    TF1 = theta_motor / tau        TF2 = theta_table / theta_motor           (Eq. 16-17)

In natural coordinates by inverting ([J] s^2 + [C] s + [K]), in modal coordinates as a sum over the modes; all at
s = 2 pi i f. Responses are complex (k,) arrays.
"""

from collections.abc import Callable
from math import pi

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.control.cascade import Gains
from hil.twin.structure.chain import Chain
from hil.twin.structure.modal import Modal, discretise

ComplexArray = NDArray[np.complex128]
SampledPlant = Callable[[ComplexArray], tuple[ComplexArray, ComplexArray]]


def laplace(frequency_hz: FloatArray) -> ComplexArray:
    """s = 2 pi i f [1/s]."""
    return np.asarray(2j * pi * np.asarray(frequency_hz), dtype=np.complex128)


def modal_transfer(modal: Modal, frequency_hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """TF1 [rad/(N m)] and TF2 [1] in modal coordinates (Eq. 17)."""
    s = laplace(frequency_hz)[:, None]
    w, xi = modal.frequency_rad_s, modal.damping_ratio
    modes = modal.shape[modal.motor] / (s**2 + 2.0 * xi * w * s + w**2)
    tf1 = np.asarray(modes @ modal.shape[modal.motor], dtype=np.complex128)
    return tf1, np.asarray(modes @ modal.shape[modal.table] / tf1)


def natural_transfer(
    chain: Chain, damping_n_m_s_rad: FloatArray, frequency_hz: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """TF1 [rad/(N m)] and TF2 [1] in natural coordinates, by matrix inversion (Eq. 14).

    `damping_n_m_s_rad` is the matrix [C] (n, n). The damping ratios of the chain are not used.
    """
    s = laplace(frequency_hz)[:, None, None]
    load = np.zeros((len(chain.names), 1))
    load[chain.motor] = 1.0
    dynamic = chain.inertia_kg_m2 * s**2 + damping_n_m_s_rad * s + chain.stiffness_n_m_rad
    answer = np.asarray(np.linalg.solve(dynamic, load)[..., 0], dtype=np.complex128)
    tf1 = answer[:, chain.motor]
    return tf1, answer[:, chain.table] / tf1


def modal_damping(chain: Chain, modal: Modal) -> FloatArray:
    """[C] = [J] phi diag(2 xi w) phi^T [J]: the matrix (n, n) with the modal damping of Eq. 7."""
    basis = chain.inertia_kg_m2 @ modal.shape
    return (basis * (2.0 * modal.damping_ratio * modal.frequency_rad_s)) @ basis.T


def closed_loop(modal: Modal, gains: Gains, frequency_hz: FloatArray) -> ComplexArray:
    """Position command to table position under the continuous cascade (Sec. 2), linear and without friction.

        v_ref = Kv (x_cmd - x) + ff s x_cmd,   u = (Kp + Ki / s) (v_ref / r - s theta)

    x is r theta or the table. Cycle times, filters and the torque limit of `gains` are left out; see
    `sampled_closed_loop`.
    """
    s = laplace(frequency_hz)
    tf1, tf2 = modal_transfer(modal, frequency_hz)
    pi_law = gains.velocity_gain_n_m_s_rad + gains.integral_gain_n_m_rad / s
    position = tf1 * pi_law / (1.0 + s * tf1 * pi_law)  # r theta / v_ref
    feedback = position * tf2 if gains.position_from_table else position
    command = gains.position_gain_1_s + gains.velocity_feedforward * s
    return position * tf2 * command / (1.0 + gains.position_gain_1_s * feedback)


def sampled_transfer(modal: Modal, period_s: float, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Held torque to sampled motor and table angle [rad/(N m)] at z = exp(s T), discretised exactly."""
    d = discretise(modal, period_s)
    x = z[:, None]
    per_mode = (d.b1 * (x - d.a22) + d.a12 * d.b2) / ((x - d.a11) * (x - d.a22) - d.a12 * d.a21)
    per_mode = per_mode * modal.shape[modal.motor]
    return per_mode @ modal.shape[modal.motor], per_mode @ modal.shape[modal.table]


def sampled_closed_loop(modal: Modal, gains: Gains, frequency_hz: FloatArray, delay_ticks: int = 0) -> ComplexArray:
    """Position command to sampled table position under the law of `hil.control.cascade`, below its torque limit.

    Exact for the sampled loops; the torque may act `delay_ticks` late. See `position_loop`.
    """

    def plant(z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        motor, table = sampled_transfer(modal, gains.period_s, z)
        return motor / z**delay_ticks, table / z**delay_ticks

    return position_loop(plant, gains, frequency_hz)[1]


def position_loop(plant: SampledPlant, gains: Gains, frequency_hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Open position loop, cut at its input, and position command to sampled table position.

    `plant` gives held torque to motor and table angle [rad/(N m)] at z = exp(s T). The position loop runs every n-th
    tick and its output is held, so that its samples see the inner loop at the n aliases of each frequency; the open
    loop is that of these samples and has the period 1 / (n T) over frequency.
    """
    ticks = gains.position_ticks
    z = np.exp(laplace(frequency_hz) * gains.period_s)
    aliases = [z * np.exp(2j * pi * m / ticks) for m in range(ticks)]
    loops = [_held_velocity_loop(plant, gains, alias) for alias in aliases]
    table = loops[0][1] / ticks
    feedback = sum(loop[int(gains.position_from_table)] for loop in loops) / ticks
    opened = np.asarray(gains.position_gain_1_s * feedback, dtype=np.complex128)
    command = gains.position_gain_1_s + gains.velocity_feedforward * laplace(frequency_hz)
    return opened, np.asarray(table * command / (1.0 + opened))


def velocity_law(gains: Gains, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """PI law [N m s/rad] from the error of the velocity to the torque, and the law's velocity over position [1/s]."""
    period, coefficient = gains.period_s, gains.filter_coefficient
    pi_law = gains.velocity_gain_n_m_s_rad + gains.integral_gain_n_m_rad * period / (z - 1.0)
    difference = (1.0 - z**-2) / (2.0 * period) if gains.two_sample_mean else (1.0 - z**-1) / period
    return pi_law, difference * coefficient / (1.0 - (1.0 - coefficient) / z)


def _held_velocity_loop(plant: SampledPlant, gains: Gains, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Velocity reference of the position loop to r theta of motor and table, hold of n ticks included."""
    motor, table = plant(z)
    pi_law, velocity = velocity_law(gains, z)
    hold = sum(z**-i for i in range(gains.position_ticks))
    torque = hold * pi_law / (1.0 + motor * pi_law * velocity)  # times r over v_ref
    return motor * torque, table * torque


def bandwidth_hz(frequency_hz: FloatArray, response: ComplexArray) -> float:
    """First frequency at which |response| falls 3 dB (1/sqrt 2) below 1, interpolated in dB over log f.

    NaN where it never does within the given ascending frequencies.
    """
    level_db = 20.0 * np.log10(np.abs(response)) - 20.0 * np.log10(np.sqrt(0.5))
    below = np.flatnonzero(level_db < 0.0)
    if below.size == 0 or below[0] == 0:
        return float("nan")
    i = below[0]
    share = level_db[i - 1] / (level_db[i - 1] - level_db[i])
    return float(frequency_hz[i - 1] * (frequency_hz[i] / frequency_hz[i - 1]) ** share)
