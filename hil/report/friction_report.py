"""Report of `hil friction`: the regression, its points and its picture."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from hil.bench.bench_file import Bench
from hil.files.optional_library import missing_of
from hil.files.output import write_json
from hil.identification.friction import FrictionResult
from hil.quantities import change, digits, quantity
from hil.report.page import Page

SCHEMA_VERSION = 1


def write_friction(result: FrictionResult, name: str, bench: Bench | None, folder: Path) -> None:
    """Write friction.json, and with the libraries of the extra `report` also friction.html and friction.png.

    Values of `bench` stand beside the identified ones.
    """
    units = result.units
    write_json(
        folder / "friction.json",
        {
            "schema_version": SCHEMA_VERSION,
            "recording": name,
            "units": {"coulomb": units.coulomb, "viscous": units.viscous, "speed": units.speed},
            **asdict(result),
        },
    )
    if not missing_of("report"):
        _write_page(result, name, bench, folder)


def _write_page(result: FrictionResult, name: str, bench: Bench | None, folder: Path) -> None:
    from hil.figures.drawing import save

    units = result.units
    feeds = [abs(point.feed_m_s) * 60.0 for point in result.points]
    page = Page(
        f"Friction of {name}",
        f"{len(result.points)} stretches of constant feed, {digits(min(feeds))} to {digits(max(feeds))} m/min",
        verdict(result, bench),
        True,
    )
    page.heading("Regression")
    page.text(
        f"At constant feed the acceleration is zero: mean {units.quantity} = Coulomb × sign(speed) + viscous × speed "
        f"+ offset. The points scatter by {quantity(result.residual_rms, units.coulomb)} rms about the line."
    )
    page.table(("", "value", "standard error", "bench file"), rows_of(result, bench))
    page.picture(
        save(result.plot(), folder / "friction.png"),
        f"Mean motor {units.quantity} over speed with the regression line; below, the residuals.",
    )
    page.heading("Points")
    line = result.torque(np.array([point.speed for point in result.points]))
    page.table(
        (
            f"motor speed [{units.speed}]",
            f"mean [{units.coulomb}]",
            f"line [{units.coulomb}]",
            "feed [m/min]",
            "start [s]",
            "averaged over [s]",
        ),
        [
            [
                digits(value, 4)
                for value in (point.speed, point.torque, torque, point.feed_m_s * 60.0, point.start_s, point.duration_s)
            ]
            for point, torque in zip(result.points, line.tolist(), strict=True)
        ],
        left=(),
    )
    page.write(folder / "friction.html")


def verdict(result: FrictionResult, bench: Bench | None) -> str:
    """State the values and their change against the bench file in one sentence."""
    units = result.units
    text = f"Coulomb {digits(result.coulomb, 4)} {units.coulomb}, viscous {digits(result.viscous, 4)} {units.viscous}"
    pairs = zip(("Coulomb", "viscous"), (result.coulomb, result.viscous), _nominal(bench), strict=False)
    changes = [f"{name} {change(value, nominal)}" for name, value, nominal in pairs if nominal > 0.0]
    return f"{text}; against the bench file: {', '.join(changes)}." if changes else f"{text}."


def rows_of(result: FrictionResult, bench: Bench | None) -> list[tuple[str, str, str, str]]:
    """Rows of the table: name with unit, value, standard error, value of the bench file."""
    units = result.units
    coulomb, viscous = [digits(value, 4) for value in _nominal(bench)] or ("–", "–")
    return [
        (f"Coulomb [{units.coulomb}]", digits(result.coulomb, 4), digits(result.coulomb_std_error, 2), coulomb),
        (f"viscous [{units.viscous}]", digits(result.viscous, 4), digits(result.viscous_std_error, 2), viscous),
        (f"offset [{units.coulomb}]", digits(result.offset, 4), digits(result.offset_std_error, 2), "–"),
    ]


def _nominal(bench: Bench | None) -> tuple[float, ...]:
    """Coulomb and viscous friction of the bench file; empty without one."""
    if bench is None:
        return ()
    physics = bench.axis.physics()
    return physics.coulomb_n_m, physics.viscous_n_m_s_rad
