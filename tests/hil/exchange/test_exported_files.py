"""Exported files: what other programs find in them, what `hil` says of wrong ones, and that nothing heavy is loaded."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pyarrow.csv as pacsv
import pytest
from command_line import hil, refused
from exported import FORMATS, assert_same, needs, short_run
from scipy.io import loadmat

from hil.channels import CHANNELS
from hil.errors import InputError
from hil.exchange.export import export_recording
from hil.exchange.own_file import read_exported
from hil.recording.recording import Recording, read_recording, write_parquet

RUN = short_run()
START_S = 1770087906.0  # of the run, since 1970


@pytest.fixture(autouse=True)
def _libraries_may_warn() -> Iterator[None]:
    with warnings.catch_warnings():
        if "asammdf" in sys.modules:
            warnings.simplefilter("ignore")
        yield


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_parquet(RUN, tmp_path / "run.parquet")
    return tmp_path


@pytest.mark.parametrize("ending", FORMATS)
def test_the_commands_export_and_import_without_a_question(ending: str, folder: Path) -> None:
    ran = hil(folder, "export", "run.parquet", "--out", f"run{ending}")
    assert ran.returncode == 0, ran.stderr
    (folder / "run.parquet").rename(folder / "before.parquet")
    ran = hil(folder, "import", f"run{ending}")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == "600 rows, 0.001 s each\nRecording: run.parquet\n"
    before = read_recording(folder / "before.parquet")
    assert_same(read_recording(folder / "run.parquet"), Recording("run", before.columns, 1e-3, before.metadata))
    assert not list(folder.glob("*map*"))


def test_csv_is_a_plain_table_with_metadata_beside_it(folder: Path) -> None:
    export_recording(RUN, folder / "run.csv")
    table = pacsv.read_csv(folder / "run.csv")
    assert table.column_names == list(RUN.columns)
    told = json.loads((folder / "run.csv-metadata.json").read_text())
    assert told["@context"] == "http://www.w3.org/ns/csvw"
    units = {one["name"]: one["schema:unitText"] for one in told["tableSchema"]["columns"]}
    assert units == {name: CHANNELS[name].unit for name in RUN.columns}
    (folder / "run.csv-metadata.json").unlink()
    assert read_exported(folder / "run.csv") is None
    np.testing.assert_array_equal(read_recording(folder / "run.csv")["torque_n_m"], RUN["torque_n_m"])


def test_mat_has_vectors_units_and_meanings(folder: Path) -> None:
    export_recording(RUN, folder / "run.mat")
    content = loadmat(folder / "run.mat", simplify_cells=True)
    np.testing.assert_array_equal(content["torque_n_m"], RUN["torque_n_m"])
    assert content["units"]["torque_n_m"] == "N m"
    assert content["meaning"]["table_position_m"] == "linear encoder"


@pytest.mark.parametrize("ending", [pytest.param(".h5", marks=needs(".h5"))])
def test_hdf5_has_a_dimension_of_time(ending: str, folder: Path) -> None:
    import h5py

    export_recording(RUN, folder / f"run{ending}")
    with h5py.File(folder / f"run{ending}") as file:
        torque = file["torque_n_m"]
        assert torque.attrs["units"] == "N m"
        assert torque.dims[0][0].name == "/time_s"
        np.testing.assert_array_equal(torque[()], RUN["torque_n_m"])


def test_a_unit_that_was_changed_is_refused(folder: Path) -> None:
    export_recording(RUN, folder / "run.csv")
    beside = folder / "run.csv-metadata.json"
    beside.write_text(beside.read_text().replace('"schema:unitText": "N m"', '"schema:unitText": "mN m"', 1))
    with pytest.raises(InputError, match="torque_command_n_m: given in mN m, allowed N m"):
        read_exported(folder / "run.csv")


@pytest.mark.parametrize("ending", [pytest.param(".mcap", marks=needs(".mcap"))])
def test_mcap_has_a_message_per_row_at_its_instant(ending: str, folder: Path) -> None:
    from mcap.reader import make_reader

    export_recording(RUN, folder / f"run{ending}")
    with (folder / f"run{ending}").open("rb") as file:
        messages = list(make_reader(file).iter_messages())
    assert len(messages) == len(RUN)
    schema, channel, last = messages[-1]
    assert (channel.topic, channel.message_encoding) == ("hil", "json")
    assert json.loads(schema.data)["properties"]["torque_n_m"]["title"] == "torque_n_m [N m]"
    assert json.loads(last.data)["torque_n_m"] == RUN["torque_n_m"][-1]
    assert last.log_time == round(START_S) * 10**9 + round(RUN["time_s"][-1] * 1e9)


@pytest.mark.parametrize("ending", [pytest.param(".mf4", marks=needs(".mf4"))])
def test_mdf_has_units_comments_and_the_start(ending: str, folder: Path) -> None:
    from asammdf import MDF

    export_recording(RUN, folder / f"run{ending}")
    with MDF(folder / f"run{ending}") as file:
        signal = file.get("torque_n_m")
        assert (signal.unit, signal.comment) == ("N m", CHANNELS["torque_n_m"].meaning)
        np.testing.assert_array_equal(signal.samples, RUN["torque_n_m"])
        np.testing.assert_array_equal(signal.timestamps, RUN["time_s"])
        assert file.start_time.timestamp() == START_S


@pytest.mark.parametrize("ending", FORMATS)
def test_a_changed_export_is_refused_with_its_reason(ending: str, tmp_path: Path) -> None:
    wrong = Recording("run", RUN.columns, 1e-3, {"clock_notes": "no list"})
    path = tmp_path / f"run{ending}"
    export_recording(wrong, path)
    with pytest.raises(InputError, match=r"its metadata \(clock_notes: given 'no list'\)"):
        read_exported(path)


@pytest.mark.parametrize("ending", FORMATS)
def test_damaged_exports_are_refused_without_a_trace(ending: str, tmp_path: Path) -> None:
    export_recording(RUN, tmp_path / f"whole{ending}")
    whole, path = (tmp_path / f"whole{ending}").read_bytes(), tmp_path / f"run{ending}"
    if ending == ".csv":
        (tmp_path / "run.csv-metadata.json").write_bytes((tmp_path / "whole.csv-metadata.json").read_bytes())
    middle = len(whole) // 2
    for content in (b"", b"\0" * 1000, whole[:50], whole[: middle - 5], whole[:-20],
                    whole[:middle] + b"\xff" * 40 + whole[middle + 40 :]):  # fmt: skip
        path.write_bytes(content)
        (tmp_path / "run.parquet").unlink(missing_ok=True)
        ran = hil(tmp_path, "import", path.name)
        assert "Traceback" not in ran.stderr
        assert ran.returncode in (0, 2)
        if ran.returncode:
            assert path.name in ran.stderr
            (tmp_path / "run-map.yaml").unlink(missing_ok=True)


def test_wrong_targets_are_refused(folder: Path) -> None:
    told = refused(folder, "export", "run.parquet", "--out", "a.xyz")
    assert "given the ending '.xyz', allowed .mf4, .mcap, .csv" in told
    (folder / "run.mat").write_text("mine")
    told = refused(folder, "export", "run.parquet", "--out", "run.mat")
    assert "run.mat: the file exists and is not overwritten" in told
    assert (folder / "run.mat").read_text() == "mine"
    (folder / "a.csv-metadata.json").write_text("mine")
    told = refused(folder, "export", "run.parquet", "--out", "a.csv")
    assert "a.csv-metadata.json: the file exists" in told
    assert "cannot be written" in refused(folder, "export", "run.parquet", "--out", "no/folder/a.mat")
    told = refused(folder, "export", "run.parquet", "--out", "a.mat", "--plotjuggler")
    assert "given --plotjuggler with the ending '.mat', allowed .csv, .mcap" in told


EXTRAS = [(".mf4", "asammdf", "mf4"), (".mcap", "mcap.writer", "exchange"), (".h5", "h5py", "exchange")]


@pytest.mark.parametrize(("ending", "module", "extra"), EXTRAS)
def test_an_extra_that_is_not_installed_is_named(
    ending: str, module: str, extra: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    told = refused(folder, "export", "run.parquet", "--out", f"a{ending}")
    assert f"which is not installed; install it: pip install 'hil-servo[{extra}]'" in told


@pytest.mark.parametrize("ending", [".csv", pytest.param(".mcap", marks=needs(".mcap"))])
def test_a_layout_names_the_curves_of_the_file(ending: str, folder: Path) -> None:
    ran = hil(folder, "export", "run.parquet", "--out", f"run{ending}", "--plotjuggler")
    assert "Export: run-layout.xml" in ran.stdout, ran.stderr
    root = Xml.parse(folder / "run-layout.xml").getroot()
    areas = root.findall("./tabbed_widget/Tab/Container/DockSplitter/DockArea")
    prefix = "hil/" if ending == ".mcap" else ""
    torque = next(area for area in areas if area.get("name") == "torque")
    names = [curve.get("name") for curve in torque.iter("curve")]
    assert names == [f"{prefix}{name}" for name in ("torque_command_n_m", "torque_n_m", "twin_torque_n_m")]
    assert all(curve.get("name", "").removeprefix(prefix) in RUN.columns for curve in root.iter("curve"))
    assert "velocity" not in [area.get("name") for area in areas]
    info = root.find("./previouslyLoaded_Datafiles/fileInfo")
    assert info is not None
    assert info.get("filename") == f"run{ending}"


def test_no_format_is_loaded_unless_it_is_asked_for(folder: Path) -> None:
    heavy = "asammdf", "mcap", "h5py", "nptdms", "pyulog", "scipy", "zstandard"
    code = (
        "import sys; from hil.cli import main; sys.argv = ['hil', 'export', 'run.parquet', '--out', 'run.csv']\n"
        f"try: main()\nfinally: print([name for name in {heavy} if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    assert found.stdout.splitlines()[-1] in ("[]", "['asammdf']")  # python-can imports that where it is installed
