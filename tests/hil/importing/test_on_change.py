"""A column that is written only where it changes holds its value; lost values of a measured one stay gaps."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, csv_text, renamed

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text
from hil.importing.on_change import columns_on_change, held, written_on_change

AXIS = axis()
T = AXIS["t"]
MOVES = np.concatenate([np.full(300, 0.0), np.cumsum(np.hanning(300)), np.full(400, 150.0)])
SET = np.round(np.tile(np.r_[MOVES, MOVES[::-1]], 2), 4)  # rests, moves, rests, and back


def on_change(values: np.ndarray) -> np.ndarray:
    return np.where(np.r_[True, np.diff(values) != 0.0], values, np.nan)


def test_the_last_value_is_held_and_the_first_one_before_it() -> None:
    np.testing.assert_array_equal(held(np.array([np.nan, 2.0, np.nan, np.nan, 5.0])), [2.0, 2.0, 2.0, 2.0, 5.0])


def test_a_set_point_written_on_change_is_told() -> None:
    assert written_on_change(np.tile(on_change(SET), 3))


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6])
def test_values_that_are_lost_in_a_motion_do_not_hold(share: float) -> None:
    random = np.random.default_rng(4)
    lost = AXIS["angle"] + random.normal(0.0, 1e-4, T.size)
    lost[random.random(T.size) < share] = np.nan
    assert not written_on_change(lost)
    assert not written_on_change(np.where(np.arange(T.size) % 5 == 0, AXIS["angle"], np.nan))  # another rate
    assert not written_on_change(AXIS["angle"])


def columns_at(values: np.ndarray) -> dict[str, np.ndarray]:
    """An axis that follows `values` [mm] exactly, in the columns of a log."""
    speed = np.gradient(values, T)
    torque = 1e-3 * np.gradient(speed, T) + 0.4 * np.sign(speed) + np.random.default_rng(3).normal(0.0, 0.01, T.size)
    return {"time_s": T, "set_mm": values, "motor_mm": values + 1e-4 * torque, "force_N": torque}


def text_with_empty_cells(columns: dict[str, np.ndarray]) -> str:
    return csv_text(columns).replace("nan", "")


def test_noise_with_few_digits_tells_a_value_that_holds() -> None:
    random = np.random.default_rng(6)
    noisy = np.round(AXIS["torque"] + random.normal(0.0, 0.05, T.size), 2)
    assert written_on_change(on_change(noisy))
    assert not written_on_change(np.where(random.random(T.size) < 0.3, np.nan, noisy))
    rarely = np.where(random.random(T.size) < 0.01, np.nan, AXIS["speed"])
    assert columns_on_change({"a": on_change(noisy), "b": AXIS["angle"], "c": rarely}) == ["a", "c"]
    assert columns_on_change({"b": noisy, "c": rarely}) == []


@pytest.mark.parametrize("form", ["attributes", "elements", "lines of JSON"])
def test_records_without_the_values_that_stay_are_imported(tmp_path: Path, form: str) -> None:
    texts = {"speed_rpm": AXIS["speed"] * 30.0 / np.pi, "torque_Nm": AXIS["torque"]}
    columns = {name: on_change(np.round(values, 1 if "rpm" in name else 2)) for name, values in texts.items()}
    records = [
        {"t_ms": round(1e3 * t)} | {name: float(one[k]) for name, one in columns.items() if np.isfinite(one[k])}
        for k, t in enumerate(T)
    ]
    write = {
        "attributes": lambda one: f"<r {' '.join(f'{key}={str(value)!r}' for key, value in one.items())}/>",
        "elements": lambda one: f"<r>{''.join(f'<{key}>{value}</{key}>' for key, value in one.items())}</r>",
        "lines of JSON": json.dumps,
    }[form]
    lines = [write(one) for one in records]
    path, map_path = tmp_path / ("log.jsonl" if "JSON" in form else "log.xml"), tmp_path / "map.yaml"
    path.write_text("\n".join(lines if "JSON" in form else ['<log xmlns="urn:axis">', *lines, "</log>"]))
    map_path.write_text(map_text(draft_map(path)))
    recording = import_recording(path, map_path)
    np.testing.assert_allclose(recording["torque_n_m"], np.round(AXIS["torque"], 2), atol=1e-9)


def test_a_file_with_a_set_point_on_change_is_imported(tmp_path: Path) -> None:
    path, map_path = tmp_path / "log.csv", tmp_path / "map.yaml"
    columns = columns_at(SET)
    path.write_text(text_with_empty_cells(columns | {"set_mm": on_change(SET)}))
    draft = draft_map(path)
    assert any("written only where it changes" in note for note in draft.unsure)
    map_path.write_text(map_text(draft))
    np.testing.assert_allclose(import_recording(path, map_path)["position_command_m"], 1e-3 * SET, atol=1e-9)


def test_lost_values_of_a_measured_column_are_refused_as_before(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    motor = np.where(np.random.default_rng(5).random(T.size) < 0.3, np.nan, AXIS["angle"])
    path.write_text(text_with_empty_cells(renamed(AXIS | {"angle": motor}, t="time_s", angle="q_rad", torque="tau_Nm")))
    with pytest.raises(InputError, match="q_rad has no number in"):
        draft_map(path)
