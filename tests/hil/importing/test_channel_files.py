"""Files of groups of channels of other makers: other rates, names twice, units, and wrong or hostile content."""

from __future__ import annotations

import struct
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from channel_files import ANGLE, CHANNEL_FILES, START_NS, TORQUE, T, mat_of_version_7_3
from exported import needs

from hil.errors import InputError
from hil.files import input_file
from hil.importing.by_map import import_recording
from hil.importing.channel_groups import Group, one_length
from hil.importing.draft_map import draft_map
from hil.importing.hdf5_file import load_hdf5
from hil.importing.map_text import map_text
from hil.importing.variables import load_variables
from hil.recording.recording import Recording

SLOW = slice(None, None, 4)  # rows of the torque, in a group of its own
RATES = [pytest.param(ending, marks=needs(ending)) for ending in (".mf4", ".h5", ".mcap", ".tdms", ".ulg")]
FILES = [pytest.param(name, marks=needs(f".{CHANNEL_FILES[name][0]}")) for name in CHANNEL_FILES]


@pytest.fixture(autouse=True)
def _libraries_may_warn() -> Iterator[None]:
    with warnings.catch_warnings():
        if "asammdf" in sys.modules or "pandas" in sys.modules:
            warnings.simplefilter("ignore")
        yield


def write_two_rates(path: Path) -> None:
    """The angle in every row, the torque in every fourth, each group with stamps of its own."""
    match path.suffix:
        case ".mf4":
            from asammdf import MDF, Signal

            with MDF(version="4.10") as file:
                file.append([Signal(ANGLE, T, "rad", "angle")], acq_name="fast")
                file.append([Signal(TORQUE[SLOW], T[SLOW], "Nm", "torque")], acq_name="slow")
                file.save(path, overwrite=True)
        case ".h5":
            import h5py

            with h5py.File(path, "w") as file:
                for group, rows, name, values, unit in (
                    ("fast", slice(None), "angle", ANGLE, "rad"), ("slow", SLOW, "torque", TORQUE, "Nm"),
                ):  # fmt: skip
                    file[f"{group}/{name}"], file[f"{group}/time"] = values[rows], T[rows]
                    file[f"{group}/{name}"].attrs["unit"] = np.bytes_(unit)
                    file[f"{group}/time"].attrs["unit"] = "s"
        case ".mcap":
            import json

            from mcap.writer import Writer

            with path.open("wb") as stream:
                writer = Writer(stream)
                writer.start()
                schema = writer.register_schema("axis", "jsonschema", b"{}")
                fast, slow = (writer.register_channel(name, "json", schema) for name in ("fast", "slow"))
                for k, t in enumerate(T):
                    at = START_NS + round(t * 1e9)
                    writer.add_message(fast, at, json.dumps({"angle_rad": ANGLE[k]}).encode(), at)
                    if k % 4 == 0:
                        writer.add_message(slow, at, json.dumps({"torque_Nm": TORQUE[k]}).encode(), at)
                writer.finish()
        case ".tdms":
            from nptdms import ChannelObject, TdmsWriter

            def wave(group: str, name: str, values: np.ndarray, step_s: float, unit: str) -> ChannelObject:
                return ChannelObject(group, name, values, {"wf_increment": step_s, "unit_string": unit})

            with TdmsWriter(path) as file:
                file.write_segment(
                    [wave("a", "angle", ANGLE, 1e-3, "rad"), wave("b", "torque", TORQUE[SLOW], 4e-3, "Nm")]
                )
        case _:
            write_ulog(path, [("fast", "double angle_rad;", ANGLE, 1), ("slow", "double torque_nm;", TORQUE, 4)])


def write_ulog(path: Path, topics: list[tuple[str, str, np.ndarray, int]]) -> None:
    """Topics of one field each, every n-th row of it."""
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]

    def put(kind: str, content: bytes) -> None:
        parts.append(struct.pack("<HB", len(content), ord(kind)) + content)

    for name, fields, _, _ in topics:
        put("F", f"{name}:uint64_t timestamp;{fields}".encode())
    for number, (name, *_) in enumerate(topics):
        put("A", struct.pack("<BH", 0, number) + name.encode())
    for k, t in enumerate(T):
        for number, (_, _, values, every) in enumerate(topics):
            if k % every == 0:
                put("D", struct.pack("<HQd", number, 1000 + round(t * 1e6), values[k]))
    path.write_bytes(b"".join(parts))


def imported(path: Path) -> Recording:
    map_path = path.with_suffix(".yaml")
    map_path.write_text(map_text(draft_map(path)))
    return import_recording(path, map_path)


