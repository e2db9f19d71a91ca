"""What a notebook shows of a result: title, what it says in words, a table and its picture, as one piece of HTML."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

from hil.figures.drawing import PAGE_DPI, WIDTH_IN, Drawing
from hil.figures.panels import GOOD, WARNING

MOST_BYTES = 300_000  # of a card: a notebook of twenty stays smaller than 6 MB
_CODED = 4 / 3  # of base64, per byte of the picture
_WIDTH_PX = round(100 * WIDTH_IN)
_COARSEST_DPI = 20.0


def card(
    title: str,
    words: str,
    figure: Drawing,
    table: Sequence[Sequence[str]] = (),
    good: bool | None = None,
) -> str:
    """Return a card of at most `MOST_BYTES`. The first row of the table is its head; `good` colours the words' edge.

    Letters have the colours of the page, so that it can be read on a dark one; only the picture is white.
    """
    edge = "#999999" if good is None else GOOD if good else WARNING
    above = (
        f'<div style="max-width:{_WIDTH_PX}px"><p style="margin:0 0 0.4em"><b>{escape(title)}</b></p>'
        f'<p style="margin:0 0 0.6em;padding-left:0.6em;border-left:4px solid {edge}">{escape(words)}</p>'
        f"{_table(table)}"
    )
    image = '<img alt="{}" style="width:100%;background:white" src="data:image/png;base64,{}"></div>'
    room = (MOST_BYTES - len(above.encode()) - len(image) - len(escape(title))) / _CODED
    return above + image.format(escape(title), b64encode(_png(figure, room)).decode())


def _png(figure: Drawing, most_bytes: float) -> bytes:
    """The picture, coarser where it is noise, which does not compress."""
    dpi = float(PAGE_DPI)
    while len(picture := figure.png(dpi)) > most_bytes and dpi > _COARSEST_DPI:
        dpi *= 0.8
    return picture


def _table(rows: Sequence[Sequence[str]]) -> str:
    if not rows:
        return ""
    cells = [
        "".join(
            f'<{tag} style="padding:0.1em 0.8em 0.1em 0;text-align:{"right" if at else "left"}">{escape(cell)}</{tag}>'
            for at, cell in row
        )
        for tag, row in (("td" if number else "th", enumerate(row)) for number, row in enumerate(rows))
    ]
    return f'<table style="margin:0 0 0.6em">{"".join(f"<tr>{row}</tr>" for row in cells)}</table>'
