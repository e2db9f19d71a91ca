"""What is fuzzed: each target makes one damaged input from a generator of random numbers and gives it to the code that
reads such input. `EXPECTED` errors are answers; any other exception is a failure."""

from __future__ import annotations

import contextlib
import functools
import random
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from fuzz_devices import eds, frames, sdo, serial
from fuzz_foreign import foreign
from mutations import damaged_bytes, damaged_text

import hil
from drivers.port import DriverError
from hil.errors import HilError
from hil.files.shipped import shipped_files
from hil.loop.run import rehearse
from hil.loop.simulated_bench import load_simulated
from hil.recording.recording import Recording, write_parquet

ROOT = Path(__file__).parents[2]
RECORDINGS = ROOT / "tests" / "recordings"
MAP = RECORDINGS / "foreign_map.yaml"
EXPECTED = (HilError, DriverError)
ROWS = 300
_COMMENT = re.compile(r"(^|\s+)#.*", re.MULTILINE)


@functools.cache
def _texts(folder: Path) -> tuple[str, ...]:
    return tuple(_COMMENT.sub("", path.read_text()) for path in sorted(folder.glob("*.yaml")))


@functools.cache
def _file(path: Path) -> bytes:
    return path.read_bytes()


@functools.cache
def _recordings() -> Mapping[str, bytes]:
    """A short recording as each kind of file, by its ending."""
    import tempfile

    import pyarrow as pa
    import pyarrow.parquet as pq

    whole = hil.read_recording(RECORDINGS / "clean.parquet")
    short = Recording(
        "short", {name: values[:ROWS] for name, values in whole.columns.items()}, whole.period_s, whole.metadata
    )
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "short.parquet"
        write_parquet(short, path)
        table = pq.read_table(path)
        with pa.OSFile(str(path.with_suffix(".arrows")), "wb") as file, pa.ipc.new_stream(file, table.schema) as stream:
            stream.write_table(table, 100)
        columns = np.column_stack(list(short.columns.values()))
        text = ",".join(short.columns) + "\n" + "\n".join(",".join(map(repr, row)) for row in columns.tolist())
        path.with_suffix(".csv").write_text(text)
        return {ending: path.with_suffix(ending).read_bytes() for ending in (".parquet", ".arrows", ".csv")}


def profile(rng: random.Random, folder: Path) -> None:
    """Profile: read and planned."""
    path = folder / "profile.yaml"
    path.write_bytes(damaged_text(rng, rng.choice(_texts(ROOT / "profiles"))))
    hil.plan(hil.load_profile(path), 0.004)


@functools.cache
def _benches() -> tuple[str, ...]:
    return tuple(_COMMENT.sub("", path.read_text()) for path in shipped_files("bench").values())


def rehearse_all() -> None:
    """Rehearse the shipped benches, which compiles all kernels."""
    jog = hil.load_profile(ROOT / "profiles" / "jog.yaml")
    for name in shipped_files("bench"):
        loaded = load_simulated(name)
        if loaded.law_known:
            with contextlib.suppress(HilError):
                rehearse(loaded, hil.plan(jog, loaded.period_s), jog)


def bench(rng: random.Random, folder: Path) -> None:
    """Bench: read, its twin built, and one in four rehearsed on simulated devices."""
    path = folder / "bench.yaml"
    path.write_bytes(damaged_text(rng, rng.choice(_benches())))
    loaded = load_simulated(path)
    if loaded.law_known:
        loaded.twin()
        if rng.random() < 0.25:
            jog = hil.load_profile(ROOT / "profiles" / "jog.yaml")
            rehearse(loaded, hil.plan(jog, loaded.period_s), jog)


def import_map(rng: random.Random, folder: Path) -> None:
    """Import map of a whole file, or a damaged file with a whole map."""
    path, source = folder / "map.yaml", RECORDINGS / "foreign.mat"
    if rng.random() < 0.8:
        path.write_bytes(damaged_text(rng, MAP.read_text()))
    else:
        path, source = MAP, folder / "foreign.mat"
        source.write_bytes(damaged_bytes(rng, _file(RECORDINGS / "foreign.mat")))
    hil.import_recording(source, path)


def recording(rng: random.Random, folder: Path) -> None:
    """Recording: read, cut into its parts, printed, and its stored bench looked for."""
    from hil.identification.measured import bench_of

    ending, data = rng.choice(list(_recordings().items()))
    path = folder / f"recording{ending}"
    path.write_bytes(damaged_bytes(rng, data))
    read = hil.read_recording(path)
    for part in read.parts():
        repr(part)
    with contextlib.suppress(HilError):
        bench_of(read)


TARGETS: Mapping[str, Callable[[random.Random, Path], None]] = {
    "profiles": profile,
    "benches": bench,
    "import maps, .mat": import_map,
    "recordings": recording,
    "foreign recordings": foreign,
    "EDS": eds,
    "SDO frames": sdo,
    "PDO, EMCY, heartbeat frames": frames,
    "serial frames": serial,
}
# share of the inputs
WEIGHTS: Mapping[str, int] = {
    "profiles": 3, "benches": 3, "import maps, .mat": 3, "recordings": 4, "foreign recordings": 4, "EDS": 1,
    "SDO frames": 4, "PDO, EMCY, heartbeat frames": 5, "serial frames": 3,
}  # fmt: skip
