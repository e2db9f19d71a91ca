"""A clock that is a counter of common width starts again and is counted on; another fall is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis

from hil.errors import InputError
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_text import map_text
from hil.importing.stamp_columns import counted_on, range_of

AXIS = axis(4000)
T, ANGLE, TORQUE = AXIS["t"], AXIS["angle"], AXIS["torque"]


def text(stamps: np.ndarray, names: str = "us,angle_rad,torque_Nm", form: str = ".0f") -> str:
    rows = (f"{s:{form}},{a:.6f},{m:.6f}" for s, a, m in zip(stamps, ANGLE, TORQUE, strict=True))
    return "\n".join([*([names] if names else []), *rows]) + "\n"


COUNTERS = {
    "micros of 32 bits": (text((2**32 - 1_500_000 + 1e6 * T) % 2**32), 2**32),
    "millis of 16 bits": (text((64_000 + 1e3 * T) % 2**16, "millis,q_rad,tau_Nm"), 2**16),
    "micros of 16 bits": (text((1e6 * T) % 2**16), 2**16),
    "micros of 32 bits with a sign": (text((2**32 - 10_500 + 1e6 * T) % 2**32 - 2.0**31), 2**32),
    "micros told in ms": (
        text((4_294_000.0 + 1e3 * T) % 4_294_967.296, "t_ms,angle_rad,torque_Nm", ".3f"),
        2**32 / 1e3,
    ),
    "ticks of 24 bits without a name of time": (text((2**24 - 900_500 + 1e6 * T) % 2**24, "xx,q_rad,tau_Nm"), 2**24),
    "seconds of a day": (text((86_398.0 + T) % 86_400, "time [s],angle_rad,torque_Nm", ".3f"), 86_400),
}


@pytest.mark.parametrize("counter", COUNTERS)
def test_a_counter_of_common_width_is_counted_on(tmp_path: Path, counter: str) -> None:
    content, size = COUNTERS[counter]
    path, map_path = tmp_path / "log.csv", tmp_path / "map.yaml"
    path.write_text(content)
    draft = draft_map(path)
    assert draft.clock.time is not None
    assert draft.clock.time.wraps_at == pytest.approx(size)
    assert any("starts again at" in note for note in draft.unsure)
    map_path.write_text(map_text(draft))
    recording = import_recording(path, map_path)
    assert recording.period_s == pytest.approx(1e-3, rel=1e-4)
    assert len(recording) == T.size
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE, atol=1e-5)


def test_a_column_in_a_unit_of_time_that_grows_evenly_is_the_clock(tmp_path: Path) -> None:
    """Its name may tell another quantity."""
    path = tmp_path / "log.csv"
    path.write_text(text(4_120_000.0 + 1e6 * T, "cycle_us,angle_rad,torque_Nm"))
    clock = draft_map(path).clock
    assert clock.time is not None
    assert (clock.time.column, clock.time.unit) == ("cycle_us", "us")


def test_rows_that_are_lost_where_a_counter_starts_again_stay_lost() -> None:
    stamps = np.delete((2**32 - 20_000 + 5000.0 * np.arange(2000)) % 2**32, [3, 4, 5])
    assert range_of(stamps) == 2**32
    assert np.diff(counted_on(stamps, 2.0**32)).max() == 20_000


@pytest.mark.parametrize(
    "stamps",
    [
        np.r_[1e6 * T[:2000], 1e6 * T[:2000]],  # two recordings
        np.r_[1e6 * T[:2000], 1e6 * T[1990:3990]],  # rows again
        (1e6 * T) % 1_234_567,  # a range that no counter has
        np.where(np.arange(T.size) == 2000, 0.0, 1e6 * T),  # a stamp that is lost
        np.r_[(2**32 - 1e6 + 1e6 * T[:2000]) % 2**32, (1e6 * T[:2000]) % 2**32],  # a counter, then another recording
    ],
)
def test_other_falls_are_refused_with_their_row(tmp_path: Path, stamps: np.ndarray) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(stamps))
    assert range_of(stamps) is None
    with pytest.raises(InputError, match=r"row \d+ of the numbers: time_s: (runs back|repeats)"):
        draft_map(path)
