"""One known axis in the dialects of text files: clocks, header rows, marks, messages. All give its channels."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta
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

AXIS, FAST = axis(2400), axis(9600, 4000.0)
T, DEG, TORQUE = AXIS["t"], np.rad2deg(AXIS["angle"]), AXIS["torque"]
FAST_MS, FAST_TORQUE = 1e3 * FAST["t"], FAST["torque"]
TIMES = [datetime(2025, 3, 30, 1, 59, 59) + timedelta(milliseconds=row) for row in range(T.size)]
PLAIN = [
    "time [s];angle [deg];torque [Nm]",
    *(f"{t:.4f};{q:.6f};{m:.6f}" for t, q, m in zip(T, DEG, TORQUE, strict=True)),
]
CALM = int(np.argmin(np.abs(np.diff(DEG, 2)[100:-100]))) + 101  # row without acceleration: the line tells its angle
MARKS = {CALM - 1: "+++++++", CALM: f"{TORQUE[CALM]:.6f}", CALM + 1: "#VALUE!"}


def rows(form: Callable[[int], str]) -> list[str]:
    return [form(row) for row in range(T.size)]


def grouped(value: float, mark: str, decimals: int = 0, point: str = ",") -> str:
    return f"{value:,.{decimals}f}".replace(".", "p").replace(",", mark).replace("p", point)


def pairs(unit_s: float, slow_first: bool) -> list[str]:
    """A torque at 4 kHz and an angle at 1 kHz, each beside its stamps; the slow one ends before the other."""
    names = [("Torque", "0.25", "Nm (Torque)"), ("Angle", "1", "° (Angle)")][:: -1 if slow_first else 1]
    above = [
        "\t".join(f"{label}\t{one[of]}" for one in names) for of, label in enumerate(("Name", "SampleTime[ms]", "Unit"))
    ]
    lines = []
    for row in range(FAST_MS.size):
        fast = f"{1e-3 * FAST_MS[row] / unit_s:.0f}\t{FAST_TORQUE[row]:.6f}"
        slow = f"{T[row] / unit_s:.0f}\t{DEG[row]:.6f}" if row < T.size else "\t" if slow_first else ""
        lines.append("\t".join(one for one in ((slow, fast) if slow_first else (fast, slow)) if one))
    return [*above, "", *lines]


DIALECTS: dict[str, tuple[list[str], str]] = {
    "pairs of two rates": (pairs(1e-6, slow_first=False), "is interpolated to those of Angle"),
    "pairs of two rates in 100 ns": (pairs(1e-7, slow_first=True), "is interpolated to those of Angle"),
    "seconds and microseconds": (
        [
            "sec,usec,angle [deg],torque [Nm]",
            *rows(lambda i: f"{1705314569 + i // 1000},{i % 1000 * 1000},{DEG[i]:.6f},{TORQUE[i]:.6f}"),
        ],
        "",
    ),
    "date, time of whole seconds and milliseconds": (
        [
            "date;time;ms;angle;torque",
            ";;ms;deg;Nm",
            *rows(lambda i: f"{TIMES[i]:%d/%m/%Y;%H:%M:%S};{i % 1000};{DEG[i]:.6f};{TORQUE[i]:.6f}"),
        ],
        "",
    ),
    "day before month, and summer time": (
        [
            "time;angle [deg];torque [Nm]",
            *rows(
                lambda i: f"{TIMES[i] + timedelta(hours=i >= 1000):%d/%m/%Y %H:%M:%S.%f};{DEG[i]:.6f};{TORQUE[i]:.6f}"
            ),
        ],
        "summer time",
    ),
    "stamps of whole seconds": (
        [
            "time,angle_deg,torque_Nm",
            *rows(lambda i: f"{TIMES[i] + timedelta(milliseconds=300):%H:%M:%S},{DEG[i]:.6f},{TORQUE[i]:.6f}"),
        ],
        "too few digits",
    ),
    "ticks whose period the header gives": (
        ["Cycle time: 1 ms", "Time;angle [deg];torque [Nm]", *rows(lambda i: f"{7 * i};{DEG[i]:.6f};{TORQUE[i]:.6f}")],
        "a step of 7 is one period",
    ),
    "names, types, units, addresses and a description": (
        [
            "Trace 4",
            "t,ActAngle,ActTorque",
            "TIME,LREAL,LREAL",
            "s,deg,Nm",
            "%MW0,%MD2,%MD6",
            "clock,of axis,of drive",
            *rows(lambda i: f"{T[i]:.4f},{DEG[i]:.6f},{TORQUE[i]:.6f}"),
        ],
        "",
    ),
    "factor and offset": (
        [
            "Name;phi;M",
            "Unit;deg;Nm",
            "Scale;0.001;0.0001",
            "Offset;0;0.05",
            *rows(lambda i: f"{T[i]:.4f};{1000.0 * DEG[i]:.0f};{10000.0 * (TORQUE[i] - 0.05):.0f}"),
        ],
        "factor 0.0001 and offset 0.05",
    ),
    "factors in the units": (
        [
            "t;angle;torque",
            "ms;1/1000 deg;0.0001 Nm",
            *rows(lambda i: f"{1000.0 * T[i]:.0f};{1000.0 * DEG[i]:.0f};{10000.0 * TORQUE[i]:.0f}"),
        ],
        "factor 0.0001",
    ),
    "commas in names": (
        [
            "Time [s],Angle, actual [deg],Torque, actual [Nm]",
            *rows(lambda i: f"{T[i]:.4f},{DEG[i]:.6f},{TORQUE[i]:.6f}"),
        ],
        "",
    ),
    "thousands with points": (
        [
            "Zeit [ms];Winkel [mdeg];Moment [mNm]",
            *rows(lambda i: ";".join(grouped(1000.0 * x, ".") for x in (T[i], DEG[i], TORQUE[i]))),
        ],
        "'.' is read as the mark between thousands",
    ),
    "thousands with apostrophes": (
        [
            "t [ms];angle [deg];torque [mNm]",
            *rows(
                lambda i: f"{grouped(1000.0 * T[i], chr(39))};{grouped(DEG[i], chr(39), 4)};{1000.0 * TORQUE[i]:.0f}"
            ),
        ],
        "mark between thousands",
    ),
    "each column its decimal mark": (
        [
            "t [s];angle [deg];torque [Nm]",
            *rows(
                lambda i: (
                    f"{T[i]:.3f};{DEG[i]:.4f};{TORQUE[i]:.4f}".replace(";", "X", 1).replace(".", ",").replace("X", ";")
                )
            ),
        ],
        "",
    ),
    "message, end tag and footer": (
        [*PLAIN[:900], "overrun", *PLAIN[900:], "", "Mean;12.5;0.1", "[END]"],
        "line 901 is no row and left out: 'overrun'",
    ),
    "groups in place of pairs of channels with their times": (
        [
            "Name;M;Name;phi;n",
            "Unit;Nm;Unit;deg;rad/s",
            *(
                f"{ms:.2f};{m:.6f}" + (f";{1e3 * T[i]:.0f};{DEG[i]:.6f};{AXIS['speed'][i]:.4f}" if i < T.size else "")
                for i, (ms, m) in enumerate(zip(FAST_MS, FAST_TORQUE, strict=True))
            ),
        ],
        "M has its own stamps",
    ),
    "lines of a terminal": (
        [
            "11:59:58.100 -> ready",
            "11:59:58.200 -> monitor: angle [deg], torque [Nm]",
            *rows(lambda i: f"{TIMES[i] + timedelta(seconds=300):%H:%M:%S.%f} -> {DEG[i]:.6f}\t{TORQUE[i]:.6f}"),
        ],
        "",
    ),
    "a number before each row": (
        ["Rate: 1 kHz", "angle_deg torque_Nm", *rows(lambda i: f"{512 + i} {DEG[i]:.6f} {TORQUE[i]:.6f} ")],
        "",
    ),
    "a line for each channel": (
        [
            "Sampling: 1 kHz",
            "CH1: Motor angle (0.001 deg)",
            "CH2: Motor torque (0.0001 Nm)",
            "CH1\tCH2",
            *rows(lambda i: f"{1000.0 * DEG[i]:.0f}\t{10000.0 * TORQUE[i]:.0f}"),
        ],
        "CH2: the header's factor 0.0001",
    ),
    "factors that the values hold": (
        [
            "Name;t [s];phi [deg];M [Nm]",
            "Scale;1;250;0.8",
            *rows(lambda i: f"{i};{T[i]:.4f};{DEG[i]:.6f};{TORQUE[i]:.6f}"),
        ],
        "M [Nm]: its values hold the factor 0.8 of the header already",
    ),
    "values beyond the range": (
        [*PLAIN[:CALM], *(f"{T[i]:.4f};{DEG[i]:.6f};{mark}" for i, mark in MARKS.items()), *PLAIN[CALM + 3 :]],
        "missing: 2 rows have no value",
    ),
    "units with their label before them": (
        ['"SIGNAL", "TIME", "A", "B"', '"VERT", "S", "deg", "N.m"', *(line.replace(";", ", ") for line in PLAIN[1:])],
        "",
    ),
    "rows of two joints in turn": (
        [
            "t [s],joint,position_deg,torque_Nm",
            *(
                line
                for i in range(T.size)
                for line in (f"{T[i]:.4f},a1,{30 + i % 3 * 1e-4},2.5", f"{T[i]:.4f},a2,{DEG[i]:.6f},{TORQUE[i]:.6f}")
            ),
        ],
        "rows: of a1, a2 in turn; those of a2 are taken",
    ),
    "rows and their period in a line": (
        [f"{T.size},1", "angle_deg,torque_Nm", *rows(lambda i: f"{DEG[i]:.6f},{TORQUE[i]:.6f}")],
        "",
    ),
    "a sign apart": (
        [PLAIN[0], *rows(lambda i: f"{T[i]:.4f};{DEG[i]:+.6f};{TORQUE[i]:+.6f}".replace("+", "+ ").replace("-", "- "))],
        "",
    ),
    "names that stand twice": (
        ["t [s],AI,AI,angle [deg],torque [Nm]", *rows(lambda i: f"{T[i]:.4f},{i % 7},1,{DEG[i]:.6f},{TORQUE[i]:.6f}")],
        "",
    ),
    "a path of names": (
        [
            "time,axis.x.angle [deg],pid.x.error,pid.x.output [Nm]",
            *rows(lambda i: f"{T[i]:.4f},{DEG[i]:.6f},{i % 7},{TORQUE[i]:.6f}"),
        ],
        "",
    ),
    "a torque beside current and friction": (
        [
            "t [s],current [A],angle [deg],friction torque [Nm],torque [Nm]",
            *rows(
                lambda i: (
                    f"{T[i]:.4f},{2 * TORQUE[i]:.4f},{DEG[i]:.6f},{0.4 * np.sign(AXIS['speed'][i])},{TORQUE[i]:.6f}"
                )
            ),
        ],
        "torque [Nm]: taken for the measured torque",
    ),
}


def imported(path: Path, lines: list[str], encoding: str = "utf-8") -> tuple[MapDraft, Recording]:
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    draft = draft_map(path)
    by_map = path.with_name("map.yaml")
    by_map.write_text(map_text(draft), encoding="utf-8")
    return draft, import_recording(path, by_map)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_gives_the_channels_and_says_what_it_took(tmp_path: Path, dialect: str) -> None:
    lines, said = DIALECTS[dialect]
    draft, recording = imported(tmp_path / "log.csv", lines)
    assert recording.period_s == pytest.approx(1e-3, rel=2e-3)
    rows = slice(0, min(len(recording), T.size) - 1)
    np.testing.assert_allclose(recording["motor_position_rad"][rows], AXIS["angle"][rows], atol=2e-4)
    # a torque of another rate, or of rows that are left out, is the line between its samples
    np.testing.assert_allclose(
        recording["torque_n_m"][rows], TORQUE[rows], atol=0.1 if "pairs" in dialect or "beyond" in dialect else 2e-3
    )
    assert any(said in note for note in draft.unsure) or not said


def test_characters_of_dos_are_read(tmp_path: Path) -> None:
    lines = [PLAIN[0].replace("angle", "Winkel rückgeführt"), *PLAIN[1:]]
    draft, recording = imported(tmp_path / "log.csv", lines, "cp850")
    assert draft.table.csv.encoding == "cp850"
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE, atol=1e-5)


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        ("時間[ms];モータ回転角度[deg];トルク[N・m]", "cp932"),
        ("temps [s];angle [°];couple [mN·m]", "mac_roman"),
        ("Zeit [µs];Winkel [°];Drehmoment für Prüfung [Ncm]", "cp1252"),
        ("Zeit [s];Winkel am Messgerät [°];Drehmoment am Längenmessgerät [Ncm]", "cp1252"),
    ],
)
def test_the_encoding_is_that_in_which_the_words_are_known(tmp_path: Path, names: str, encoding: str) -> None:
    size = {"[ms]": 1e3, "[µs]": 1e6}.get(names.split(";")[0][-4:], 1.0)
    torque = {"mac_roman": 1e3, "cp1252": 100.0}.get(encoding, 1.0)
    lines = [names, *rows(lambda i: f"{size * T[i]:.3f};{DEG[i]:.6f};{torque * TORQUE[i]:.6f}")]
    draft, recording = imported(tmp_path / "log.csv", lines, encoding)
    assert draft.table.csv.encoding == encoding
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE, atol=1e-5)


def test_records_in_lines_of_json_are_read_and_a_cut_one_is_named(tmp_path: Path) -> None:
    lines = rows(lambda i: json.dumps({"t": T[i], "angle_deg": DEG[i], "torque_Nm": TORQUE[i]}))
    _, recording = imported(tmp_path / "log.json", lines)
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE)
    with pytest.raises(InputError, match=r"log\.json:500: column 10 is no JSON .*given '\{\"t\": 0.4'"):
        imported(tmp_path / "log.json", [*lines[:499], '{"t": 0.4', *lines[500:]])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0.8980;12.5", r"log\.csv:900: given 2 fields, allowed 3 as in the other rows: '0\.8980;12\.5'"),
        ("0.8980;1x2;0.1", r"log\.csv:900: angle \[deg\] has text and no number: given '1x2'"),
        (";12.5;0.1", r"log\.csv:900: time \[s\]: the row has no time stamp"),
    ],
)
def test_a_row_that_cannot_be_read_is_named_with_its_text(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        imported(tmp_path / "log.csv", [*PLAIN[:899], line, *PLAIN[900:]])


def test_decimal_commas_between_commas_are_refused(tmp_path: Path) -> None:
    lines = ["t,angle,torque", *(line.replace(".", ",").replace(";", ",") for line in PLAIN[1:])]
    with pytest.raises(InputError, match=r"log\.csv:1: 't,angle,torque' has 3 fields, the rows 6: decimal commas"):
        imported(tmp_path / "log.csv", lines)


def test_a_row_of_the_header_that_is_not_used_is_said(tmp_path: Path) -> None:
    draft, _ = imported(tmp_path / "log.csv", ["7;8;9", *PLAIN])
    assert any("line 1 is not used: '7;8;9'" in note for note in draft.unsure)


def test_a_speed_counts_where_the_position_is_another_one(tmp_path: Path) -> None:
    lines = ["t [s];Speed [rad/s];torque [Nm];Position of the lid"]
    lines += rows(lambda i: f"{T[i]:.4f};{AXIS['speed'][i]:.5f};{TORQUE[i]:.6f};{np.sin(0.9 * T[i]):.5f}")
    draft, _ = imported(tmp_path / "log.csv", lines)
    assert [one.entry["column"] for one in draft.channels] == ["Speed [rad/s]", "torque [Nm]"]
    assert any("is taken for the motion" in note for note in draft.unsure)


def test_a_column_that_the_motion_does_not_explain_is_not_the_torque(tmp_path: Path) -> None:
    noise = np.random.default_rng(2).normal(0.0, 1.0, T.size)
    lines = ["t [s],angle [deg],Torque sensor [Nm],Torque [Nm]"]
    lines += rows(lambda i: f"{T[i]:.4f},{DEG[i]:.6f},{noise[i]:.4f},{TORQUE[i]:.6f}")
    draft, _ = imported(tmp_path / "log.csv", lines)
    assert draft.channels[-1].entry["column"] == "Torque [Nm]"
    assert "explain 1% of it" in draft.left_out["Torque sensor [Nm]"]
