"""Forget a part of what is known of a case: control law, set-points, rows, an encoder, digits of the positions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil.bench.bench_file import Bench
from hil.bench.control_section import Control, without_law
from hil.channels import AXIS_CHANNELS
from hil.recording.recording import Recording
from hil.validation.proof.draw.axes import DrawnAxis
from hil.validation.proof.draw.axis_kinds import Rng

Known = tuple[list[Recording], Bench]
WRONG_GAIN = (0.4, 2.5)  # factors of a gain that is guessed
FEWER_ROWS = 4  # of the rows one is kept
COARSER = 100.0  # factor of the encoder counts that are recorded


def forget(how: str, recordings: Sequence[Recording], bench: Bench, rng: Rng) -> Known:
    """Return recordings and bench with less known, in one of the ways of `WAYS`."""
    return WAYS[how](list(recordings), bench, rng)


def possible(axis: DrawnAxis) -> tuple[str, ...]:
    """Return the ways in which less can be known of a kind of axis."""
    return tuple(how for how in WAYS if axis.has_table or how != "one encoder")


def _no_controller(runs: list[Recording], bench: Bench, rng: Rng) -> Known:
    return runs, bench.model_copy(update={"control": without_law(bench.known_control)})


def _no_set_points(runs: list[Recording], bench: Bench, rng: Rng) -> Known:
    return [_without(run, "position_command_m", "velocity_command_m_s") for run in runs], bench


def _wrong_gains(runs: list[Recording], bench: Bench, rng: Rng) -> Known:
    control = bench.known_control
    low, high = np.log(WRONG_GAIN)
    wrong = {name: float(np.exp(rng.uniform(low, high))) for name in control.gain_names}
    values = {name: factor * value for name, factor in wrong.items() if (value := getattr(control, name)) is not None}
    return runs, bench.model_copy(update={"control": Control.model_validate({**control.model_dump(), **values})})


def _fewer_rows(runs: list[Recording], bench: Bench, rng: Rng) -> Known:
    kept = [
        replace(
            run,
            columns={name: values[::FEWER_ROWS].copy() for name, values in run.columns.items()},
            period_s=FEWER_ROWS * run.period_s,
        )
        for run in runs
    ]
    return kept, bench


def _one_encoder(runs: list[Recording], bench: Bench, rng: Rng) -> Known:
    if bench.gains.position_from_table:  # the law needs it
        bench = bench.model_copy(update={"control": without_law(bench.known_control)})
        motor = bench.control.model_copy(update={"position_feedback": "motor"})
        bench = bench.model_copy(update={"control": motor})
    encoders = bench.encoders.model_copy(update={"table": None})
    return [_without(run, "table_position_m") for run in runs], bench.model_copy(update={"encoders": encoders})


def _coarse_positions(runs: list[Recording], bench: Bench, rng: Rng) -> Known:
    table = bench.encoders.table
    steps = {
        "motor": COARSER * bench.motor_count,
        "table": COARSER * table.resolution_m if table is not None else 0.0,
    }

    def coarse(run: Recording) -> Recording:
        names = AXIS_CHANNELS[run.kind]
        columns = dict(run.columns)
        for name, step in ((names.motor_position, steps["motor"]), (names.table_position, steps["table"])):
            if step > 0.0 and name in columns:
                columns[name] = np.round(columns[name] / step) * step
        return replace(run, columns=columns)

    return [coarse(run) for run in runs], bench


WAYS: Mapping[str, Callable[[list[Recording], Bench, Rng], Known]] = {
    "no controller": _no_controller,
    "no set-points": _no_set_points,
    "wrong gains": _wrong_gains,
    "every fourth row": _fewer_rows,
    "one encoder": _one_encoder,
    "coarse positions": _coarse_positions,
}


def _without(run: Recording, *names: str) -> Recording:
    return replace(run, columns={name: values for name, values in run.columns.items() if name not in names})
