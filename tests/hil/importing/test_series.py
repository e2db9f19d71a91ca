"""Rows of one value each (time, channel, value) as columns: CSV, JSON, with units, quality, several devices."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text
from hil.recording.recording import Recording

AXIS = axis(2400)
T, ANGLE, TORQUE = AXIS["t"], AXIS["angle"], AXIS["torque"]
DEG = np.rad2deg(ANGLE)
STAMPS = [f"2024-05-01T08:00:{k // 1000:02d}.{k % 1000:03d}Z" for k in range(T.size)]


def in_turn(form: Callable[[int, str, float, str], str]) -> list[str]:
    """Lines of angle and torque in turn, with row, name, value and unit."""
    return [
        form(k, *one) for k in range(T.size) for one in (("angle", DEG[k], "deg"), ("torque", 1e3 * TORQUE[k], "mN m"))
    ]


def imported(path: Path, content: str) -> tuple[MapDraft, Recording]:
    path.write_text(content, encoding="utf-8")
    draft = draft_map(path)
    by_map = path.with_name("map.yaml")
    by_map.write_text(map_text(draft), encoding="utf-8")
    return draft, import_recording(path, by_map)


TABLES = {
    "channel, value, stamp with tabs": [
        "Variable\tReading\tDate",
        *in_turn(lambda k, name, value, unit: f"{name} [{unit}]\t{value:.5f}\t{STAMPS[k]}"),
    ],
    "decimal commas and units in the values": [
        "Zeit;Kanal;Wert",
        *in_turn(lambda k, name, value, unit: f"{T[k]:.4f};{name};{value:.4f} {unit}".replace(".", ",")),
    ],
    "no header, milliseconds since 1970, one channel after the other": sorted(
        in_turn(lambda k, name, value, unit: f"{name}_{unit.replace(' ', '')},{1_714_550_400_000 + k},{value:.5f}"),
        key=lambda line: line[0],
    ),
    "the newest first": [
        "time,tag,value",
        *in_turn(lambda k, name, value, unit: f"{STAMPS[k]},{name}_{unit.replace(' ', '')},{value:.5f}")[::-1],
    ],
    "a unit that changes from row to row": [
        "time_s,sensor,value,uom",
        *(
            line
            for k in range(T.size)
            for line in (
                f"{T[k]:.4f},angle,{ANGLE[k]:.6f},rad",
                f"{T[k]:.4f},torque,{TORQUE[k]:.6f},Nm" if k % 3 else f"{T[k]:.4f},torque,{1e3 * TORQUE[k]:.3f},mNm",
            )
        ),
    ],
    "two devices with the same names": [
        "ts,device,signal,val",
        *(
            line
            for k in range(T.size)
            for line in (
                f"{T[k]:.4f},fan,speed_rpm,{50 + k % 7}",
                f"{T[k]:.4f},axis,angle_deg,{DEG[k]:.5f}",
                f"{T[k]:.4f},fan,torque_Nm,{0.1 + k % 3}",
                f"{T[k]:.4f},axis,torque_Nm,{TORQUE[k]:.6f}",
            )
        ),
    ],
    "two axes one after the other, told by a tag": [
        "time,value,field,axis",
        *(
            f"{T[k]:.4f},{values[k]:.6f},{name},{axis}"
            for axis, factor in (("A1", 1.0), ("A2", 0.3))
            for name, values in (("angle_deg", factor * DEG), ("torque_Nm", factor * TORQUE))
            for k in range(T.size)
        ),
    ],
    "the same, newest first": [
        "time,value,field,axis",
        *(
            f"{T[k]:.4f},{values[k]:.6f},{name},{axis}"
            for axis, factor in (("A2", 0.3), ("A1", 1.0))
            for name, values in (("torque_Nm", factor * TORQUE), ("angle_deg", factor * DEG))
            for k in range(T.size - 1, -1, -1)
        ),
    ],
    "a part of another state before": [
        "time,value,field,state",
        *(
            f"{T[k]:.4f},{values[k]:.6f},{name},{state}"
            for state, count in (("stopped", 4), ("running", T.size))
            for name, values in (("angle_deg", DEG), ("torque_Nm", TORQUE))
            for k in range(T.size - count, T.size)
        ),
    ],
    "numbers of rows, texts and bad values": [
        '"id","timestamp","tag","value","quality"',
        *(
            line
            for k in range(T.size)
            for line in (
                f'"{3 * k}","{STAMPS[k]}","angle_deg","{DEG[k]:.5f}","Good"',
                f'"{3 * k + 1}","{STAMPS[k]}","torque_Nm","{0.0 if k in (70, 71) else TORQUE[k]:.6f}",'
                f'"{"Bad - no communication" if k in (70, 71) else "Good"}"',
                f'"{3 * k + 2}","{STAMPS[k]}","mode","{"RUN" if k % 900 else "HOLD"}","Good"',
            )
        ),
    ],
}


@pytest.mark.parametrize("table", TABLES)
def test_rows_of_one_value_are_put_together(tmp_path: Path, table: str) -> None:
    draft, recording = imported(tmp_path / "log.csv", "\n".join(TABLES[table]) + "\n")
    assert draft.table.csv.series is not None
    assert recording.period_s == pytest.approx(1e-3, rel=1e-6)
    np.testing.assert_allclose(recording["motor_position_rad"], ANGLE, atol=1e-4)
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE, atol=0.05 if "bad" in table else 1e-4)
    assert any("a value of one channel each" in note for note in draft.unsure)


def pairs(values: np.ndarray, late_s: float = 0.0) -> list[list[float]]:
    return [[1_714_550_400.0 + t + late_s, v] for t, v in zip(T.tolist(), values.tolist(), strict=True)]


DOCUMENTS: dict[str, object] = {
    "records": [
        {"time": STAMPS[k], "name": name, "value": value}
        for k in range(T.size)
        for name, value in (("angle_deg", float(DEG[k])), ("torque_Nm", float(TORQUE[k])))
    ],
    "pairs by channel": {"torque_Nm": pairs(TORQUE), "angle_rad": pairs(ANGLE + 2e-4 * AXIS["speed"], 2e-4)},
    "value before the stamp": [
        {"target": name, "datapoints": [[v, 1000 * t] for t, v in pairs(values)]}
        for name, values in (("angle_rad", ANGLE), ("torque_Nm", TORQUE))
    ],
    "two lists": [
        {"metric": {"__name__": name, "unit": unit}, "timestamps": (1e3 * T).tolist(), "values": values.tolist()}
        for name, unit, values in (("angle", "rad", ANGLE), ("torque", "N m", TORQUE))
    ],
    "an object around it": {
        "status": "success",
        "data": {
            "resultType": "matrix",
            "result": [
                {"metric": {"__name__": name}, "values": [[t, f"{v:.6f}"] for t, v in pairs(values)]}
                for name, values in (("angle_rad", ANGLE), ("torque_Nm", TORQUE))
            ],
        },
    },
    "points with dates": [
        {"tag": name, "unit": unit, "samples": [{"t": s, "v": v} for s, v in zip(STAMPS, values.tolist(), strict=True)]}
        for name, unit, values in (("angle", "deg", DEG), ("torque", "mNm", 1e3 * TORQUE))
    ],
}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_channels_with_stamps_of_their_own_are_put_together(tmp_path: Path, document: str) -> None:
    _, recording = imported(tmp_path / "log.json", json.dumps(DOCUMENTS[document]))
    assert recording.period_s == pytest.approx(1e-3, rel=1e-3)
    rows = len(recording)
    assert rows >= T.size - 1
    np.testing.assert_allclose(recording["motor_position_rad"], ANGLE[-rows:], atol=6e-3)
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE[-rows:], atol=1e-3)


def table(form: str = "{t},torque,{m}", row: int = -1, line: str = "") -> str:
    lines = ["time_s,tag,value"]
    for k, (t, a, m) in enumerate(zip(T, ANGLE, TORQUE, strict=True)):
        lines += [f"{t:.4f},angle_rad,{a:.6f}", form.format(t=f"{t:.4f}", m=f"{m:.6f}") if k != row else line]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (table(row=500, line="0.5000,torque,1x2"), r"log\.csv:1003: torque has text and no number: given '1x2'"),
        (table(row=500, line="noon,torque,1.2"), r"log\.csv:1003: time_s: given 'noon', allowed a time stamp"),
        (table(row=500, line="0.5000,torque"), r"log\.csv:1003: given 2 fields, allowed 3"),
        (table("{t},angle_rad,{m}"), r"log\.csv:3: angle_rad: given '.*' at the stamp of another value"),
        (table().replace("torque,", "torque,n"), r"given values of 1 channel|given values of angle_rad in value"),
    ],
)
def test_a_row_that_cannot_be_read_is_named(tmp_path: Path, content: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        imported(tmp_path / "log.csv", content)


def test_units_that_are_unknown_and_change_are_named(tmp_path: Path) -> None:
    lines = [
        "t,tag,value,unit",
        *(
            line
            for k in range(T.size)
            for line in (
                f"{T[k]:.4f},angle,{ANGLE[k]:.6f},rad",
                f"{T[k]:.4f},torque,{TORQUE[k]},{'QQ' if k % 2 else 'PP'}",
            )
        ),
    ]
    with pytest.raises(InputError, match=r"log\.csv:5: torque has text and no number: given '.* QQ'"):
        imported(tmp_path / "log.csv", "\n".join(lines))


def test_rows_with_words_and_several_values_stay_rows(tmp_path: Path) -> None:
    lines = ["t,mode,angle_rad,torque_Nm"]
    rows = enumerate(zip(T, ANGLE, TORQUE, strict=True))
    lines += [f"{t:.4f},{'a' if k % 2 else 'b'},{a:.6f},{m:.6f}" for k, (t, a, m) in rows]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    assert draft_map(path).table.csv.series is None
