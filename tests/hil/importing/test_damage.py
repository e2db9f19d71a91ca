"""A damaged file is refused in one sentence with exit code 2; an odd one is imported with a note."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from damaged_files import (
    AXIS,
    GOOD,
    HALF,
    LINES,
    RANDOM,
    TEXT,
    Make,
    content,
    cut,
    field,
    in_rows,
    shuffled,
    table,
    text,
    two_rates,
    unequal,
    with_lines,
)
from foreign_axis import csv_text, renamed, write

from hil.commands.import_ import import_
from hil.errors import InputError
from hil.importing.draft_map import draft_map
from hil.recording.recording import read_recording

REFUSED: dict[str, tuple[str, Make, str]] = {
    "empty": ("csv", text(""), "empty"),
    "blank lines only": ("csv", text("\n\n  \n"), "empty"),
    "header only": ("csv", text(LINES[0] + "\n"), "no rows of numbers"),
    "two rows": ("csv", text("\n".join(LINES[:3]) + "\n"), "three rows"),
    "prose": ("csv", text("This is a letter.\nIt holds no numbers.\n" * 20), "no rows of numbers"),
    "binary garbage": ("csv", content(RANDOM.bytes(5000)), "binary"),
    "a zip archive": ("csv", content(b"PK\x03\x04" + RANDOM.bytes(4000)), "binary"),
    "an image": ("csv", content(b"\x89PNG\r\n\x1a\n\x00\x00" + RANDOM.bytes(4000)), "binary"),
    "a spreadsheet": ("xlsx", content(b"PK\x03\x04"), "ending '.xlsx' cannot be imported"),
    "a binary file without an ending": ("", content(b"PK\x03\x04" + RANDOM.bytes(4000)), "cannot be imported"),
    "one column": ("csv", text("torque\n" + "1.5\n" * 100), "two columns"),
    "a cut last row": ("csv", text(TEXT[:-12]), "given [123] fields|no number"),
    "half of a row in the middle": ("csv", with_lines((1500, LINES[1500][:9])), "1501|no number"),
    "text in the torque": ("csv", with_lines(field(700, 3, "error")), "no number"),
    "an unknown unit beside each torque": (
        "csv",
        text("\n".join([LINES[0], *(f"{line} Nq" for line in LINES[1:])])),
        "torque",
    ),
    "infinity in the torque": ("csv", table(**in_rows("torque", slice(50, 51), np.inf)), "no number"),
    "infinity as a word": ("csv", with_lines(field(700, 3, "inf")), "no number"),
    "stamps of text": (
        "csv",
        text("\n".join([LINES[0], *(f"row {i},{line.split(',', 1)[1]}" for i, line in enumerate(LINES[1:]))])),
        "time_s: text such as",
    ),
    "missing values in a tenth of the rows": (
        "csv",
        table(**in_rows("torque", slice(0, len(AXIS["t"]) // 10), np.nan)),
        "no number in 10",
    ),
    "the torque ends half way": ("csv", table(**in_rows("torque", slice(HALF, None), np.nan)), "never after"),
    "the position starts half way": ("csv", table(**in_rows("angle", slice(0, HALF), np.nan)), "no number in 50"),
    "a channel of another rate that ends early": (
        "csv",
        table(torque=np.where(np.arange(len(AXIS["t"])) % 4 < 2 * (AXIS["t"] < 1.0) - 1, AXIS["torque"], np.nan)),
        "export one rate",
    ),
    "a placeholder of -9999": ("csv", table(**in_rows("angle", slice(800, 801), -9999.0)), "spike or a placeholder"),
    "a spike in the set-point": ("csv", table(**in_rows("x_set", slice(800, 801), 1e6)), "spike or a placeholder"),
    "a position that jumps": ("csv", table(**in_rows("angle", slice(HALF, None), lambda v: v + 200.0)), "jumps"),
    "rows shuffled": ("csv", lambda path: write(path, shuffled()), "out of order"),
    "rows shuffled, without stamps": (
        "csv",
        lambda path: path.write_text(
            csv_text({n: v for n, v in shuffled().items() if n != "time_s"}, above="# sampling rate: 1000 Hz\n")
        ),
        "shuffled",
    ),
    "rows in reverse": (
        "csv",
        lambda path: write(path, {n: v[::-1] for n, v in GOOD.items()}),
        "out of order|runs back",
    ),
    "two recordings in one file": ("csv", text(TEXT + "\n".join(LINES[1:]) + "\n"), "runs back"),
    "two files with headers": ("csv", text(TEXT + TEXT), "no time stamp|runs back"),
    "two rates, one after the other": ("csv", lambda path: write(path, two_rates()), "two sampling rates"),
    "a missing stamp": ("csv", with_lines(field(1000, 0, "")), "no time stamp"),
    "constant stamps": ("csv", table(t=np.zeros(len(AXIS["t"]))), "all 0"),
    "no stamps": ("csv", table(t=None), "--rate HZ"),
    "dates whose milliseconds start again": (
        "csv",
        text(
            "\n".join(
                [
                    LINES[0],
                    *(
                        f"2024-05-01 12:00:00.{i % 1000:03d},{line.split(',', 1)[1]}"
                        for i, line in enumerate(LINES[1:])
                    ),
                ]
            )
        ),
        "runs back",
    ),
    "a frozen motor": ("csv", table(angle=np.full(len(AXIS["t"]), 1.5), x_set=None), "constant are motor_angle_rad"),
    "everything constant": (
        "csv",
        table(**{n: np.ones(len(AXIS["t"])) for n in ("angle", "x_set", "torque")}),
        "constant are",
    ),
    "a constant torque": ("csv", table(torque=np.full(len(AXIS["t"]), 0.2), x_set=None), "no torque"),
    "no torque": ("csv", table(torque=None), "no torque"),
    "no position": ("csv", table(angle=None, x_set=None), "position"),
    "only noise": (
        "csv",
        table(**{n: RANDOM.normal(size=len(AXIS["t"])) for n in ("angle", "x_set", "torque")}),
        "shuffled|no column",
    ),
    "the torque's sign turns": ("csv", table(**in_rows("torque", slice(HALF, None), lambda v: -v)), "sign was turned"),
    "the set-point's sign turns": (
        "csv",
        table(**in_rows("x_set", slice(HALF, None), lambda v: -v)),
        "jumps|sign was turned",
    ),
    "metres called millimetres": (
        "csv",
        lambda path: write(
            path,
            renamed(
                AXIS | {"x_set": 1e-3 * AXIS["x_act"]}, t="t", x_act="x_ist [mm]", x_set="x_soll [mm]", torque="F [N]"
            ),
        ),
        "m or mm",
    ),
    "degrees called radians": (
        "csv",
        lambda path: write(
            path,
            renamed(
                AXIS | {"x_set": np.rad2deg(AXIS["angle"])},
                t="t",
                x_set="angle_ref [rad]",
                angle="angle [rad]",
                torque="torque [Nm]",
            ),
        ),
        "rad or deg",
    ),
    "position and velocity interchanged": (
        "csv",
        lambda path: write(
            path, renamed(AXIS, t="t", angle="speed_rad_s", speed="motor_angle_rad", torque="torque_Nm")
        ),
        "interchanged",
    ),
    "a name twice": ("csv", with_lines((0, "time_s,motor_angle_rad,motor_angle_rad,torque_Nm")), "names two columns"),
    "a truncated .mat": ("mat", cut("mat", 0.5), "damaged"),
    "a .mat of a few bytes": ("mat", content(b"MATLAB 5.0 MAT-file"), "damaged|no readable"),
    "an empty .mat": ("mat", content(b""), "empty"),
    "text as .mat": ("mat", text(TEXT), "no readable .mat"),
    "a .mat of version 7.3": (
        "mat",
        content(b"MATLAB 7.3 MAT-file" + b" " * 105 + b"\x00\x02IM" + b"\x00" * 512),
        "7.3|no readable",
    ),
    "a .mat with two rates": ("mat", unequal, "no column|no torque|no position|beside"),
    "a truncated Parquet": ("parquet", cut("parquet", 0.7), "no readable Parquet"),
    "text as Parquet": ("parquet", text(TEXT), "no readable Parquet"),
    "an empty Parquet": ("parquet", content(b""), "empty"),
    "a truncated JSON": ("json", cut("json", 0.6), "no readable JSON"),
    "a JSON of a number": ("json", text("3.5"), "no list"),
    "a JSON of text": ("json", text(json.dumps({"t": ["a", "b", "c"], "x": ["d", "e", "f"]})), "columns of numbers"),
    "an empty JSON": ("json", text("{}"), "no list"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_damaged_file_is_refused_in_one_sentence(tmp_path: Path, case: str) -> None:
    ending, make, says = REFUSED[case]
    path = tmp_path / f"log.{ending}".rstrip(".")
    make(path)
    with pytest.raises(InputError, match=says) as caught:
        import_(path, None, tmp_path / "out.parquet", None, None)
    assert caught.value.exit_code == 2
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out.parquet").exists()


NOTED: dict[str, tuple[Make, str]] = {
    "the torque has the other sign": (table(torque=-AXIS["torque"]), "its sign is turned"),
    "the motor counts the other way": (table(angle=-AXIS["angle"]), "its sign is turned"),
    "stamps with too few digits": (table(t=np.floor(AXIS["t"] * 500) / 500), "too few digits"),
    "milliseconds called seconds": (table(t=1e3 * AXIS["t"]), "no rate of a recording"),
    "a torque that is another axis's": (table(torque=np.sin(7 * AXIS["t"])), "explain only"),
    "a set-point that is not followed": (table(x_set=RANDOM.normal(size=len(AXIS["t"])).cumsum()), "does not follow"),
    "NaN in the position": (table(**in_rows("angle", slice(900, 903), np.nan)), "rows have no value of"),
    "an empty field": (with_lines(field(700, 3, "")), "rows have no value of"),
    "an angle that wraps": (table(angle=np.mod(AXIS["angle"], 2 * np.pi), x_set=None), "wraps at 6.28319"),
    "a sensor that jumps by a fraction of the travel": (
        table(**in_rows("angle", slice(2000, 2003), AXIS["angle"][2000] + 5.0)),
        "its sensor, not the axis",
    ),
    "a gap": (lambda path: write(path, {n: np.delete(v, slice(500, 600)) for n, v in GOOD.items()}), "a gap of"),
    "a duplicate row": (with_lines((1000, LINES[999])), "duplicate rows: 1"),
    "numbers in quotes": (
        text("\n".join([LINES[0], *(",".join(f'"{f}"' for f in line.split(",")) for line in LINES[1:])]) + "\n"),
        "",
    ),
    "a trailing delimiter": (text("\n".join(f"{line}," for line in LINES) + "\n"), ""),
    "a blank line at the end": (text(TEXT + "\n\n"), ""),
    "Windows line ends": (content(TEXT.replace("\n", "\r\n").encode()), ""),
    "a clock that starts late": (table(t=AXIS["t"] + 1000.0), ""),
    "a status column of text": (
        text("\n".join(f"{line},{'status' if i == 0 else 'OK'}" for i, line in enumerate(LINES)) + "\n"),
        "",
    ),
    "a constant column beside": (
        lambda path: write(
            path, GOOD | {"temperature": np.full(len(AXIS["t"]), 20.0), "spare": np.zeros(len(AXIS["t"]))}
        ),
        "",
    ),
}


@pytest.mark.parametrize("case", NOTED)
def test_an_odd_file_is_imported_and_the_oddity_named(tmp_path: Path, case: str) -> None:
    make, says = NOTED[case]
    path = tmp_path / "log.csv"
    make(path)
    notes = draft_map(path).unsure
    assert any(says in note for note in notes) if says else notes == []
    import_(path, None, tmp_path / "out.parquet", None, None)
    assert len(read_recording(tmp_path / "out.parquet")) > 0.9 * len(AXIS["t"])
