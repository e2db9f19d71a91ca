"""Reproduction of the source paper: printed and computed values, reasons for differences, and its figures.

`run_paper` computes and writes numbers and pictures; `hil.report.paper_report` writes the page.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from hil.arrays import FloatArray
from hil.files.output import write_json
from hil.paper import figures, source, tables
from hil.paper.row import Reproduction, Row
from hil.twin.structure.modal import modal

__all__ = ["PaperPicture", "PaperResult", "Reproduction", "Row", "run_paper"]

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class PaperPicture:
    """A picture: the figure of the source it stands for, its file beside paper.json, its caption."""

    figure: str
    file: str
    caption: str


@dataclass(frozen=True)
class PaperResult:
    """The reproduction as written to `folder`. `modal_matrix` (7, 7) stands for Eq. 21, whose entries are
    lost: mass-normalised columns [1/sqrt(kg m^2)], rows named by `coordinates`."""

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
        pictures=tuple(_save(out, *picture) for picture in _pictures()),
        assumptions=source.ASSUMPTIONS,
        coordinates=chain.names,
        frequencies_hz=tables.frequencies_hz("7-dof"),
        modal_matrix=modal(chain).shape,
    )
    write_json(out / "paper.json", result.as_json())
    return result


def _save(out: Path, figure: str, file: str, caption: str, drawing: Figure) -> PaperPicture:
    drawing.savefig(out / file, dpi=110)
    return PaperPicture(figure, file, caption)


def _pictures() -> list[tuple[str, str, str, Figure]]:
    two, seven = source.chains().values()
    pictures = [
        (
            "Fig. 6",
            "modes.png",
            "First three modes of the 7-dof model: the second mainly axial, between nut and "
            "table; the third mainly torsional, in the screw.",
            figures.mode_shapes(),
        ),
    ]
    for figure, feed in (("Fig. 7", 7.0), ("Fig. 8", 22.0)):
        run = source.simulate(seven, feed)
        caption = (
            f"7-dof model against the command at {feed:g} m/min; the source's measurement is not printed as "
            "numbers. The ripple of 250 and 500 Hz in torque and jerk is the 4 ms stair of the position loop."
        )
        pictures.append((figure, f"move_{feed:.0f}_m_min.png", caption, figures.move_over_time([("7-dof", run)])))
    pictures += [
        ("Fig. 9a", "bode_tf1.png", "Primary transfer function, motor angle over torque.", figures.bode_transfer(1)),
        ("Fig. 9b", "bode_tf2.png", "Secondary transfer function, table over motor.", figures.bode_transfer(2)),
        (
            "Fig. 9c",
            "bode_closed_loop.png",
            "Position loop, command to table, without and with feed-forward.",
            figures.bode_closed_loop(),
        ),
        (
            "Fig. 10",
            "move_30_m_min.png",
            "2-dof against 7-dof model at 30 m/min.",
            figures.move_over_time([("7-dof", source.simulate(seven, 30.0)), ("2-dof", source.simulate(two, 30.0))]),
        ),
        (
            "Sec. 3.3.3",
            "nut_travel.png",
            "What the position of the nut changes: the source suspects it of the delays it cannot explain.",
            figures.nut_travel(),
        ),
    ]
    return pictures
