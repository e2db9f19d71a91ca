"""Modes of a chain: eigenproblem, truncation, exact discretisation.

    ([K] - w_i^2 [J]) phi_i = 0,   phi^T [J] phi = 1,   q = phi delta,   g = phi^T tau    (Eq. 4-6)
    delta_i'' + 2 xi_i w_i delta_i' + w_i^2 delta_i = g_i                                 (Eq. 8)

Eq. 6 prints {f} = [phi]{g}; with mass-normalised modes the modal force is g = phi^T f. Eq. 7-8 print
the damping on the position; it acts on the velocity.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hil.arrays import FloatArray
from hil.twin.structure.chain import Chain

_RIGID = 1e-12  # eigenvalues below this fraction of the largest are the rigid body


@dataclass(frozen=True)
class Modal:
    """Modes in ascending frequency: (m,) frequencies [rad/s] and damping ratios, (n, m) shapes.

    Column i of `shape` is mode i, mass-normalised [1/sqrt(kg m^2)], with a motor component >= 0.
    `shape[motor]` and `shape[table]` are the participations of the two encoders, `transmission` (m,)
    and `screw` (m,) those of the deflections of these springs.
    """

    frequency_rad_s: FloatArray
    shape: FloatArray
    damping_ratio: FloatArray
    motor: int
    table: int
    transmission: FloatArray
    screw: FloatArray


class Discrete(NamedTuple):
    """delta' = a11 delta + a12 v + b1 g,  v' = a21 delta + a22 v + b2 g: one entry per mode."""

    a11: FloatArray
    a12: FloatArray
    a21: FloatArray
    a22: FloatArray
    b1: FloatArray
    b2: FloatArray


@lru_cache(maxsize=256)  # a fit changes the chain in few of its parameters
def modal(chain: Chain) -> Modal:
    """Compute the modes of a chain by the symmetric eigenproblem L^-1 K L^-T with J = L L^T.

    The rigid body has frequency exactly 0. Raises numpy.linalg.LinAlgError where the inertia is not
    positive definite.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(chain.inertia_kg_m2))
    square, vectors = np.linalg.eigh(inverse @ chain.stiffness_n_m_rad @ inverse.T)
    shape = inverse.T @ vectors
    shape *= np.where(shape[chain.motor] < 0.0, -1.0, 1.0)
    square[square < _RIGID * square[-1]] = 0.0
    return Modal(
        frequency_rad_s=np.sqrt(square),
        shape=shape,
        damping_ratio=chain.damping_ratio,
        motor=chain.motor,
        table=chain.table,
        transmission=chain.transmission @ shape,
        screw=chain.screw @ shape,
    )


def truncate(modal: Modal, modes: int) -> Modal:
    """Keep the lowest `modes` modes. Raises ValueError where there are not as many."""
    available = modal.frequency_rad_s.size
    if not 1 <= modes <= available:
        raise ValueError(f"modes must lie between 1 and {available}, got {modes}")
    return replace(
        modal,
        frequency_rad_s=modal.frequency_rad_s[:modes],
        shape=modal.shape[:, :modes],
        damping_ratio=modal.damping_ratio[:modes],
        transmission=modal.transmission[:modes],
        screw=modal.screw[:modes],
    )


def lowest_modes(chain: Chain, number: int | None) -> Modal:
    """The lowest modes of a chain; None: all. Raises ValueError where there are not as many."""
    return modal(chain) if number is None else truncate(modal(chain), number)


def discretise(modal: Modal, period_s: float) -> Discrete:
    """Discretise every mode exactly under a modal force held for `period_s` (zero-order hold).

    With s = xi w, w_d = w sqrt(1 - xi^2), e = exp(-s T):
        a11 = e (cos w_d T + s/w_d sin w_d T)     a12 = e sin(w_d T) / w_d
        a21 = -w^2 a12                            a22 = e (cos w_d T - s/w_d sin w_d T)
        b1 = (1 - a11) / w^2                      b2 = a12
    and for the rigid body (w = 0) the limits 1, T, 0, 1, T^2/2, T.
    Raises ValueError for a damping ratio outside [0, 1).
    """
    w, xi = modal.frequency_rad_s, modal.damping_ratio
    if xi.min() < 0.0 or xi.max() >= 1.0:
        raise ValueError(f"damping_ratio must lie in [0, 1) for every mode, got {xi.tolist()}")
    rigid = w == 0.0
    w_safe = np.where(rigid, 1.0, w)
    decay = xi * w_safe
    damped = w_safe * np.sqrt(1.0 - xi * xi)
    envelope = np.exp(-decay * period_s)
    sine, cosine = np.sin(damped * period_s), np.cos(damped * period_s)
    a12 = envelope * sine / damped
    # 1 - a11 without cancellation at small w T
    rest = -np.expm1(-decay * period_s) + 2.0 * envelope * np.sin(0.5 * damped * period_s) ** 2 - decay * a12
    return Discrete(
        a11=np.where(rigid, 1.0, envelope * cosine + decay * a12),
        a12=np.where(rigid, period_s, a12),
        a21=np.where(rigid, 0.0, -w_safe * w_safe * a12),
        a22=np.where(rigid, 1.0, envelope * cosine - decay * a12),
        b1=np.where(rigid, 0.5 * period_s**2, rest / w_safe**2),
        b2=np.where(rigid, period_s, a12),
    )
