"""Physics that the library has not, drawn at random: what the simulated axis does, and faults of its linear encoder.

The right answer is `unexplained`, with the right block. Tight spots and dents are kept narrow: a wide one would be
half a sine of position, which the library has.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from drivers.sim.effects import Effect
from hil.arrays import FloatArray
from hil.proof.draw.axes import DrawnAxis
from hil.proof.draw.effects import Scene
from hil.proof.draw.random_draws import Rng, any_phase, any_sign, log_uniform


@dataclass(frozen=True)
class EncoderFault:
    """What goes wrong in the linear encoder, which the loop does not see.

    novel_lost_counts: `events` times it loses `counts` counts for good while it moves; novel_noise_bursts: `events`
    windows of `length_s` with noise of `counts` counts rms, as from a welding machine.
    """

    id: str
    parameters: Mapping[str, float]
    form: str = ""

    def change_m(self, table_m: FloatArray, axis: DrawnAxis, rng: Rng) -> FloatArray:
        """What it adds to a recording of the table (n,): whole counts."""
        p, size = self.parameters, table_m.size
        change = np.zeros(size)
        if self.id == "novel_lost_counts":
            moving = np.flatnonzero(np.abs(np.diff(table_m)) > axis.sensors.table_resolution_m)
            for row in rng.choice(moving, round(p["events"]), replace=False):
                change[row + 1 :] -= p["counts"] * np.sign(table_m[row + 1] - table_m[row])
        else:
            length = round(p["length_s"] / axis.period_s)
            for start in rng.integers(0, size - length, round(p["events"])):
                change[start : start + length] = np.round(p["counts"] * rng.standard_normal(length))
        return change * axis.sensors.table_resolution_m

    def size(self, table_m: FloatArray, axis: DrawnAxis, rng: Rng) -> float:
        """What it adds, in units of noise: a constant is none, no one knows the datum of an encoder."""
        return float(np.std(self.change_m(table_m, axis, rng))) / axis.table_noise_m


def draw_novel(name: str, scene: Scene, rng: Rng) -> Effect | EncoderFault:
    """An effect or a fault with random parameters for this axis."""
    parameters = {key: float(value) for key, value in _DRAWS[name](scene, rng).items()}
    return EncoderFault(name, parameters) if name in FAULTS else Effect(name, parameters)


def novel(axis: DrawnAxis) -> tuple[str, ...]:
    """Ids of what this kind of axis can have."""
    return tuple(name for name in NOVEL if axis.has_table or name not in ("novel_pitch_bump", *FAULTS))


def _somewhere(s: Scene, rng: Rng) -> dict[str, float]:
    """A narrow stretch of the travel."""
    return {"centre_m": s.axis.travel_m * rng.uniform(0.15, 0.85), "width_m": s.axis.travel_m * rng.uniform(0.01, 0.03)}


def _friction_bump(s: Scene, rng: Rng) -> dict[str, float]:
    return {"fraction": log_uniform(rng, 0.3, 2.0), **_somewhere(s, rng)}


def _friction_wander(s: Scene, rng: Rng) -> dict[str, float]:
    return {
        "fraction": log_uniform(rng, 0.05, 0.25),
        "period_s": log_uniform(rng, 0.6, 3.0),
        "phase_rad": any_phase(rng),
    }


def _pitch_bump(s: Scene, rng: Rng) -> dict[str, float]:
    return {"height_m": any_sign(rng) * log_uniform(rng, 3e-6, 30e-6), **_somewhere(s, rng)}


def _mass_change(s: Scene, rng: Rng) -> dict[str, float]:
    fraction = any_sign(rng) * rng.uniform(0.2, 0.6)
    return {"fraction": fraction, "start_s": s.duration_s * rng.uniform(0.3, 0.7)}


def _vibration(s: Scene, rng: Rng) -> dict[str, float]:
    frequency_hz = log_uniform(rng, 2.0, 20.0)
    return {
        "force_n": s.coulomb / s.ratio * log_uniform(rng, 0.05, 0.4),
        "frequency_hz": frequency_hz,
        "phase_rad": any_phase(rng),
        "ratio": rng.uniform(0.3, 0.9),
        "frequency_2_hz": frequency_hz * rng.uniform(1.2, 1.9),
    }


def _hammering(s: Scene, rng: Rng) -> dict[str, float]:
    period_s = log_uniform(rng, 0.25, 0.8)
    return {
        "force_n": any_sign(rng) * s.coulomb / s.ratio * log_uniform(rng, 0.2, 1.0),
        "start_s": rng.uniform(0.0, 1.0),
        "period_s": period_s,
        "width_s": period_s * rng.uniform(0.05, 0.2),
    }


def _torque_fade(s: Scene, rng: Rng) -> dict[str, float]:
    return {"fraction": rng.uniform(0.05, 0.25), "time_constant_s": log_uniform(rng, 2.0, 10.0)}


def _lost_counts(s: Scene, rng: Rng) -> dict[str, float]:
    return {"events": float(rng.integers(3, 9)), "counts": float(rng.integers(4, 40))}


def _noise_bursts(s: Scene, rng: Rng) -> dict[str, float]:
    return {
        "events": float(rng.integers(3, 8)),
        "counts": log_uniform(rng, 5.0, 50.0),
        "length_s": log_uniform(rng, 0.05, 0.4),
    }


_DRAWS: Mapping[str, Callable[[Scene, Rng], Mapping[str, float]]] = {
    f"novel{function.__name__}": function
    for function in (
        _friction_bump,
        _friction_wander,
        _pitch_bump,
        _mass_change,
        _vibration,
        _hammering,
        _torque_fade,
        _lost_counts,
        _noise_bursts,
    )
}
FAULTS = ("novel_lost_counts", "novel_noise_bursts")
NOVEL: tuple[str, ...] = tuple(_DRAWS)
