"""True parameters of a simulated axis: lumped masses, springs and friction of a ball-screw chain.

Every coordinate is kept as translation at the table: y = r theta for a rotary one (r = lead / 2 pi),
hence J becomes J / r^2 [kg] and a torsional stiffness k_t / r^2 [N/m].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

GROUND = -1
MAX_MASSES = 24


@dataclass(frozen=True)
class Spring:
    """Linear spring between masses `first` and `second` (or GROUND).

    `on_screw`: the stiffness depends on the position of the nut (effect position_dependent_stiffness).
    """

    stiffness_n_m: float
    first: int
    second: int = GROUND
    on_screw: bool = False
    damping_n_s_m: float = 0.0


@dataclass(frozen=True)
class Nut:
    """Spring of the screw-nut contact: stretch = y[screw] (+ y[axial]) - y[table_side]."""

    stiffness_n_m: float
    screw: int
    table_side: int
    axial: int = GROUND


@dataclass(frozen=True)
class AxisTruth:
    """True parameters of the axis. Build it with one_mass, two_mass, seven_dof or serial_chain.

    mass_kg: chain from the motor (first) to the table (last), as translation at the table.
    damping_ratio: of every elastic mode of the chain. None: C = a M + b K instead, with
    a = mass_damping_1_s and b = stiffness_damping_s.
    linear: force and metres at the motor instead of torque and radians; friction is then in N and N s/m.
    """

    mass_kg: tuple[float, ...]
    springs: tuple[Spring, ...]
    nut: Nut | None
    lead_m: float
    coulomb_torque_n_m: float
    viscous_torque_n_m_s_rad: float
    damping_ratio: float | None = 0.03
    mass_damping_1_s: float = 0.0
    stiffness_damping_s: float = 0.0
    linear: bool = False

    def __post_init__(self) -> None:
        if not 1 <= len(self.mass_kg) <= MAX_MASSES - 1:
            raise ValueError(f"mass_kg: must hold 1 to {MAX_MASSES - 1} masses, got {len(self.mass_kg)}")
        _check("mass_kg", min(self.mass_kg), positive=True)
        for spring in self.springs:
            _check("stiffness_n_m", spring.stiffness_n_m, positive=True)
        if self.nut is not None:
            _check("nut stiffness_n_m", self.nut.stiffness_n_m, positive=True)
        _check("lead_m", self.lead_m, positive=True)
        for name in ("coulomb_torque_n_m", "viscous_torque_n_m_s_rad", "mass_damping_1_s", "stiffness_damping_s"):
            _check(name, getattr(self, name))
        if self.damping_ratio is not None:
            _check("damping_ratio", self.damping_ratio)

    @property
    def screw_ratio_m_rad(self) -> float:
        """r = lead / 2 pi."""
        return self.lead_m / (2 * pi)

    @property
    def drive_ratio_m_rad(self) -> float:
        """Table travel per unit of motor position: r on a rotary axis, 1 on a linear one."""
        return 1.0 if self.linear else self.screw_ratio_m_rad

    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """M [kg], C [N s/m], K [N/m], each (N, N), of M y'' + C y' + K y = f without friction.

        Modal damping in natural coordinates: C = M^1/2 V diag(2 zeta omega) V^T M^1/2 with
        M^-1/2 K M^-1/2 = V diag(omega^2) V^T.
        """
        count = len(self.mass_kg)
        mass = np.diag(self.mass_kg)
        stiffness = np.zeros((count, count))
        for spring in self.springs:
            stiffness += spring.stiffness_n_m * _outer(count, ((spring.first, 1.0), (spring.second, -1.0)))
        if self.nut is not None:
            ends = ((self.nut.screw, 1.0), (self.nut.axial, 1.0), (self.nut.table_side, -1.0))
            stiffness += self.nut.stiffness_n_m * _outer(count, ends)
        if self.damping_ratio is None:
            return mass, self.mass_damping_1_s * mass + self.stiffness_damping_s * stiffness, stiffness
        root = np.sqrt(np.asarray(self.mass_kg))
        squares, modes = np.linalg.eigh(stiffness / np.outer(root, root))
        omega = np.sqrt(np.where(squares > 1e-9 * max(squares[-1], 1.0), squares, 0.0))
        damping = (modes * (2 * self.damping_ratio * omega)) @ modes.T * np.outer(root, root)
        return mass, damping, stiffness

    def frequencies_hz(self) -> NDArray[np.float64]:
        """Undamped natural frequencies (N,), ascending, the rigid-body mode first."""
        mass, _, stiffness = self.matrices()
        root = np.sqrt(np.diag(mass))
        squares = np.linalg.eigvalsh(stiffness / np.outer(root, root))
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2 * pi), dtype=np.float64)


def one_mass(
    mass_kg: float = 95.109,
    coulomb_force_n: float = 20.394,
    viscous_force_n_s_m: float = 203.5,
    lead_m: float = 0.0025,
) -> AxisTruth:
    """Linear axis with one encoder: x'' m = f - friction. Defaults: published EMPS model
    (Janot, Gautier, Brunot 2019). `lead_m` is one revolution for the angle-locked effects."""
    return AxisTruth((mass_kg,), (), None, lead_m, coulomb_force_n, viscous_force_n_s_m, linear=True)


def two_mass(
    lead_m: float = 0.010,
    motor_mass_kg: float = 335.0,
    table_mass_kg: float = 384.0,
    stiffness_n_m: float = 5.64e7,
    damping_ratio: float = 0.03,
    coulomb_torque_n_m: float = 1.1,
    viscous_torque_n_m_s_rad: float = 0.0064,
) -> AxisTruth:
    """Eq. 1 of the source paper: motor and table, one spring between; the nut is that spring."""
    return AxisTruth(
        (motor_mass_kg, table_mass_kg), (), Nut(stiffness_n_m, 0, 1), lead_m,
        coulomb_torque_n_m, viscous_torque_n_m_s_rad, damping_ratio,
    )  # fmt: skip


def serial_chain(
    mass_kg: Sequence[float],
    stiffness_n_m: Sequence[float],
    lead_m: float = 0.010,
    damping_ratio: float | None = 0.03,
    coulomb_torque_n_m: float = 1.1,
    viscous_torque_n_m_s_rad: float = 0.0064,
    nut_spring: int = -1,
    mass_damping_1_s: float = 0.0,
    stiffness_damping_s: float = 0.0,
) -> AxisTruth:
    """N masses joined by N - 1 springs, spring i between masses i and i + 1; `nut_spring` is the nut
    (default the last). Raises ValueError when the counts do not fit."""
    links = len(stiffness_n_m)
    if links != len(mass_kg) - 1 or links < 1:
        raise ValueError(f"stiffness_n_m: must hold one value less than mass_kg ({len(mass_kg)}), got {links}")
    if not -links <= nut_spring < links:
        raise ValueError(f"nut_spring: must be {-links} to {links - 1}, got {nut_spring}")
    at = nut_spring % links
    springs = tuple(Spring(k, i, i + 1) for i, k in enumerate(stiffness_n_m) if i != at)
    return AxisTruth(
        tuple(mass_kg), springs, Nut(stiffness_n_m[at], at, at + 1), lead_m, coulomb_torque_n_m,
        viscous_torque_n_m_s_rad, damping_ratio, mass_damping_1_s, stiffness_damping_s,
    )  # fmt: skip


def seven_dof(
    lead_m: float = 0.010,
    inertia_kg_m2: Sequence[float] = (8.486e-4, 1.04e-4, 4.89e-5, 6.62e-4),
    axial_mass_kg: Sequence[float] = (5.25, 3.49, 58.8),
    torsional_stiffness_n_m_rad: Sequence[float] = (3.94e4, 1.10e4, 4.17e3),
    axial_stiffness_n_m: Sequence[float] = (1.96e8, 6.40e8, 6.53e7),
    damping_ratio: float = 0.03,
    coulomb_torque_n_m: float = 1.1,
    viscous_torque_n_m_s_rad: float = 0.0064,
) -> AxisTruth:
    """Motor, two coupling halves, screw (angle and axial), nut, table: J1..J4, m5..m7; kt1..kt3;
    ka4 (screw and bearings to ground), ka5 (nut: theta4 + theta5 - theta6), ka6 (nut bracket).

    Defaults are a reconstruction of the source paper's lost Table 1, not its authors' numbers; they
    keep its Eq. 22 and 23 and reproduce its Eq. 20 frequencies within 0.25 %.
    """
    square = (lead_m / (2 * pi)) ** 2
    kt1, kt2, kt3 = (value / square for value in torsional_stiffness_n_m_rad)
    ka4, ka5, ka6 = axial_stiffness_n_m
    springs = (
        Spring(kt1, 0, 1), Spring(kt2, 1, 2), Spring(kt3, 2, 3, on_screw=True),
        Spring(ka4, 4, on_screw=True), Spring(ka6, 5, 6),
    )  # fmt: skip
    masses = tuple(inertia / square for inertia in inertia_kg_m2) + tuple(axial_mass_kg)
    nut = Nut(ka5, screw=3, table_side=5, axial=4)
    return AxisTruth(masses, springs, nut, lead_m, coulomb_torque_n_m, viscous_torque_n_m_s_rad, damping_ratio)


def _outer(count: int, ends: Sequence[tuple[int, float]]) -> NDArray[np.float64]:
    row = np.zeros(count)
    for index, sign in ends:
        if index != GROUND:
            row[index] = sign
    return np.outer(row, row)


def _check(name: str, value: float, positive: bool = False) -> None:
    if not np.isfinite(value) or value < 0 or (positive and value == 0):
        raise ValueError(f"{name}: must be finite and {'> 0' if positive else '>= 0'}, got {value!r}")
