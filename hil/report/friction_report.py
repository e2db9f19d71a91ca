"""The report of `hil friction`: the regression, its points and its picture."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from hil.bench.bench_file import Bench
from hil.channels import AxisKind
from hil.files.output import write_json
from hil.identification.friction import FrictionResult
from hil.report.figures import save
from hil.report.friction_figure import friction_figure
from hil.report.page import Number, Page
from hil.report.style import digits

_UNITS = {AxisKind.ROTARY: ("N m", "N m s/rad", "rad/s"), AxisKind.LINEAR: ("N", "N s/m", "m/s")}
SCHEMA_VERSION = 1


def write_friction(result: FrictionResult, name: str, bench: Bench | None, folder: Path) -> None:
    """Write friction.html, friction.png and friction.json; `bench` shows what its file believes beside it."""
    unit, _, speed_unit = _UNITS[result.kind]
    feeds = [abs(point.feed_m_s) * 60.0 for point in result.points]
    page = Page(
        f"Friction of {name}",
        f"{len(result.points)} stretches of constant feed, {digits(min(feeds))} to {digits(max(feeds))} m/min",
        verdict(result, bench),
        True,
    )
    page.heading("Regression")
    page.text(
        "At constant feed nothing accelerates: the mean torque is Coulomb x sign(speed) + viscous x speed + "
        f"offset. Points lie {digits(result.residual_rms)} {unit} rms about the line."
    )
    page.table(
        ("", "value", "standard error", "bench file"),
        [(row[0], *(Number(text) for text in row[1:])) for row in rows_of(result, bench)],
    )
    page.picture(
        save(friction_figure(result), folder / "friction.png"),
        "Mean motor torque over speed, and below what the line leaves out.",
    )
    page.heading("Points")
    line = result.torque(np.array([point.speed for point in result.points]))
    page.table(
        (f"motor speed [{speed_unit}]", f"mean [{unit}]", f"line [{unit}]", "feed [m/min]", "from [s]", "averaged [s]"),
        [
            tuple(
                Number(digits(value, 4))
                for value in (point.speed, point.torque, torque, point.feed_m_s * 60.0, point.start_s, point.duration_s)
            )
            for point, torque in zip(result.points, line.tolist(), strict=True)
        ],
    )
    write_json(
        folder / "friction.json",
        {
            "schema_version": SCHEMA_VERSION,
            "recording": name,
            "units": dict(zip(("coulomb", "viscous", "speed"), _UNITS[result.kind], strict=True)),
            **asdict(result),
        },
    )
    page.write(folder / "friction.html")


def verdict(result: FrictionResult, bench: Bench | None) -> str:
    """One sentence with the values, and how far the bench file is off."""
    unit, viscous_unit, _ = _UNITS[result.kind]
    text = f"Coulomb {digits(result.coulomb, 4)} {unit}, viscous {digits(result.viscous, 4)} {viscous_unit}"
    believed = _believed(bench)
    if believed is None:
        return text + "."
    changes = [
        f"{name} {100.0 * (value / nominal - 1.0):+.1f} %"
        for name, value, nominal in zip(("Coulomb", "viscous"), (result.coulomb, result.viscous), believed, strict=True)
        if nominal > 0.0
    ]
    return f"{text}; against the bench file: {', '.join(changes)}."


def rows_of(result: FrictionResult, bench: Bench | None) -> list[tuple[str, str, str, str]]:
    """Rows of the table: name with unit, value, standard error, value of the bench file."""
    unit, viscous_unit, _ = _UNITS[result.kind]
    believed = _believed(bench)
    nominal = ("–", "–") if believed is None else tuple(digits(value, 4) for value in believed)
    return [
        (f"Coulomb [{unit}]", digits(result.coulomb, 4), digits(result.coulomb_std_error, 2), nominal[0]),
        (f"viscous [{viscous_unit}]", digits(result.viscous, 4), digits(result.viscous_std_error, 2), nominal[1]),
        (f"offset [{unit}]", digits(result.offset, 4), digits(result.offset_std_error, 2), "–"),
    ]


def _believed(bench: Bench | None) -> tuple[float, float] | None:
    if bench is None:
        return None
    physics = bench.axis.physics()
    return physics.coulomb_n_m, physics.viscous_n_m_s_rad
