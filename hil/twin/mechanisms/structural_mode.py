"""Structural mode: a flexible mode that is not in the chain, such as machine base, column or screw torsion."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.twin.mechanism import Block, Mechanism, SearchHints, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role
from hil.twin.picture import Picture
from hil.twin.scene import AxisFacts
from hil.twin.structure.chain import Chain
from hil.twin.structure.frequency import modal_damping
from hil.twin.structure.modal import modal

_MOST = 0.99  # a modal damping ratio stays below 1


def _with_mass_on_table(chain: Chain, parameters: Sequence[float]) -> Chain:
    """Add a mass that sways on the table."""
    return _with_structure(chain, parameters, _on_the_table)


def _with_flexible_load(chain: Chain, parameters: Sequence[float]) -> Chain:
    """Part the inertia of the load into two with a spring between; the sum stays, as slow motion shows it."""
    inertia = chain.inertia_kg_m2.copy()
    inertia[chain.table, chain.table] /= 1.0 + parameters[2]
    return _with_mass_on_table(replace(chain, inertia_kg_m2=inertia), parameters)


def _with_yielding_base(chain: Chain, parameters: Sequence[float]) -> Chain:
    """Add a machine base that yields."""
    return _with_structure(chain, parameters, _under_the_axis)


def _with_structure(
    chain: Chain, parameters: Sequence[float], added: Callable[[Chain, float, float], tuple[Chain, FloatArray]]
) -> Chain:
    """Add one more mass on a spring; a mass ratio of 0 leaves the chain unchanged."""
    frequency_hz, damping_ratio, mass_ratio = parameters
    if mass_ratio <= 0.0:
        return chain
    omega = 2.0 * math.pi * frequency_hz
    extended, spring = added(chain, omega**2, mass_ratio)
    stiffness = extended.stiffness_n_m_rad[-1, -1]
    modes = modal(extended)
    elastic = np.where(modes.frequency_rad_s > 0.0, modes.frequency_rad_s, np.inf)

    def shared(damping: FloatArray) -> FloatArray:
        # damping of each mode by its share in the dampers (modal strain energy, Johnson and Kienholz 1982)
        taken = np.einsum("im,ij,jm->m", modes.shape, damping, modes.shape)
        return np.asarray(np.maximum(taken, 0.0) / (2.0 * elastic))

    damping = np.pad(modal_damping(chain, modal(chain)), (0, 1))
    damping += 2.0 * damping_ratio / omega * stiffness * np.outer(spring, spring)
    # keep all modes below critical damping
    damping *= min(_MOST / max(float(shared(damping).max()), _MOST), 1.0)
    return replace(extended, damping_ratio=shared(damping), damping_n_m_s_rad=damping)


def _on_the_table(chain: Chain, square: float, mass_ratio: float) -> tuple[Chain, FloatArray]:
    """Extend the chain by a mass on a spring on the table."""
    n, table = len(chain.names), chain.table
    inertia = mass_ratio * chain.inertia_kg_m2[table, table]
    extended = _longer(chain)
    extended.inertia_kg_m2[n, n] = inertia
    extended.stiffness_n_m_rad[np.ix_((table, n), (table, n))] += (
        inertia * square * np.array([[1.0, -1.0], [-1.0, 1.0]])
    )
    return extended, np.eye(n + 1)[n] - np.eye(n + 1)[table]


def _under_the_axis(chain: Chain, square: float, mass_ratio: float) -> tuple[Chain, FloatArray]:
    """Extend the chain by a machine base on a spring, with the linear encoder on it: coordinates that travel with the
    nut are relative to the base, and move with it as well."""
    n = len(chain.names)
    travelling = chain.inertia_kg_m2 @ (1.0 - chain.side(chain.motor))
    table = chain.inertia_kg_m2[chain.table, chain.table]
    extended = _longer(chain)
    extended.inertia_kg_m2[:n, n] = extended.inertia_kg_m2[n, :n] = travelling
    extended.inertia_kg_m2[n, n] = table / mass_ratio + travelling.sum()
    extended.stiffness_n_m_rad[n, n] = (table / mass_ratio + table) * square
    return extended, np.eye(n + 1)[n]


def _longer(chain: Chain) -> Chain:
    """Extend the chain by a free coordinate."""
    return replace(
        chain,
        inertia_kg_m2=np.pad(chain.inertia_kg_m2, (0, 1)),
        stiffness_n_m_rad=np.pad(chain.stiffness_n_m_rad, (0, 1)),
        damping_ratio=np.append(chain.damping_ratio, 0.0),
        names=(*chain.names, "structure"),
        transmission=np.append(chain.transmission, 0.0),
        screw=np.append(chain.screw, 0.0),
    )


_LOWEST_HZ, _HIGHEST_HZ = 0.1, 2000.0  # a load that hangs on 25 m; the rate of the loops
_NEAR = 0.9  # of the highest frequency: beyond, the structure is a mass
_NO_PEAK = 1.0 / math.sqrt(2.0)  # damping ratio from which there is no resonance
_LEAST_DAMPING = 1e-4
_TONE = 1.1 * _LEAST_DAMPING  # damping ratio up to which a fit has found a tone, since every structure damps


def _valid(values: Sequence[float], variant: int, axis: AxisFacts) -> bool:
    """Check that the frequency is not at its upper bound, and that the structure has a resonance of some width."""
    return values[0] < _NEAR * _HIGHEST_HZ and _TONE < values[1] < _NO_PEAK


MECHANISM = Mechanism(
    id="structural_mode",
    block=Block.TABLE,
    element="machine base, column or screw torsion",
    equation="m_a x_a'' + k_a (x_a - x) = 0, k_a = m_a (2 pi f)^2, m_a = mu m_table, damped by xi where the table "
    "is held; or a base of m_table / mu under the axis, which sways with the table at f",
    source="Den Hartog, Mechanical Vibrations, 4th ed. (1956), auxiliary mass on a spring",
    parameters=(
        Parameter("frequency_hz", Dimension.FREQUENCY, _LOWEST_HZ, _HIGHEST_HZ, role=Role.FREQUENCY),
        Parameter("damping_ratio", Dimension.RATIO, _LEAST_DAMPING, 0.9),
        Parameter("mass_ratio", Dimension.RATIO, 1e-3, 10.0, role=Role.STRENGTH),
    ),
    variants=(
        Variant(Stage.CHAIN, _with_mass_on_table, "mass on the table"),
        Variant(
            Stage.CHAIN,
            _with_yielding_base,
            "yielding base",
            text=Text(
                "The machine base yields: it sways with the table at {frequency_hz}, damped by {damping_ratio}; "
                "the table has {mass_ratio} of its mass."
            ),
        ),
        Variant(
            Stage.CHAIN,
            _with_flexible_load,
            "flexible load",
            text=Text(
                "The load is flexible: while the motor is held, an inertia of {mass_ratio} of that of the rest of the "
                "axis swings at {frequency_hz}, damped by {damping_ratio}."
            ),
            element="load on an elastic arm, shaft or belt",
            # an arm or a bar swings at some hertz; behind a belt or a gear it may be most of the inertia; a load that
            # hangs is a small one, and swings below a hertz
            starts=lambda s: [
                *((f, 0.03, ratio) for f in np.geomspace(1.5, 100.0, 13) for ratio in (0.3, 3.0)),
                *((f, 0.03, 0.1) for f in s.lines_hz if f >= _LOWEST_HZ),
            ],
            observable=lambda table_encoder: not table_encoder,
        ),
    ),
    text=Text(
        "A structure of {mass_ratio} of the table's mass sways at {frequency_hz}, damped by {damping_ratio}.",
        Picture.RESPONSE,
    ),
    search=SearchHints(
        lambda s: [(f, 0.03, 0.15) for f in np.geomspace(12.0, 240.0, 13)],
        lambda a: (40.0, 0.03, 0.1),
        proportional=False,
        needs_table=True,
    ),
    can_be=_valid,
)
