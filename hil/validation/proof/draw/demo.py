"""Motions and concealed effects of `hil demo`.

Motions: creep through reversals, two feeds of figures 7 and 8 of the source both ways, the faster one repeated to
measure the noise floor; and other feeds and strokes to validate the diagnosis.
"""

from typing import Any

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.hardware import SimulatedEffect, SimulationSection
from hil.errors import InputError
from hil.motion.profile import Profile

LIMITS = {"velocity_m_s": 0.6, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0}
REST: dict[str, Any] = {"kind": "dwell", "duration_s": 0.2}


def _reversal(stroke_m: float, feed_m_s: float) -> list[dict[str, Any]]:
    return [{"kind": "reversal", "stroke_m": stroke_m, "feed_m_s": feed_m_s}, REST]


def there_and_back(to_m: float, feed_m_s: float) -> list[dict[str, Any]]:
    """Return the segments of a move to a position and back to 0, each with a rest."""
    return [
        part
        for target in (to_m, 0.0)
        for part in ({"kind": "sine_squared", "to_m": target, "feed_m_s": feed_m_s}, REST)
    ]


def from_rest(description: str, segments: list[dict[str, Any]]) -> Profile:
    """Return a profile that begins with a rest."""
    return Profile.model_validate(
        {"schema_version": 1, "description": description, "limits": LIMITS, "segments": [REST, *segments]}
    )


LEARN = from_rest(
    "creep through reversals, 100 mm at 7 and 22 m/min there and back",
    [
        *_reversal(0.002, 0.004),
        *_reversal(0.01, 0.02),
        *there_and_back(0.1, 0.116667),
        {"kind": "repeat", "times": 2, "segments": there_and_back(0.1, 0.366667)},
    ],
)
PROVE = from_rest(
    "another creep, 80 mm at 12 m/min there and back", [*_reversal(0.004, 0.008), *there_and_back(0.08, 0.2)]
)

# Effects to conceal: parameters by name with the range of the draw. Usual values of axes in service, well above the
# noise of these motions.
_PHASE = (0.0, 6.28)
CONCEALED: dict[str, dict[str, tuple[float, float]]] = {
    "periodic_lead_error": {"amplitude_m": (3e-6, 8e-6), "phase_rad": _PHASE},
    "backlash": {"gap_m": (6e-6, 20e-6)},
    "stribeck_friction": {"static_torque_n_m": (1.5, 2.0), "stribeck_velocity_rad_s": (1.0, 2.5)},
    "cogging_torque": {"amplitude_n_m": (0.05, 0.15), "cycles_per_rev": (12.0, 12.0), "phase_rad": _PHASE},
    "structural_mode": {"frequency_hz": (25.0, 40.0), "damping_ratio": (0.02, 0.05), "mass_ratio": (0.1, 0.2)},
    "encoder_eccentricity": {"amplitude_rad": (2e-3, 6e-3), "phase_rad": _PHASE},
}
# Nominal values that are wrong in the bench file as well: factors.
WRONG = {"table_mass_kg": (0.9, 1.1), "coulomb_torque_n_m": (0.9, 1.1)}


def conceal(believed: Bench, seed: int, effect: str | None = None) -> tuple[Bench, SimulationSection]:
    """Return the true bench and its concealed section: one effect, drawn by `seed` unless given, and wrong parameters.

    Raises InputError for an effect that is not among CONCEALED.
    """
    if effect is not None and effect not in CONCEALED:
        raise InputError(f"--effect: given {effect}, allowed {', '.join(CONCEALED)}")
    draw = np.random.default_rng(seed)
    chosen = str(draw.choice(list(CONCEALED)))
    effect = effect or chosen
    parameters = {name: float(draw.uniform(*limits)) for name, limits in CONCEALED[effect].items()}
    axis = {name: float(getattr(believed.axis, name) * draw.uniform(*limits)) for name, limits in WRONG.items()}
    simulation = SimulationSection(
        axis=axis, effects=(SimulatedEffect(effect=effect, parameters=parameters),), seed=seed
    )
    return believed.model_copy(update={"simulation": simulation}), simulation
