"""Friction that the twin lacks has the sign of the motion: a structure of the torque over load or distance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from foreign_axis import INERTIA_KG_M2, axis, write

from hil.bench.bench_file import load_bench
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.diagnosis.preparation.prepare import prepare
from hil.diagnosis.structure_left import TORQUE, Dependence, structure_left
from hil.identification.hypothesis import Hypothesis
from hil.identification.intended_motion import measured_motion
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.identification.torque_left import fit_plain, needed_torque
from hil.recording.recording import read_recording

COLUMNS, LONG = axis(24_000), axis(48_000)
WEIGHT_N_M, SHARE = 0.3, 0.1
ROW = 20  # rows of a slow recording
DRAG_N_M, PLAY_RAD, RAMP_RAD = 0.15, 12.0, 1.0


def left_by(extra: np.ndarray, folder: Path, axis: dict[str, np.ndarray] = COLUMNS) -> list[Dependence]:
    """Torque that the twin of the drafted bench leaves, for an axis with `extra` torque (n,) added."""
    folder.mkdir()
    table = {"time_s": axis["t"], "motor_angle_rad": axis["angle"], "torque_Nm": axis["torque"] + extra}
    import_(write(folder / "log.csv", table), None, folder / "log.parquet", None, None)
    identify([folder / "log.parquet"], folder / "axis.yaml")
    prepared = prepare([read_recording(folder / "log.parquet")], [], load_bench(folder / "axis.yaml"))
    left = structure_left(fit_nominal_parameters(prepared.train), prepared.held_out)
    return [one for one in left if one.channel == TORQUE and one.question.name != "offset"]


def test_friction_that_grows_with_the_load_is_seen(tmp_path: Path) -> None:
    acceleration = np.gradient(COLUMNS["speed"], 1e-3)
    acceleration = np.convolve(acceleration, np.ones(25) / 25.0, mode="same")
    load = INERTIA_KG_M2 * acceleration + WEIGHT_N_M
    assert left_by(WEIGHT_N_M + 0.0 * load, tmp_path / "without") == []
    friction = SHARE * np.abs(load) * np.sign(COLUMNS["speed"])
    assert "load" in {one.question.name for one in left_by(WEIGHT_N_M + friction, tmp_path / "with")}


def test_what_is_dragged_after_a_free_play_is_seen_from_the_reversal_on(tmp_path: Path) -> None:
    """A cover that the axis carries along from the end of a play: it stays behind after each reversal."""
    cover, drag = LONG["angle"][0], []
    for angle in LONG["angle"]:
        apart = float(np.clip(angle - cover, -PLAY_RAD - RAMP_RAD, PLAY_RAD + RAMP_RAD))
        cover = angle - apart
        drag.append(np.sign(apart) * max(abs(apart) - PLAY_RAD, 0.0) / RAMP_RAD)
    found = {one.question.name: one for one in left_by(DRAG_N_M * np.array(drag), tmp_path / "drag", LONG)}
    seen = found["distance from the last reversal"]
    forwards = slice(int(np.searchsorted(seen.found.edges, seen.question.by_direction)) + 1, None)
    starts = seen.found.edges[forwards][:-1] - seen.question.by_direction
    free, taut = (
        seen.found.means[forwards][starts < PLAY_RAD],
        seen.found.means[forwards][starts > 2.0 * PLAY_RAD + RAMP_RAD],
    )
    assert np.mean(free) < 0.0 < np.mean(taut)


def test_torque_that_a_drive_lacks_where_it_makes_much_power_is_seen(tmp_path: Path) -> None:
    """At the limit of its voltage it asks for more than it gives while the motor drives, and not while it brakes."""
    power = COLUMNS["torque"] * COLUMNS["speed"]
    asked = 0.4 * np.sign(COLUMNS["speed"]) * np.clip(power / np.quantile(power, 0.9) - 1.0, 0.0, 1.0)
    first = left_by(asked, tmp_path / "limit")[0]
    assert first.question.name == "power"
    assert "less torque than the twin at a power of" in first.in_words("N m")


def test_rows_in_which_the_twin_sticks_are_known(tmp_path: Path) -> None:
    """In slow rows a twin with too much friction stands still where its axis is slow, until more torque moves it."""
    left_by(np.zeros(COLUMNS["t"].size), tmp_path / "plain")
    bench = load_bench(tmp_path / "plain" / "axis.yaml")
    table = {"time_s": COLUMNS["t"], "motor_angle_rad": COLUMNS["angle"], "torque_Nm": COLUMNS["torque"]}
    slow = {name: values[::ROW] for name, values in table.items()}
    import_(write(tmp_path / "slow.csv", slow), None, tmp_path / "slow.parquet", None, None)
    more = bench.axis.model_copy(update={"coulomb_torque_n_m": 2.0 * bench.axis.coulomb_torque_n_m})
    owner = bench.model_copy(update={"axis": more}).sampled(ROW * 1e-3)
    data = prepare([read_recording(tmp_path / "slow.parquet")], [], owner).train
    plain = fit_plain(data)
    assert plain is not None
    (series,) = needed_torque(Hypothesis(data.bench), data, plain)
    speed = np.abs(measured_motion(data.runs[0]).moved.velocity)
    stuck, clear = series.rows & ~series.clear, series.rows & series.clear
    assert np.count_nonzero(stuck) > 10
    assert np.median(speed[stuck]) < 0.5 * np.median(speed[clear])