@pytest.mark.parametrize("ending", RATES)
def test_groups_of_other_rates_are_merged_by_their_stamps(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"two{ending}"
    write_two_rates(path)
    recording = imported(path)
    rows = len(recording)
    assert rows >= T.size - 4
    assert recording.period_s == pytest.approx(1e-3)
    np.testing.assert_allclose(recording["motor_position_rad"], ANGLE[:rows], atol=1e-9)
    np.testing.assert_allclose(recording["torque_n_m"][::4], TORQUE[:rows:4], atol=1e-9)


@pytest.mark.parametrize("at", ["/", "AxisX", "settings"])
def test_the_rate_is_an_attribute_of_a_group_or_of_the_file(at: str, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("AxisX")
        for name, values, unit in (("angle", ANGLE, "rad"), ("torque", TORQUE, "Nm")):
            group.create_dataset(name, data=values).attrs["unit"] = unit
        file.require_group(at).attrs["sample_rate_Hz"] = 1000.0
    assert imported(path).period_s == pytest.approx(1e-3)


def test_attributes_of_data_go_before_those_beside_and_another_axis_has_none(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("axes/X")
        group.attrs["sample_rate_Hz"] = 1000.0
        for name, values, unit in (("angle", ANGLE, "rad"), ("current", TORQUE, "A")):
            group.create_dataset(name, data=values).attrs["unit"] = unit
        file.create_group("axes/Y/nameplate").attrs["torque_constant_Nm_per_A"] = 7.0
        file.create_group("nameplate").attrs["torque_constant_Nm_per_A"] = 2.0
        file.create_group("calibration").attrs["sample_rate_Hz"] = 10.0
    recording = imported(path)
    assert recording.period_s == pytest.approx(1e-3)
    np.testing.assert_allclose(recording["torque_n_m"], 2.0 * TORQUE, atol=1e-9)


def test_a_number_before_the_unit_of_an_attribute_is_a_factor(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_Hz"] = 1000.0
        rated = np.full(ANGLE.size, 80.0)
        for name, values, unit in (
            ("s_act", np.degrees(ANGLE) / 1e-3, "0.001 deg"),
            ("torque", TORQUE / 0.08, "%"),
            ("rated_torque", rated, "0.1 Nm"),
        ):
            file.create_dataset(name, data=values).attrs["unit"] = unit
    np.testing.assert_allclose(imported(path)["motor_position_rad"], ANGLE, atol=1e-9)
    np.testing.assert_allclose(imported(path)["torque_n_m"], TORQUE, atol=1e-9)


def test_counts_with_a_scale_and_their_number_per_turn_beside_a_dataset(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path, counts = tmp_path / "run.h5", 65536
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_Hz"] = 1000.0
        angle = np.round(ANGLE / (2.0 * np.pi) * counts).astype(np.int32)
        file.create_dataset("enc_pos", data=angle).attrs.update({"unit": "counts", "counts_per_rev": counts})
        torque = np.round(TORQUE / 1e-4).astype(np.int32)
        file.create_dataset("torque", data=torque).attrs.update({"unit": "Nm", "scale": 1e-4, "offset": 0.25})
        told = {"unit": "Nm", "scale": 0.5, "sample_rate_Hz": 250.0}  # numbers may hold it; the rate of a sensor
        file.create_dataset("torque_set", data=TORQUE).attrs.update(told)
    found = imported(path)
    np.testing.assert_allclose(found["motor_position_rad"], ANGLE, atol=2.0 * np.pi / counts)
    np.testing.assert_allclose(found["torque_n_m"], TORQUE + 0.25, atol=1e-4)
    np.testing.assert_allclose(found["torque_command_n_m"], TORQUE, atol=1e-9)


def test_datasets_with_numbers_for_names_have_those_of_an_attribute(tmp_path: Path) -> None:
    """dSPACE writes a dataset /Measurement/Y3, and its name into the attribute Path."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        folder = file.create_group("Measurement")
        for name, values, about in (
            ("X", np.arange(ANGLE.size) * 1e-3, {"Path": "currentTime", "Unit": "s"}),
            ("Y0", ANGLE / (2.0 * np.pi), {"Path": "Model/Encoder/Position", "Unit": "rev"}),
            ("Y1", np.round(TORQUE / 1e-4).astype(np.int32), {"Path": "Model/Torque", "Unit": "Nm", "Factor": 1e-4}),
            ("Y2", np.full(ANGLE.size, 560.0), {"Path": "Model/ADC/U_DC", "Unit": "V"}),
        ):
            folder.create_dataset(name, data=values).attrs.update(about)
    found = imported(path)
    assert found.metadata["channels"]["torque_n_m"]["column"] == "Model/Torque"
    np.testing.assert_allclose(found["motor_position_rad"], ANGLE, atol=1e-9)
    np.testing.assert_allclose(found["torque_n_m"], TORQUE, atol=1e-4)


@pytest.mark.parametrize(
    ("factor", "says"), [(0.0, "the factor 0"), (np.nan, "the factor nan"), ("fast", "the factor nan")]
)
def test_a_factor_of_whole_numbers_that_is_none_is_refused(tmp_path: Path, factor: float | str, says: str) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_Hz"] = 1000.0
        file.create_dataset("angle_rad", data=ANGLE)
        torque = file.create_dataset("torque", data=np.round(TORQUE / 1e-4).astype(np.int32))
        torque.attrs.update({"Unit": "Nm", "FACTOR": factor})
    with pytest.raises(InputError, match=f"/torque: given {says}"):
        imported(path)


@pytest.mark.parametrize("factor", [b"1e-4", "1e-4", np.array([1e-4])])
def test_a_factor_may_be_a_text_and_the_unit_stand_in_the_name(tmp_path: Path, factor: object) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate_Hz"] = 1000.0
        file.create_dataset("q", data=ANGLE).attrs.update({"unit": "rad", "description": "angle of the motor"})
        torque = file.create_dataset("P2", data=np.round(TORQUE / 1e-4).astype(np.int32))
        torque.attrs.update({"Name": "torque_Nm", "Factor": factor, "label": h5py.Empty("f")})
    found = imported(path)
    assert found.metadata["channels"]["motor_position_rad"]["column"] == "q"
    np.testing.assert_allclose(found["torque_n_m"], TORQUE, atol=1e-4)


def test_an_attribute_that_groups_give_with_different_values_is_none(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        for number, name in enumerate(("angle", "torque")):
            group = file.create_group(name)
            group.create_dataset(name, data=ANGLE)
            group.attrs.update({"sample_rate_Hz": 1000.0 * (1 + number), "device": "a"})
    texts, _ = load_hdf5(path)
    assert "sample_rate_Hz" not in texts
    assert str(texts["device"]) == "a"


@pytest.mark.parametrize("library", [pytest.param("h5py", marks=needs(".h5"))])
def test_matlab_files_of_version_7_3_are_read_as_the_hdf5_that_they_are(library: str, tmp_path: Path) -> None:
    path = tmp_path / "axis.mat"
    mat_of_version_7_3(path)
    assert str(load_variables(path).arrays["note"]) == "test rig"
    recording = imported(path)
    np.testing.assert_allclose(recording["motor_position_rad"], ANGLE)
    np.testing.assert_allclose(recording["torque_n_m"], TORQUE)


def test_a_name_of_several_groups_is_told_apart_by_the_group(tmp_path: Path) -> None:
    groups = [
        Group("a", {"time": np.arange(4.0), "x": np.arange(4)}, {"time": "s", "x": "mm"}),
        Group("b", {"time": np.arange(2.0), "x": np.arange(2), "y": np.array(["p", "q"])}, {"x": "m"}),
        Group("b", {"x": np.arange(3.0), "z": np.ones(1)}, {}, has_clock=False),
        Group("only a clock", {"time": np.arange(9.0)}, {}),
    ]
    arrays, units = one_length(tmp_path, groups)
    assert list(arrays) == ["a.time", "a.x", "b.time", "b.x", "y", "b.x 2", "z"]
    np.testing.assert_array_equal(arrays["b.x"], [0.0, 1.0, np.nan, np.nan])
    assert arrays["y"].size == 2
    assert arrays["b.x 2"].size == 3
    assert units == {"a.time": "s", "a.x": "mm", "b.x": "m"}


@pytest.mark.parametrize("name", FILES)
def test_damaged_files_are_refused_or_read(name: str, tmp_path: Path) -> None:
    ending, write = CHANNEL_FILES[name]
    write(tmp_path / f"whole.{ending}")
    whole, path = (tmp_path / f"whole.{ending}").read_bytes(), tmp_path / f"axis.{ending}"
    rng = np.random.default_rng(5)
    contents = [b"", b"\0" * 5000, b"text\n" * 100, whole[:40], whole[: len(whole) // 2], whole[:-9]]
    for _ in range(6):
        at = int(rng.integers(len(whole) - 8))
        contents.append(whole[:at] + rng.bytes(8) + whole[at + 8 :])
        at = int(rng.integers(2000))
        contents.append(whole[:at] + b"\xff" * 8 + whole[at + 8 :])
    for content in contents:
        path.write_bytes(content)
        try:
            draft_map(path)
        except InputError as error:
            assert path.name in str(error)  # noqa: PT017  (whether it is refused depends on the place)


@pytest.mark.parametrize("name", FILES)
def test_too_many_values_are_refused_before_they_are_read(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ending, write = CHANNEL_FILES[name]
    path = tmp_path / f"axis.{ending}"
    write(path)
    monkeypatch.setattr(input_file, "MOST_VALUES", 2000)
    with pytest.raises(InputError, match="allowed 2000 values together"):
        load_variables(path)


@pytest.mark.parametrize("ending", [pytest.param(".h5", marks=needs(".h5"))])
def test_a_huge_dataset_in_a_small_file_is_refused(ending: str, tmp_path: Path) -> None:
    import h5py

    path = tmp_path / f"huge{ending}"
    with h5py.File(path, "w") as file:
        file.create_dataset("position", (10**6, 10**6), "f8", chunks=(1000, 1000), compression="gzip")
    assert path.stat().st_size < 10_000
    with pytest.raises(InputError, match="datasets of 1000000000000 values, allowed 50000000"):
        load_variables(path)


@pytest.mark.parametrize("ending", [pytest.param(".h5", marks=needs(".h5"))])
def test_links_out_of_the_file_are_not_followed(ending: str, tmp_path: Path) -> None:
    import h5py

    (tmp_path / "secret").write_bytes(bytes(range(80)))
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["angle"] = np.arange(10.0)
    path = tmp_path / f"links{ending}"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(10.0)
        file["linked"] = h5py.ExternalLink("other.h5", "/angle")
        file.create_dataset("outside", (10,), "f8", external=[(str(tmp_path / "secret"), 0, 80)])
        layout = h5py.VirtualLayout((10,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "angle", (10,))
        file.create_virtual_dataset("virtual", layout)
        file["speed"] = np.arange(10.0)
    assert sorted(load_variables(path).arrays) == ["speed", "time"]


@pytest.mark.parametrize("ending", [pytest.param(".mcap", marks=needs(".mcap"))])
def test_chunks_that_expand_beyond_what_they_say_are_refused(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import lz4.frame
    import zstandard
    from mcap.opcode import Opcode

    from hil.importing import mcap_file

    monkeypatch.setattr(mcap_file, "MOST_BYTES", 8000)
    monkeypatch.setattr(input_file, "MOST_VALUES", 1000)
    content = bytes(100_000)
    for compression, data in ((b"lz4", lz4.frame.compress(content)), (b"zstd", zstandard.compress(content))):
        head = struct.pack("<QQQII", 0, 0, 10, 0, len(compression)) + compression
        chunk = head + struct.pack("<Q", len(data)) + data
        record = struct.pack("<BQ", Opcode.CHUNK, len(chunk)) + chunk
        header = struct.pack("<BQ", Opcode.HEADER, 8) + bytes(8)
        path = tmp_path / f"bomb{ending}"
        path.write_bytes(b"\x89MCAP0\r\n" + header + record)
        with pytest.raises(InputError, match="chunks that expand to more than 8000 bytes, allowed 1000"):
            load_variables(path)


@pytest.mark.parametrize("ending", [pytest.param(".mcap", marks=needs(".mcap"))])
def test_messages_of_another_encoding_are_named(ending: str, tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / f"other{ending}"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("axis", "protobuf", b"")
        channel = writer.register_channel("axis", "protobuf", schema)
        writer.add_message(channel, 0, b"\x01", 0)
        writer.finish()
    with pytest.raises(InputError, match="its messages are of the encoding protobuf, allowed json, cdr; export"):
        draft_map(path)


@pytest.mark.parametrize("ending", RATES)
def test_columns_of_nothing_but_nan_or_text_are_refused(ending: str, tmp_path: Path) -> None:
    if ending in (".mcap", ".ulg"):
        pytest.skip("the format has no such columns")
    path = tmp_path / f"nan{ending}"
    nothing, words = np.full(100, np.nan), np.array([b"abc"] * 100)
    if ending == ".mf4":
        from asammdf import MDF, Signal

        with MDF(version="4.10") as file:
            stamps = np.arange(100) * 1e-3
            file.append(
                [Signal(nothing, stamps, "rad", "angle"), Signal(words, stamps, "", "torque", encoding="utf-8")]
            )
            file.save(path, overwrite=True)
    elif ending == ".h5":
        import h5py

        with h5py.File(path, "w") as file:
            file["time"], file["angle"], file["torque"] = np.arange(100) * 1e-3, nothing, words
    else:
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(path) as file:
            texts = ChannelObject("a", "torque", ["abc"] * 100)
            file.write_segment([ChannelObject("a", "angle", nothing, {"wf_increment": 1e-3}), texts])
    with pytest.raises(InputError, match=path.name):
        imported(path)


@pytest.mark.parametrize(
    ("ending", "module"), [(".h5", "h5py"), (".mcap", "mcap.records"), (".tdms", "nptdms"), (".ulg", "pyulog")]
)
def test_an_extra_that_is_not_installed_is_named(
    ending: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / f"run{ending}"
    path.write_bytes(b"content")
    with pytest.raises(InputError, match=r"not installed; install it: pip install 'hil-servo\[exchange\]'"):
        draft_map(path)
