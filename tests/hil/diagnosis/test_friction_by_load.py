"""Friction of a screw that grows with the load has the sign of the motion: a structure of the torque by direction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from foreign_axis import INERTIA_KG_M2, axis, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.structure_left import TORQUE, structure_left
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import read_recording

WEIGHT_N_M, SHARE = 0.3, 0.1


def test_friction_that_grows_with_the_load_is_seen(tmp_path: Path) -> None:
    columns = axis(9000)
    acceleration = np.gradient(columns["speed"], 1e-3)
    acceleration = np.convolve(acceleration, np.ones(25) / 25.0, mode="same")
    load = INERTIA_KG_M2 * acceleration + WEIGHT_N_M
    told = {}
    for share in (0.0, SHARE):
        folder = tmp_path / str(share)
        folder.mkdir()
        torque = columns["torque"] + WEIGHT_N_M + share * np.abs(load) * np.sign(columns["speed"])
        table = {"time_s": columns["t"], "motor_angle_rad": columns["angle"], "torque_Nm": torque}
        import_(write(folder / "log.csv", table), None, folder / "log.parquet", None, None)
        identify([folder / "log.parquet"], folder / "axis.yaml")
        prepared = prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml"))
        base = fit_nominal_parameters(prepared.train)
        left = structure_left(base, prepared.held_out)
        told[share] = {one.question.name for one in left if one.channel == TORQUE} - {"offset"}
    assert told[0.0] == set()
    assert "load" in told[SHARE]
