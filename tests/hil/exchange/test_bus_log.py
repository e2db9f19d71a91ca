"""The log of a bus, written beside a run by a process of its own: decoded, it gives the rows of the run again."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import can
import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from bench_runs import MOVE
from command_line import hil, refused
from patient_bench import patient_bench

from hil.bench.bench_file import Bench
from hil.errors import FieldError, HilError, InputError
from hil.exchange import can_frames
from hil.exchange.bus_log import import_bus_log, sync_rows
from hil.exchange.can_frames import BusFrames, read_frames
from hil.files import input_file
from hil.loop.bus_log import log_bus
from hil.loop.run import run_profile
from hil.recording.recording import read_recording

ENDINGS = (".blf", ".asc", ".log")
RATED_N_M = 14.0  # of the simulated drive
Logged = tuple[Path, dict[str, np.ndarray]]


@pytest.fixture(scope="module")
def bench() -> Bench:
    return patient_bench(interface="udp_multicast", channel="239.74.163.41")


@pytest.fixture(scope="module")
def logged(bench: Bench, tmp_path_factory: pytest.TempPathFactory) -> Logged:
    """A run in wall-clock time and the BLF file of its bus."""
    folder = tmp_path_factory.mktemp("logged")
    with log_bus(bench, folder / "bus.blf"):
        ran = run_profile(bench, MOVE, folder, "run", force=True)
    assert ran.complete
    assert ran.recording is not None
    return folder / "bus.blf", rows_of(ran.recording)


def frame(tick: int, can_id: int, data: bytes) -> can.Message:
    return can.Message(timestamp=1e9 + 1e-3 * tick, arbitration_id=can_id, data=data, is_extended_id=False)


def with_rated_torque(bench: Bench) -> Bench:
    assert bench.drive is not None
    return bench.model_copy(update={"drive": bench.drive.model_copy(update={"rated_torque_n_m": RATED_N_M})})


def converted(path: Path, ending: str, keep: range | None = None) -> Path:
    """The log in another format of python-can; of its frames those of `keep` only."""
    target = path.with_name(f"copy{'' if keep is None else keep.start}{ending}")
    with can.LogReader(path) as frames, can.Logger(target) as copy:
        for number, frame in enumerate(frames):
            if keep is None or number in keep:
                copy.on_message_received(frame)
    return target


def rows_of(path: Path) -> dict[str, np.ndarray]:
    """Rows as the run wrote them: a reader interpolates those of ticks that were left out."""
    table = pq.read_table(path)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def assert_same_rows(decoded: dict[str, np.ndarray], run: dict[str, np.ndarray]) -> None:
    """The rows of the run stand in those of the log, which begin before the drive is enabled."""
    begin = int(np.argmax(decoded["drive_state"] == run["drive_state"][0]))
    piece = slice(begin, begin + len(run["time_s"]))
    for name in ("motor_position_rad", "table_position_m", "torque_n_m", "drive_state", "drive_error_code"):
        np.testing.assert_array_equal(decoded[name][piece], run[name], err_msg=name)
    step = 0.51e-3 * RATED_N_M  # of the target torque
    np.testing.assert_allclose(decoded["torque_command_n_m"][piece], run["torque_command_n_m"], atol=step)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_log_gives_the_rows_of_the_run_again(ending: str, bench: Bench, logged: Logged) -> None:
    path, run = logged
    assert_same_rows(sync_rows(read_frames(converted(path, ending)), bench), run)


def test_ticks_are_told_by_stamps_that_may_be_late() -> None:
    ticks = np.delete(np.arange(20_000), [5000, 5001, 5002, 12_000])
    rng = np.random.default_rng(1)
    late = rng.exponential(0.1, ticks.size)
    late[::700] += 5.0  # of the program that logs
    for clock in (1.0, 1.0 + 80e-6):  # that of another PC
        stamps = np.sort(1e9 + 1e-3 * (ticks * clock + late))
        found = BusFrames(Path("a"), {}, stamps).tick_times(1e-3) / 1e-3
        assert np.abs(found - ticks).max() < 1.01
        assert np.mean(np.abs(found - ticks) < 0.01) > 0.995
    assert BusFrames(Path("a"), {}, np.arange(100) * 2e-5).tick_times(1e-3)[-1] == pytest.approx(0.099)
    with pytest.raises(InputError, match=r"SYNC comes every 0.002 s, allowed 0.001 s as in the bench"):
        BusFrames(Path("a"), {}, np.arange(100) * 2e-3).tick_times(1e-3)


def test_a_log_that_begins_after_the_set_up_is_read_by_the_bench(bench: Bench, logged: Logged) -> None:
    path, run = logged
    with can.LogReader(path) as frames:
        count = sum(1 for _ in frames)
    late = converted(path, ".asc", range(count // 3, count))
    with pytest.raises(InputError, match=r"tells the rated torque \(object 0x6076\); give drive.rated_torque_n_m"):
        import_bus_log(late, bench)
    decoded = sync_rows(read_frames(late), with_rated_torque(bench))
    motor = run["motor_position_rad"]
    at = np.flatnonzero(motor == decoded["motor_position_rad"][100])
    assert at.size == 1
    np.testing.assert_array_equal(decoded["motor_position_rad"][:200], motor[at[0] - 100 :][:200])


def test_positions_are_counted_on_over_the_wrap_of_their_object(tmp_path: Path, bench: Bench) -> None:
    counts = np.arange(-50, 50) * 1000 + 2**31
    path = tmp_path / "wrap.blf"
    with can.Logger(path) as log:
        for tick, count in enumerate(counts):
            answer = (0x0237).to_bytes(2, "little") + int(count % 2**32).to_bytes(4, "little") + bytes(2)
            for can_id, data in ((0x080, b""), (0x185, answer), (0x186, bytes(4)), (0x205, bytes(4))):
                log.on_message_received(frame(tick, can_id, data))
    motor = import_bus_log(path, with_rated_torque(bench))["motor_position_rad"]
    np.testing.assert_allclose(np.diff(motor), 1000 * bench.motor_count)


def test_the_mapping_in_the_log_counts_before_that_of_this_program(tmp_path: Path, bench: Bench) -> None:
    """Another master: position and velocity in TPDO 2 at another identifier, the statusword in TPDO 1."""
    written = {
        (0x608F, 1): 4096, (0x608F, 2): 1, (0x6076, 0): 2000,
        (0x1800, 1): 0x185, (0x1A00, 0): 1, (0x1A00, 1): 0x60410010,
        (0x1801, 1): 0x3A5, (0x1A01, 0): 2, (0x1A01, 1): 0x606C0020, (0x1A01, 2): 0x60640020,
        (0x1A02, 0): 1, (0x1A02, 1): 0x60770010, (0x1600, 0): 1, (0x1600, 1): 0x60710010,
    }  # fmt: skip
    path = tmp_path / "other.asc"
    with can.Logger(path) as log:

        def put(tick: int, can_id: int, data: bytes) -> None:
            log.on_message_received(frame(tick, can_id, data))

        for (index, subindex), value in written.items():
            request = b"\x23" + index.to_bytes(2, "little") + bytes([subindex]) + value.to_bytes(4, "little")
            put(0, 0x605, request)
        for tick in range(100):
            put(tick, 0x080, b"")
            put(tick, 0x185, (0x0237).to_bytes(2, "little"))
            put(tick, 0x3A5, bytes(4) + (-tick).to_bytes(4, "little", signed=True))
            put(tick, 0x385, (tick).to_bytes(2, "little"))
            put(tick, 0x205, (-tick).to_bytes(2, "little", signed=True))
    decoded = import_bus_log(path, bench)
    np.testing.assert_array_equal(decoded["motor_position_rad"], -np.arange(99.0) * (2 * np.pi / 4096))
    np.testing.assert_allclose(decoded["torque_n_m"], 2e-3 * np.arange(1.0, 100.0))
    np.testing.assert_allclose(decoded["torque_command_n_m"], -2e-3 * np.arange(99.0))


@pytest.mark.parametrize("ending", ENDINGS)
def test_damaged_logs_are_refused_or_read_to_their_damage(
    ending: str, tmp_path: Path, bench: Bench, logged: Logged
) -> None:
    path, _ = logged
    whole = (path if ending == ".blf" else converted(path, ending)).read_bytes()
    damaged = tmp_path / f"bus{ending}"
    for content in (b"", b"\0" * 500, b"no log\n" * 50, whole[:100], whole[: len(whole) // 2], whole[:-7],
                    whole[:200] + b"\xff" * 64 + whole[264:]):  # fmt: skip
        damaged.write_bytes(content)
        try:
            rows = len(import_bus_log(damaged, bench))
        except InputError as error:
            assert str(damaged) in str(error)  # noqa: PT017  (whether it is refused depends on the place)
        else:
            assert rows > 2


def test_a_compressed_log_is_bounded(tmp_path: Path, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_frames, "MOST_BYTES", 8000)
    monkeypatch.setattr(input_file, "MOST_VALUES", 1000)
    data = zlib.compress(bytes(9000))
    path = tmp_path / "bomb.blf"
    container = struct.pack("<4sHHII", b"LOBJ", 16, 1, 32 + len(data), 10) + bytes(16) + data
    path.write_bytes(b"LOGG" + bytes(140) + container)
    with pytest.raises(InputError, match="expand to more than 8000, allowed 1000 values"):
        import_bus_log(path, bench)


def test_wrong_arguments_are_refused(tmp_path: Path, bench: Bench) -> None:
    (tmp_path / "bus.blf").write_bytes(b"LOGG")
    (tmp_path / "bus.csv").write_text("t,x\n0,1\n")
    assert "say whose: hil import bus.blf --bench BENCH" in refused(tmp_path, "import", "bus.blf")
    told = refused(tmp_path, "import", "bus.csv", "--bench", "reference")
    assert "bus.csv: given the ending '.csv' with --bench, allowed .blf, .asc, .log" in told
    assert "allowed one of them" in refused(tmp_path, "import", "bus.blf", "--bench", "reference", "--map", "emps")
    virtual = patient_bench(interface="virtual")
    for of, name, error, told in (
        (bench, "bus.txt", InputError, r"given the ending '.txt', allowed .blf, .asc, .log"),
        (bench, "bus.blf", InputError, "the file exists and is not overwritten"),
        (virtual, "new.blf", FieldError, "given virtual with a log of the bus, allowed socketcan or udp_multicast"),
    ):
        with pytest.raises(error, match=told), log_bus(of, tmp_path / name):
            pass


def test_a_log_that_fails_is_told_and_ends_nothing_else(tmp_path: Path, bench: Bench) -> None:
    assert bench.drive is not None
    away = bench.model_copy(update={"drive": bench.drive.model_copy(update={"channel": "10.0.0.1"})})
    with (
        pytest.raises(HilError, match=r"the bus cannot be logged: bus udp_multicast:10.0.0.1: cannot be opened"),
        log_bus(away, tmp_path / "a.blf"),
    ):
        pass
    full, reached = tmp_path / "full.asc", False
    full.symlink_to("/dev/full")
    with pytest.raises(HilError, match=r"log of the bus is not complete: .*No space left"), log_bus(bench, full):
        reached = True
    assert reached


def test_the_commands_log_and_import(tmp_path: Path, bench: Bench) -> None:
    (tmp_path / "bench.yaml").write_text(yaml.safe_dump(bench.model_dump(mode="json", exclude_none=True)))
    (tmp_path / "move.yaml").write_text(yaml.safe_dump(MOVE.model_dump(mode="json", exclude_none=True)))
    ran = hil(
        tmp_path, "run", "move.yaml", "--bench", "bench.yaml", "--force", "--out", "run", "--bus-log", "logs/a.blf"
    )
    assert ran.returncode == 0, ran.stderr
    assert "Log of the bus: logs/a.blf" in ran.stdout
    ran = hil(tmp_path, "import", "logs/a.blf", "--bench", "bench.yaml", "--out", "decoded.parquet")
    assert ran.returncode == 0, ran.stderr
    decoded = read_recording(tmp_path / "decoded.parquet")
    assert decoded.metadata["bench"] == bench.model_dump(mode="json")
    moved = np.ptp(read_recording(tmp_path / "run" / "move.parquet")["motor_position_rad"])
    assert np.ptp(decoded["motor_position_rad"]) == pytest.approx(moved, rel=1e-3)
