"""Process cases in parallel: in processes that keep to their share of the cores, or on a dask.distributed cluster."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from math import inf
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import TYPE_CHECKING, TypeVar

from hil.errors import HilError, InputError

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

CONNECT_S = 10.0  # within which a scheduler answers over a network
JOIN_S = 5.0  # after which workers that have joined get their cases: short beside a diagnosis
Argument = TypeVar("Argument")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers:
    """Processes that do tasks: `count` tells how many there are now."""

    pool: Executor
    count: Callable[[], int]


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


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """Connect to the scheduler of a dask.distributed cluster, whose workers may come and go.

    A case whose worker is lost goes to another one. Raises InputError if no scheduler answers, HilError if
    dask.distributed is not installed, if the scheduler is lost, if a worker has no room for a case, or if a case ended
    several workers.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise HilError(
            "--scheduler: dask.distributed is not installed; pip install 'hil-servo[cluster]', or give --workers"
        ) from None
    try:
        client = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler: given {address}, allowed the address that dask scheduler prints, as tcp://10.0.0.1:8786; "
            f"no scheduler answers there ({error})"
        ) from None
    with client:
        try:
            yield Workers(client.get_executor(pure=False), lambda: len(client.nthreads()))
        except KilledWorker as error:
            raise HilError(f"a case ended several workers, perhaps for want of memory: {error}") from None
        except (OSError, CancelledError) as error:
            raise HilError(
                f"{address}: the scheduler is lost, or a worker cannot write ({type(error).__name__}: {error}); "
                "mend that and run the same again to go on"
            ) from None


def completed(
    workers: Workers, work: Callable[[Argument], Result], todo: Iterable[Argument], hours: float = inf
) -> Iterator[tuple[Argument, Result]]:
    """Call `work` for each argument, one per worker at once, none begun after `hours`; yields results as they come.

    An argument is taken from `todo` when a worker is free for it.
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
                yield running.pop(done), done.result()
    except BaseException:  # stopped, or the generator is closed: no further case begins
        for case in running:
            case.cancel()
        raise


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
