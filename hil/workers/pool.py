"""Do tasks in parallel, in processes that keep to their share of the cores."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from math import inf
from multiprocessing import get_context, parent_process
from threading import Thread
from time import monotonic
from typing import TYPE_CHECKING, TypeVar

from hil.errors import HilError

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

JOIN_S = 5.0  # after which workers that have joined get their cases: short beside a diagnosis
Argument = TypeVar("Argument")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers:
    """Processes that do tasks: `count` tells how many there are now.

    `gives_up`: what a task raises that ended several of them.
    """

    pool: Executor
    count: Callable[[], int]
    gives_up: type[BaseException] | tuple[()] = ()


def side_by_side(work: Callable[[Argument], None], todo: Iterable[Argument], jobs: int) -> Iterator[Argument]:
    """Call `work` for each argument in `jobs` processes; yields each argument when it is done.

    Raises HilError if a process was ended from outside.
    """
    with local(jobs) as workers:
        for argument, _ in completed(workers, work, todo):
            yield argument


@contextmanager
def local(jobs: int) -> Iterator[Workers]:
    """Start processes on this machine; they end with the block. Raises HilError if one is ended from outside."""
    # each process distributes its own work; threads of the linear algebra would compete with it
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    context = get_context("spawn")
    shares: Queue[set[int]] = context.Queue()
    for share in _shares(jobs):
        shares.put(share)
    try:
        with ProcessPoolExecutor(jobs, context, _keep_to, (shares,)) as pool:
            yield Workers(pool, lambda: jobs)
    except BrokenProcessPool:
        raise HilError(
            "a process was ended from outside, perhaps for want of memory; run the same again to go on"
        ) from None


def completed(
    workers: Workers,
    work: Callable[[Argument], Result],
    todo: Iterable[Argument],
    hours: float = inf,
    given_up: Callable[[Argument], None] | None = None,
) -> Iterator[tuple[Argument, Result]]:
    """Call `work` for each argument, one per worker at once, none begun after `hours`; yields results as they come.

    An argument is taken from `todo` when a worker is free for it. With `given_up`, one that ended several workers is
    told to it, and the others go on.
    """
    end_s = monotonic() + 3600.0 * hours
    waiting, running = iter(todo), dict[Future[Result], Argument]()
    try:
        while True:
            free = max(workers.count(), 1) - len(running)  # without a worker yet, one case waits for it
            for argument in islice(waiting, max(free, 0) if monotonic() < end_s else 0):
                running[workers.pool.submit(work, argument)] = argument
            if not running:
                break
            for done in wait(running, JOIN_S, return_when=FIRST_COMPLETED).done:
                argument = running.pop(done)
                try:
                    result = done.result()
                except workers.gives_up:
                    if given_up is None:
                        raise
                    given_up(argument)
                else:
                    yield argument, result
    except BaseException:  # stopped, or the generator is closed: no further case begins
        for case in running:
            case.cancel()
        raise


def _shares(jobs: int) -> list[set[int]]:
    """Return the cores of each process."""
    cores = sorted(os.sched_getaffinity(0))
    return [set(cores[job % len(cores) :: jobs]) for job in range(jobs)]


def _keep_to(shares: "Queue[set[int]]") -> None:
    """Bind this process to its share of the cores; end it on ctrl-C and with its parent."""
    signal.signal(signal.SIGINT, lambda signum, frame: os._exit(130))
    Thread(target=_end_together, daemon=True).start()
    os.sched_setaffinity(0, shares.get())


def _end_together() -> None:
    """End this process when its parent has ended in any way; an unfinished case is done again."""
    if (parent := parent_process()) is not None:
        parent.join()
    os._exit(1)
