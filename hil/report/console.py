"""Output of commands on the terminal: results on stdout, progress on stderr."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.table import Table

# no markup: names of files and benches may hold square brackets
out = Console(highlight=False, soft_wrap=True, markup=False)
err = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)


class Progress(Protocol):
    """Receiver of progress: the task at work, and the share of it that is done if that is known."""

    def __call__(self, task: str, share: float | None = None) -> None: ...


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a progress bar per task; without a terminal print one line per task."""
    if not err.is_terminal:
        seen: set[str] = set()

        def line(task: str, share: float | None = None) -> None:
            if task not in seen:
                seen.add(task)
                err.print(f"{task} ...")

        yield line
        return
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    with Bars(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=err,
        transient=True,
    ) as bars:
        tasks: dict[str, TaskID] = {}

        def update(task: str, share: float | None = None) -> None:
            if task not in tasks:
                for other in tasks.values():
                    bars.update(other, total=1.0, completed=1.0)
                tasks[task] = bars.add_task(task, total=None if share is None else 1.0)
            bars.update(tasks[task], completed=share or 0.0)

        yield update


def table(headers: Sequence[str], rows: Sequence[Sequence[str]], *, right: bool = True) -> None:
    """Print a table; all columns but the first are aligned to the right, unless they hold text (`right=False`)."""
    view = Table(box=None, pad_edge=False, header_style="bold")
    for index, header in enumerate(headers):
        view.add_column(header, justify="right" if index and right else "left")
    for row in rows:
        view.add_row(*row)
    out.print(view)


def print_look(lines: Sequence[str]) -> None:
    """Print what recordings show before a twin is compared with them."""
    for line in lines:
        out.print(line)
    out.print()
