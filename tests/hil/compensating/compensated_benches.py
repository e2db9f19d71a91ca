"""Benches with concealed effects, and what their owner knows of them after a diagnosis."""

from __future__ import annotations

from typing import Any

from hil.bench.bench_file import Bench, load_bench
from hil.motion.profile import Profile
from hil.motion.trajectory import Trajectory, plan

COGGING = {"amplitude_n_m": 0.15, "cycles_per_rev": 6.0, "phase_rad": 0.4}
LEAD = {"amplitude_m": 8e-6, "phase_rad": 0.5}
EFFECTS: dict[str, dict[str, float]] = {
    "cogging_torque": COGGING,
    "periodic_lead_error": LEAD,
    "backlash": {"gap_m": 12e-6},
    "table_side_friction": {"share": 0.3},
}
LIMITS = {"velocity_m_s": 0.6, "acceleration_m_s2": 2.5, "jerk_m_s3": 120}


def bench_of_effects(**sections: Any) -> Bench:
    """The reference bench, whose simulated axis has the effects, by other equations than those of the twin."""
    data = load_bench("reference").model_dump(mode="json")
    entries = [{"effect": name, "parameters": values} for name, values in EFFECTS.items()]
    return Bench.model_validate(data | {"simulation": {"effects": entries}} | sections)


def diagnosed() -> Bench:
    """The same bench after a diagnosis that found the effects."""
    return bench_of_effects(mechanisms=[{"effect": name, "parameters": values} for name, values in EFFECTS.items()])


def there_and_back(bench: Bench, to_m: float, feed_m_s: float, rest_s: float = 0.3) -> Trajectory:
    """Two moves to a place and back, after a rest."""
    moves = [{"kind": "sine_squared", "to_m": place, "feed_m_s": feed_m_s} for place in (to_m, 0.0, to_m, 0.0)]
    rest = {"kind": "dwell", "duration_s": rest_s}
    segments = [rest, *(part for move in moves for part in (move, rest))]
    profile = Profile.model_validate({"schema_version": 1, "limits": LIMITS, "segments": segments})
    return plan(profile, bench.period_s)
