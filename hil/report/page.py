"""Page of results: one HTML file that opens without a network, verdict at the top."""

import base64
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from hil.figures.panels import GOOD, GOOD_IN_DARK, WARNING, WARNING_IN_DARK
from hil.files.output import write_text

_TEMPLATE = Path(__file__).with_name("page.html.j2")


class Page:
    """Parts of a page in the order in which they are added; `write` renders the template page.html.j2.

    `legend` says what the colour of the verdict means.
    """

    def __init__(self, title: str, lead: str, verdict: str, good: bool, legend: str = "") -> None:
        self.title, self.lead, self.verdict, self.good, self.legend = title, lead, verdict, good, legend
        self._parts: list[tuple[str, Any]] = []
        self._plots: list[Any] = []

    def heading(self, text: str) -> None:
        """Add the heading of a section."""
        self._parts.append(("heading", text))

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self._parts.append(("text", text))

    def items(self, texts: Sequence[str]) -> None:
        """Add a list."""
        self._parts.append(("items", list(texts)))

    def table(
        self,
        headers: Sequence[str],
        rows: Sequence[Sequence[str]],
        left: Collection[int] = (0,),
        mark: int | None = None,
    ) -> None:
        """Add a table. The columns `left` hold text, the others numbers, aligned to the right. In column `mark`, "yes"
        and "reproduced" are green, other texts orange."""
        right = [bool(rows) and at not in left and at != mark for at in range(len(headers))]
        self._parts.append(("table", {"headers": headers, "rows": rows, "right": right, "mark": mark}))

    def plot(self, model: Any) -> None:
        """Add an interactive plot, a Bokeh model."""
        self._parts.append(("plot", len(self._plots)))
        self._plots.append(model)

    def picture(self, path: Path, caption: str) -> None:
        """Embed a PNG file."""
        data = base64.b64encode(path.read_bytes()).decode()
        self._parts.append(("picture", {"data": data, "caption": caption}))

    def write(self, path: Path) -> None:
        """Write the page. Raises InputError if the file cannot be written."""
        head = ""
        divisions: tuple[str, ...] = ()
        if self._plots:
            from bokeh.embed import components
            from bokeh.resources import Resources

            script, divisions = components(tuple(self._plots))
            head = Resources(mode="inline", components=["bokeh"]).render() + script
        environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
        html = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
            title=self.title,
            lead=self.lead,
            verdict=self.verdict,
            good=self.good,
            legend=self.legend,
            parts=self._parts,
            head=Markup(head),  # Bokeh's own HTML
            divisions=[Markup(division) for division in divisions],
            good_colour=GOOD,
            warning_colour=WARNING,
            good_in_dark=GOOD_IN_DARK,
            warning_in_dark=WARNING_IN_DARK,
        )
        write_text(path, html)
