"""Measured frequency responses over the figures 9 a to c of the source, for a bench with its axis."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.frequency.curves import ResponseCurve
from hil.frequency.picture import beside, decibels
from hil.frequency.result import FrequencyResponse
from hil.twin.structure.frequency import ComplexArray, laplace
from hil.validation.paper import PaperPicture, figures, source

MEASURED_COLOUR = "black"  # the models of these figures have colours of their own


def over_the_paper(result: FrequencyResponse, bench: Bench, folder: Path) -> list[PaperPicture]:
    """Draw measured curves over Fig. 9 of the source and save them to a folder; none for another axis than its."""
    if not _is_the_source_axis(bench) or "plant_table" not in result.measured:
        return []
    motor, table = result.measured["plant_motor"], result.measured["plant_table"]
    s_t = laplace(motor.frequency_hz) * bench.period_s
    held = -np.expm1(-s_t) / s_t  # hold of the torque, which the figures do not have
    drawings = [
        ("Fig. 9a", "paper_tf1.png", figures.bode_transfer(1), motor, motor.response / held,
         "Fig. 9 a: motor angle over torque. The hold of the torque is taken out of the measured lines; "
         "viscous friction, which the models of the figure do not have, turns their phase at low frequencies."),
        ("Fig. 9b", "paper_tf2.png", figures.bode_transfer(2), table,
         table.response / motor.response / bench.axis.ratio_m_rad, "Fig. 9 b: table over motor."),
    ]  # fmt: skip
    if closed := result.measured.get("position_closed"):
        caption = "Fig. 9 c: position command to table. The lines of the figure are those of continuous loops."
        drawings.append(
            ("Fig. 9c", "paper_closed_loop.png", figures.bode_closed_loop(), closed, closed.response, caption)
        )
    pictures = []
    for name, file, figure, curve, response, caption in drawings:
        good = curve.trusted & motor.trusted[: curve.trusted.size] if curve is table else curve.trusted
        _over(figure, curve, response, good)
        figure.savefig(folder / file, dpi=110)
        pictures.append(PaperPicture(name, file, caption))
    return pictures


def _is_the_source_axis(bench: Bench) -> bool:
    chain = bench.axis.physics().chain
    return any(
        one.inertia_kg_m2.shape == chain.inertia_kg_m2.shape
        and np.allclose(one.inertia_kg_m2, chain.inertia_kg_m2, rtol=0.01)
        and np.allclose(one.stiffness_n_m_rad, chain.stiffness_n_m_rad, rtol=0.01)
        for one in source.chains().values()
    )


def _over(figure: Figure, curve: ResponseCurve, response: ComplexArray, good: NDArray[np.bool_]) -> None:
    magnitude, phase = figure.axes
    hz = curve.frequency_hz[good]
    look: dict[str, Any] = {"color": MEASURED_COLOUR, "markersize": 3, "linestyle": "none", "marker": ".", "zorder": 5}
    magnitude.plot(hz, decibels(response[good]), label="measured", **look)
    line_hz, line_deg = _longest_line(phase)
    phase.plot(hz, beside(hz, response[good], line_hz, line_deg), **look)
    magnitude.legend()


def _longest_line(axis: Axes) -> tuple[FloatArray, FloatArray]:
    line = max(axis.lines, key=lambda one: len(np.asarray(one.get_xdata())))
    return np.asarray(line.get_xdata(), dtype=np.float64), np.asarray(line.get_ydata(), dtype=np.float64)
