"""Report of `hil paper`: printed and computed values, reasons for differences, and the figures."""

from pathlib import Path

from hil.quantities import digits
from hil.report.page import Page
from hil.validation.paper import PaperResult, Reproduction


def write_paper(result: PaperResult, folder: Path) -> None:
    """Write paper.html beside the pictures and paper.json that `run_paper` wrote to `folder`."""
    page = Page(
        "The source paper, reproduced",
        f"{len(result.rows)} figures of the paper recomputed",
        verdict(result),
        not _count(result, Reproduction.DIFFERS),
    )
    page.heading("Printed and computed")
    page.table(
        ("where", "quantity", "unit", "printed", "computed", "outcome", "why they differ"),
        [
            (row.where, row.quantity, row.unit, _value(row.printed), _value(row.computed), row.verdict.value, row.why)
            for row in result.rows
        ],
        left=(0, 1, 2, 6),
        mark=5,
    )
    page.heading("Modal matrix of the 7-dof model")
    page.text("Mass-normalised columns; the entries of Eq. 21 are lost in the source.")
    page.table(
        ("coordinate", *(f"{digits(float(hz))} Hz" for hz in result.frequencies_hz)),
        [
            (name, *(digits(float(value)) for value in row))
            for name, row in zip(result.coordinates, result.modal_matrix, strict=True)
        ],
    )
    page.heading("Figures")
    for picture in result.pictures:
        page.picture(folder / picture.file, f"{picture.figure}: {picture.caption}")
    page.heading("Assumptions")
    page.items(result.assumptions)
    page.write(folder / "paper.html")


def verdict(result: PaperResult) -> str:
    """Count the printed figures that are reproduced, differ, or cannot be compared."""
    reproduced, differ, incomparable = (_count(result, outcome) for outcome in Reproduction)
    return (
        f"{reproduced} of the printed figures are reproduced, {differ} differ, {incomparable} cannot be compared; "
        "the table gives the reasons."
    )


def _count(result: PaperResult, wanted: Reproduction) -> int:
    return sum(row.verdict is wanted for row in result.rows)


def _value(value: float | None) -> str:
    return "–" if value is None else digits(value, 4)
