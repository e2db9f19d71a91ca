"""Fit before and after, channel by channel, on training and on held-out recordings, against the noise floor.

In closed loop, from the set-points alone, unless that is chaotic: where stick-slip or play let two recordings of the
same axis part, a twin that leaves nothing but noise in every block still strays from the recording in closed
loop. Then the figures are those of the block, which is fed measured inputs. The same holds for the position of the
motor: its encoder resolves far less than what the noise of the torque moves it by.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS, CHANNELS
from hil.diagnosis.estimation.fit import Fit
from hil.diagnosis.estimation.hypothesis import scales
from hil.diagnosis.estimation.noise_floor import Floor, Laps, floor, laps, rms, sensor_noise, shaken
from hil.diagnosis.result import ChannelFit, FitFigures, Mode
from hil.identification.dataset import Measured

STRAYS = 1.15  # times its floor: beyond, though its block is at the floor, a closed loop strays


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


@dataclass(frozen=True, eq=False)
class _Set:
    """Recordings of one kind, training or held out, with the residuals of each hypothesis and their laps."""

    runs: Sequence[Measured]
    owner: list[Residuals]
    nominal: list[Residuals]
    final: list[Residuals]
    shaken: list[dict[str, float]]  # rms by which the noise of the encoders moves the axis in closed loop
    laps: list[Laps | None]

    def rms(self, found: list[Residuals], channel: str, mode: Mode) -> float:
        """Root mean square of a channel over all recordings."""
        values = [_of(entry, mode)[channel][run.judged] for entry, run in zip(found, self.runs, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))

    def floors(self, channel: str, mode: Mode, final: Fit) -> list[Floor]:
        """Floor of a channel in each recording.

        What one hypothesis does differently from lap to lap is its own, and no noise: the lowest is the floor.
        """
        return [
            min(
                (
                    floor(_of(entry, mode)[channel], _white(run, final, channel, mode, moved), repeated)
                    for entry in pair
                ),
                key=lambda found: found.rms,
            )
            for *pair, run, moved, repeated in zip(
                self.nominal, self.final, self.runs, self.shaken, self.laps, strict=True
            )
        ]


def fit_table(
    owner: Fit, nominal: Fit, final: Fit, train: Sequence[Measured], held_out: Sequence[Measured]
) -> dict[str, ChannelFit]:
    """The table, by recorded channel."""

    def gathered(runs: Sequence[Measured]) -> _Set:
        of = [[residuals(found, run) for run in runs] for found in (owner, nominal, final)]
        return _Set(runs, of[0], of[1], of[2], [shaken(final, run) for run in runs], [laps(run) for run in runs])

    trained, validated = gathered(train), gathered(held_out)

    def figures(of: _Set, channel: str, mode: Mode) -> FitFigures:
        # the axis and its sensors are the same: laps of the one set tell the floor of the other
        other = trained if of is validated else validated
        own, others = of.floors(channel, mode, final), other.floors(channel, mode, final)
        repeated = next(
            (
                known
                for known in (
                    [value.rms for value in values if value.source == "repeated_laps"] for values in (own, others)
                )
                if known
            ),
            [value.rms for value in own],
        )
        return FitFigures(
            before_rms=of.rms(of.nominal, channel, mode),
            after_rms=of.rms(of.final, channel, mode),
            noise_floor_rms=float(np.sqrt(np.mean(np.square(repeated)))),
            owner_rms=of.rms(of.owner, channel, mode),
        )

    result = {}
    any_laps = any(found is not None for found in (*trained.laps, *validated.laps))
    for channel, recorded in channel_names(final.model.bench, train[0]).items():
        if channel == "command":
            continue
        sets = [trained, validated] if held_out else [trained]
        closed, block = (
            max(found.after_rms / found.noise_floor_rms for found in (figures(of, channel, mode) for of in sets))
            for mode in (Mode.CLOSED_LOOP, Mode.BLOCKS)
        )
        chaotic = closed > STRAYS >= block and not train[0].torque_is_command
        mode = Mode.BLOCKS if chaotic else Mode.CLOSED_LOOP
        result[recorded] = ChannelFit(
            unit=CHANNELS[recorded].unit,
            mode=mode,
            floor_from="repeated_laps" if any_laps else "white_noise",
            train=figures(trained, channel, mode),
            validate_=figures(validated, channel, mode) if held_out else None,
        )
    return result


def _of(found: Residuals, mode: Mode) -> dict[str, FloatArray]:
    return found.closed_loop if mode is Mode.CLOSED_LOOP else found.blocks


def _white(run: Measured, found: Fit, channel: str, mode: Mode, moved: dict[str, float]) -> float:
    """White noise of a channel; block by block the motor counts from the torque that the torque channel can see, in
    closed loop all move with what the controller answers to the noise."""
    if mode is Mode.BLOCKS:
        return rms(scales(run, found.model.bench, found.model.observer_s)[channel][run.judged])
    return math.hypot(sensor_noise(run)[channel], moved[channel])
