"""The small recordings that come with the tests, simulated by tests/recordings/make.py."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parents[1] / "recordings"
CLEAN = FOLDER / "clean.parquet"  # the axis is as the bench `reference` says
COGGING_LEARN = FOLDER / "cogging_learn.parquet"  # a concealed cogging torque: 0.08 N m, 12 per revolution
COGGING_PROVE = FOLDER / "cogging_prove.parquet"  # the same axis over another motion
FOREIGN = FOLDER / "foreign.mat"  # the first 1.5 s of CLEAN in other units
FOREIGN_MAP = FOLDER / "foreign_map.yaml"
