"""Cells with their units, which may change from cell to cell."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis
from hypothesis import given
from hypothesis import strategies as st

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.cell_units import read_cells
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text
from hil.importing.number_form import NumberForm
from hil.importing.records import read_records

AXIS = axis(2400)
T, ANGLE, SPEED, TORQUE = AXIS["t"], AXIS["angle"], AXIS["speed"], AXIS["torque"]
LINES = [
    "t,angle,torque",
    *(f"{1e3 * t:.0f} ms,{a:.6f} rad,{m:.5f} Nm" for t, a, m in zip(T, ANGLE, TORQUE, strict=True)),
]


@given(
    st.lists(st.floats(-1e6, 1e6, allow_subnormal=False), min_size=3, max_size=20),
    st.sampled_from([".", ","]),
    st.booleans(),
)
def test_any_numbers_are_read_in_one_unit(values: list[float], decimal: str, blank: bool) -> None:
    units = ((" " if blank else "") + unit for unit in ("mN·m", "N·m", "kNm"))
    factors = dict(zip(units, (1e-3, 1.0, 1e3), strict=True))
    cells = [
        f"{value / factor!r}".replace(".", decimal) + unit
        for k, value in enumerate(values)
        for unit, factor in [list(factors.items())[k % 3]]
    ]
    read = read_cells(cells, NumberForm(decimal))
    assert (read.unit, read.texts) == ("N m", {})
    np.testing.assert_allclose(read.values, values, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize(
    ("cells", "unit", "values", "texts"),
    [
        (["12.3 mm", "1.5 cm", "0", "0.2 m"], "m", [0.0123, 0.015, 0.0, 0.2], {}),
        (["1500 1/min", "-30 rpm", "3.14159265 rad/s"], "rad/s", [157.0796, -3.14159, 3.14159], {}),
        (["145 mA", "1.2 A", "-", ""], "A", [0.145, 1.2, np.nan, np.nan], {}),
        (["12 %", "1 ‰", "-3 %"], "%", [12.0, 0.1, -3.0], {}),
        (["1e-3 Nm", "1.5E2Nm", "+2 Nm"], "N m", [1e-3, 150.0, 2.0], {}),
        (["1 mm", "2 deg", "3 mm"], "m", [1e-3, np.nan, 3e-3], {1: "2 deg"}),
        (["1 mm", "2", "3 mm"], "m", [1e-3, np.nan, 3e-3], {1: "2"}),
        (["1 mm", "2 blobs", "3 mm"], "m", [1e-3, np.nan, 3e-3], {1: "2 blobs"}),
        (["1", "2 mm", "3"], "", [1.0, np.nan, 3.0], {1: "2 mm"}),
        (["1 MNm", "2 MNm"], "", [np.nan, np.nan], {0: "1 MNm", 1: "2 MNm"}),  # mega, or milli in capitals
    ],
)
def test_cells_of_one_quantity_become_one_unit(
    cells: list[str], unit: str, values: list[float], texts: dict[int, str]
) -> None:
    read = read_cells(cells, NumberForm("."))
    assert (read.unit, read.texts) == (unit, texts)
    np.testing.assert_allclose(read.values, values, rtol=1e-5)


VARIANTS = {
    "times and angles": LINES,
    "semicolons and decimal commas": [
        "Zeit;Winkel;Moment",
        *(
            f"{t:.3f} s;{np.rad2deg(a):.4f}°;{100 * m:.3f} Ncm".replace(".", ",")
            for t, a, m in zip(T, ANGLE, TORQUE, strict=True)
        ),
    ],
    "another unit in the name": [
        "torque (mNm)\tposition [deg]\ttime [s]",
        *(f"{m:.5f} N·m\t{a / 2 / np.pi:.7f} rev\t{1e3 * t:.1f} ms" for t, a, m in zip(T, ANGLE, TORQUE, strict=True)),
    ],
    "units beside the values": [
        "t;angle;unit;torque;unit",
        *(
            f"{t:.4f};{np.rad2deg(a):.5f};deg;" + (f"{1e3 * m:.2f};mNm" if abs(m) < 1 else f"{m:.5f};Nm")
            for t, a, m in zip(T, ANGLE, TORQUE, strict=True)
        ),
    ],
    "units by size": [
        "t;angle;torque",
        *(
            f"{t:.4f};{f'{a:.5f} rad' if abs(a) > 1 else f'{1e3 * a:.2f} mrad'};"
            f"{f'{1e3 * m:.1f} mN m' if abs(m) < 1 else f'{m:.4f} N m'}"
            for t, a, m in zip(T, ANGLE, TORQUE, strict=True)
        ),
    ],
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_file_of_cells_with_units_is_imported(tmp_path: Path, variant: str) -> None:
    path, map_path = tmp_path / "log.csv", tmp_path / "map.yaml"
    path.write_text("\n".join(VARIANTS[variant]) + "\n", encoding="utf-8")
    draft = draft_map(path)
    assert not draft.asked
    assert any("its cells hold their units" in note for note in draft.unsure)
    map_path.write_text(map_text(draft), encoding="utf-8")
    recording = import_recording(path, map_path)
    assert recording.period_s == pytest.approx(1e-3)
    np.testing.assert_allclose(recording["motor_position_rad"], ANGLE, atol=1e-4)
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE, atol=1e-3)


def test_a_state_beside_a_value_is_no_unit(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = (f"{t:.4f},{a:.6f},{m:.5f},N" for t, a, m in zip(T, ANGLE, TORQUE, strict=True))
    path.write_text("\n".join(["t,angle_rad,torque_Nm,fault", *rows]))
    draft = draft_map(path)
    assert not draft.table.cell_units
    assert draft.left_out["fault"] == "text such as 'N', no numbers"


def test_texts_of_records_are_read_with_their_units(tmp_path: Path) -> None:
    path, map_path = tmp_path / "log.json", tmp_path / "map.yaml"
    rows = [
        {"t": f"{1e3 * t:.0f} ms", "angle": f"{a:.6f} rad", "torque": f"{m:.5f} Nm"}
        for t, a, m in zip(T, ANGLE, TORQUE, strict=True)
    ]
    path.write_text(json.dumps(rows))
    map_path.write_text(map_text(draft_map(path)))
    np.testing.assert_allclose(import_recording(path, map_path)["torque_n_m"], TORQUE, atol=1e-5)
    rows[900]["torque"] = "1.0 rpm"
    path.write_text(json.dumps(rows))
    with pytest.raises(InputError, match=r"log\.json:901: torque: given '1\.0 rpm', allowed a finite number"):
        import_recording(path, map_path)


def test_a_unit_of_the_map_is_that_to_which_cells_are_converted(tmp_path: Path) -> None:
    path, map_path = tmp_path / "log.csv", tmp_path / "map.yaml"
    path.write_text("\n".join(LINES) + "\n")
    text = map_text(draft_map(path))
    map_path.write_text(text.replace('unit: "N m"', 'unit: "mN m"').replace("unit: s ", "unit: ms "))
    np.testing.assert_allclose(import_recording(path, map_path)["torque_n_m"], TORQUE, atol=1e-5)
    map_path.write_text(text.replace('unit: "N m"', "unit: A\n    torque_constant_n_m_a: 2.0"))
    with pytest.raises(InputError, match=r"torque: given 'A' in the map, its cells hold units of N m"):
        import_recording(path, map_path)


@pytest.mark.parametrize("cell", ["0.5", "0.5 rpm", "0.5 MNm", "0.5 Nq", "x Nm"])
def test_a_cell_of_no_such_unit_is_named(tmp_path: Path, cell: str) -> None:
    path, map_path = tmp_path / "log.csv", tmp_path / "map.yaml"
    path.write_text("\n".join(LINES) + "\n")
    map_path.write_text(map_text(draft_map(path)))
    lines = [*LINES[:900], f"{LINES[900].rpartition(',')[0]},{cell}", *LINES[901:]]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=rf"log\.csv:901: torque .*given '{cell}', allowed a number in N m"):
        draft_map(path)
    with pytest.raises(InputError, match=rf"log\.csv:901: torque: given '{cell}', allowed a number with its unit"):
        import_recording(path, map_path)


@pytest.mark.parametrize("ending", ["xml", "json"])
@pytest.mark.parametrize("begin", [20_000, 0])
def test_texts_of_records_have_thousands(tmp_path: Path, ending: str, begin: int) -> None:
    """20,000 um are 20 mm, also where every position has a mark between thousands."""
    path, place = tmp_path / f"log.{ending}", begin + 1e4 * (ANGLE - ANGLE.min())
    values = zip(T, place, TORQUE, strict=True)
    rows = [{"t": f"{t:.3f}", "x_um": f"{x:,.0f}", "m_Nm": f"{m:.5f}"} for t, x, m in values]
    lines = ["<r " + " ".join(f"{name}={text!r}" for name, text in row.items()) + "/>" for row in rows]
    path.write_text(json.dumps(rows) if ending == "json" else f"<D>{''.join(lines)}</D>")
    read = read_records(path).columns.lists
    assert np.array(read["x_um"]) == pytest.approx(np.round(place))
    assert np.array(read["m_Nm"]) == pytest.approx(np.round(TORQUE, 5))


def test_a_first_row_of_values_with_units_is_no_row_of_factors(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    bare = [f"{line.rpartition(',')[0]},{m:.5f}" for line, m in zip(LINES[2:], TORQUE[1:], strict=True)]
    path.write_text("\n".join(["t,angle,torque", LINES[1].replace(LINES[1].split(" ")[0], "0"), *bare]) + "\n")
    assert not any(draft_map(path).table.scales.values())


@pytest.mark.parametrize(("many", "refused"), [(50, False), (51, True)])
def test_many_rows_without_a_number_are_no_footer(tmp_path: Path, many: int, refused: bool) -> None:
    path = tmp_path / "log.csv"
    lines = [f"{t:.3f};{a:.6f};{m:.5f}" for t, a, m in zip(T, ANGLE, TORQUE, strict=True)]
    path.write_text("\n".join(["t;angle;torque", *lines, *["1-5;0-2;0-1"] * many]) + "\n")
    if not refused:
        assert any("text after the last row" in note for note in draft_map(path).table.notes)
        return
    with pytest.raises(InputError, match=rf"log\.csv:{len(lines) + 2}: no number as in the rows before"):
        draft_map(path)


def test_nm_in_a_cell_may_be_nanometres() -> None:
    assert read_cells(["12345 nm", "12400 nm"], NumberForm()).unit == ""


def test_a_column_without_a_name_is_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    path.write_text(json.dumps({"": ANGLE.tolist(), "t": T.tolist(), "angle": ANGLE.tolist(), "m_Nm": TORQUE.tolist()}))
    table = draft_map(path).table
    assert "" not in table.columns
    assert any("without a name" in remark for remark in table.remarks)
