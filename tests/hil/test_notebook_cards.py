"""What a notebook and pandas get: cards with words and a picture, figures that show themselves, tables, saved files."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from browser import browser
from own_recordings import CLEAN, FOREIGN
from processes import DEADLINE_S

import hil
from hil.channels import CHANNELS
from hil.diagnosis.value import Value
from hil.figures.card import MOST_BYTES, card
from hil.figures.drawing import Drawing

PNG = b"\x89PNG\r\n"


@pytest.fixture(scope="module")
def recording() -> hil.Recording:
    return hil.read_recording(CLEAN)


@pytest.fixture(scope="module")
def comparison(recording: hil.Recording) -> hil.Comparison:
    return hil.compare(recording, hil.load_bench("reference"))


def picture_of(html: str) -> bytes:
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return b64decode(data)


def test_a_figure_shows_itself_without_pyplot(recording: hil.Recording) -> None:
    assert recording.plot("torque_n_m")._repr_png_().startswith(PNG)
    code = "import hil, sys; hil.read_recording(sys.argv[1]).plot()._repr_png_(); "
    code += "print('matplotlib.pyplot' in sys.modules)"
    ran = subprocess.run(
        [sys.executable, "-c", code, str(CLEAN)], capture_output=True, text=True, timeout=DEADLINE_S, check=True
    )
    assert ran.stdout == "False\n"


def test_cards_have_words_and_a_small_picture(recording: hil.Recording, comparison: hil.Comparison) -> None:
    for html, words in (
        (recording._repr_html_(), f"{len(recording)} rows at 1 ms"),
        (comparison._repr_html_(), "The twin explains this recording"),
    ):
        assert words in html
        assert picture_of(html).startswith(PNG)
        assert len(html.encode()) <= MOST_BYTES


def test_a_card_of_noise_is_small_too_and_text_is_no_markup() -> None:
    figure = Drawing(7.4, 6.0)
    figure.subplots().imshow(np.random.default_rng(1).uniform(size=(900, 900)), cmap="gray")
    html = card("<b>", "a & b", figure, [("x", "y"), ("<i>", "1")], good=False)
    assert len(html.encode()) <= MOST_BYTES
    assert "<b>&lt;b&gt;</b>" in html
    assert "a &amp; b" in html
    assert "<i>" not in html


def test_a_browser_shows_a_card(comparison: hil.Comparison, tmp_path: Path) -> None:
    page = tmp_path / "card.html"
    page.write_text(f"<!doctype html><meta charset=utf-8>{comparison._repr_html_()}", encoding="utf-8")
    with browser(tmp_path / "profile", page.as_uri()) as shown:
        assert shown.until("document.images.length == 1 && document.images[0].naturalWidth") > 700
        assert shown.run("document.documentElement.scrollWidth <= window.innerWidth")
        assert shown.run("document.querySelectorAll('tr').length") == 1 + len(comparison.channels)
        assert shown.errors == []


def test_a_table_for_pandas_has_time_units_and_names(recording: hil.Recording) -> None:
    pandas = pytest.importorskip("pandas")
    frame = recording.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.index.name == "time_s"
    assert list(frame.columns) == [name for name in recording.columns if name != "time_s"]
    assert np.array_equal(frame["torque_n_m"], recording["torque_n_m"])
    assert frame.attrs["units"]["torque_n_m"] == "N m"


def test_without_pandas_it_says_how_to_install_it(recording: hil.Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(hil.InputError, match=r"pip install 'hil-servo\[notebook\]'"):
        recording.to_pandas()


def test_quantities_have_no_unit() -> None:
    assert CHANNELS["acceleration_command_m_s2"].quantity == "acceleration command"
    assert CHANNELS["torque_n_m"].quantity == "torque"
    assert CHANNELS["drive_state"].quantity == "drive state"


def test_a_value_has_number_standard_error_and_unit() -> None:
    value = Value(value=7.75e-6, std=6.5e-9, unit="m")
    assert (value.value, value.standard_error, value.unit) == (7.75e-6, 6.5e-9, "m")
    assert value.model_dump() == {"value": 7.75e-6, "std": 6.5e-9, "unit": "m"}  # the JSON stays
    assert str(Value(value=418.2, std=0.847, unit="kg")) == "418.20 ± 0.85 kg"


def test_what_is_saved_is_read_again(recording: hil.Recording, comparison: hil.Comparison, tmp_path: Path) -> None:
    again = hil.read_recording(hil.save(recording, tmp_path / "run.parquet"))
    assert np.array_equal(again["torque_n_m"], recording["torque_n_m"])
    bench = hil.load_bench("reference")
    assert hil.load_bench(hil.save(bench, tmp_path / "bench.yaml")).axis == bench.axis
    motor = {name: recording[name] for name in ("time_s", "motor_position_rad", "torque_n_m")}  # no law to replay
    drafted = hil.identify(replace(recording, columns=motor))
    assert hil.load_bench(hil.save(drafted, tmp_path / "drafted.yaml")).axis == drafted.bench.axis
    assert "coulomb_torque_n_m = " in repr(drafted)
    assert "data:image/png" in hil.save(comparison, tmp_path / "compare.html").read_text(encoding="utf-8")
    assert json.loads(hil.save(comparison, tmp_path / "compare.json").read_text())["explained"] is True


def test_a_drafted_map_is_saved_and_reads_the_file(tmp_path: Path) -> None:
    the_map = hil.draft_map(FOREIGN)
    assert "motor_position_rad: column: " in repr(the_map)
    text = hil.save(the_map, tmp_path / "map.yaml").read_text(encoding="utf-8")
    assert text.startswith(f"# Map of {FOREIGN.name}")


def test_saving_overwrites_only_when_told_and_never_loses_the_old(recording: hil.Recording, tmp_path: Path) -> None:
    path = hil.save(recording, tmp_path / "run.csv")
    with pytest.raises(hil.InputError, match="overwrite=True"):
        hil.save(recording, path)
    assert hil.save(recording, path, overwrite=True) == path
    bench = hil.load_bench("reference")
    kept = tmp_path / "bench.yaml"
    kept.write_text("mine")
    broken = cast(hil.Bench, hil.Bench.model_construct(axis=SimpleNamespace()))
    with pytest.raises(Exception):  # noqa: B017, PT011  (any error while it is written)
        hil.save(broken, kept, overwrite=True)
    assert kept.read_text() == "mine"
    with pytest.raises(hil.InputError, match=r"given the ending '\.csv', allowed \.yaml, \.yml"):
        hil.save(bench, tmp_path / "bench.csv")
    with pytest.raises(TypeError, match="given int"):
        hil.save(1, tmp_path / "one.yaml")  # type: ignore[arg-type]
    assert {one.name for one in tmp_path.iterdir()} == {"run.csv", "run.csv-metadata.json", "bench.yaml"}


def test_help_fits_and_names_everything() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", "import hil; help(hil)"], capture_output=True, text=True, timeout=DEADLINE_S, check=True
    )
    assert len(ran.stdout.splitlines()) < 200
    assert [name for name in hil.__all__ if name != "__version__" and not re.search(rf"\b{name}\b", ran.stdout)] == []
    assert set(hil.__all__) <= set(dir(hil))
