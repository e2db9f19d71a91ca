"""Draw effects that the library lacks: physics of the simulated axis, and faults of its linear encoder.

The right answer is `unexplained` with the right block. Tight spots and dents are kept narrow: a wide one would be half
a sine of position, which the library has.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from drivers.sim.effects import Effect
from hil.arrays import FloatArray
from hil.validation.proof.draw.axes import DrawnAxis
from hil.validation.proof.draw.axis_kinds import Rng, any_phase, any_sign, log_uniform
from hil.validation.proof.draw.effects import DrawScale

_LOST_COUNTS, _NOISE_BURSTS = "novel_lost_counts", "novel_noise_bursts"


@dataclass(frozen=True)
class EncoderFault:
    """A fault of the linear encoder, outside of the control loop.

    novel_lost_counts: it loses `counts` counts for good at `events` instants of motion; novel_noise_bursts: `events`
    windows of `length_s` with noise of `counts` counts rms, as from a welding machine.
    """

    id: str
    parameters: Mapping[str, float]
    form: str = ""

    def change_m(self, table_m: FloatArray, axis: DrawnAxis, rng: Rng) -> FloatArray:
        """Return the error (n,) that it adds to a recording of the table (n,): whole counts [m]."""
        p, size = self.parameters, table_m.size
        change = np.zeros(size)
        if self.id == _LOST_COUNTS:
            moving = np.flatnonzero(np.abs(np.diff(table_m)) > axis.sensors.table_resolution_m)
            for row in rng.choice(moving, round(p["events"]), replace=False):
                change[row + 1 :] -= p["counts"] * np.sign(table_m[row + 1] - table_m[row])
        else:
            length = round(p["length_s"] / axis.period_s)
            for start in rng.integers(0, size - length, round(p["events"])):
                change[start : start + length] = np.round(p["counts"] * rng.standard_normal(length))
        return change * axis.sensors.table_resolution_m

    def size(self, table_m: FloatArray, axis: DrawnAxis, rng: Rng) -> float:
        """Return the standard deviation of the error over the noise; the datum of the encoder is arbitrary."""
        return float(np.std(self.change_m(table_m, axis, rng))) / axis.table_noise_m


def draw_novel(name: str, scale: DrawScale, rng: Rng) -> Effect | EncoderFault:
    """Draw an effect or a fault with random parameters for this axis."""
    parameters = {key: float(value) for key, value in _UNKNOWN[name][1](scale, rng).items()}
    return EncoderFault(name, parameters) if name in FAULTS else Effect(name, parameters)


def novel(axis: DrawnAxis) -> tuple[str, ...]:
    """Return the ids of the unknown effects that this kind of axis can have."""
    return tuple(name for name in NOVEL if axis.has_table or name not in ("novel_pitch_bump", *FAULTS))


def _somewhere(s: DrawScale, rng: Rng) -> dict[str, float]:
    """Draw a narrow stretch of the travel."""
    return {"centre_m": s.axis.travel_m * rng.uniform(0.15, 0.85), "width_m": s.axis.travel_m * rng.uniform(0.01, 0.03)}


def _mass_change(s: DrawScale, rng: Rng) -> dict[str, float]:
    fraction = any_sign(rng) * rng.uniform(0.2, 0.6)
    return {"fraction": fraction, "start_s": s.duration_s * rng.uniform(0.3, 0.7)}


def _vibration(s: DrawScale, rng: Rng) -> dict[str, float]:
    frequency_hz = log_uniform(rng, 2.0, 20.0)
    return {
        "force_n": s.coulomb / s.ratio * log_uniform(rng, 0.05, 0.4),
        "frequency_hz": frequency_hz,
        "phase_rad": any_phase(rng),
        "ratio": rng.uniform(0.3, 0.9),
        "frequency_2_hz": frequency_hz * rng.uniform(1.2, 1.9),
    }


def _hammering(s: DrawScale, rng: Rng) -> dict[str, float]:
    period_s = log_uniform(rng, 0.25, 0.8)
    return {
        "force_n": any_sign(rng) * s.coulomb / s.ratio * log_uniform(rng, 0.2, 1.0),
        "start_s": rng.uniform(0.0, 1.0),
        "period_s": period_s,
        "width_s": period_s * rng.uniform(0.05, 0.2),
    }


# The block of each, and the draw of its parameters.
_UNKNOWN: Mapping[str, tuple[str, Callable[[DrawScale, Rng], dict[str, float]]]] = {
    "novel_friction_bump": (
        "motor_side",
        lambda s, rng: {"fraction": log_uniform(rng, 0.3, 2.0), **_somewhere(s, rng)},
    ),
    "novel_friction_wander": (
        "motor_side",
        lambda s, rng: {
            "fraction": log_uniform(rng, 0.05, 0.25),
            "period_s": log_uniform(rng, 0.6, 3.0),
            "phase_rad": any_phase(rng),
        },
    ),
    "novel_pitch_bump": (
        "transmission",
        lambda s, rng: {"height_m": any_sign(rng) * log_uniform(rng, 3e-6, 30e-6), **_somewhere(s, rng)},
    ),
    "novel_mass_change": ("table", _mass_change),
    "novel_vibration": ("table", _vibration),
    "novel_hammering": ("table", _hammering),
    _LOST_COUNTS: (
        "sensor",
        lambda s, rng: {"events": float(rng.integers(3, 9)), "counts": float(rng.integers(4, 40))},
    ),
    _NOISE_BURSTS: (
        "sensor",
        lambda s, rng: {
            "events": float(rng.integers(3, 8)),
            "counts": log_uniform(rng, 5.0, 50.0),
            "length_s": log_uniform(rng, 0.05, 0.4),
        },
    ),
}
FAULTS = (_LOST_COUNTS, _NOISE_BURSTS)
NOVEL: tuple[str, ...] = tuple(_UNKNOWN)
BLOCKS: Mapping[str, str] = {name: block for name, (block, _) in _UNKNOWN.items()}
