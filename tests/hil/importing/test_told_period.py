"""A file without stamps tells its period in a line, a scalar or a text of units; a counter of rows is no position."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, csv_text
from scipy.io import savemat

from hil.errors import InputError, RateNeeded
from hil.explanation import explain
from hil.importing.by_map import import_recording
from hil.importing.draft_map import draft_map
from hil.importing.map_draft import MapDraft
from hil.importing.map_text import map_text

AXIS = axis(3000)
DEG, TORQUE = np.rad2deg(AXIS["angle"]), AXIS["torque"]
ROWS = np.arange(DEG.size)
COLUMNS = {"angle [deg]": DEG, "torque [Nm]": TORQUE}


def drafted(path: Path, above: str, columns: dict[str, np.ndarray] = COLUMNS, delimiter: str = "\t") -> MapDraft:
    path.write_text(csv_text(columns, delimiter, above=above))
    return draft_map(path)


PERIODS = {
    "# T_scan = 1600 us\n": 625.0,
    "% cycle_period_ms 8\n": 125.0,
    "; gather buffer, period 0.400 ms\n": 2500.0,
    "Période (ms);3,2\n": 312.5,
    "Periodo: 16 ms\n": 62.5,
    "rate = 160 Hz\n": 160.0,
    "Task;PrimaryTask;2000;us\n": 500.0,
    "fs: 1,25 kHz\n": 1250.0,
    "Zykluszeit [ms];0,8\n": 1250.0,
    '"V 1.3","dt=20ms"\n': 50.0,
    "период 5 мс\n": 200.0,
    "采样周期 4ms\n": 250.0,
    "Campionamento 800 Hz, passo vite 10 mm/giro\n": 800.0,
    "Muestreo: 2 ms\n": 500.0,
}


@pytest.mark.parametrize(
    "line", ["Ritardo campionamento: 10 ms", "Retardo de muestreo 5 ms", "Filtre echantillonnage 2 ms"]
)
def test_a_delay_or_a_filter_of_the_sampling_is_no_period(tmp_path: Path, line: str) -> None:
    with pytest.raises(RateNeeded):
        drafted(tmp_path / "log.txt", f"{line}\n")


def test_a_period_of_the_header_goes_before_a_counter_in_a_unit_of_time(tmp_path: Path) -> None:
    columns = {"cycle_ms": 5.0 + 0.3 * ROWS, **COLUMNS}
    assert drafted(tmp_path / "log.txt", "sampling period 4 ms\n", columns).clock.rate_hz == pytest.approx(250.0)
    told = drafted(tmp_path / "from_zero.txt", "", {"cycle_ms": 1.0 * ROWS, **COLUMNS}).clock
    assert told.time is not None
    assert (told.time.column, told.time.unit) == ("cycle_ms", "ms")


@pytest.mark.parametrize("line", PERIODS)
def test_a_line_with_the_period_is_the_clock(tmp_path: Path, line: str) -> None:
    draft = drafted(tmp_path / "log.txt", line)
    assert draft.clock.rate_hz == pytest.approx(PERIODS[line])
    assert f"period from the line {line.strip(' #%;' + chr(10)).strip(chr(34))!r}" in map_text(draft)
    assert not any("is not used" in note for note in draft.unsure)


@pytest.mark.parametrize("line", ["feed rate = 250 mm/min\n", "PWM period 62.5 us\n", "Sample: 17\n", "Rate: 2\n"])
def test_other_periods_and_rates_are_no_clock(tmp_path: Path, line: str) -> None:
    with pytest.raises(RateNeeded, match=r"no line above the rows tells their rate or period.*hil import FILE --rate"):
        drafted(tmp_path / "log.txt", line)


def test_the_message_names_the_command_that_was_called(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    path.write_text(csv_text(COLUMNS, "\t"))
    with pytest.raises(InputError, match=rf"hil explain {path} --out \S+ --rate HZ"):
        explain(path, tmp_path / "out")


@pytest.mark.parametrize("name", ["n", "N°", "idx", "nº", "Zeile", "pos", "sample"])
def test_a_counter_of_rows_is_the_tick_and_no_channel(tmp_path: Path, name: str) -> None:
    counter = ROWS + 7
    lost = np.delete(ROWS, [400, 401, 402, 1500])
    columns = {key: values[lost] for key, values in ({name: counter} | COLUMNS).items()}
    draft = drafted(tmp_path / "log.csv", "sampling period 2 ms\n", columns, ";")
    assert [one.entry["column"] for one in draft.channels] == ["angle [deg]", "torque [Nm]"]
    assert draft.clock.time is not None
    assert draft.clock.time_s[-1] == pytest.approx(2e-3 * (DEG.size - 1))


def test_a_counter_beside_a_velocity_refuses_nothing(tmp_path: Path) -> None:
    columns = {"n": 0.25 * ROWS, "Winkel_grad": DEG, "Tempo_grad/s": np.rad2deg(AXIS["speed"]), "M_Nm": TORQUE}
    draft = drafted(tmp_path / "log.csv", "Abtastzeit 1 ms\n", columns, ";")
    assert [one.entry["column"] for one in draft.channels] == ["Winkel_grad", "M_Nm"]


def test_stamps_count_more_than_a_line_and_the_difference_is_told(tmp_path: Path) -> None:
    draft = drafted(tmp_path / "log.csv", "period 5 ms\n", {"time [s]": AXIS["t"]} | COLUMNS)
    assert draft.clock.time is not None
    assert draft.clock.time.column == "time [s]"
    assert any(
        "period from the line 'period 5 ms', but the stamps of time [s] step by 0.001" in n for n in draft.unsure
    )


def mat(path: Path, **beside: object) -> MapDraft:
    savemat(path, {"GPOS": np.round(1e4 * AXIS["x_act"])[:, None], "IQ": TORQUE[:, None], **beside})
    return draft_map(path)


@pytest.mark.parametrize(
    "beside",
    [
        {"Ts": 0.5, "info": "GPOS um; IQ A; Ts ms"},
        {"dt": 500.0, "units": ["GPOS um", "IQ A", "dt us"]},
        {"fs": 2.0, "UNITS": np.array(["GPOS um", "IQ A", "fs kHz"], dtype=object)},
    ],
)
def test_a_text_of_units_tells_those_of_numbers_and_columns(tmp_path: Path, beside: dict[str, object]) -> None:
    draft = mat(tmp_path / "run.mat", **beside)
    assert draft.clock.rate_hz == pytest.approx(2000.0)
    assert [one.entry["unit"] for one in draft.channels] == ["um", "A"]


def test_a_unit_of_another_quantity_than_the_name_is_not_taken(tmp_path: Path) -> None:
    draft = mat(tmp_path / "run.mat", Ts=1e-3, info="GPOS um; IQ mm")
    assert draft.channels[1].entry["unit"] == "A"


def test_the_drafted_map_imports_by_that_period(tmp_path: Path) -> None:
    draft = drafted(tmp_path / "log.txt", "# T_scan = 4000 us\n")
    (tmp_path / "map.yaml").write_text(map_text(draft))
    recording = import_recording(tmp_path / "log.txt", tmp_path / "map.yaml")
    assert recording.period_s == pytest.approx(4e-3)
    np.testing.assert_allclose(recording["motor_position_rad"], AXIS["angle"], atol=1e-6)


@pytest.mark.parametrize(("name", "rate"), [("rec.Fs_Hz", 4000.0), ("rec.sample_rate_kHz", 2.0), ("Fs_Hz", 4000.0)])
def test_a_rate_in_the_struct_of_the_signals_is_the_clock(tmp_path: Path, name: str, rate: float) -> None:
    """Before that of another struct."""
    struct = {"angle_deg": DEG, "torque_Nm": TORQUE}
    holder, _, last = name.rpartition(".")
    values = {"gps": {"fs": 5.0}, "rec": struct | ({last: rate} if holder else {})} | ({} if holder else {last: rate})
    savemat(tmp_path / "log.mat", values)
    assert draft_map(tmp_path / "log.mat").clock.rate_hz == pytest.approx(1e3 * rate if "kHz" in name else rate)
