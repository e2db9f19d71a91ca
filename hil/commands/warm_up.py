"""hil warm-up, and the same before the first command that needs compiled kernels."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

from hil.compiled.kernel_cache import provide_kernel_cache
from hil.report.console import Progress, out, progress


def warm_up() -> None:
    """Compile all kernels now, so that no later command has to; for images and services."""
    compile_kernels()
    out.print(f"All kernels are compiled in {provide_kernel_cache()}")


def compile_kernels(shown: Progress | None = None) -> None:
    """Compile all kernels if they are not compiled yet; raises HilError without a cache folder.

    Progress goes to the bar `shown`, or to one of its own.
    """
    if kernels_are_compiled():
        return
    mark, versions = _mark(), _versions()
    with progress() if shown is None else nullcontext(shown) as tell:
        task = "compiling kernels, once after the installation: about a minute"
        tell(task, 0.0)
        # imported late: the kernels are built by the first imports
        import numpy as np

        from hil.api import simulate
        from hil.bench.bench_file import load_bench
        from hil.control import cascade
        from hil.diagnosis.search.change_points import segments
        from hil.motion.trajectory import plan
        from hil.validation.proof.draw.demo import from_rest, there_and_back

        bench = load_bench("reference")
        motion = plan(from_rest("", there_and_back(0.01, 0.05)), bench.period_s)
        recording = simulate(bench, motion)
        tell(task, 0.5)
        bench.twin().simulate(motion.position_m, motion.velocity_m_s)  # read-only, of which numba makes another kernel
        tell(task, 0.65)
        setpoints = (recording["position_command_m"], recording["velocity_command_m_s"])
        measured = bench.twin().simulate(*setpoints)
        tell(task, 0.8)
        bench.twin().observe(*setpoints, measured)
        bench.twin().command(*setpoints, measured)
        tell(task, 0.9)
        cascade.replay(bench.gains, cascade.init(0.0), *setpoints, measured.motor_position, measured.table_position_m)
        bench.twin().drive(measured.torque_command)
        segments(measured.torque, np.ones(measured.torque.size), 1.0, 1.0)
        tell(task, 1.0)
    mark.write_text(versions, encoding="utf-8")


def kernels_are_compiled() -> bool:
    """Return True if all kernels are in the cache, for these versions of numba and Python and this processor."""
    mark = _mark()
    return mark.exists() and mark.read_text(encoding="utf-8") == _versions()


def _mark() -> Path:
    return provide_kernel_cache() / "compiled.txt"


def _versions() -> str:
    """Return what a kernel depends on beside its sources: numba, Python, the processor, and its folder."""
    import sys
    from importlib.metadata import version

    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    processor = f"{get_host_cpu_name()} {get_host_cpu_features().flatten()}"
    return f"numba {version('numba')}, {sys.implementation.cache_tag}, {processor}\n{provide_kernel_cache()}\n"
