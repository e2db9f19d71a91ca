"""Recordings that tell nothing of the axis, or only multiples of its values."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from command_line import hil
from foreign_axis import axis, write

from hil.commands.import_ import import_
from hil.drafting.draft_bench import draft_bench
from hil.recording.recording import Recording, read_recording, write_parquet

AXIS = axis(rows=8000)


def recording(columns: dict[str, np.ndarray]) -> Recording:
    names = {"t": "time_s", "angle": "motor_position_rad", "x_act": "table_position_m", "torque": "torque_n_m"}
    return Recording(
        "log", {names[name]: values * (1e-3 if name == "x_act" else 1.0) for name, values in columns.items()}, 1e-3
    )


def still(seed: int, torque: np.ndarray | float) -> dict[str, np.ndarray]:
    """A motor at constant speed, with a torque beside noise."""
    time, random = np.arange(8000) * 1e-3, np.random.default_rng(seed)
    return {"t": time, "angle": 50.0 * time + random.normal(0.0, 1e-5, time.size),
            "torque": torque + random.normal(0.0, 0.05, time.size)}  # fmt: skip


OF_ANOTHER_AXIS = axis(rows=8000)["torque"][::-1] * np.sign(np.sin(0.7 * AXIS["t"]))


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        (still(1, 1.5), r"told is only friction and load together, 1\.5"),
        ({"t": AXIS["t"], "angle": AXIS["angle"], "torque": OF_ANOTHER_AXIS}, "leaves .* % of the torque. Check in"),
    ],
)
def test_a_recording_that_tells_nothing_gives_no_bench(
    tmp_path: Path, columns: dict[str, np.ndarray], says: str
) -> None:
    write_parquet(recording(columns), tmp_path / "log.parquet")
    told = hil(tmp_path, "identify", "log.parquet")
    assert told.returncode == 2
    words = " ".join(told.stderr.split())
    assert words.startswith("log: neither inertia nor friction is identifiable, and no bench is written: inertia ")
    assert re.search(says, words)
    assert not (tmp_path / "log.yaml").exists()


@pytest.mark.parametrize("more", [{"x_act": AXIS["x_act"]}, {"angle": 40.0 * np.sin(3.0 * AXIS["t"])}])
def test_a_recording_that_tells_a_part_gives_a_bench(more: dict[str, np.ndarray]) -> None:
    """A second encoder tells the ratio; at feeds both ways without acceleration friction is told."""
    torque = OF_ANOTHER_AXIS if "x_act" in more else 0.4 * np.sign(np.cos(3.0 * AXIS["t"]))
    assert draft_bench(recording({"t": AXIS["t"], "angle": AXIS["angle"], "torque": torque} | more)).axis


@pytest.mark.parametrize(("constant", "reminded"), [(1.0, 1), (0.7, 0)])
def test_a_torque_constant_of_one_is_reminded_of_once(tmp_path: Path, constant: float, reminded: int) -> None:
    columns = {"time_s": AXIS["t"], "motor_angle_rad": AXIS["angle"], "current_A": AXIS["torque"] / constant}
    source, draft = write(tmp_path / "log.csv", columns), tmp_path / "log-map.yaml"
    assert hil(tmp_path, "import", "log.csv").returncode == 2
    text, asked = re.subn(r"(torque_constant_n_m_a:) +# <-- write: .*", rf"\1 {constant}", draft.read_text())
    assert asked == 1
    draft.write_text(text)
    import_(source, str(draft), tmp_path / "log.parquet", None, None)
    found = draft_bench(read_recording(tmp_path / "log.parquet"))
    notes = [note for note in (*found.notes, *found.unsure) if "the map gives torque_constant_n_m_a: 1;" in note]
    assert len(notes) == reminded
    if reminded:
        assert notes == [
            "the map gives torque_constant_n_m_a: 1; if that stands for an unknown value, inertia, friction, loads and "
            "torque gains are not in SI: multiply them by the true torque_constant_n_m_a"
        ]
