"""A page of results: one self-contained HTML file that opens without a network, verdict on top."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from hil.files.output import write_text
from hil.report import style

_CSS = f"""
body {{ font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; color: #1c1c1c; margin: 0 auto; padding: 0 24px 60px;
       max-width: 1240px; }}
h1 {{ font-size: 24px; margin: 28px 0 4px; }} h2 {{ font-size: 19px; margin: 34px 0 8px; }}
.lead {{ color: #555; margin: 0 0 14px; }}
.verdict {{ border-left: 6px solid; padding: 10px 16px; margin: 14px 0 20px; background: #f6f6f4; font-size: 17px; }}
.good {{ border-color: {style.GOOD}; }} .warning {{ border-color: {style.WARNING}; }}
table {{ border-collapse: collapse; margin: 8px 0 16px; }}
th, td {{ padding: 4px 14px 4px 0; text-align: left; border-bottom: 1px solid #ddd; vertical-align: top; }}
th {{ font-weight: 600; border-bottom: 2px solid #999; }}
td.n, th.n {{ text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }}
figure {{ margin: 16px 0 24px; }} figure img {{ max-width: 100%; border: 1px solid #ddd; }}
figcaption {{ color: #444; max-width: 900px; }}
ul {{ margin: 6px 0; padding-left: 22px; }} .yes {{ color: {style.GOOD}; }} .no {{ color: {style.WARNING}; }}
@media print {{ body {{ max-width: none; }} }}
"""


class Number(str):
    """Text of a table cell that is a number: set to the right."""


class Page:
    """Parts of a page in the order they are added; `write` makes the file."""

    def __init__(self, title: str, lead: str, verdict: str, good: bool) -> None:
        self.title = title
        self._parts = [
            f"<h1>{escape(title)}</h1>",
            f'<p class="lead">{escape(lead)}</p>',
            f'<div class="verdict {"good" if good else "warning"}">{escape(verdict)}</div>',
        ]
        self._plots: list[Any] = []

    def heading(self, text: str) -> None:
        """A new section."""
        self._parts.append(f"<h2>{escape(text)}</h2>")

    def text(self, text: str) -> None:
        """A paragraph."""
        self._parts.append(f"<p>{escape(text)}</p>")

    def items(self, texts: Sequence[str]) -> None:
        """A list."""
        self._parts.append("<ul>" + "".join(f"<li>{escape(text)}</li>" for text in texts) + "</ul>")

    def table(self, headers: Sequence[str], rows: Sequence[Sequence[str]], mark: int | None = None) -> None:
        """A table; a column is set to the right if its cells are `Number`. In column `mark`, "yes" and
        "reproduced" are green, other texts orange."""
        right = [bool(rows) and all(isinstance(row[i], Number) for row in rows) for i in range(len(headers))]

        def cell(tag: str, index: int, text: str) -> str:
            names = ["n"] if right[index] else []
            if tag == "td" and index == mark:
                names.append("yes" if text in ("yes", "reproduced") else "no")
            kind = f' class="{" ".join(names)}"' if names else ""
            return f"<{tag}{kind}>{escape(text)}</{tag}>"

        head = "".join(cell("th", i, text) for i, text in enumerate(headers))
        body = "".join("<tr>" + "".join(cell("td", i, text) for i, text in enumerate(row)) + "</tr>" for row in rows)
        self._parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")

    def plot(self, model: Any) -> None:
        """An interactive plot: a Bokeh model."""
        self._plots.append(model)
        self._parts.append("")  # filled when written
        self._parts[-1] = f"\0{len(self._plots) - 1}"

    def picture(self, path: Path, caption: str) -> None:
        """A PNG, carried inside the page."""
        data = base64.b64encode(path.read_bytes()).decode()
        self._parts.append(
            f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>"
        )

    def write(self, path: Path) -> None:
        """Write the page. Raises InputError where it cannot be written."""
        head, parts = "", list(self._parts)
        if self._plots:
            from bokeh.embed import components
            from bokeh.resources import Resources

            script, divisions = components(tuple(self._plots))
            head = Resources(mode="inline", components=["bokeh"]).render() + script
            parts = [divisions[int(part[1:])] if part.startswith("\0") else part for part in parts]
        body = "\n".join(parts)
        write_text(
            path,
            f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(self.title)}'
            f"</title><style>{_CSS}</style>{head}</head><body>\n{body}\n</body></html>\n",
        )
