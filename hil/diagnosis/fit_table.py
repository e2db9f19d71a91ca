"""Fit before and after, channel by channel, on training and on held-out recordings, against the noise floor.

In closed loop, from the set-points alone, unless that is chaotic: where stick-slip or play let two recordings of the
same axis part, a twin that leaves nothing but noise in every block still strays from the recording in closed
loop. Then the figures are those of the block, which is fed measured inputs. The same holds for the position of the
motor: its encoder resolves far less than what the noise of the torque moves it by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.bench import Bench
from hil.channels import AXIS_CHANNELS, CHANNELS
from hil.diagnosis.fit import Fit
from hil.diagnosis.floor import Floor, floor, laps
from hil.diagnosis.model import scales
from hil.diagnosis.result import ChannelFit, FitFigures, Mode
from hil.measured import Measured

FloatArray = NDArray[np.float64]

STRAYS = 1.5      # times its floor: a closed loop beyond, though its block is at the floor, is chaotic


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals (n,) of one hypothesis over one run, per channel of the recording, in its unit."""

    closed_loop: dict[str, FloatArray]
    blocks: dict[str, FloatArray]


def channel_names(bench: Bench, run: Measured) -> dict[str, str]:
    """Channel of the twin -> name of the recorded channel."""
    names = AXIS_CHANNELS[run.kind]
    found = {"motor": names.motor_position, "torque": names.torque, "command": names.torque_command}
    if bench.has_table_encoder:
        found["table"] = names.table_position
    return found


def residuals(found: Fit, run: Measured) -> Residuals:
    """Measured less twin. In closed loop the table is compared as it is, block by block against the motor."""
    model = found.model
    closed = model.closed_loop(found.x, run)
    if "table" in closed:
        closed["table"] = closed["table"] + model.bench.axis.ratio_m_rad * closed["motor"]
    if run.torque_is_command:
        closed.pop("command", None)
    return Residuals(closed, model.blocks(found.x, run))


def fit_table(owner: Fit, nominal: Fit, final: Fit, train: Sequence[Measured],
              held_out: Sequence[Measured]) -> dict[str, ChannelFit]:
    """The table, by recorded channel."""
    bench = final.model.bench
    sets = {"train": train, "validate": held_out}
    all_residuals = {(which, name): [residuals(fit, run) for run in runs] for which, runs in sets.items()
                     for name, fit in (("owner", owner), ("nominal", nominal), ("final", final))}
    all_laps = {which: [laps(run) for run in runs] for which, runs in sets.items()}
    result = {}
    for channel, recorded in channel_names(bench, train[0]).items():
        if channel == "command":
            continue

        def floors(which: str, mode: Mode, channel: str = channel) -> list[Floor]:
            # what one hypothesis does differently from lap to lap is its own, and no noise: the lowest is the floor
            return [min((floor(_of(found, mode)[channel], _white(run, final, channel, mode), repeated)
                         for found in pair), key=lambda value: value.rms)
                    for *pair, run, repeated in zip(all_residuals[which, "nominal"], all_residuals[which, "final"],
                                                    sets[which], all_laps[which], strict=True)]

        def figures(which: str, mode: Mode, channel: str = channel) -> FitFigures:
            runs = sets[which]
            rms = {name: _pooled([_of(found, mode)[channel] for found in all_residuals[which, name]], runs)
                   for name in ("owner", "nominal", "final")}
            rows = [run.motor.size for run in runs]
            noise = float(np.sqrt(np.average([value.rms**2 for value in floors(which, mode)], weights=rows)))
            return FitFigures(before_rms=rms["nominal"], after_rms=rms["final"], noise_floor_rms=noise,
                              owner_rms=rms["owner"])

        mode = Mode.CLOSED_LOOP
        closed, block = figures("train", Mode.CLOSED_LOOP), figures("train", Mode.BLOCKS)
        strays = closed.after_rms > STRAYS * closed.noise_floor_rms
        if strays and block.after_rms <= STRAYS * block.noise_floor_rms and not train[0].torque_is_command:
            mode = Mode.BLOCKS
        repeated = any(entry is not None for entry in all_laps["train"])
        result[recorded] = ChannelFit(
            unit=CHANNELS[recorded].unit, mode=mode, floor_from="repeated_laps" if repeated else "white_noise",
            train=figures("train", mode), validate_=figures("validate", mode) if held_out else None)
    return result


def _of(found: Residuals, mode: Mode) -> dict[str, FloatArray]:
    return found.closed_loop if mode is Mode.CLOSED_LOOP else found.blocks


def _white(run: Measured, found: Fit, channel: str, mode: Mode) -> float:
    """White noise of a channel; block by block the motor counts from the torque that the torque channel can see."""
    if mode is Mode.BLOCKS:
        return scales(run, found.model.bench, found.model.observer_s)[channel]
    return {"motor": run.noise.motor, "table": run.noise.table_m, "torque": run.noise.torque}[channel]


def _pooled(values: Sequence[FloatArray], runs: Sequence[Measured]) -> float:
    squares = [float(np.sum(value[run.judged] ** 2)) for value, run in zip(values, runs, strict=True)]
    return float(np.sqrt(sum(squares) / sum(value[run.judged].size for value, run in zip(values, runs, strict=True))))
