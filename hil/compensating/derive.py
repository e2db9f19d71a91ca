"""Tables of a diagnosed bench: what each comes from, and what no table compensates, with the reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil.bench.bench_file import Bench
from hil.compensating.shapes import PULSE, TableReach, shapes, thinned
from hil.control.compensation_tables import Adds, Compensation, CompensationLimits, CompensationTable, Over
from hil.motion.trajectory import Trajectory
from hil.twin.library import BY_ID
from hil.twin.mechanism import WIDTH, Moment, Stage
from hil.twin.physics import Active
from hil.twin.stepping.stages import KERNEL_STAGES

SMALL = {Adds.TORQUE: 2e-3, Adds.POSITION: 0.0}  # of all torque: friction is known no better
SMALL_PULSE = 0.05  # of all torque: less is lost in the lag of the law
SMALLEST_M = 2e-8  # below the counts of linear encoders
MATTERS = 0.01  # of a table: change by which a mechanism counts as its source
ROOM = 1.2  # of the limits above the largest values of the tables
SHARE = 0.8  # of the torque limit of the axis at most: the rest is for the control law
REVERSAL_S, TAKE_UP_S = 0.002, 0.01  # in which torque, and a lost motion, change their direction
_TIMES_S = (0.37, 12.1, 3600.0)  # a mechanism that goes by time is another one at one of them
_REASONS = {
    Stage.CHAIN: "a mode: it answers by frequency, which tables do not know",
    Stage.VELOCITY_FILTER: "a lag in the loop: lower it in the drive",
    Stage.CHANNEL: "time stamps of a recorded channel: no error of the axis; comparisons take it back",
    Stage.ANSWER: "time stamps of a recorded channel: no error of the axis; comparisons take it back",
    Stage.CURRENT: "a delay or limit of the torque: nothing that is added to the torque comes earlier or goes beyond",
    Stage.TORQUE: "a delay or limit of the torque: nothing that is added to the torque comes earlier or goes beyond",
    Stage.BRISTLE: "friction before sliding: its pulse after a reversal is small, or no table follows it",
    Stage.TABLE_READING: "the linear encoder misreads: the table is where it should be",
}
BY_TIME = "it goes by the time of a run, not by a set-point"
NOTHING = "it needs no steady torque and moves the table by nothing on this motion"
BY_LOOP = "the position loop sees the table and corrects it"
TOO_FINE = "it changes faster along the travel than a table of 513 knots follows"


@dataclass(frozen=True, eq=False)
class Derived:
    """Tables with the effects that each comes from, and effects without a table with the reason."""

    compensation: Compensation
    sources: dict[str, tuple[str, ...]]
    left_out: tuple[tuple[str, str], ...]


def reach_of(bench: Bench, motion: Trajectory) -> TableReach:
    """TableReach of a motion, its travel enlarged to that of the bench."""
    low, high = float(motion.position_m.min()), float(motion.position_m.max())
    if bench.drive is not None and bench.drive.travel_m is not None:
        low, high = min(low, bench.drive.travel_m[0]), max(high, bench.drive.travel_m[1])
    speed, acceleration = (float(np.abs(one).max()) for one in (motion.velocity_m_s, motion.acceleration_m_s2))
    return TableReach(low, high, speed, acceleration, turn_m(bench))


def turn_m(bench: Bench) -> float:
    """Way per turn of the motor [m]; 0 if it is not known."""
    physics = bench.axis.physics()
    return 2.0 * np.pi * bench.axis.ratio_m_rad / physics.angle_per_unit if physics.turn_known else 0.0


def derive(bench: Bench, reach: TableReach, fade_in_s: float) -> Derived:
    """Derive the tables of a bench for a reach. Raises FieldError without a control law."""
    gains, left_out = bench.known_control.gains(bench.axis.ratio_m_rad), list[tuple[str, str]]()
    whole = bench.twin()
    lasting = list[Active]()
    for active in whole.active:
        if BY_ID[active.effect].transient or _goes_by_time(active, reach):
            left_out.append((active.effect, BY_TIME))
        else:
            lasting.append(active)
    twin = replace(whole, active=tuple(lasting))
    found = shapes(twin, reach, gains.position_from_table)
    kept, fine = dict[str, CompensationTable](), set[str]()
    for name, table in found.items():
        if size(table) <= SMALL[table.adds] * _largest(found.values(), table.adds) + _least(table, found):
            continue
        few = thinned(table)
        if few is None:
            fine.add(name)
        else:
            kept[name] = few
    from_table = gains.position_from_table
    sources: dict[str, list[str]] = {name: [] for name in kept}
    for index, active in enumerate(lasting):
        without = shapes(replace(twin, active=(*lasting[:index], *lasting[index + 1 :])), reach, from_table)
        moved = [name for name in found if _changes(found[name], without[name], _least(found[name], found))]
        for name in set(moved) & set(sources):
            sources[name].append(active.effect)
        if not set(moved) & set(sources):
            left_out.append((active.effect, TOO_FINE if set(moved) & fine else _reason(active, from_table)))
    limits = limits_of(list(kept.values()), reach, gains.torque_limit_n_m, fade_in_s)
    angle_per_m = twin.physics.angle_per_unit / gains.ratio_m_rad
    return Derived(
        Compensation(tuple(kept.values()), limits, angle_per_m),
        {name: tuple(effects) or ("axis",) for name, effects in sources.items()},
        tuple(left_out),
    )


def size(table: CompensationTable) -> float:
    """Largest value of a table."""
    return float(max(np.abs(table.forward).max(), np.abs(table.backward).max()))


def _largest(tables: Iterable[CompensationTable], adds: Adds) -> float:
    return max((size(table) for table in tables if table.adds is adds), default=0.0)


def _least(table: CompensationTable, found: dict[str, CompensationTable]) -> float:
    """Values of a table that are nothing, whatever its size."""
    if table.adds is Adds.POSITION:
        return SMALLEST_M
    return SMALL_PULSE * _largest(found.values(), Adds.TORQUE) if table.name == PULSE else 0.0


def _changes(table: CompensationTable, other: CompensationTable, least: float) -> bool:
    """True if two tables differ by more than `MATTERS` of the first and `least`."""
    change = max(np.abs(table.forward - other.forward).max(), np.abs(table.backward - other.backward).max())
    return bool(change > MATTERS * size(table) + least)


def _goes_by_time(active: Active, reach: TableReach) -> bool:
    """True if a contribution is another one at the same place and speed later."""
    if active.form.stage not in KERNEL_STAGES:
        return False

    def at(time_s: float, place_m: float) -> float:
        moment = Moment(time_s, 0.0, 1e-3, 1e-4, place_m, 1.0, place_m, 1.0, 1.0)
        return float(active.form.contribution(1.0, moment, np.array(active.values), np.zeros(WIDTH)))

    places = np.linspace(reach.low_m, reach.high_m, 9).tolist()
    return any(abs(at(time_s, one) - at(0.0, one)) > 0.0 for one in places for time_s in _TIMES_S)


def _reason(active: Active, from_table: bool) -> str:
    stage = active.form.stage
    if from_table and stage in (Stage.TRANSMISSION, Stage.SCREW, Stage.MOTOR_READING):
        return BY_LOOP
    return _REASONS.get(stage, NOTHING)


def limits_of(
    tables: Sequence[CompensationTable], reach: TableReach, torque_limit: float, fade_in_s: float
) -> CompensationLimits:
    """Limits with room above the tables, and speeds with which they can be followed over the reach."""
    of_torque, of_position = ([table for table in tables if table.adds is adds] for adds in Adds)
    torque = min(ROOM * sum(map(size, of_torque)), SHARE * torque_limit)
    position_m = ROOM * sum(map(size, of_position))
    slope = jump = 0.0
    for table in of_position:
        metres = reach.turn_m / (2.0 * np.pi) if table.over is Over.ANGLE else 1.0
        steepest = max(float(np.abs(np.diff(one) / np.diff(table.at)).max()) for one in (table.forward, table.backward))
        slope += steepest / metres
        jump += float(np.abs(table.forward - table.backward).max())
    return CompensationLimits(
        torque=max(torque, 1e-9),
        torque_slope=max(torque, 1e-9) / REVERSAL_S,
        position_m=max(position_m, 1e-9),
        speed_m_s=max(ROOM * slope * reach.velocity_m_s + jump / TAKE_UP_S, 1e-9),
        fade_in_s=fade_in_s,
        direction_m_s=reach.direction_m_s,
    )
