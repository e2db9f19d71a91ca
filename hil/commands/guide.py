"""hil guide."""

from typing import Annotated

import typer

from hil.report.console import out, table

WIDEST = 110  # columns of a page that are read easily


def guide(
    context: typer.Context,
    topic: Annotated[str, typer.Argument(help="Page to print. Default: the list of all.", show_default=False)] = "",
) -> None:
    """Print a page of the manual: how to do something, or a reference of keys, channels, mechanisms, commands."""
    from hil.errors import InputError
    from hil.manual.topics import REFERENCES, TOPICS, for_terminal, guide_page, reference_page, title

    if not topic:
        table(("hil guide ...", ""), [(name, title(name)) for name in TOPICS], right=False)
        return
    if topic not in TOPICS:
        raise InputError(f"TOPIC: given {topic!r}, allowed one of {', '.join(TOPICS)}; choose one")
    group = context.find_root().command
    text = for_terminal(reference_page(topic, group) if topic in REFERENCES else guide_page(topic))
    if not out.is_terminal:
        out.print(text)
        return
    from rich.markdown import Markdown

    out.print(Markdown(text), soft_wrap=False, width=min(out.width, WIDEST))
