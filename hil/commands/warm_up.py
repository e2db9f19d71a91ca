"""hil warm-up, and the same before the first command that needs compiled kernels."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from hil.compiled.kernel_cache import provide_kernel_cache
from hil.report.console import Progress, out, progress

if TYPE_CHECKING:
    from hil.motion.trajectory import Trajectory

_ALL, _TWIN = "compiled.txt", "compiled-twin.txt"  # marks in the cache: which kernels are there


def warm_up() -> None:
    """Compile all kernels now, so that no later command has to; for images and services."""
    compile_kernels()
    out.print(f"All kernels are compiled in {provide_kernel_cache()}")


def compile_kernels(shown: Progress | None = None, of_loop: bool = True) -> None:
    """Compile the kernels that are not compiled yet; raises HilError without a cache folder.

    Those of the twin, which a diagnosis takes, and `of_loop` those of the loop on the simulated bus. Progress goes to
    the bar `shown`, or to one of its own.
    """
    if kernels_are_compiled(of_loop):
        return
    with progress() if shown is None else nullcontext(shown) as tell:
        task = f"compiling kernels, once after the installation: {'about a minute' if of_loop else 'half a minute'}"
        tell(task, 0.0)
        if not kernels_are_compiled(of_loop=False):
            _compile_twin()
            _mark(_TWIN).write_text(_versions(), encoding="utf-8")
        if of_loop:
            tell(task, 0.5)
            _compile_loop()
            _mark(_ALL).write_text(_versions(), encoding="utf-8")
        tell(task, 1.0)


def _compile_twin() -> None:
    """Compile the kernels of twin, control law and search. Imports are late: the kernels are built by the first."""
    import numpy as np

    from hil.bench.bench_file import load_bench
    from hil.control import cascade
    from hil.diagnosis.search.change_points import segments

    bench, motion = load_bench("reference"), _motion()
    twin = bench.twin()
    twin.simulate(motion.position_m, motion.velocity_m_s)  # read-only, of which numba makes another kernel
    setpoints = (motion.position_m.copy(), motion.velocity_m_s.copy())
    measured = twin.simulate(*setpoints)
    twin.observe(*setpoints, measured)
    twin.command(*setpoints, measured)
    cascade.replay(bench.gains, cascade.init(0.0), *setpoints, measured.motor_position, measured.table_position_m)
    twin.drive(measured.torque_command)
    segments(measured.torque, np.ones(measured.torque.size), 1.0, 1.0)


def _compile_loop() -> None:
    """Compile the kernels of the loop and of the simulated axis."""
    from hil.api import simulate
    from hil.bench.bench_file import load_bench

    simulate(load_bench("reference"), _motion())


def _motion() -> Trajectory:
    from hil.bench.bench_file import load_bench
    from hil.motion.trajectory import plan
    from hil.validation.proof.draw.demo import from_rest, there_and_back

    return plan(from_rest("", there_and_back(0.01, 0.05)), load_bench("reference").period_s)


def kernels_are_compiled(of_loop: bool = True) -> bool:
    """Return True if the kernels are in the cache, for these versions of numba and Python and this processor."""
    marks = [_mark(_ALL)] if of_loop else [_mark(_ALL), _mark(_TWIN)]
    return any(mark.exists() and mark.read_text(encoding="utf-8") == _versions() for mark in marks)


def _mark(name: str) -> Path:
    return provide_kernel_cache() / name


def _versions() -> str:
    """Return what a kernel depends on beside its sources: numba, Python, the processor, and its folder."""
    import sys
    from importlib.metadata import version

    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    processor = f"{get_host_cpu_name()} {get_host_cpu_features().flatten()}"
    return f"numba {version('numba')}, {sys.implementation.cache_tag}, {processor}\n{provide_kernel_cache()}\n"
