"""The loop with its simulated axis by the wall clock, beside cyclictest on the same core and a busy process on each.

    python -m hil.validation.benchmarks.real_time [--rates 250,1000] [--seconds 600] [--no-busy]

The whole loop is measured: bus, drive, encoders, controller, twin, supervision and recorder; the simulated devices are
in its process. cyclictest wakes four times in a period with a higher priority than the loop, so that the loop never
delays it. Left out are the cycles that the loop's rule leaves out (`clock.SKIP_FROM`: more than half a period late);
those of cyclictest are the cycles that a peer would have left out by the same rule, had it been due when the loop was
(`left_out`). The lateness is that of the ticks themselves: a reader of the recording interpolates rows that were left
out. The deadlines of the drive are wide, so that a stall of the machine does not end the measurement.
"""

import os
from contextlib import ExitStack, nullcontext
from functools import partial
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from hil.bench.bench_file import Bench
from hil.loop.latency import Cyclictest, Latencies, cyclictest, load
from hil.loop.outcome import Outcome
from hil.loop.realtime import PRIORITY, loop_core
from hil.loop.run import run_profile
from hil.loop.simulated_bench import load_simulated
from hil.recording.recording import read_recording
from hil.report.console import err, out, table
from hil.validation.benchmarks.axis import repeated
from hil.validation.benchmarks.left_out import Stalls, compare
from hil.validation.proof.draw.demo import PROVE

# as slow as a loop of 250 Hz allows: those of the reference bench are for a velocity loop of 1 kHz
_GAINS = {"position_gain_1_s": 15.0, "velocity_gain_ma_rpm": 10.0, "velocity_integral_time_ms": 30.0}
_COUNTS = ("skipped", "page_faults", "preemptions", "collections", "threads")
_WAKE_UPS = 4  # of cyclictest in a period of the loop
_STALL_S = 5.0  # longer than any stall; the axis moves on meanwhile
_DRIVE = {
    "command_deadline_s": _STALL_S,
    "overrun_s": _STALL_S,
    "heartbeat_s": _STALL_S,
    "missed_answers": 100,
    "following_error_m": 100.0,
    "travel_m": (-100.0, 100.0),
}
_SUPERVISION = {"velocity_m_s": 100.0, "torque": 100.0, "torque_difference": 100.0}


def measure(
    rates: Annotated[str, typer.Option(help="Rates of the loop [Hz], with commas.")] = "250,1000",
    seconds: Annotated[float, typer.Option(help="Duration at each rate [s].")] = 600.0,
    busy: Annotated[bool, typer.Option(help="Keep every core busy with an ordinary process.")] = True,
) -> None:
    """Print lateness, cycles left out, page faults and collections of the loop, and cyclictest's latencies."""
    rows, said = list[tuple[str, ...]](), list[str]()
    with load() if busy else nullcontext(0) as processes:
        for rate_hz in (float(rate) for rate in rates.split(",")):
            err.print(
                f"{seconds:g} s at {rate_hz:g} Hz beside {processes} busy processes, load {os.getloadavg()[0]:.1f} ..."
            )
            period_s = 1.0 / rate_hz
            outcome, counts, beside = _run(period_s, seconds)
            shown = ", ".join(f"{name.replace('_', ' ')} {counts[name]}" for name in _COUNTS)
            said.append(f"{rate_hz:g} Hz: {outcome.ending}: {outcome.reason}; {shown}")
            rows.append(_row(f"loop, {rate_hz:g} Hz", Latencies.of(outcome.lateness_s), counts["skipped"]))
            reference, _ = beside.found
            if reference is None:
                continue
            stalls = Stalls.of(beside.spikes, period_s / _WAKE_UPS)
            found = compare(outcome.lateness_s, outcome.first_tick_s, period_s, stalls)
            rows.append(_row("cyclictest", reference, found.peer))
            said.append(
                f"{rate_hz:g} Hz: left out by the loop and not by cyclictest within a period: {found.loop_only}; "
                f"by cyclictest and not by the loop: {found.peer_only}"
            )
    table(("", "ticks", "left out", "p50", "p99.9", "largest"), rows)
    out.print("\n".join(said))


def _run(period_s: float, seconds: float) -> tuple[Outcome, dict[str, int], Cyclictest]:
    """Run the loop beside cyclictest; returns its outcome and what disturbed it between arming and its end."""
    wake_up_s = period_s / _WAKE_UPS
    data = load_simulated("reference").model_dump()
    data["control"] |= {"position_period_s": period_s, "velocity_period_s": period_s} | _GAINS
    data["drive"] |= _DRIVE
    data["drive"]["supervision"] |= _SUPERVISION
    bench = Bench.model_validate(data)
    with TemporaryDirectory() as folder:
        with ExitStack() as stack:
            beside = partial(cyclictest, wake_up_s, seconds, loop_core(), PRIORITY + 1, 0.5 * wake_up_s)
            started = list[Cyclictest]()
            result = run_profile(
                bench, repeated(PROVE, seconds, period_s), folder, "run", force=True,
                planned=lambda _: started.append(stack.enter_context(beside())),
            )  # fmt: skip
        assert result.recording is not None
        return result.outcome, read_recording(result.recording).metadata["real_time"]["run"], started[0]


def _row(name: str, found: Latencies, left_out: int) -> tuple[str, ...]:
    times = (found.quantile(0.5), found.quantile(0.999), found.largest_s)
    return (name, f"{found.total}", f"{left_out}", *(f"{1e6 * time_s:.0f} us" for time_s in times))


if __name__ == "__main__":
    typer.run(measure)
