"""An effect that only has a map is compensated like a named one: the twin runs it, and tables go by the twin."""

from __future__ import annotations

import pytest
from compensated_benches import bench_of_effects, there_and_back

from hil.compensating.compensate import plan_compensation
from hil.control.compensation_tables import Adds, Over

KNOTS = (0.0, 0.1, 0.3, 0.2, -0.1, 0.0)  # N m
OVER_POSITION = {"first_position_m": 0.0, "last_position_m": 0.1} | {
    f"knot_{number}_n_m": value for number, value in enumerate(KNOTS, 1)
}
OVER_SPEED = {"first_speed_rad_s": -60.0, "last_speed_rad_s": 60.0} | {
    f"knot_{number}_n_m": value for number, value in enumerate((-0.4, -0.3, -0.1, 0.1, 0.3, 0.4), 1)
}


@pytest.mark.parametrize(
    ("effect", "parameters", "name", "over"),
    [
        ("unnamed_torque_over_position", OVER_POSITION, "torque over position", Over.POSITION),
        (
            "unnamed_torque_within_period",
            OVER_POSITION | {"last_position_m": 0.05},
            "torque over position",
            Over.POSITION,
        ),
        ("unnamed_torque_over_speed", OVER_SPEED, "friction and load", Over.VELOCITY),
    ],
)
def test_a_map_is_the_source_of_its_table_and_its_error_falls(
    effect: str, parameters: dict[str, float], name: str, over: Over
) -> None:
    bench = bench_of_effects(mechanisms=[{"effect": effect, "parameters": parameters}])
    made = plan_compensation(bench, there_and_back(bench, 0.1, 0.1), None, 0.3)
    table = next(one for one in made.compensation.tables if one.name == name)
    assert table.over is over
    assert effect in made.derived.sources[name]
    assert made.gain.after.following_m < 0.25 * made.gain.before.following_m


def test_an_encoder_that_misreads_is_not_corrected() -> None:
    reading = {"first_position_m": 0.0, "last_position_m": 0.1} | {f"knot_{n}_m": n * 1e-6 for n in range(1, 7)}
    bench = bench_of_effects(mechanisms=[{"effect": "unnamed_reading_over_position", "parameters": reading}])
    made = plan_compensation(bench, there_and_back(bench, 0.1, 0.1), None, 0.3)
    assert not [one for one in made.compensation.tables if one.adds is Adds.POSITION]
    assert ("unnamed_reading_over_position", "the linear encoder misreads: the table is where it should be") in (
        made.derived.left_out
    )
