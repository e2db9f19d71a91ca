"""An odd file is imported with a note that names the oddity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from damaged_files import AXIS, GOOD, LINES, RANDOM, TEXT, Make, content, field, in_rows, table, text, with_lines
from foreign_axis import renamed, write

from hil.commands.import_ import import_
from hil.importing.draft_map import draft_map
from hil.recording.recording import read_recording

NOTED: dict[str, tuple[Make, str]] = {
    "the torque has the other sign": (table(torque=-AXIS["torque"]), "its sign is turned"),
    "counts without a scale": (
        lambda path: write(
            path,
            renamed(
                AXIS | {"angle": np.round(1000 * AXIS["angle"])}, t="t", angle="encoder [counts]", torque="torque_Nm"
            ),
        ),
        "1 um per count is taken",
    ),
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
