"""Simulations in parallel: compiled kernels run without the GIL, so threads take all cores."""

import ctypes
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar, cast

from threadpoolctl import threadpool_limits

Output = TypeVar("Output")
Function = TypeVar("Function", bound=Callable[..., Any])
# HIL_THREADS: where the cores that this process may use are not its own, as on a cluster
_ARENA_MAX = -8  # M_ARENA_MAX of mallopt(3)
_USABLE = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
THREADS = int(os.environ.get("HIL_THREADS", 0)) or _USABLE
# glibc: one heap for all threads, else each keeps memory the others freed
if sys.platform == "linux" and hasattr(ctypes.CDLL(None), "mallopt"):
    ctypes.CDLL(None).mallopt(_ARENA_MAX, 1)
POOL = ThreadPoolExecutor(THREADS)


def in_parallel(jobs: Sequence[Callable[[], Output]]) -> list[Output]:
    """Run jobs in parallel; results in order. Jobs may use `POOL`."""
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(lambda job: job(), jobs))


def one_blas_thread(function: Function) -> Function:
    """Limit linear algebra to one thread during a function: its threads wait actively and slow simulations down."""
    return cast(Function, threadpool_limits.wrap(limits=1, user_api="blas")(function))
