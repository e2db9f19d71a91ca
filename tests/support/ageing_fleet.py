"""Make a fleet of simulated axes that age: python tests/support/ageing_fleet.py FOLDER TRUTH.json

The axes are those of the simulated reality, whose equations are independent of the twin's; the bench files have masses
and friction that are wrong by up to a factor of 1.3. From one recording to the next friction scatters. Bad recordings
(truncated, empty, of another axis, of another sampling) lie beside the good ones.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from drivers.sim.effects import Effect
from drivers.sim.reality import record
from hil.arrays import FloatArray
from hil.motion.profile import Profile
from hil.motion.trajectory import plan
from hil.recording.recording import Recording, write_parquet
from hil.report.compare_report import write_bench
from hil.validation.proof.draw.axes import DrawnAxis, draw_axis

BEGIN = datetime(2025, 1, 1, 6, tzinfo=UTC)
SCATTER = 0.02  # of friction from one recording to the next, standard deviation
GAP_M, LEAD_ERROR_M, TABLE_SHARE = 3e-6, 2e-6, 0.5  # of a good axis


@dataclass(frozen=True)
class Wear:
    """State of an axis at one moment: factor on friction, play, first harmonic of the lead error, lateness of the
    table's encoder."""

    friction: float = 1.0
    gap_m: float = GAP_M
    lead_error_m: float = LEAD_ERROR_M
    late_s: float = 20e-6


@dataclass(frozen=True)
class Change:
    """A true change of one quantity: a step at a day, or a slope from it on; `serviced` is in service.csv."""

    quantity: str
    kind: str
    day: float
    size: float
    serviced: bool = False


@dataclass(frozen=True)
class Life:
    """How an axis ages over `days`: wear at a day, its true changes, and what was serviced when."""

    kind: str
    wear: Callable[[float], Wear]
    changes: tuple[Change, ...] = ()
    services: tuple[tuple[float, str], ...] = ()


def lives(days: float) -> tuple[Life, ...]:
    """The ways to age, a third of the axes not at all."""

    def friction(day: float) -> Wear:
        return Wear(friction=1.0 + 0.6 * max(day / days - 0.3, 0.0) / 0.7)

    def backlash(day: float) -> Wear:
        return Wear(gap_m=GAP_M + 15e-6 * day / days)

    def serviced(day: float) -> Wear:
        return Wear(friction=1.0 + 0.5 * day / (0.6 * days) if day < 0.6 * days else 1.0)

    def crash(day: float) -> Wear:
        return Wear(gap_m=GAP_M + 8e-6 * (day >= 0.7 * days), lead_error_m=LEAD_ERROR_M + 4e-6 * (day >= 0.7 * days))

    def sensor(day: float) -> Wear:
        return Wear(late_s=20e-6 + 200e-6 * (day >= 0.45 * days))

    still = Life("still", lambda day: Wear())
    return (
        still,
        Life("friction grows", friction, (Change("friction", "slope", 0.3 * days, 0.6 / (0.7 * days)),)),
        Life("play grows", backlash, (Change("reversal", "slope", 0.0, 15e-6 / days),)),
        still,
        Life(
            "friction grows, serviced", serviced,
            (Change("friction", "slope", 0.0, 0.5 / (0.6 * days)),
             Change("friction", "step", 0.6 * days, -0.5, serviced=True)),
            ((0.6 * days, "lubricated"),)),
        Life(
            "crash", crash,
            (Change("reversal", "step", 0.7 * days, 8e-6), Change("lead_error", "step", 0.7 * days, 4e-6))),
        still,
        Life(
            "sensor exchanged", sensor, (Change("table_delay", "step", 0.45 * days, 200e-6, serviced=True),),
            ((0.45 * days, "linear encoder exchanged"),)),
    )  # fmt: skip


def motion(axis: DrawnAxis, seconds: float = 6.0) -> Profile:
    """A check motion of some 6 s: creep through a reversal, two feeds there and back."""
    slow, fast, way = 0.3 * axis.feed_m_s, 0.9 * axis.feed_m_s, 0.3 * axis.travel_m
    rest = {"kind": "dwell", "duration_s": 0.15}
    segments: list[dict[str, object]] = [rest, {"kind": "reversal", "stroke_m": 0.008, "feed_m_s": 0.02}, rest]
    for feed in (slow, fast, fast) if seconds > 4.0 else (slow, fast):
        for target in (way, 0.0):
            segments += [{"kind": "sine_squared", "to_m": target, "feed_m_s": feed}, rest]
    limits = {"velocity_m_s": axis.feed_m_s, "acceleration_m_s2": axis.acceleration_m_s2, "jerk_m_s3": 100.0}
    return Profile.model_validate({"schema_version": 1, "limits": limits, "segments": segments})


