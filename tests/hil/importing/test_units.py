"""Spellings of units of foreign files."""

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, write

from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.lexicon import Quantity
from hil.importing.units import QUANTITY_OF_UNIT, split_unit, unit_named
from hil.quantities import si_factor


@pytest.mark.parametrize(
    ("spelling", "unit", "si"),
    [
        ("lbf", "lbf", 4.44822),
        ("lbf·ft", "lbf ft", 1.355818),
        ("ft-lb", "lbf ft", 1.355818),
        ("lbf in", "lbf in", 0.1129848),
        ("in.lb", "lbf in", 0.1129848),
        ("oz-in", "ozf in", 0.00706155),
        ("kgf cm", "kgf cm", 0.0980665),
        ("Ncm", "N cm", 0.01),
    ],
)
def test_forces_and_torques_of_other_systems(spelling: str, unit: str, si: float) -> None:
    assert unit_named(spelling) == unit
    assert si_factor(unit, "N" if unit == "lbf" else "N m") == pytest.approx(si, rel=1e-5)
    assert QUANTITY_OF_UNIT[unit] == "effort"


@pytest.mark.parametrize(
    ("name", "rest", "unit"),
    [
        ("torque_lbf_in", "torque", "lbf in"),
        ("Torque [lbf in]", "Torque", "lbf in"),
        ("speed (in/s)", "speed", "in/s"),
        ("Drehzahl_1/min", "Drehzahl", "rpm"),
        ("v_axis_mm/s", "v_axis", "mm/s"),
        ("pos/mm", "pos", "mm"),
    ],
)
def test_a_unit_in_the_name_of_a_column(name: str, rest: str, unit: str) -> None:
    assert split_unit(name) == (rest, unit, False)


def test_names_in_italian_and_spanish() -> None:
    wanted, given = label("posizione comandata [mm]"), label("posición medida [mm]")
    assert (wanted.quantity, wanted.command, wanted.unit) == (Quantity.POSITION, True, "mm")
    assert (given.quantity, given.measured, given.command) == (Quantity.POSITION, True, False)
    assert label("velocità [rpm]").quantity is Quantity.VELOCITY
    assert label("forza [N]").quantity is Quantity.EFFORT


@pytest.mark.parametrize("name", ["pos_motor_grados", "angolo [gradi]", "Ángulo (grados)"])
def test_degrees_in_spanish_and_italian(name: str) -> None:
    assert split_unit(name)[1] == "deg"


@pytest.mark.parametrize(
    "name", ["set_rev", "pos_rev", "pos [rev]", "Lage_Umdr", "Umdr", "turns", "Position U", "q_turns"]
)
def test_revolutions_are_a_unit_of_a_position(name: str) -> None:
    assert (label(name).unit, label(name).quantity) == ("rev", Quantity.POSITION)


@pytest.mark.parametrize(("name", "unit"), [("motor_u", None), ("speed_rev", None), ("pos_min", None), ("U", None)])
def test_what_is_no_revolution(name: str, unit: str | None) -> None:
    assert label(name).unit == unit


@pytest.mark.parametrize(("name", "unit"), [("rpm", "rpm"), ("trq_pct_avg", "%"), ("vel_rpm_mean", "rpm")])
def test_a_unit_that_is_the_name_or_stands_before_its_last_word(name: str, unit: str) -> None:
    assert label(name).unit == unit


@pytest.mark.parametrize(("name", "unit"), [("phi_M", None), ("phi_m", "m"), ("POS_M", "m")])
def test_a_capital_is_no_metre_where_the_name_has_small_letters(name: str, unit: str | None) -> None:
    assert split_unit(name)[1] == unit


@pytest.mark.parametrize(("turn", "unit"), [(360.0, "deg"), (2.0 * np.pi, "rad")])
def test_an_angle_without_a_unit_that_starts_again_after_a_turn_tells_it(
    tmp_path: Path, turn: float, unit: str
) -> None:
    columns = axis()
    angle = np.mod(columns["angle"] / (2.0 * np.pi) * turn, turn)
    draft = draft_map(
        write(tmp_path / "log.csv", {"time_s": columns["t"], "ActPos": angle, "torque_Nm": columns["torque"]})
    )
    (position,) = (one.entry for one in draft.channels if one.channel == "motor_position_rad")
    assert position["unit"] == unit
    assert any(f"it is unwrapped, and in {unit}" in note for note in draft.unsure)
