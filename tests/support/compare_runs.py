"""Runs of the simulated reference bench in virtual time, to be compared with their twin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hil.bench.bench_file import Bench, load_bench
from hil.loop.run import run_profile
from hil.motion.profile import Profile
from hil.recording.recording import Recording, read_recording

LIMITS = {"velocity_m_s": 0.3, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0}
THERE_AND_BACK = [
    {"kind": "dwell", "duration_s": 0.1},
    {"kind": "sine_squared", "to_m": 0.04, "feed_m_s": 0.1},
    {"kind": "dwell", "duration_s": 0.2},
    {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.2},
    {"kind": "dwell", "duration_s": 0.2},
]


def bench_with(simulation: dict[str, Any] | None = None, axis: dict[str, float] | None = None) -> Bench:
    """The reference bench; `simulation` conceals what its twin does not know, `axis` is what is believed of it."""
    data = load_bench("reference").model_dump()
    data["simulation"] |= simulation or {}
    data["axis"] |= axis or {}
    return Bench.model_validate(data)


def record(folder: Path, bench: Bench, name: str = "run") -> Recording:
    """Run 40 mm there and back and read what was recorded."""
    profile = Profile.model_validate({"schema_version": 1, "limits": LIMITS, "segments": THERE_AND_BACK})
    ran = run_profile(bench, profile, folder, name, virtual=True)
    assert ran.complete
    assert ran.recording is not None
    return read_recording(ran.recording)
