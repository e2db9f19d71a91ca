"""Structural mode: a flexible mode that the chain has not, such as machine base, column or screw torsion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.twin.chain import Chain
from hil.twin.mechanism import Block, Dimension, Mechanism, Parameter, Stage
from hil.twin.modal import modal


def _with_auxiliary_mass(chain: Chain, parameters: Sequence[float]) -> Chain:
    """The chain with a mass on a spring at its table; a mass ratio of 0 leaves it as it is."""
    frequency_hz, damping_ratio, mass_ratio = parameters[:3]
    if mass_ratio <= 0.0:
        return chain
    n, table = len(chain.names), chain.table
    inertia = mass_ratio * chain.inertia_kg_m2[table, table]
    spring = inertia * (2.0 * math.pi * frequency_hz) ** 2

    inertias = np.pad(chain.inertia_kg_m2, (0, 1))
    inertias[n, n] = inertia
    stiffness = np.pad(chain.stiffness_n_m_rad, (0, 1))
    stiffness[np.ix_((table, n), (table, n))] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    longer = replace(
        chain,
        inertia_kg_m2=inertias,
        stiffness_n_m_rad=stiffness,
        damping_ratio=np.append(chain.damping_ratio, damping_ratio),
        names=(*chain.names, "structure"),
        transmission=np.append(chain.transmission, 0.0),
    )
    # The new damping belongs to the elastic mode in which the auxiliary mass has most of its energy
    modes = modal(longer)
    energy = np.where(modes.frequency_rad_s > 0.0, modes.shape[n] ** 2, -1.0)
    damping = np.insert(chain.damping_ratio, int(energy.argmax()), damping_ratio)
    return replace(longer, damping_ratio=damping)


MECHANISM = Mechanism(
    id="structural_mode",
    block=Block.TABLE,
    element="machine base, column or screw torsion",
    sentence="A structure of {mass_ratio} of the table's mass sways at {frequency_hz}, damped by {damping_ratio}.",
    equation="m_a x_a'' + k_a (x_a - x) = 0, k_a = m_a (2 pi f)^2, m_a = mu m_table; modal damping ratio xi",
    source="Den Hartog, Mechanical Vibrations, 4th ed. (1956), auxiliary mass on a spring",
    parameters=(
        Parameter("frequency_hz", Dimension.FREQUENCY, 1.0, 2000.0),
        Parameter("damping_ratio", Dimension.RATIO, 1e-4, 0.9),
        Parameter("mass_ratio", Dimension.RATIO, 1e-3, 10.0),
    ),
    stage=Stage.CHAIN,
    contribution=_with_auxiliary_mass,
)
