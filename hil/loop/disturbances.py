"""Page faults, preemptions and collections of this process: what delays a loop although it has all grants."""

from __future__ import annotations

import gc
import os
from typing import NamedTuple


class Disturbances(NamedTuple):
    """What may delay a thread that has all grants, counted since its process began.

    page_faults: the kernel provided or fetched memory. preemptions: another thread took the core. collections: of the
    garbage collector. threads: of the process, now.
    """

    page_faults: int
    preemptions: int
    collections: int
    threads: int

    @classmethod
    def now(cls) -> Disturbances:
        """Count them."""
        import resource  # POSIX only: of a run on wall-clock time

        usage = resource.getrusage(resource.RUSAGE_SELF)
        collections = sum(generation["collections"] for generation in gc.get_stats())
        return cls(usage.ru_minflt + usage.ru_majflt, usage.ru_nivcsw, collections, len(os.listdir("/proc/self/task")))

    def since(self, before: Disturbances) -> Disturbances:
        """Return those since `before`."""
        return Disturbances(
            self.page_faults - before.page_faults,
            self.preemptions - before.preemptions,
            self.collections - before.collections,
            self.threads,
        )
