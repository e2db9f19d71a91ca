"""Measure the frequency responses of an axis from a recording: `frf`.

Torque and positions answer to the set-points; the plant is the quotient of two answers (`hil.frequency.joint`). The
loops follow from signals and the law:

    velocity loop, open     L = C D theta / u          C, D: PI law and velocity of the law, u: torque command
    position loop, open     L = Kv x / v_ref           at the ticks of the position loop, v_ref = Kv (r - x) + ff v
    position loop, closed   x_table / r

A hold of the position loop has images of each line f at m f_p +- f; laps show them without leakage, and the plant is
measured there too.
"""

from collections.abc import Iterable
from math import nan

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.control.cascade import Gains
from hil.errors import InputError
from hil.frequency.blocks import RECORD, Blocks, find_blocks
from hil.frequency.curves import (
    LEAST_LINES,
    LEAST_SPAN,
    ResponseCurve,
    resonances,
)
from hil.frequency.joint import JointEstimate, joint_estimate
from hil.frequency.margins import StabilityMargins, stability_margins
from hil.frequency.result import FrequencyResponse
from hil.frequency.twin_curves import axis_units, left_out, titles, twin_curves
from hil.identification.derived_channels import DERIVED
from hil.identification.measured import Measured, take
from hil.recording.recording import Recording
from hil.twin.structure.frequency import bandwidth_hz, laplace, velocity_law

# Of the strongest line of the set velocity: every line of a multisine over two decades is above. Segments of a sweep
# leak, so that lines beside its band are not excited by it; below the third line its window sees the mean.
EXCITED, SWEPT, FIRST_SWEPT = 2e-3, 0.03, 3
_TORQUE, _COMMAND, _MOTOR, _TABLE = range(4)  # channels of the estimate at the rows


def frf(recording: Recording, bench: Bench) -> FrequencyResponse:
    """Measure the frequency responses of an axis from a recording with a chirp or a multisine, beside its twin's.

    H1 estimate, joint for torque and position, so that the closed loop does not bias it (see `hil.frequency.joint`);
    by laps where the set-points repeat, else by Welch's segments. bench: gives the law, the units and the twin.

    Returns the responses with standard errors, coherence and margins; arrays in Hz and SI units. Raises
    InputError, with what to record, for a recording without torque, set-points or excitation, or too short.
    """
    run = _taken(recording, bench)
    bench = bench.sampled(run.period_s)
    twin = bench.twin()
    gains = twin.loop_gains
    ticks = gains.position_ticks if bench.law_known else 1
    blocks = find_blocks(recording.name, run.position_command_m, run.velocity_command_m_s, run.period_s, ticks)
    slides = blocks.sliding(run.motor)
    all_slide = blocks.only(slides).enough
    lines = _Lines(run, blocks.only(slides) if all_slide else blocks, ticks)
    measured = _plant(lines, bench, run)
    low, high = measured["plant_motor"].trusted_hz
    known = measured["plant_motor"].trusted
    if np.count_nonzero(known) < LEAST_LINES or not high >= LEAST_SPAN * low:
        raise InputError(
            f"{recording.name}: the set-points excite {np.count_nonzero(known)} frequencies from {low:.3g} to "
            f"{high:.3g} Hz so that the plant is known to a tenth, allowed {LEAST_LINES} or more over a factor of "
            f"{LEAST_SPAN:g}; {RECORD}"
        )
    if bench.law_known:
        measured |= _loops(lines, bench, run, measured, gains)
    curves = twin_curves(bench)
    margins = {name: _margins(measured[name]) for name in measured if name.endswith("_open")}
    return FrequencyResponse(
        name=recording.name,
        bench=bench.name,
        method="periods" if blocks.periodic else "welch",
        averages=lines.estimate.averages,
        resolution_hz=1.0 / (blocks.rows * run.period_s),
        measured=measured,
        twin=curves,
        margins=margins,
        twin_margins={name: _margins(curves[name]) for name in margins},
        bandwidth_hz={name: _bandwidth(measured[name]) for name in measured if name.endswith("_closed")},
        twin_bandwidth_hz={name: _bandwidth(curves[name]) for name in measured if name.endswith("_closed")},
        resonances=resonances(measured["plant_motor"].within(known)),
        twin_resonances=resonances(curves["plant_motor"]),
        distorted=not all_slide,
        notes=tuple([*_sliding(slides, all_slide), *_notes(run, bench, blocks)]),
    )


