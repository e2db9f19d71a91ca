"""A command that is added behind a known control law in windows, found in what the law leaves of the recorded command.

    recorded command = law(set-points, positions) + a constant level in each window

The law replays without the axis, so the windows are those of the command whether the axis felt them or not. Windows
that its motion does not show are taken off the recorded command and torque. With those that it felt the plant is
judged alone, from the recorded torque.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from hil.arrays import FloatArray
from hil.bench.bench_file import Bench
from hil.diagnosis.criteria import CRITERIA
from hil.diagnosis.result import EventWindow
from hil.diagnosis.search.change_points import Segment, joined, segments, standing_out
from hil.diagnosis.search.event_detection import BLOCK_S, SHORTEST, Event
from hil.diagnosis.value import Value
from hil.diagnosis.verdict.event_windows import train_of
from hil.identification.derivatives import MeasuredMotion, motion, smoothed
from hil.identification.law.fit import command_left
from hil.identification.law.replay import Settings
from hil.identification.least_squares import least_squares
from hil.identification.measured import Measured
from hil.identification.plain_model import plain_columns
from hil.quantities import quantity

_MOST_BLOCKS = 6000  # the time of a partition grows with their square
_ALIKE = 0.05  # levels of adjacent windows that differ less are one
_HALF = 0.5  # of the windows: in a measured torque, or in what the motion does not explain of the command


def added_windows(runs: Iterable[Measured], bench: Bench, settings: Settings) -> tuple[Event, ...]:
    """Windows of an added command in all runs, levels in command units; rows of another part are left out.

    A window that continues in the next part of a recording is one in each.
    """
    return tuple(event for run in runs for event in _of_run(run, command_left(run, bench, settings)))


def _of_run(run: Measured, left: FloatArray) -> list[Event]:
    """Windows in what a law leaves (n,) of the command, if its set-points do not explain that: a feed-forward does."""
    period_s, first = run.period_s, run.lead_in
    left, speed = left[first:] - (left[first] if first else 0.0), run.velocity_command_m_s[first:]
    moved = MeasuredMotion(np.zeros(speed.size), speed, np.gradient(speed, period_s), np.sign(speed))
    if not np.any(left) or least_squares(plain_columns(moved), left, blocks=0).left ** 2 < CRITERIA.most_left:
        return []
    block = max(round(BLOCK_S / period_s), -(-left.size // _MOST_BLOCKS), 1)
    values = left[: left.size // block * block].reshape(-1, block).mean(axis=1)
    steps = np.abs(np.diff(values))
    noise = max(float(np.median(steps)) / (0.6745 * 2.0**0.5), run.noise.torque / block**0.5)
    known = np.ones(values.size)
    found = segments(values, known, noise**2, 3.0 * np.log(values.size) + CRITERIA.evidence)
    # a block with an edge has a level between
    found = [one for one in joined(found, known, 1, _ALIKE) if one.last - one.first >= SHORTEST]
    found = standing_out(values, known, found, CRITERIA.stands_out, 1)
    at_s = run.time_s[first]
    return [
        Event(run.name, float(at_s + begin * period_s), float(at_s + end * period_s), float(left[begin:end].mean()))
        for begin, end in (_edges(left, one, block) for one in found)
    ]


def _edges(left: FloatArray, one: Segment, block: int) -> tuple[int, int]:
    """First row of a window of a signal (n,), and that after its last: where a step of its level fits best."""

    def begin(values: FloatArray, block_of_edge: int) -> int:
        low, high = max((block_of_edge - 1) * block, 0), min((block_of_edge + 2) * block, values.size)
        before = float(np.mean(values[max(low - 2 * block, 0) : low])) if low else 0.0
        misfit = np.concatenate(
            [[0.0], np.cumsum((values[low:high] - before) ** 2 - (values[low:high] - one.level) ** 2)]
        )
        return low + int(np.argmin(misfit))

    count = -(-left.size // block)
    backwards = np.concatenate([left, np.full(count * block - left.size, left[-1])])[::-1]
    return begin(left, one.first), count * block - begin(backwards, count - one.last)


def axis_felt(runs: Sequence[Measured], windows: Sequence[Event]) -> bool:
    """True if inertia, friction and offset over the measured motion explain the commands with the windows in them."""
    parts = list[dict[str, FloatArray]]()
    for run in runs:
        added = run.torque_command - without_added(run, windows).torque_command
        columns = {
            **plain_columns(motion(run.motor, run.period_s)),
            "added": smoothed(added, run.period_s),
            "all": smoothed(run.torque_command, run.period_s),
        }
        parts.append({name: column[run.evaluated] for name, column in columns.items()})
    together = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    command = together.pop("all")
    return least_squares(together, command, blocks=0)["added"].value < _HALF


def without_added(run: Measured, windows: Iterable[Event]) -> Measured:
    """The run with its windows taken off command and torque; off a torque measured beside the command if it has them.

    In the lead-in, which another part evaluates, the windows of that part count.
    """
    added, time_s = np.zeros(run.motor.size), run.time_s
    for one in windows:
        if one.run == run.name:
            added[(time_s > one.start_s - 0.5 * run.period_s) & (time_s < one.end_s - 0.5 * run.period_s)] += one.level
    if not added.any():
        return run
    command = run.torque_command - added
    felt = float(added @ (run.torque - command)) > _HALF * float(added @ added)
    return replace(run, torque_command=command, torque=run.torque - added if felt else run.torque)


def windows_told(windows: Sequence[Event], runs: Sequence[Measured], unit: str) -> tuple[EventWindow, ...]:
    """Windows in order of time, those that were cut between parts of a recording joined; an edge is told to a row."""
    whole, period_s = list[Event](), runs[0].period_s
    for one in sorted(windows, key=lambda event: event.start_s):
        before = next((other for other in whole if _continues(other, one, period_s)), None)
        if before is not None:
            longer = max(before, one, key=lambda event: event.end_s - event.start_s)
            whole[whole.index(before)] = before._replace(end_s=one.end_s, level=longer.level)
        else:
            whole.append(one)
    noise = {run.name: run.noise.torque for run in runs}
    error = Value(value=0.0, std=period_s / 12.0**0.5, unit="s")

    def told(one: Event) -> EventWindow:
        rows = max((one.end_s - one.start_s) / period_s, 1.0)
        return EventWindow(
            recording=one.run,
            start=error.model_copy(update={"value": one.start_s}),
            end=error.model_copy(update={"value": one.end_s}),
            strength=Value(value=one.level, std=noise[one.run] / rows**0.5, unit=unit),
        )

    return tuple(map(told, whole))


def _continues(before: Event, after: Event, period_s: float) -> bool:
    near = abs(after.start_s - before.end_s) < 2.0 * period_s
    return before.run != after.run and near and abs(after.level - before.level) < _ALIKE * abs(before.level)


def added_in_words(windows: Sequence[EventWindow]) -> str:
    """Say what is added to the command behind its law, when."""
    levels = np.array([one.strength.value for one in windows])
    edges = np.array([(one.start.value, one.end.value) for one in windows])
    unit, alike = windows[0].strength.unit, np.ptp(levels) < _ALIKE * np.abs(levels).max()
    size = quantity(float(levels.mean() if alike else levels[np.argmax(np.abs(levels))]), unit)
    regular = train_of(edges, np.full(edges.shape, windows[0].start.std)) if alike else None
    count = "a window" if len(windows) == 1 else f"{len(windows)} windows"
    text = (
        f"The recorded command is that of the control law and {'' if alike else 'up to '}{size} more in {count} from "
        f"{edges.min():.3f} s to {edges.max():.3f} s"
    )
    if regular is not None:
        text += f", for {quantity(regular[0].width_s, 's')} every {quantity(regular[0].period_s, 's')}"
    return f"{text}: a command that is added behind the law, or a force written into it."
