"""Recordings of the simulated reference axis with concealed effects, there and back at two feeds."""

from __future__ import annotations

from typing import Any

import hil
from hil.bench.bench_file import Bench
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.recording.recording import Recording

Effects = dict[str, dict[str, float]]  # parameters by the id of the effect


def concealed_run(
    owner: Bench,
    effects: Effects,
    far_m: float = 0.4,
    feeds: tuple[float, float] = (0.15, 0.08),
    times: int = 2,
    form: str = "",
) -> Recording:
    """Record the axis of a bench with effects of a form: to `far_m` and back at `feeds` [m/s], `times` times."""
    listed: list[dict[str, Any]] = [
        {"effect": effect, "parameters": given, "form": form} for effect, given in effects.items()
    ]
    data = owner.model_dump(mode="json") | {"simulation": {"effects": listed}, "drive": {"following_error_m": 0.05}}
    truth = Bench.model_validate(data)
    moves = zip((far_m, 0.0), feeds, strict=True)
    legs = [
        {"kind": "dwell", "duration_s": 0.2},
        *({"kind": "sine_squared", "to_m": to_m, "feed_m_s": feed} for to_m, feed in moves),
    ]
    profile = Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": max(0.3, *feeds), "acceleration_m_s2": 3.0, "jerk_m_s3": 100.0},
            "segments": [{"kind": "repeat", "times": times, "segments": legs}],
        }
    )
    return hil.simulate(truth, plan(profile, truth.period_s), seed=3)
