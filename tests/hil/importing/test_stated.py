"""What a file states by name, beside its columns or as a column, is used and not asked, unless it contradicts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from foreign_axis import axis, renamed, write
from scipy.io import savemat

from hil.importing.column_names import label
from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft
from hil.importing.stated import Stated

AXIS = axis()
AMPS = renamed(AXIS | {"torque": AXIS["torque"] / 0.8}, t="time_s", angle="motor_angle_rad", torque="current_A")


def drafted(path: Path, stated: dict[str, Any], columns: dict[str, np.ndarray] = AMPS) -> MapDraft:
    """Draft of a file with `columns` and what it states beside them."""
    match path.suffix:
        case ".json":
            lists = {name: values.tolist() for name, values in columns.items()}
            path.write_text(json.dumps({"config": stated, "data": lists}))
        case ".mat":
            savemat(path, {"config": stated, "data": columns})
        case ".npz":
            np.savez(path, **columns, **stated)
        case ".parquet":
            table = pa.table({name: pa.array(values) for name, values in columns.items()})
            texts = {name: str(value) for name, value in stated.items()}
            pq.write_table(table.replace_schema_metadata(texts), path)
        case _:
            write(path, columns | {name: np.full(columns["time_s"].size, value) for name, value in stated.items()})
    return draft_map(path)


def constant(draft: MapDraft) -> object:
    (entry,) = [one.entry for one in draft.channels if one.channel == "torque_n_m"]
    return None if [one for one in draft.asked if one.key != "unit"] else entry["torque_constant_n_m_a"]


@pytest.mark.parametrize(
    ("ending", "stated", "value"),
    [
        (".json", {"m1": {"torque_constant": 0.8, "torque_constant_unit": "Nm/A"}}, 0.8),
        (".json", {"axis0.motor.kt": 800.0, "axis0.motor.kt_unit": "mNm/A"}, 0.8),
        (".json", {"kt": {"value": 0.8, "unit": "Nm/A"}}, 0.8),
        (".json", {"torque_constant": "0.8 Nm/A"}, 0.8),
        (".json", {"torqueConstant": 0.8}, 0.8),
        (".mat", {"kt": 800.0, "kt_unit": "mNm/A", "motor": "M1"}, 0.8),
        (".mat", {"kt": 0.8}, 0.8),
        (".npz", {"kt": 800.0, "kt_unit": "mNm/A"}, 0.8),
        (".parquet", {"kt": 800.0, "kt_unit": "mNm/A"}, 0.8),
        (".parquet", {"torque_constant": "0.8 Nm/A"}, 0.8),
        (".csv", {"kt [mNm/A]": 800.0}, 0.8),
        (".csv", {"torque constant (Nm/A)": 0.8}, 0.8),
        (".json", {"m1": {"kt": 0.8, "kt_unit": "Nm/A"}, "m2": {"kt": 0.7, "kt_unit": "Nm/A"}}, None),
        (".json", {"kt": 0.8, "kt_unit": "N/A"}, None),
        (".json", {"kt_max": 0.8}, None),
        (".json", {"kt": -0.8}, None),
        (".csv", {"kv [V/rpm]": 0.8}, None),
    ],
)
def test_a_torque_constant_by_name_is_used(tmp_path: Path, ending: str, stated: dict[str, Any], value: float) -> None:
    draft = drafted(tmp_path / f"log{ending}", stated)
    assert constant(draft) == (None if value is None else pytest.approx(value))
    assert any("of the file" in note for note in draft.unsure) == (value is not None)


def test_a_constant_in_every_row_counts_only_where_it_is_one() -> None:
    columns = {"kt": np.full(5, 0.8), "cpr": np.array([4096.0, 4096.0, np.nan, 4096.0, 4096.0])}
    assert [str(one) for one in Stated().constants((), columns, {"kt": "Nm/A"})] == ["torque_constant"]


def test_units_of_columns_by_texts_of_their_names(tmp_path: Path) -> None:
    plain = renamed(AXIS, t="time", angle="motor_angle", torque="torque")
    draft = drafted(
        tmp_path / "log.mat", {}, plain | {"torque_unit": "Nm", "motor_angle_unit": "rad", "time_unit": "s"}
    )  # type: ignore[dict-item]
    assert not draft.asked
    entries = {one.channel: one.entry["unit"] for one in draft.channels}
    assert entries == {"motor_position_rad": "rad", "torque_n_m": "N m"}


@pytest.mark.parametrize(
    ("words", "unit"),
    [
        ("0x6077 in 1/1000 of rated torque", "permille"),
        ("torque in % of the rated one", "%"),
        ("Istmoment in ‰ des Nennmoments", "permille"),
        ("torque of the motor", None),
        ("1000 of them", None),
    ],
)
def test_the_part_of_a_rated_value_is_read_from_words(words: str, unit: str | None) -> None:
    assert label("torque", "(None)", words).unit == unit
