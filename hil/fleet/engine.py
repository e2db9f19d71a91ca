"""Do one stage over a fleet: tasks of some recordings on a cluster, a result for each, and on from where it ended.

A worker writes the result of each recording when it has it, so that a worker or the client may be ended at any time. A
result has one id, under which a second one only replaces the first. At the end the client gathers all into the dataset.
A recording that ends its workers, as for want of memory, is done alone, and then reported.
"""

import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from time import monotonic
from typing import NamedTuple, Protocol

import pyarrow as pa

from hil.errors import HilError
from hil.fleet.store import Row, Store
from hil.workers.code import code_of, versions
from hil.workers.pool import Workers, completed

GOOD, BAD = "good", "bad"  # status of a row
MOST_IN_TASK, TASKS_A_WORKER = 50, 4  # recordings of a task; tasks that a worker gets at least, for an even end
_COMPUTING = ("bench", "control", "diagnosis", "fleet", "identification", "importing", "recording", "twin")
_ENDED = "ended the workers that read it, perhaps for want of memory"


class WorkItem(NamedTuple):
    """One recording to work on: its id, its axis, its file within the fleet, and what the work needs beside it."""

    id: str
    axis: str
    file: str
    given: str = ""


class Teller(Protocol):
    """Receiver of progress: results that are there, all of them, and the time that is left [s]."""

    def __call__(self, stage: str, done: int, of: int, left_s: float) -> None: ...


@dataclass(frozen=True)
class StageOfWork:
    """A stage: its name, the columns of its rows, and the work for one item, a function that workers can import.

    The work returns the columns of its row beside those of the item; what it raises as HilError is the reason of a bad
    one. `alone`: one item is a task.
    """

    name: str
    schema: pa.Schema
    work: Callable[[WorkItem], Row]
    alone: bool = False


@dataclass(frozen=True)
class Engine:
    """Where results are, how workers are reached when there is work, and who is told of progress."""

    results: Store
    connect: Callable[[], Workers]
    tell: Teller

    def run(self, stage: StageOfWork, items: Sequence[WorkItem], done: Sequence[Row] = ()) -> list[Row]:
        """Return a row for each item, those in `done` as they are; the dataset then has these rows alone."""
        kept = {row["id"]: row for row in done}
        written = {row["id"]: row for row in self.results.parts(stage.name)}
        known = kept | written
        todo = [item for item in items if item.id not in known]
        if todo:
            for row in self._made(stage, todo, len(items)):
                known[row["id"]] = row
        empty = dict.fromkeys(stage.schema.names)
        rows = [empty | known[item.id] for item in items]
        if todo or written or len(rows) != len(done):
            self._gather(stage, rows)
        return rows

    def _made(self, stage: StageOfWork, todo: Sequence[WorkItem], of: int) -> Iterator[Row]:
        begin, made, failed = monotonic(), 0, list[Sequence[WorkItem]]()
        work = partial(do, self.results, stage.name, stage.work, _code())
        self.tell(stage.name, of - len(todo), of, 0.0)
        workers = self.connect()
        size = 1 if stage.alone else max(min(len(todo) // (TASKS_A_WORKER * max(workers.count(), 1)), MOST_IN_TASK), 1)
        tasks: list[Sequence[WorkItem]] = [todo[at : at + size] for at in range(0, len(todo), size)]
        for batch, rows in completed(workers, work, tasks, given_up=failed.append):
            made += len(batch)
            left_s = (monotonic() - begin) / made * (len(todo) - made)
            self.tell(stage.name, of - len(todo) + made, of, left_s)
            yield from rows
        single = [[item] for batch in failed for item in batch]
        lost = list[Sequence[WorkItem]]()
        for _, rows in completed(workers, work, single, given_up=lost.append):
            yield from rows
        for (item,) in lost:
            row = _row(item, BAD, _ENDED)
            self.results.write_part(stage.name, row)
            yield row

    def _gather(self, stage: StageOfWork, rows: Sequence[Row]) -> None:
        """Write the dataset anew, then remove the results of workers: one that is ended between both does it again."""
        by_axis = defaultdict[str, list[Row]](list, {axis: [] for axis in self.results.axes(stage.name)})
        for row in rows:
            by_axis[row["axis"]].append(row)
        for axis, of_axis in by_axis.items():
            self.results.write_rows(stage.name, axis, of_axis, stage.schema)
        self.results.remove([f"parts/{stage.name}/{name}" for name in self.results.names(f"parts/{stage.name}")])


def do(
    results: Store, stage: str, work: Callable[[WorkItem], Row], code: dict[str, str], batch: Sequence[WorkItem]
) -> list[Row]:
    """Do the items of a task in this process, a worker's; returns their rows and writes each.

    Raises HilError if the code or the libraries here are not those of the client.
    """
    if _code() != code:
        other = [name for name, value in code.items() if _code()[name] != value]
        raise HilError(
            f"{os.uname().nodename}: the worker has other code or libraries ({', '.join(other)}); results of two would "
            "mix: install the same there and run the same again to go on"
        )
    os.environ.setdefault("HIL_THREADS", "1")  # others work on this machine too
    rows = list[Row]()
    for item in batch:
        if (row := results.part(stage, item.id)) is not None:  # of a worker that was ended within this task
            rows.append(row)
            continue
        try:
            row = _row(item, GOOD, "") | work(item)
        except HilError as error:
            row = _row(item, BAD, str(error).splitlines()[0])
        except Exception as error:  # a defect of the program, or of a library: the others go on
            row = _row(item, BAD, f"{type(error).__name__}: {error}".splitlines()[0])
        results.write_part(stage, row)
        rows.append(row)
    return rows


def columns(**more: pa.DataType) -> pa.Schema:
    """Columns of a stage: those of every row, and its own."""
    text = pa.string()
    every = {"id": text, "axis": text, "file": text, "status": text, "reason": text}
    return pa.schema(list((every | more).items()))


def _row(item: WorkItem, status: str, reason: str) -> Row:
    return {"id": item.id, "axis": item.axis, "file": item.file, "status": status, "reason": reason}


@cache
def _code() -> dict[str, str]:
    return {"code": code_of(_COMPUTING), **versions()}