def recording_of(axis: DrawnAxis, wear: Wear, seed: int, seconds: float = 6.0) -> Recording:
    """Record the check motion on an axis in this state."""
    rng = np.random.default_rng(seed)
    factor = wear.friction * (1.0 + SCATTER * rng.standard_normal())
    worn = axis.with_parameters(
        {name: factor * axis.true[name] for name in ("coulomb_torque_n_m", "viscous_torque_n_m_s_rad")}
    )
    effects = [
        Effect("backlash", {"gap_m": wear.gap_m}),
        Effect("table_side_friction", {"share": TABLE_SHARE}),
        Effect("periodic_lead_error", {"amplitude_m": wear.lead_error_m, "phase_rad": 0.7}),
        Effect("channel_time_skew", {"delay_s": wear.late_s}, "table_position"),
    ]
    moves = plan(motion(axis, seconds), axis.period_s)
    set_points: tuple[FloatArray, FloatArray] = np.array(moves.position_m), np.array(moves.velocity_m_s)
    columns = record(worn, axis.sensors, effects, axis.servo, *set_points, axis.period_s, seed)
    return Recording("run", columns, axis.period_s)


def make_axis(
    folder: Path, days: float, recordings: int, seed: int, bad: float, seconds: float, number: int
) -> dict[str, object]:
    """Write the folder of one axis; returns its truth."""
    life = lives(days)[number % len(lives(days))]
    rng = np.random.default_rng([seed, number])
    axis = next(one for one in iter(lambda: draw_axis(rng, "two_mass"), None) if one.period_s == 1e-3)
    name = f"axis-{number:03d}"
    place = folder / name
    place.mkdir(parents=True)
    write_bench(axis.bench.model_copy(update={"name": name}), place / "bench.yaml")
    if life.services:
        lines = [f"{BEGIN + timedelta(days=day):%Y-%m-%d},{what}" for day, what in life.services]
        (place / "service.csv").write_text("\n".join(["date,what", *lines]) + "\n", encoding="utf-8")
    rows = list[dict[str, object]]()
    for at in range(recordings):
        day = days * at / recordings
        path = place / f"{BEGIN + timedelta(days=day):%Y-%m-%d_%H%M}.parquet"
        write_parquet(recording_of(axis, life.wear(day), seed + 1000 * number + at, seconds), path)
        rows.append({"file": f"{name}/{path.name}", "day": day, **asdict(life.wear(day))})
    for turn in range(round(bad * recordings)):
        day = days * rng.uniform()
        path = place / f"{BEGIN + timedelta(days=day):%Y-%m-%d}_2300.parquet"
        write_parquet(recording_of(axis, life.wear(day), seed + 1000 * number + 500 + turn, seconds), path)
        WAYS[(number + turn) % len(WAYS)](path, axis)
    true = {key: float(value) for key, value in axis.true.items()}
    changes = [asdict(one) for one in life.changes]
    return {"axis": name, "kind": life.kind, "changes": changes, "true": true, "rows": rows}


def _truncated(path: Path, axis: DrawnAxis) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _empty(path: Path, axis: DrawnAxis) -> None:
    path.write_bytes(b"")


def _other_axis(path: Path, axis: DrawnAxis) -> None:
    true = {
        **axis.true,
        "table_mass_kg": 2.5 * axis.true["table_mass_kg"],
        "motor_mass_kg": 2 * axis.true["motor_mass_kg"],
    }
    path.unlink()
    write_parquet(recording_of(replace(axis, true=true), Wear(), 77), path)


def _other_sampling(path: Path, axis: DrawnAxis) -> None:
    path.unlink()
    columns = recording_of(axis, Wear(), 78).columns
    write_parquet(Recording("run", {name: one[::4] for name, one in columns.items()}, 4 * axis.period_s), path)


WAYS: Sequence[Callable[[Path, DrawnAxis], None]] = (_truncated, _empty, _other_axis, _other_sampling)


def make_fleet(
    folder: Path, axes: int, recordings: int, *, days: float = 364.0, seed: int = 1, bad: float = 0.0,
    seconds: float = 6.0, jobs: int = 1,
) -> list[dict[str, object]]:  # fmt: skip
    """Write a fleet; returns the truth of each axis."""
    work = partial(make_axis, folder, days, recordings, seed, bad, seconds)
    if jobs == 1:
        return [work(number) for number in range(axes)]
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        return list(pool.map(work, range(axes)))


if __name__ == "__main__":
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("folder", type=Path)
    given.add_argument("truth", type=Path)
    for name, kind, default in (("axes", int, 10), ("recordings", int, 52), ("days", float, 364.0), ("seed", int, 1),
                                ("bad", float, 0.0), ("jobs", int, 2)):  # fmt: skip
        given.add_argument(f"--{name}", type=kind, default=default)
    asked = vars(given.parse_args())
    truth = asked.pop("truth")
    truth.write_text(json.dumps(make_fleet(**asked), indent=1), encoding="utf-8")
