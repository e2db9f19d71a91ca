"""hil demo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.commands.console import err, out, progress, table


def demo(
    folder: Annotated[Path | None, typer.Option("--out", help="Folder for recording and report; left out: "
                                                "runs/demo-TIME")] = None,
    virtual: Annotated[bool, typer.Option("--virtual", help="In virtual time")] = False,
) -> None:
    """Move the simulated reference axis 100 mm at 7 and 22 m/min over CANopen, record it, compare it with its twin."""
    from hil.commands.run import say
    from hil.errors import HilError
    from hil.profile import Profile
    from hil.report.output import default_folder
    from hil.run import run_profile
    from hil.simulated import load_simulated
    from hil.supervision import Ending

    folder = folder or default_folder("demo")
    bench = load_simulated("reference")
    moves = Profile.model_validate(MOVES)
    # on a simulated bench nothing can be harmed by a late tick: a busy machine is reported, not refused
    result = run_profile(bench, moves, folder, "demo", virtual=virtual, force=True,
                         planned=lambda trajectory: err.print(f"100 mm at 7 and 22 m/min on the simulated CANopen bus: "
                                                              f"{trajectory.duration_s:.1f} s ..."))
    say(result, virtual)
    if result.outcome.ending is Ending.OVERRUN:
        err.print("This machine is too busy for wall-clock time; the same moves again in virtual time.")
        result = run_profile(bench, moves, folder, "demo", virtual=True)
        say(result, virtual=True)
    if not result.complete or result.recording is None:
        raise HilError(f"stopped: {result.outcome.ending}: {result.outcome.reason}")

    from hil.compare import compare
    from hil.recording import read_recording
    from hil.report.compare_report import verdict, write_comparison
    from hil.report.look import percent, quantity

    with progress() as tell:
        comparison = compare(read_recording(result.recording), bench, progress=tell)
        tell("writing the report", None)
        write_comparison(comparison, folder)
    table(("measured less simulated", "rms", "largest", "relative"),
          [(channel.label, quantity(channel.rms, channel.unit), quantity(channel.peak, channel.unit),
            percent(channel.relative)) for channel in comparison.channels])
    out.print(f"\n{verdict(comparison)}\n\nOpen this file in a browser: {(folder / 'compare.html').resolve()}")


# The moves of figures 7 and 8 of the source, there and back.
MOVES = {
    "schema_version": 1,
    "description": "100 mm at 7 and 22 m/min, there and back",
    "limits": {"velocity_m_s": 0.6, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0},
    "segments": [
        {"kind": "dwell", "duration_s": 0.5},
        {"kind": "repeat", "times": 2, "segments": [
            {"kind": "sine_squared", "to_m": 0.1, "feed_m_s": 0.116667},
            {"kind": "dwell", "duration_s": 0.5},
            {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.116667},
            {"kind": "dwell", "duration_s": 0.5},
        ]},
        {"kind": "repeat", "times": 3, "segments": [
            {"kind": "sine_squared", "to_m": 0.1, "feed_m_s": 0.366667},
            {"kind": "dwell", "duration_s": 0.5},
            {"kind": "sine_squared", "to_m": 0.0, "feed_m_s": 0.366667},
            {"kind": "dwell", "duration_s": 0.5},
        ]},
    ],
}
