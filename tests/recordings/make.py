"""Make the recordings of this folder anew: python tests/recordings/make.py

The simulated reality (`drivers.sim`) of the reference bench over two short motions, without and with a concealed
effect. Seeds are fixed; values are rounded to what the sensors resolve, so that the files stay small.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import savemat

import hil
from hil.bench.bench_file import Bench
from hil.loop.simulated_bench import load_simulated
from hil.recording.recording import write_parquet

FOLDER = Path(__file__).parent
CHANNELS = (
    "time_s",
    "position_command_m",
    "velocity_command_m_s",
    "motor_position_rad",
    "table_position_m",
    "torque_command_n_m",
    "torque_n_m",
)
DECIMALS = {"time_s": 6, "position_command_m": 9, "velocity_command_m_s": 9, "motor_position_rad": 9,
            "table_position_m": 9, "torque_command_n_m": 6, "torque_n_m": 6}  # fmt: skip
COGGING = {"effect": "cogging_torque", "parameters": {"amplitude_n_m": 0.08, "cycles_per_rev": 12.0, "phase_rad": 0.7}}


def motion(*strokes: tuple[float, float]) -> hil.Profile:
    """A profile of moves (target [m], feed [m/s]) with rests between them."""
    moves = [{"kind": "sine_squared", "to_m": target, "feed_m_s": feed} for target, feed in strokes]
    rest = {"kind": "dwell", "duration_s": 0.1}
    return hil.Profile.model_validate(
        {
            "schema_version": 1,
            "limits": {"velocity_m_s": 0.4, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
            "segments": [rest, *(part for move in moves for part in (move, rest))],
        }
    )


LEARN = motion((0.06, 0.1), (0.0, 0.25), (0.0015, 0.004), (0.0, 0.004), (0.02, 0.03), (0.0, 0.05))
PROVE = motion((0.05, 0.2), (0.0, 0.08), (0.03, 0.04), (0.0, 0.15))


def bench(*effects: dict[str, object]) -> Bench:
    """The reference bench with noisy sensors, whose simulated axis conceals the effects."""
    believed = load_simulated("reference")
    simulation = {"seed": 7, "sensors": {"table_noise_m": 2e-7}, "effects": list(effects)}
    return type(believed).model_validate(believed.model_dump() | {"simulation": simulation})


def record(truth: Bench, profile: hil.Profile, name: str, seed: int) -> hil.Recording:
    """Simulate, keep the channels of every recording, round."""
    run = hil.simulate(truth, hil.plan(profile, truth.period_s), seed=seed)
    columns = {channel: np.round(run[channel], DECIMALS[channel]) for channel in CHANNELS}
    return hil.Recording(name, columns, run.period_s, {"made_by": "tests/recordings/make.py", "seed": seed})


def main() -> None:
    """Write all files."""
    concealed = bench(COGGING)
    for name, truth, profile, seed in (
        ("clean", bench(), LEARN, 1),
        ("cogging_learn", concealed, LEARN, 2),
        ("cogging_prove", concealed, PROVE, 3),
    ):
        path = FOLDER / f"{name}.parquet"
        path.unlink(missing_ok=True)
        write_parquet(record(truth, profile, name, seed), path)
    clean = hil.read_recording(FOLDER / "clean.parquet")
    every = slice(None, 1500)
    savemat(
        FOLDER / "foreign.mat",
        {
            "t": 1e3 * clean["time_s"][every],
            "x_set": 1e3 * clean["position_command_m"][every],
            "enc": np.round(clean["motor_position_rad"][every] * 2**20 / (2 * np.pi)),
            "x_table": 1e6 * clean["table_position_m"][every],
            "tau": clean["torque_n_m"][every],
        },
        do_compression=True,
    )


if __name__ == "__main__":
    main()
