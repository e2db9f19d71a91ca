"""The compensation in the cycle: the same bits everywhere, off by one key, and none in a stop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from compensated_benches import there_and_back

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.control import cascade, compensation
from hil.control.compensation import Remembered
from hil.control.compensation_tables import Adds, Compensation, CompensationLimits, CompensationTable, Over, pack
from hil.errors import InputError
from hil.loop.cycle import STOP_SEGMENT
from hil.manual.keys import EXAMPLES

EXAMPLE = EXAMPLES / "bench-compensated.yaml"
CHANNELS = ("compensation_position_m", "compensation_velocity_m_s", "compensation_torque_n_m")
FREE = CompensationLimits(10.0, 1e9, 1.0, 1e9, 0.0, 0.01)


def with_section(**changes: object) -> Bench:
    section = load_bench(EXAMPLE).model_dump(mode="json")["compensation"] | changes
    return Bench.model_validate(load_bench("reference").model_dump(mode="json") | {"compensation": section})


def one_table(adds: Adds, over: Over, at: list[float], forward: list[float], backward: list[float]) -> Compensation:
    columns = (np.array(one) for one in (at, forward, backward))
    return Compensation((CompensationTable("one", adds, over, *columns),), FREE, 2.0)


def added(tables: Compensation, *set_points: tuple[float, float, float]) -> list[compensation.Added]:
    packed, state = pack(tables, 1e-3), compensation.start()
    return [compensation.step(packed, state, *one, True) for one in set_points]


def test_lines_go_on_over_velocity_and_repeat_over_the_angle() -> None:
    over_velocity = one_table(Adds.TORQUE, Over.VELOCITY, [1.0, 2.0], [1.0, 3.0], [1.0, 3.0])
    assert added(over_velocity, (0.0, 4.0, 0.0))[0].torque == pytest.approx(7.0)
    over_angle = one_table(Adds.POSITION, Over.ANGLE, [0.0, np.pi], [0.0, 1.0], [0.0, 1.0])
    # angle = 2 x position: three quarters of a turn, and a turn before it
    for place in (0.75 * np.pi, 0.75 * np.pi - np.pi):
        assert added(over_angle, (place, 1.0, 0.0))[0].position_m == pytest.approx(0.5)


def test_a_position_is_held_for_the_last_direction_and_a_torque_fades_about_rest() -> None:
    position = one_table(Adds.POSITION, Over.POSITION, [0.0], [2.0], [-4.0])
    taken = added(position, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 0.0))
    limit = FREE.position_m
    assert [one.position_m for one in taken] == [-limit, limit, limit, -limit, -limit]
    torque = one_table(Adds.TORQUE, Over.POSITION, [0.0], [2.0], [-2.0])
    assert [one.torque for one in added(torque, (0.0, 0.005, 0.0), (0.0, 0.0, 0.0))] == pytest.approx([1.0, 0.0])


def test_a_pulse_begins_at_a_reversal_and_not_at_the_first_motion() -> None:
    pulse = one_table(Adds.TORQUE, Over.REVERSAL_WAY, [0.0, 0.002], [1.0, 0.0], [-1.0, 0.0])
    speeds = (1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0)
    torque = [one.torque for one in added(pulse, *((0.0, speed, 0.0) for speed in speeds))]
    assert torque == pytest.approx([0.0, 0.0, 0.0, -1.0, -0.5, 0.0, 0.0])


def test_a_stroke_within_a_pulse_makes_the_next_one_less() -> None:
    # Masing: half a pulse is left after 1 mm of the first stroke, which began with half of one; then half of 0.75
    pulse = one_table(Adds.TORQUE, Over.REVERSAL_WAY, [0.0, 0.002], [1.0, 0.0], [-1.0, 0.0])
    speeds = (1.0, 1.0, -1.0, -1.0, 1.0, 0.2)
    torque = [one.torque for one in added(pulse, *((0.0, speed, 0.0) for speed in speeds))]
    assert torque[:5] == pytest.approx([0.0, 0.0, -0.75, -0.375, 0.625])
    assert 0.0 < torque[5] <= 0.625


def test_a_pulse_goes_over_with_the_direction() -> None:
    pulse = one_table(Adds.TORQUE, Over.REVERSAL_WAY, [0.0, 0.002], [1.0, 0.0], [-1.0, 0.0])
    slow = 0.25 * FREE.direction_m_s
    torque = [one.torque for one in added(pulse, (0.0, 1.0, 0.0), *((0.0, 1.0, 0.0),) * 3, (0.0, -slow, 0.0))]
    assert torque[-1] == pytest.approx(-0.25)


def test_it_is_bounded_in_size_and_slope_and_fades_in() -> None:
    bench = with_section(torque_limit=1.0, torque_slope=400.0, position_limit_m=3e-6, speed_limit_m_s=5e-4)
    motion = there_and_back(bench, 0.05, 0.2)
    over = compensation.follow(
        pack(bench.tables(), bench.period_s), motion.position_m, motion.velocity_m_s, motion.acceleration_m_s2
    )
    assert np.abs(over.torque).max() == pytest.approx(1.0)
    assert np.abs(np.diff(over.torque)).max() <= 0.4 * (1 + 1e-9)
    assert np.abs(over.position_m).max() == pytest.approx(3e-6)
    assert np.abs(over.velocity_m_s).max() <= 5e-4 * (1 + 1e-9)
    assert np.abs(over.torque[:100]).max() < 0.3


def test_the_replay_of_a_recording_gives_its_bits(tmp_path: Path) -> None:
    bench = with_section()
    run = hil.simulate(bench, there_and_back(bench, 0.05, 0.2), seed=3)
    set_points = (run["position_command_m"], run["velocity_command_m_s"], run["acceleration_command_m_s2"])
    over = compensation.follow(pack(bench.tables(), bench.period_s), *set_points)
    for values, channel in zip(over, CHANNELS, strict=True):
        assert np.array_equal(values, run[channel]), channel
        assert np.any(values)
    gains, state = bench.gains, cascade.init(run["motor_position_rad"][0], period_s=bench.period_s)
    for k in range(len(run)):
        inputs = cascade.Inputs(
            set_points[0][k] + over.position_m[k],
            set_points[1][k] + over.velocity_m_s[k],
            run["motor_position_rad"][k],
            run["table_position_m"][k],
            over.torque[k],
        )
        state, out = cascade.step(gains, state, inputs)
        assert out.torque_n_m == run["torque_command_n_m"][k]
    assert hil.compare(run, bench).explained


def test_one_key_switches_it_off() -> None:
    bench = with_section(enabled=False)
    motion = there_and_back(bench, 0.02, 0.1)
    off, without = (hil.simulate(one, motion, seed=2) for one in (bench, load_bench("reference")))
    assert off.columns.keys() == without.columns.keys()
    assert all(np.array_equal(off[name], without[name]) for name in off.columns)


def test_a_stop_takes_it_out_within_its_slope() -> None:
    tables = one_table(Adds.TORQUE, Over.VELOCITY, [-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])
    packed, state = pack(tables, 1e-3), compensation.start()
    before = compensation.step(packed, state, 0.0, 1.0, 0.0, True)
    state[Remembered.TORQUE] = before.torque
    slow = packed._replace(constants=np.array([10.0, 100.0, 1.0, 1.0, 0.0, 0.01, 2.0, 1e-3]))
    torques = [compensation.step(slow, state, 0.0, 1.0, 0.0, False).torque for _ in range(12)]
    assert before.torque == pytest.approx(1.0)
    assert torques[0] == pytest.approx(0.9)
    assert torques[-1] == 0.0
    assert STOP_SEGMENT < 0


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("at: [-1.0, 1.0]", "at: [1.0, -1.0]", "ascend"),
        ("forward: [-1.144, 1.144]", "forward: [1.0]", "one for each knot"),
        ("torque_limit: 6.0", "torque_limit: -6.0", "torque_limit"),
        (
            "entries:\n",
            "entries:\n  - {name: a, adds: torque, over: motor_angle_rad, at: [7.0], forward: [1.0]}\n",
            "2 pi",
        ),
    ],
)
def test_a_wrong_table_is_refused_with_its_place(tmp_path: Path, old: str, new: str, told: str) -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "bench.yaml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=told):
        load_bench(tmp_path / "bench.yaml")


def test_a_drive_that_makes_its_torque_takes_no_torque_table() -> None:
    with pytest.raises(ValueError, match="where the drive makes it"):
        Bench.model_validate(with_section().model_dump(mode="json") | {"drive": {"mode": "csv"}})
