"""Stamps since 1970 without a known name, a motor's encoder called enc_m, and names of several words over blanks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis

from hil.importing.draft_map import draft_map

AXIS = axis(3000, rate_hz=250.0)


def test_uneven_seconds_since_1970_are_the_clock_and_whole_numbers_are_no_metres(tmp_path: Path) -> None:
    jitter = np.random.default_rng(3).uniform(-1e-3, 1e-3, AXIS["t"].size)
    turns = AXIS["angle"] / (2.0 * np.pi)
    counts = {"enc_m": 131072 * turns, "enc_l": 10000 + 1048576 * turns / 101.0}
    lines = [
        json.dumps(
            {
                "ts": 1.718e9 + AXIS["t"][row] + jitter[row],
                "j1": {name: round(values[row]) for name, values in counts.items()} | {"iq": AXIS["torque"][row]},
            }
        )
        for row in range(AXIS["t"].size)
    ]
    path = tmp_path / "joint.jsonl"
    path.write_text("\n".join(lines) + "\n")
    draft = draft_map(path)
    assert draft.clock.time is not None
    assert (draft.clock.time.column, draft.clock.time.unit) == ("ts", "s")
    units = {str(one.entry["column"]): one.entry["unit"] for one in draft.channels}
    assert units["j1.enc_m"] == units["j1.enc_l"] == "counts"


def test_names_of_several_words_stand_between_wide_blanks(tmp_path: Path) -> None:
    millimetres = 6.0 / (2.0 * np.pi) * AXIS["angle"]
    rows = [
        f"{time:12.4f}{place:12.3f}{round(speed):12d}{percent:10.1f}".replace(".", ",")
        for time, place, speed, percent in zip(
            AXIS["t"], millimetres, 60.0 * np.gradient(millimetres, 4e-3), 100.0 * AXIS["torque"], strict=True
        )
    ]
    head = ["Antrieb A14 Spindelverstellung", "Nennmoment 1,00 Nm = 100 %", ""]
    names = f"{'t / s':>12}{'Ist mm':>12}{'v mm/min':>12}{'M %':>10}"
    path = tmp_path / "log.txt"
    path.write_text("\n".join([*head, names, *rows]) + "\n")
    draft = draft_map(path)
    assert draft.clock.time is not None
    assert draft.clock.time.column == "t / s"
    entries = {str(one.entry["column"]): one.entry for one in draft.channels}
    assert entries["Ist mm"]["unit"] == "mm"
    assert entries["M %"] == pytest.approx({"column": "M %", "unit": "%", "rated": 1.0})


def test_wide_blanks_do_not_part_names_between_tabs(tmp_path: Path) -> None:
    """A tab parts the columns there, also behind a name that is followed by blanks."""
    rows = [
        f"{row[0]:.3f}\t{row[1]:.6f}\t{row[2]:.5f}"
        for row in zip(AXIS["t"], AXIS["angle"], AXIS["torque"], strict=True)
    ]
    path = tmp_path / "log.tab"
    path.write_text("\n".join(["t [s]\tmotor  angle [rad]\ttorque  [Nm]\tvalid", *rows]) + "\n")
    columns = {str(one.entry["column"]) for one in draft_map(path).channels}
    assert columns == {"motor  angle [rad]", "torque  [Nm]"}


def test_greetings_and_heartbeats_in_a_stream_of_records_are_no_rows(tmp_path: Path) -> None:
    """What they tell, as the rate, is told; a row that lacks a channel is a row."""
    stamps_ms = np.round(1.7e12 + 4.0 * np.arange(AXIS["t"].size))
    rows = [
        {"type": "d", "ts": stamps_ms[row], "q_rad": AXIS["angle"][row], "i_a": AXIS["torque"][row]}
        for row in range(AXIS["t"].size)
    ]
    rows[700] = {"type": "d", "ts": stamps_ms[700], "q_rad": AXIS["angle"][700], "fault": 3}
    beats = [{"type": "hb", "ts": stamps_ms[row] + 1.0, "up": row, "fs": 100} for row in (1000, 2000)]
    stream = [{"type": "hello", "rate_hz": 250}, *rows[:1500], *beats, *rows[1500:]]
    path = tmp_path / "gateway.jsonl"
    path.write_text("\n".join(map(json.dumps, stream)) + "\n")
    draft = draft_map(path)
    assert draft.table.columns["ts"].size == len(rows)
    assert draft.table.scalars == {"rate_hz": 250.0}
    assert "3 records are no rows and left out, such as a greeting" in draft.unsure
    assert draft.clock.time is not None
    assert (draft.clock.time.column, draft.clock.time.unit) == ("ts", "ms")


def test_a_counter_of_a_quarter_of_a_microsecond_is_told_by_its_line_and_else_doubtful(tmp_path: Path) -> None:
    ticks = 882031560 + 4000 * np.arange(AXIS["t"].size)
    rows = [f"{a}\t{b:.4f}\t{c:.5f}" for a, b, c in zip(ticks, AXIS["x_act"], AXIS["torque"], strict=True)]
    lines = ["%   0 cnt  [1/4 us]", "%   1 pos [mm]", "%   2 torque [Nm]"]
    path = tmp_path / "scope.tsv"
    path.write_text("\n".join([*lines, "cnt\tpos\ttorque", *rows]) + "\n")
    time = draft_map(path).clock.time
    assert time is not None
    assert (time.unit, time.scale) == ("us", 0.25)
    path.write_text("\n".join([*lines[1:], "cnt\tpos\ttorque", *rows]) + "\n")
    (note,) = [one for one in draft_map(path).unsure if one.startswith("clock")]
    assert note.startswith("clock: the unit of 'cnt' is not given; us is taken (steps of 4000 us)")
    assert "--rate" in note
