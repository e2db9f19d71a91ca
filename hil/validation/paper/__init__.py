"""Reproduction of the source paper: printed and computed values, reasons for differences, and its figures.

`run_paper` computes and writes numbers and pictures; `hil.validation.paper.report` writes the page.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.files.output import write_json
from hil.twin.structure.modal import modal
from hil.validation.paper import figures, source, tables
from hil.validation.paper.row import Reproduction, Row

__all__ = ["PaperPicture", "PaperResult", "Reproduction", "Row", "run_paper"]

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class PaperPicture:
    """Picture: figure of the source, file beside paper.json, caption."""

    figure: str
    file: str
    caption: str


@dataclass(frozen=True)
class PaperResult:
    """Reproduction as written to `folder`.

    `modal_matrix` (7, 7) replaces Eq. 21, whose entries are lost: mass-normalised columns [1/sqrt(kg m^2)], rows named
    by `coordinates`.
    """

    folder: Path
    rows: tuple[Row, ...]
    pictures: tuple[PaperPicture, ...]
    assumptions: tuple[str, ...]
    coordinates: tuple[str, ...]
    frequencies_hz: FloatArray
    modal_matrix: FloatArray

    def as_json(self) -> dict[str, Any]:
        """Content of paper.json."""
        return {
            "schema_version": SCHEMA_VERSION,
            "rows": [asdict(row) | {"verdict": row.verdict.value} for row in self.rows],
            "pictures": [asdict(picture) for picture in self.pictures],
            "assumptions": list(self.assumptions),
            "seven_dof": {
                "coordinates": list(self.coordinates),
                "frequencies_hz": self.frequencies_hz.tolist(),
                "modal_matrix": self.modal_matrix.tolist(),
            },
        }


def run_paper(out: Path) -> PaperResult:
    """Compute the reproduction; write its PNGs and paper.json to the folder `out`, made if missing."""
    out.mkdir(parents=True, exist_ok=True)
    chain = source.chains()["7-dof"]
    result = PaperResult(
        folder=out,
        rows=tables.rows(),
        pictures=tuple(_pictures(out)),
        assumptions=source.ASSUMPTIONS,
        coordinates=chain.names,
        frequencies_hz=tables.frequencies_hz("7-dof"),
        modal_matrix=modal(chain).shape,
    )
    write_json(out / "paper.json", result.as_json())
    return result


def _pictures(out: Path) -> Iterator[PaperPicture]:
    """Draw the figures of the source and save them to `out`."""

    def save(figure: str, file: str, drawing: Figure, caption: str) -> PaperPicture:
        drawing.savefig(out / file, dpi=110)
        return PaperPicture(figure, file, caption)

    two, seven = source.chains().values()
    yield save(
        "Fig. 6",
        "modes.png",
        figures.mode_shapes(),
        "First three modes of the 7-dof model: the second mainly axial, between nut and table; the third mainly "
        "torsional, in the screw.",
    )
    for figure, feed in (("Fig. 7", 7.0), ("Fig. 8", 22.0)):
        caption = (
            f"7-dof model against the command at {feed:g} m/min; the source's measurement is not printed as "
            "numbers. The ripple of 250 and 500 Hz in torque and jerk is the 4 ms stair of the position loop."
        )
        drawing = figures.move_over_time([("7-dof", source.simulate(seven, feed))])
        yield save(figure, f"move_{feed:.0f}_m_min.png", drawing, caption)
    caption = "Primary transfer function, motor angle over torque."
    yield save("Fig. 9a", "bode_tf1.png", figures.bode_transfer(1), caption)
    yield save("Fig. 9b", "bode_tf2.png", figures.bode_transfer(2), "Secondary transfer function, table over motor.")
    caption = "Position loop, command to table, without and with feed-forward."
    yield save("Fig. 9c", "bode_closed_loop.png", figures.bode_closed_loop(), caption)
    runs = [(name, source.simulate(chain, 30.0)) for name, chain in (("7-dof", seven), ("2-dof", two))]
    caption = "2-dof against 7-dof model at 30 m/min."
    yield save("Fig. 10", "move_30_m_min.png", figures.move_over_time(runs), caption)
    caption = "Screw stiffness and frequencies over the nut's travel, which the source suspects of unexplained delays."
    yield save("Sec. 3.3.3", "nut_travel.png", figures.nut_travel(), caption)
