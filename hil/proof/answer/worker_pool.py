"""Process cases in parallel; each process keeps to its share of the cores."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from math import inf
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import TYPE_CHECKING

from hil.errors import HilError, InputError

if TYPE_CHECKING:
    from multiprocessing.queues import Queue


def side_by_side(work: Callable[[Path], None], todo: Sequence[Path], jobs: int, hours: float = inf) -> Iterator[str]:
    """Call `work` for each folder, `jobs` at once, none begun after `hours`; yields each name when it is done.

    Raises HilError if a process was ended from outside.
    """
    end_s = monotonic() + 3600.0 * hours
    # each process distributes its own work; threads of the linear algebra would compete with it
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
            except BaseException:  # stopped, or the generator is closed: no further case begins
                for case in running:
                    case.cancel()
                raise
    except BrokenProcessPool:
        raise HilError(
            "a process was ended from outside, perhaps for want of memory; run the same again to go on"
        ) from None


def cases_in(folder: Path, answers: Path) -> list[Path]:
    """Return the cases of a folder in order of their names; makes the folder of their answers.

    Raises InputError if there are none, or if the folder cannot be made.
    """
    if not any(folder.glob("*/bench.yaml")):
        raise InputError(f"{folder}: holds no cases, allowed the folder of cases of a proof, DIR/cases")
    try:
        answers.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{answers}: cannot be made ({error.strerror}); give another folder") from None
    return sorted(folder.iterdir())


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
