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
import tempfile
from contextlib import ExitStack, nullcontext
from functools import partial
from typing import Annotated

import typer

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.loop.latency import Cyclictest, Latencies, cyclictest, load
from hil.loop.realtime import PRIORITY, loop_core
from hil.loop.run import run_profile
from hil.loop.simulated_bench import load_simulated
from hil.recording.recording import read_recording
from hil.report.console import err, out, table
from hil.validation.benchmarks.diagnosis import repeated
from hil.validation.benchmarks.left_out import LeftOut, Stalls, blocks, compare
from hil.validation.proof.draw.demo import PROVE

# as slow as a loop of 250 Hz allows: those of the reference bench are for a velocity loop of 1 kHz
_GAINS = {"position_gain_1_s": 15.0, "velocity_gain_ma_rpm": 10.0, "velocity_integral_time_ms": 30.0}
_SHOWN = 8  # longest blocks of ticks left out by the loop alone
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
            ended, loop, certificate, beside, cycle_s = _run(rate_hz, seconds)
            counts = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in certificate.items())
            said.append(f"{rate_hz:g} Hz: {ended}; {counts}")
            if beside is None:
                rows += [_row(f"loop, {rate_hz:g} Hz", loop, certificate["skipped"])]
                continue
            reference, both = beside
            rows += [_row(f"loop, {rate_hz:g} Hz", loop, both.loop), _row("cyclictest", reference, both.peer)]
            said.append(
                f"{rate_hz:g} Hz: left out by the loop and not by cyclictest within a period: {len(both.loop_only)}; "
                f"by cyclictest and not by the loop: {both.peer_only}; shared if cyclictest's were at other times: "
                f"{both.by_chance:.1f}"
            )
            said += [
                f"{rate_hz:g} Hz: {count} left out by the loop alone from {tick / rate_hz:.3f} s on; the cycle before "
                f"took {1e3 * cycle_s[tick - 1]:.3f} ms"
                for tick, count in blocks(both.loop_only)[:_SHOWN]
            ]
    table(("", "ticks", "left out", "p50", "p99.9", "largest"), rows)
    for line in said:
        out.print(line)


def _run(
    rate_hz: float, seconds: float
) -> tuple[str, Latencies, dict[str, int], tuple[Latencies, LeftOut] | None, FloatArray]:
    """Ending, lateness of the loop's ticks, what disturbed the loop between arming and its end, cyclictest's
    latencies with the comparison, None without cyclictest, and the time that the cycle of each tick took [s]."""
    period_s = 1.0 / rate_hz
    data = load_simulated("reference").model_dump()
    data["control"] |= {"position_period_s": period_s, "velocity_period_s": period_s} | _GAINS
    data["drive"] |= _DRIVE
    data["drive"]["supervision"] |= _SUPERVISION
    bench = Bench.model_validate(data)
    profile = repeated(PROVE, seconds, period_s)
    with tempfile.TemporaryDirectory() as folder:
        with ExitStack() as stack:
            wake_up_s = period_s / _WAKE_UPS
            beside = partial(cyclictest, wake_up_s, seconds, loop_core(), PRIORITY + 1, 0.5 * wake_up_s)
            started = list[Cyclictest]()
            result = run_profile(
                bench, profile, folder, "run", force=True,
                planned=lambda _: started.append(stack.enter_context(beside())),
            )  # fmt: skip
        assert result.recording is not None
        recording = read_recording(result.recording)
    certificate = recording.metadata["real_time"]["run"]
    counted = {name: certificate[name] for name in ("skipped", "page_faults", "preemptions", "collections", "threads")}
    outcome = result.outcome
    reference = started[0]()[0]
    found = None
    if reference is not None:
        stalls = Stalls.of(started[0].spikes, wake_up_s)
        found = reference, compare(outcome.lateness_s, outcome.first_tick_s, period_s, stalls)
    return f"{outcome.ending}: {outcome.reason}", Latencies.of(outcome.lateness_s), counted, found, recording["cycle_s"]


def _row(name: str, found: Latencies, left_out: int) -> tuple[str, ...]:
    times = (found.quantile(0.5), found.quantile(0.999), found.largest_s)
    return (name, f"{found.total}", f"{left_out}", *(f"{1e6 * time_s:.0f} us" for time_s in times))


if __name__ == "__main__":
    typer.run(measure)