def _taken(recording: Recording, bench: Bench) -> Measured:
    """The channels of the recording. Raises InputError where set-points or torque were not recorded."""
    names = recording.axis
    parts = recording.parts()
    if len(parts) > 1:
        recording = max(parts, key=len)
    derived = recording.metadata.get(DERIVED, {})
    for name, why in (
        (names.position_command, "the responses are those to the set-points"),
        (names.torque, "the plant is position over torque"),
    ):
        other = names.torque_command if name == names.torque else name
        if not {name, other} & set(recording.columns) or name in derived:
            raise InputError(f"{recording.name}: {name} is not recorded, but {why}; record it: {RECORD}")
    if not np.any(np.diff(recording[names.torque if names.torque in recording.columns else names.torque_command])):
        raise InputError(f"{recording.name}: {names.torque}: given a constant, allowed a measured torque; {RECORD}")
    return take(recording, bench)


class _Lines:
    """Estimates at the rows and at the ticks of the position loop, at the frequencies that the set-points excite."""

    def __init__(self, run: Measured, blocks: Blocks, ticks: int) -> None:
        self.run, self.blocks, self.ticks = run, blocks, ticks
        self.reference = blocks.spectra(run.position_command_m)
        power = np.sqrt(np.mean(np.abs(self.reference) ** 2, axis=0))
        self.slow = blocks.rows // (2 * ticks)  # lines below half of the rate of the position loop
        excited = power > (EXCITED if blocks.periodic else SWEPT) * power.max()
        excited[: 0 if blocks.periodic else FIRST_SWEPT - 1] = False
        self.closed = np.flatnonzero(excited & (np.arange(1, power.size + 1) < self.slow))
        self.all = _with_images(excited, blocks.rows // ticks) if blocks.periodic and ticks > 1 else self.closed
        channels = [run.torque, run.torque_command, run.motor, *([run.table_m] if run.table_m.size else [])]
        spectra = np.stack(
            [blocks.spectra(one, difference=index >= _MOTOR) for index, one in enumerate(channels)], axis=1
        )
        self.estimate = self._joint(self.reference, spectra, self.all)
        self.answers = self._joint(self.reference, spectra, self.closed, normal=True)

    def hz(self, chosen: NDArray[np.intp]) -> FloatArray:
        """Frequencies [Hz] of lines."""
        return np.asarray((chosen + 1) / (self.blocks.rows * self.run.period_s), dtype=np.float64)

    def at_ticks(self, channels: Iterable[FloatArray]) -> JointEstimate:
        """Estimate of channels (n,) at the ticks of the position loop."""
        spectra = np.stack([self.blocks.spectra(one, self.ticks) for one in channels], axis=1)
        return self._joint(self.blocks.spectra(self.run.position_command_m, self.ticks), spectra, self.closed)

    def _joint(
        self,
        reference: NDArray[np.complex128],
        spectra: NDArray[np.complex128],
        chosen: NDArray[np.intp],
        normal: bool = False,
    ) -> JointEstimate:
        """Estimate at some lines. Of laps, the answer per lap itself, unless it must be that to a unit of set-point."""
        reference = reference[:, chosen]
        if self.blocks.periodic and not normal:
            reference = np.ones_like(reference)
        return joint_estimate(reference, spectra[..., chosen], self.blocks.overlap)


def _with_images(excited: NDArray[np.bool_], rate: int) -> NDArray[np.intp]:
    """Lines (k,) that are excited, and their images about multiples of `rate` lines, the rate of a hold."""
    lines = np.flatnonzero(excited) + 1
    about = np.arange(0, excited.size + 1, rate)[:, None]
    images = np.unique(np.abs(np.concatenate([about + lines, about - lines])))
    inside = (images >= 1) & (images < excited.size) & (images % rate != 0)
    return np.asarray(images[inside] - 1, dtype=np.intp)


def _plant(lines: _Lines, bench: Bench, run: Measured) -> dict[str, ResponseCurve]:
    hz, units, estimate = lines.hz(lines.all), axis_units(bench), lines.estimate
    step = 1.0 - np.exp(-laplace(hz) * run.period_s)  # of a position that enters as its difference
    found = {}
    for name, unit, channel in zip(("plant_motor", "plant_table"), units, (_MOTOR, _TABLE), strict=True):
        if channel < len(estimate.answer):
            response, error = estimate.quotient(channel, _TORQUE)
            coherence = np.minimum(estimate.coherence[channel], estimate.coherence[_TORQUE])
            found[name] = ResponseCurve(
                titles(bench)[name], unit, hz, response / step, error / np.abs(step), coherence, estimate.radius
            )
    return found


def _loops(
    lines: _Lines, bench: Bench, run: Measured, plant: dict[str, ResponseCurve], gains: Gains
) -> dict[str, ResponseCurve]:
    """The loops, each where the lines tell it."""
    hz, estimate = lines.hz(lines.all), lines.estimate
    z = np.exp(laplace(hz) * run.period_s)
    pi_law, velocity = velocity_law(gains, z)
    law = pi_law * velocity / (1.0 - 1.0 / z)
    response, error = estimate.quotient(_MOTOR, _COMMAND)
    coherence, radius = plant["plant_motor"].coherence, estimate.radius
    opened, error = law * response, np.abs(law) * error
    name = titles(bench)
    found = {
        "velocity_open": ResponseCurve(name["velocity_open"], "1", hz, opened, error, coherence, radius),
        "velocity_closed": ResponseCurve(
            name["velocity_closed"],
            "1",
            hz,
            opened / (1.0 + opened),
            error / np.abs(1.0 + opened) ** 2,
            coherence,
            radius,
        ),
    }
    hz, answers = lines.hz(lines.closed), lines.answers
    ratio = gains.ratio_m_rad
    feedback = run.table_m if gains.position_from_table else ratio * run.motor
    set_speed = gains.position_gain_1_s * (run.position_command_m - feedback)
    set_speed = set_speed + gains.velocity_feedforward * run.velocity_command_m_s
    ticked = lines.at_ticks((feedback, set_speed))
    response, error = ticked.quotient(0, 1)
    found["position_open"] = ResponseCurve(
        name["position_open"], "1", hz, gains.position_gain_1_s * response, gains.position_gain_1_s * error,
        np.minimum(*ticked.coherence), ticked.radius,
    )  # fmt: skip
    end, unit = (_TABLE, 1.0) if run.table_m.size else (_MOTOR, ratio)
    found["position_closed"] = ResponseCurve(
        name["position_closed"], "1", hz, unit * answers.answer[end], unit * answers.error(end),
        answers.coherence[end], answers.radius,
    )  # fmt: skip
    return found


def _margins(curve: ResponseCurve) -> StabilityMargins:
    """Margins of an open loop within its trusted range."""
    curve = curve.within(curve.trusted)
    if curve.frequency_hz.size < 2:
        return StabilityMargins(*(nan,) * 10)
    return stability_margins(curve.frequency_hz, curve.response, curve.std_error if np.any(curve.std_error) else None)


def _bandwidth(curve: ResponseCurve) -> float:
    curve = curve.within(curve.trusted)
    return bandwidth_hz(curve.frequency_hz, curve.response) if curve.frequency_hz.size else nan


def _sliding(slides: NDArray[np.bool_], kept_apart: bool) -> list[str]:
    """What the friction does to the measurement, in words."""
    stopped, blocks = int(np.count_nonzero(~slides)), slides.size
    if stopped == 0:
        return []
    advice = "ride on a faster feed (base_feed_m_s) or lower the amplitude"
    if kept_apart:
        return [
            f"The axis stops or turns back in {stopped} of {blocks} laps or segments, which are left out; {advice}."
        ]
    return [
        f"The axis stops or turns back in {stopped} of {blocks} laps or segments: friction distorts the responses, and "
        f"their standard errors do not contain that; {advice}."
    ]


def _notes(run: Measured, bench: Bench, blocks: Blocks) -> list[str]:
    """What limits the measurement beside friction, in words."""
    notes = []
    rows = (blocks.first[:, None] + np.arange(blocks.rows)).ravel()
    if np.abs(run.torque_command[rows]).max() >= bench.gains.torque_limit_n_m:
        notes.append("The torque reaches its limit, so that the loop is not linear; lower the amplitude.")
    if not blocks.periodic:
        notes.append(
            "Segments of a sweep leak into each other: expect some standard errors more; a multisine has none."
        )
    if effects := left_out(bench):
        notes.append(f"The twin's curves are those of its linear part, without {', '.join(effects)}.")
    if not bench.law_known:
        notes.append("The bench does not know the control law: no loops, no margins.")
    return notes
