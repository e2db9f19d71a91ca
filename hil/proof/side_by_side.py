"""Cases done side by side by processes, each of which keeps to its share of the cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from math import inf
from multiprocessing import get_context
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from hil.errors import HilError

if TYPE_CHECKING:
    from multiprocessing.queues import Queue


def side_by_side(work: Callable[[Path], None], todo: Sequence[Path], jobs: int, hours: float = inf) -> Iterator[str]:
    """Have the work done for each folder, `jobs` at once, none begun after `hours`; gives the name of each when done.

    Raises HilError where a process was ended from outside.
    """
    end_s = monotonic() + 3600.0 * hours
    # each process spreads its work over its cores itself; threads of the linear algebra get into its way
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    context = get_context("spawn")
    shares: Queue[set[int]] = context.Queue()
    for share in _shares(jobs):
        shares.put(share)
    try:
        with ProcessPoolExecutor(jobs, context, _keep_to, (shares,)) as pool:
            waiting, running = iter(todo), dict[Future[None], str]()
            try:
                while True:
                    for place in islice(waiting, jobs - len(running) if monotonic() < end_s else 0):
                        running[pool.submit(work, place)] = place.name
                    if not running:
                        break
                    for done in wait(running, return_when=FIRST_COMPLETED).done:
                        done.result()
                        yield running.pop(done)
            except BaseException:     # stopped, or nobody listens any more: no case is begun
                for case in running:
                    case.cancel()
                raise
    except BrokenProcessPool:
        raise HilError("a process was ended from outside, perhaps for want of memory; run the same again to go on"
                       ) from None


def _shares(jobs: int) -> list[set[int]]:
    """Cores of each process."""
    cores = sorted(os.sched_getaffinity(0))
    return [set(cores[job % len(cores)::jobs]) for job in range(jobs)]


def _keep_to(shares: Queue[set[int]]) -> None:
    """Keep this process to its share of the cores."""
    os.sched_setaffinity(0, shares.get())
