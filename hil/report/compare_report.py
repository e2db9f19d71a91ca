"""The report of `hil compare`: page, pictures, numbers, and the bench with fitted parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hil.bench.axis_models import OneMass
from hil.bench.bench_file import Bench
from hil.files.output import write_json, write_text
from hil.identification.blocks import BlockDeviation
from hil.identification.compare import EXPLAINED, Comparison, Deviation
from hil.identification.nominal_fit import FitResult
from hil.report import figures, plots, style
from hil.report.figures import Line, Panel
from hil.report.page import Number, Page
from hil.report.style import digits, percent, quantity
from hil.twin.library import BY_ID

MOVE_MARGIN_S = 0.1


def write_comparison(result: Comparison, folder: Path) -> None:
    """Write compare.html, overview.png, move.png, blocks.png, compare.json and, after a fit, bench.fitted.yaml."""
    time_s = result.measured.time_s
    motion, blocks = motion_panels(result), block_panels(result)
    page = Page(f"{result.recording.name} against its twin", _lead(result), verdict(result), result.explained)
    page.heading("Measured over simulated")
    page.text(
        "The twin runs in closed loop from the set-points of the recording alone. Deviation: measured less "
        "simulated; relative: rms of the deviation over rms of the measured channel."
    )
    page.table(
        ("channel", "rms deviation", "largest deviation", "relative"),
        [_row(channel.label, channel) for channel in result.channels],
    )
    page.plot(plots.over_time(time_s, motion))
    page.heading("Block by block")
    page.text("Each block is fed with what was measured, so that its deviation is its own.")
    page.table(
        ("block", "fed with", "output", "rms deviation", "largest deviation", "relative", "rms over noise"),
        [_block_row(block, deviation) for block, deviation in result.blocks],
    )
    page.plot(plots.over_time(time_s, blocks, [150, 120] * len(result.blocks)))
    if result.fit is not None:
        _fit(page, result.fit)
    if result.inverse_dynamics is not None:
        _inverse_dynamics(page, result)
    page.heading("One move")
    name = result.recording.name
    figures.save(figures.over_time(f"{name}: whole recording", time_s, motion), folder / "overview.png")
    move = figures.over_time(f"{name}: fastest move", time_s, motion, fastest_move(result))
    page.picture(
        figures.save(move, folder / "move.png"),
        "The fastest move of the recording (move.png); the whole recording is overview.png.",
    )
    figures.save(figures.over_time(f"{name}: block by block", time_s, blocks), folder / "blocks.png")
    page.heading("How it was computed")
    page.items([*result.notes, *(f"{block.block}: {block.remark}." for block, _ in result.blocks if block.remark)])
    write_json(folder / "compare.json", result.as_json())
    if result.fit is not None:
        write_bench(result.bench, folder / "bench.fitted.yaml")
    page.write(folder / "compare.html")


def verdict(result: Comparison) -> str:
    """In words: does the twin explain the recording, and if not, where it fails."""
    torque, position = result.torque, result.channels[0]
    figures_ = (
        f"{torque.label} deviates by {quantity(torque.rms, torque.unit)} rms, "
        f"{digits(result.torque_over_noise)} × its noise; {position.label} by "
        f"{quantity(position.rms, position.unit)} rms"
    )
    if result.explained:
        return f"The twin explains this recording: {figures_}."
    worst = [(deviation.rms / block.noise, block.block) for block, deviation in result.blocks if block.noise > 0.0]
    if worst and max(worst)[0] <= EXPLAINED:
        return (
            f"The control loop is not as the twin has it: {figures_}. Drive and axis by themselves are within "
            f"{EXPLAINED:g} × their noise: look at gains, periods, and where the loops run (drive.mode)."
        )
    where = f" Furthest from its noise: {max(worst)[1]} ({digits(max(worst)[0])} ×)." if worst else ""
    todo = "" if result.fit else " The parameters may be wrong: --fit corrects them."
    return f"The twin leaves something out: {figures_}.{where}{todo}"


def motion_panels(result: Comparison) -> list[Panel]:
    """Position to torque, measured and simulated, then the deviations of position and torque."""
    chosen = [channel for channel in result.channels if channel.name != "motor_position"]
    panels = [_pair(channel.label, channel) for channel in chosen]
    position, torque = chosen[0], chosen[-1]
    return [
        *panels,
        _difference(f"deviation of\n{position.label}", position, 0.0),
        _difference(f"deviation of\n{torque.label}", torque, result.measured.noise.torque),
    ]


def block_panels(result: Comparison) -> list[Panel]:
    """Output of each block, measured and simulated, and the deviation."""
    panels = []
    for block, deviation in result.blocks:
        panels += [
            _pair(f"{block.block}:\n{block.output}", deviation),
            _difference("deviation", deviation, block.noise),
        ]
    return panels


def fastest_move(result: Comparison) -> slice:
    """Rows from standstill to standstill of the set-points around their greatest speed."""
    speed = np.abs(result.measured.velocity_command_m_s)
    peak = int(np.argmax(speed))
    still = np.flatnonzero(speed <= 1e-3 * speed[peak])
    margin = round(MOVE_MARGIN_S / result.measured.period_s)
    begin = still[still < peak].max(initial=0) - margin
    end = still[still > peak].min(initial=speed.size) + margin
    return slice(max(int(begin), 0), min(int(end), speed.size))


def write_bench(bench: Bench, path: Path) -> None:
    """A bench as the YAML file that `load_bench` reads."""
    import yaml

    data = bench.model_dump(mode="json", exclude_defaults=True)
    data["schema_version"] = bench.schema_version
    data["axis"]["model"] = bench.axis.model
    write_text(path, yaml.safe_dump(data, sort_keys=False, allow_unicode=True))


def _lead(result: Comparison) -> str:
    seconds = len(result.recording) * result.recording.period_s
    parameters = "parameters fitted to this recording" if result.fit else "parameters of the bench file"
    mechanisms = ", ".join(entry.effect for entry in result.bench.mechanisms)
    return (
        f"{seconds:.1f} s at {digits(1.0 / result.recording.period_s)} Hz · bench {result.bench.name} "
        f"({result.bench.axis.model}{f', with {mechanisms}' if mechanisms else ''}) · {parameters}"
    )


def _pair(label: str, channel: Deviation) -> Panel:
    return Panel(
        label,
        channel.unit,
        (
            Line("measured", channel.measured, style.MEASURED, broad=True),
            Line("simulated", channel.simulated, style.SIMULATED),
        ),
    )


def _difference(label: str, channel: Deviation, noise: float) -> Panel:
    values = np.where(np.arange(channel.measured.size) < channel.judged.start, 0.0, channel.values)
    return Panel(label, channel.unit, (Line("measured less simulated", values, style.DEVIATION),), noise)


def _row(label: str, deviation: Deviation) -> tuple[str, ...]:
    return (
        label,
        Number(quantity(deviation.rms, deviation.unit)),
        Number(quantity(deviation.peak, deviation.unit)),
        Number(percent(deviation.relative)),
    )


def _block_row(block: BlockDeviation, deviation: Deviation) -> tuple[str, ...]:
    name, *numbers = _row(block.block, deviation)
    over_noise = digits(deviation.rms / block.noise) if block.noise > 0.0 else "–"
    return name, block.inputs, block.output, *numbers, Number(over_noise)


def _fit(page: Page, fit: FitResult) -> None:
    page.heading("Fitted parameters")
    page.table(
        ("parameter", "bench file", "fitted", "standard error", "change"),
        [
            (
                parameter.name,
                Number(digits(parameter.nominal, 4)),
                Number(digits(parameter.value, 5)),
                Number(digits(parameter.standard_error, 2)),
                Number(f"{100.0 * (parameter.value / parameter.nominal - 1.0):+.1f} %" if parameter.nominal else "–"),
            )
            for parameter in fit.parameters
        ],
    )
    page.text(
        "Fitted block by block as in hil diagnose, within a factor of three of the bench file; standard errors are "
        "robust against coloured residuals. bench.fitted.yaml holds the bench with these values."
    )


def _inverse_dynamics(page: Page, result: Comparison) -> None:
    fit, axis = result.inverse_dynamics, result.bench.axis
    assert fit is not None
    page.heading("Inverse-dynamics fit")
    page.text(
        "Force over measured motion, M a + Fv v + Fc sign(v) + F0, by least squares; relative error "
        f"{percent(fit.relative_error)}."
    )
    offset = next(
        (entry.active().values[0] for entry in result.bench.mechanisms if BY_ID[entry.effect].same_as),
        0.0,
    )
    assert isinstance(axis, OneMass)
    rows = (
        ("mass M", "kg", fit.inertia, fit.inertia_std_error, axis.mass_kg),
        ("viscous friction Fv", "N s/m", fit.viscous, fit.viscous_std_error, axis.viscous_force_n_s_m),
        ("Coulomb friction Fc", "N", fit.coulomb, fit.coulomb_std_error, axis.coulomb_force_n),
        ("offset F0", "N", fit.offset, fit.offset_std_error, offset),
    )
    page.table(
        ("parameter", "unit", "value", "standard error", "bench"),
        [
            (name, unit, Number(digits(value, 5)), Number(digits(error, 2)), Number(digits(believed, 5)))
            for name, unit, value, error, believed in rows
        ],
    )
