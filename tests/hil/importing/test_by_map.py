"""Foreign recordings become channels in SI by a map; what does not fit is refused with file, row and column."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from hil.channels import AxisKind
from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.quantities import UNITS, si_factor
from hil.recording.recording import read_recording, write_parquet

MAP: dict[str, Any] = {
    "about": "a rotary axis recorded by a drive",
    "time": {"column": "t", "unit": "ms"},
    "lead_m": 0.010,
    "channels": {
        "position_command_m": {"column": "x_set", "unit": "mm"},
        "motor_position_rad": {"column": "enc", "unit": "counts", "counts_per_rev": 4096, "sign": -1},
        "torque_n_m": {"column": "i", "unit": "A", "torque_constant_n_m_a": 1.4, "offset": 0.5},
    },
}
T_MS = np.array([10.0, 11.0, 12.0, 13.0, 14.0])
COLUMNS = {
    "t": T_MS,
    "x_set": np.array([0.0, 1.0, 4.0, 9.0, 16.0]),
    "enc": -4096 * np.arange(5.0),
    "i": np.array([0.0, 1.0, 2.0, 3.0, 4.0]),
}


def changed(**channels: Any) -> dict[str, Any]:
    """The map with other channels; None removes one."""
    merged = {**MAP["channels"], **channels}
    return {**MAP, "channels": {name: entry for name, entry in merged.items() if entry is not None}}


def write_map(tmp_path: Path, content: dict[str, Any] = MAP) -> Path:
    path = tmp_path / "map.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return path


def write_csv(tmp_path: Path, columns: dict[str, Any] = COLUMNS, delimiter: str = ",") -> Path:
    path = tmp_path / "log.csv"
    rows = zip(*columns.values(), strict=True)
    lines = [delimiter.join(columns), *(delimiter.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_source(tmp_path: Path, ending: str, columns: dict[str, Any] = COLUMNS) -> Path:
    path = tmp_path / f"log.{ending}"
    if ending == "csv":
        return write_csv(tmp_path, columns)
    if ending == "mat":
        savemat(path, columns)
    else:
        pq.write_table(pa.table(columns), path)
    return path


@pytest.mark.parametrize("ending", ["csv", "mat", "parquet"])
def test_each_format_gives_channels_in_si(tmp_path: Path, ending: str) -> None:
    recording = import_recording(write_source(tmp_path, ending), write_map(tmp_path))
    assert recording.kind is AxisKind.ROTARY
    assert recording.period_s == pytest.approx(1e-3)
    np.testing.assert_allclose(recording["time_s"], T_MS * 1e-3)
    np.testing.assert_allclose(recording["position_command_m"], [0, 0.001, 0.004, 0.009, 0.016])
    np.testing.assert_allclose(recording["motor_position_rad"], 2 * pi * np.arange(5))
    np.testing.assert_allclose(recording["torque_n_m"], 0.5 + 1.4 * np.arange(5))
    assert recording.metadata["source"] == f"log.{ending}"


def test_what_can_be_derived_is_derived_and_said(tmp_path: Path) -> None:
    recording = import_recording(write_csv(tmp_path), write_map(tmp_path))
    # central differences of k^2 mm at 1 ms are exact but for the ends
    np.testing.assert_allclose(recording["velocity_command_m_s"], [1, 2, 4, 6, 7])
    assert np.array_equal(recording["torque_command_n_m"], recording["torque_n_m"])
    assert recording.metadata["derived"] == {
        "velocity_command_m_s": "central differences of position_command_m",
        "torque_command_n_m": "copy of torque_n_m, the only one recorded",
    }
    assert recording.metadata["clock"].startswith("period 0.001 s")


def test_an_import_can_be_stored_and_read_back(tmp_path: Path) -> None:
    recording = import_recording(write_csv(tmp_path), write_map(tmp_path))
    write_parquet(recording, tmp_path / "run.parquet")
    back = read_recording(tmp_path / "run.parquet")
    assert back.metadata == recording.metadata
    assert all(np.array_equal(back[name], values) for name, values in recording.columns.items())


def test_csv_of_a_german_oscilloscope(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "Aufnahme 7\nGerät X\nt;x_set;enc;i\nms;mm;-;A\n10;0,5;0;0\n11;1,5;0;0\n12;2,5;0;0\n", encoding="latin-1"
    )
    csv = {"delimiter": ";", "decimal_point": ",", "skip_lines": 2, "skip_rows": 1, "encoding": "latin-1"}
    recording = import_recording(path, write_map(tmp_path, {**MAP, "csv": csv}))
    np.testing.assert_allclose(recording["position_command_m"], [0.0005, 0.0015, 0.0025])
    path.write_text(path.read_text(encoding="latin-1").replace("11;1,5", "11;1.5"), encoding="latin-1")
    with pytest.raises(InputError, match=r"log\.csv:6: x_set: given '1\.5', allowed a finite number"):
        import_recording(path, write_map(tmp_path, {**MAP, "csv": csv}))


def test_csv_without_header_and_without_time(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("0,0,0\n1,0,0\n4,0,0\n")
    content = {**MAP, "sample_rate_hz": 2000, "csv": {"column_names": ["x_set", "enc", "i"]}}
    del content["time"]
    recording = import_recording(path, write_map(tmp_path, content))
    assert recording.period_s == 0.0005
    np.testing.assert_allclose(recording["time_s"], [0, 0.0005, 0.001])


def test_matrix_columns_and_gains_of_a_mat_file(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {**COLUMNS, "both": np.column_stack([COLUMNS["i"], 2 * COLUMNS["i"]]), "k": 0.25})
    torque = {"column": "both[1]", "unit": "V", "gain": "k"}
    recording = import_recording(path, write_map(tmp_path, changed(torque_n_m=torque)))
    np.testing.assert_allclose(recording["torque_n_m"], 0.5 * np.arange(5))
    for column, message in (("both", "has the shape 5 x 2, allowed a vector"), ("both[2]", "shape 5 x 2")):
        with pytest.raises(InputError, match=message):
            import_recording(path, write_map(tmp_path, changed(torque_n_m={**torque, "column": column})))
    with pytest.raises(InputError, match="both: given 10 values, allowed one finite number"):
        import_recording(path, write_map(tmp_path, changed(torque_n_m={**torque, "gain": "both"})))


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({"unit": "deg"}, pi / 180),
        ({"unit": "rev"}, 2 * pi),
        ({"unit": "mm"}, 2 * pi / 10),
        ({"unit": "um"}, 2 * pi / 10e3),
        ({"unit": "counts", "counts_per_m": 1000}, 2 * pi / 10),
        ({"unit": "rad", "scale": 3, "sign": -1}, -3),
    ],
)
def test_a_motor_encoder_in_any_unit(tmp_path: Path, entry: dict[str, Any], expected: float) -> None:
    content = changed(motor_position_rad={"column": "i", **entry})
    recording = import_recording(write_csv(tmp_path), write_map(tmp_path, content))
    np.testing.assert_allclose(recording["motor_position_rad"], expected * np.arange(5))


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({"unit": "rpm"}, 0.010 / 60),
        ({"unit": "m/min"}, 1 / 60),
        ({"unit": "mm/min"}, 1e-3 / 60),
        ({"unit": "rad/s"}, 0.010 / (2 * pi)),
        ({"unit": "V", "gain": 0.1}, 0.1),
        ({"unit": "%", "rated": 0.5}, 0.005),
        ({"unit": "permille", "rated": 0.5}, 0.0005),
    ],
)
def test_a_velocity_command_in_any_unit(tmp_path: Path, entry: dict[str, Any], expected: float) -> None:
    content = changed(velocity_command_m_s={"column": "i", **entry})
    recording = import_recording(write_csv(tmp_path), write_map(tmp_path, content))
    np.testing.assert_allclose(recording["velocity_command_m_s"], expected * np.arange(5))
    assert "velocity_command_m_s" not in recording.metadata["derived"]


@given(unit=st.sampled_from(sorted(UNITS)), lead_m=st.floats(1e-3, 0.1))
def test_conversion_by_the_lead_inverts(unit: str, lead_m: float) -> None:
    own, factor = UNITS[unit]
    assert si_factor(unit, own) == factor
    for other in ("m", "rad", "m/s", "rad/s", "m/s^2", "rad/s^2"):
        there, back = si_factor(unit, other, lead_m), si_factor(other, own, lead_m)
        assert (there is None) == (back is None)
        if there is not None and back is not None:
            assert there * back == pytest.approx(factor)


def damaged(name: str, row: int, value: Any) -> dict[str, Any]:
    values: list[Any] = COLUMNS[name].tolist()
    values[row] = value
    return {**COLUMNS, name: values}


@pytest.mark.parametrize(
    ("ending", "columns", "message"),
    [
        ("csv", damaged("enc", 2, "x"), r"log\.csv:4: enc: given 'x', allowed a finite number"),
        ("csv", damaged("enc", 2, "nan"), r"log\.csv:4: enc: given 'nan'"),
        ("csv", damaged("t", 2, 11.0), r"log\.csv:4: t: time_s: repeats"),
        ("csv", damaged("t", 2, 9.0), r"log\.csv:4: t: time_s: runs back"),
        ("csv", damaged("t", 4, 24.0), r"log\.csv:6: t: time_s: a step of 0\.011 s, allowed the period 0\.001 s"),
        ("csv", {"t": T_MS}, r"log\.csv: column 'x_set' is missing; the file has t"),
        ("mat", damaged("enc", 2, np.nan), r"log\.mat: row 3: enc: given nan"),
        ("mat", damaged("t", 2, 9.0), r"log\.mat: row 3: t: time_s: runs back"),
        ("mat", {"t": T_MS}, r"log\.mat: column 'x_set' is missing; the file has t"),
        ("mat", {**COLUMNS, "enc": np.arange(4.0)}, r"log\.mat: enc: given 4 rows, x_set has 5"),
        ("mat", {**COLUMNS, "enc": "text"}, r"log\.mat: enc: given values of the type .*U"),
        ("parquet", damaged("i", 4, None), r"log\.parquet: row 5: i: given nan"),
        ("parquet", {**COLUMNS, "i": list("abcde")}, r"log\.parquet: i: given string values"),
        ("parquet", {"t": T_MS}, r"log\.parquet: column 'x_set' is missing; the file has t"),
    ],
)
def test_a_damaged_source_is_refused(tmp_path: Path, ending: str, columns: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        import_recording(write_source(tmp_path, ending, columns), write_map(tmp_path))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("log.xlsx", r"the ending '\.xlsx' cannot be imported, allowed \.csv, \.mat, \.parquet"),
        ("log.mat", r"log\.mat: is no readable \.mat file"),
        ("log.parquet", r"log\.parquet: is no readable Parquet file"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / name).write_bytes(b"PK\x03\x04\x14\x00")
    with pytest.raises(InputError, match=message):
        import_recording(tmp_path / name, write_map(tmp_path))
    with pytest.raises(InputError, match="there is no such file"):
        import_recording(tmp_path / "absent.csv", write_map(tmp_path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            changed(torque_n_m={"column": "i", "unit": "kg"}),
            r"channels\.torque_n_m\.unit: given 'kg', "
            "allowed N m, Nm, mN m, mNm, .*counts, A",
        ),
        (changed(torque_n_m={"column": "i", "unit": "mm"}), r"torque_n_m\.unit: given 'mm', allowed N m"),
        (
            changed(table_position_m={"column": "x_set", "unit": "deg"}),
            r"lead_m: given 0.01 beside table_position_m as an angle, allowed none",
        ),
        (
            {**changed(motor_position_rad={"column": "enc", "unit": "mm"}), "lead_m": None},
            r"unit: given 'mm', allowed rad, .*if lead_m is given",
        ),
        (changed(torque_n_m={"column": "i", "unit": "A"}), "unit: 'A' needs exactly one of torque_constant_n_m_a"),
        (changed(torque_n_m={"column": "i", "unit": "A", "force_constant_n_a": 2.0}), "unit: given 'A'"),
        (changed(torque_n_m={"column": "i", "unit": "N m", "gain": 2.0}), "gain: is of no use for the unit 'N m'"),
        (changed(torque_n_m={"column": "i", "unit": "N m", "factor": 2.0}), "factor: given an unknown key"),
        (changed(torque_n_m={"column": "i", "unit": "N m", "sign": 2}), "sign: given 2, allowed 1 or -1"),
        (changed(torque_n_m={"column": "i", "unit": "N m", "scale": "2"}), "scale: given '2', allowed a valid number"),
        (
            changed(torque={"column": "i", "unit": "N m"}),
            r"channels\.torque: is no channel, allowed position_command_m",
        ),
        (changed(torque_n_m=None), "torque_n_m and torque_command_n_m are missing"),
        (changed(motor_position_rad=None), "motor_position_rad is missing"),
        ({**MAP, "sample_rate_hz": 1000}, "given neither or both of time and sample_rate_hz"),
    ],
)
def test_a_wrong_map_is_refused_with_line_and_field(tmp_path: Path, content: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=rf"map\.yaml:\d+: .*{message}"):
        import_recording(write_csv(tmp_path), write_map(tmp_path, content))


def test_the_line_of_a_wrong_unit_is_named(tmp_path: Path) -> None:
    content = changed(torque_n_m={"column": "i", "unit": "kg"})
    line = yaml.safe_dump(content, sort_keys=False).splitlines().index("    unit: kg") + 1
    with pytest.raises(InputError, match=rf"map\.yaml:{line}: channels\.torque_n_m\.unit: given 'kg'"):
        import_recording(write_csv(tmp_path), write_map(tmp_path, content))


def test_a_gain_by_name_needs_a_mat_file(tmp_path: Path) -> None:
    content = changed(torque_n_m={"column": "i", "unit": "V", "gain": "k"})
    with pytest.raises(InputError, match=r"log\.csv: the map takes k from the file by name"):
        import_recording(write_csv(tmp_path), write_map(tmp_path, content))


def test_a_set_point_that_is_an_angle_of_the_motor_needs_no_lead(tmp_path: Path) -> None:
    """One metre of the load stands for one radian, as in a draft of an axis that turns."""
    content = {**changed(position_command_m={"column": "x_set", "unit": "deg"}), "lead_m": None}
    recording = import_recording(write_csv(tmp_path), write_map(tmp_path, content))
    np.testing.assert_allclose(recording["position_command_m"], np.radians(COLUMNS["x_set"]))
    content["channels"]["motor_position_rad"] = {"column": "enc", "unit": "mm"}
    with pytest.raises(InputError, match="if lead_m is given"):
        import_recording(tmp_path / "log.csv", write_map(tmp_path, content))
