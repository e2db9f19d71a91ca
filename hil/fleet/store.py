"""Folders of a fleet at any URL that fsspec knows: files of the axes, and results that are written whole or not at all.

FLEET/AXIS/...                       recordings, bench.yaml, map.yaml, service.csv
RESULTS/parts/STAGE/ID.json          one result of one recording, as a worker wrote it
RESULTS/STAGE/axis=AXIS/rows.parquet the same of all recordings, a pyarrow dataset
"""

import json
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import fsspec
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
from fsspec.implementations.local import LocalFileSystem

from hil.errors import InputError

RESULTS = "_fleet"  # within the folder of the fleet, unless another place is given
Row = dict[str, Any]
# what file systems call the moment or the version of a file: S3, GCS, Azure, SFTP and local, FTP, WebDAV and WebHDFS
_STAMPS = (
    *("ETag", "etag", "mtime", "LastModified", "last_modified"),
    *("updated", "modify", "modified", "modificationTime", "created"),
)


@dataclass(frozen=True)
class StoredFile:
    """A file of a fleet: path within it, size, and a stamp that differs when it was changed."""

    file: str
    size: int
    stamp: str


@dataclass(frozen=True)
class Store:
    """A folder at a URL or a path. A value that goes to workers; they must reach the same place."""

    url: str

    @property
    def _place(self) -> tuple[Any, str]:
        try:
            system, root = fsspec.core.url_to_fs(self.url)
        except (ValueError, ImportError) as error:
            raise InputError(f"{self.url}: cannot be opened ({error}); give a folder or a URL of fsspec") from None
        return system, root

    @property
    def local(self) -> Path | None:
        """The folder on this machine; None elsewhere."""
        system, root = self._place
        return Path(root) if isinstance(system, LocalFileSystem) else None

    def within(self, folder: str) -> "Store":
        """A folder within this one."""
        return Store(f"{self.url.rstrip('/')}/{folder}")

    def entries(self) -> list[StoredFile]:
        """All files, by name; none where the folder is not there. Hidden ones and those in folders `_...` are not."""
        system, root = self._place
        found = []
        for path, info in system.find(root, detail=True).items():
            name = path[len(root) :].lstrip("/")
            if any(part.startswith((".", "_")) for part in PurePosixPath(name).parts):
                continue
            stamps = (info.get(key) for key in _STAMPS)
            found.append(StoredFile(name, int(info.get("size") or 0), str(next((one for one in stamps if one), ""))))
        return sorted(found, key=lambda one: one.file)

    def names(self, folder: str) -> list[str]:
        """Names of the files in a folder."""
        system, root = self._place
        try:
            return sorted(PurePosixPath(path).name for path in system.ls(f"{root}/{folder}", detail=False))
        except FileNotFoundError:
            return []

    def read(self, name: str) -> bytes | None:
        """Content of a file; None if it is not there."""
        system, root = self._place
        try:
            return bytes(system.cat_file(f"{root}/{name}"))
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write a file whole or not at all. Raises InputError if it cannot be written."""
        system, root = self._place
        path = f"{root}/{name}"
        try:
            system.makedirs(path.rpartition("/")[0], exist_ok=True)
            if not isinstance(system, LocalFileSystem):  # an object is there when it is complete
                system.pipe_file(path, content)
                return
            part = Path(path).with_name(f".{Path(path).name}.{os.getpid()}.part")
            part.write_bytes(content)
            part.replace(path)
        except OSError as error:
            raise InputError(f"{self.url}/{name}: cannot be written ({error}); give another --out") from None

    def remove(self, names: Sequence[str]) -> None:
        """Remove files that may not be there any more."""
        system, root = self._place
        for name in names:
            try:
                system.rm_file(f"{root}/{name}")
            except FileNotFoundError:
                continue

    @contextmanager
    def fetched(self, names: Sequence[str]) -> Iterator[list[Path]]:
        """Local copies of files with their own names, or the files themselves where they are local."""
        if (folder := self.local) is not None:
            yield [folder / name for name in names]
            return
        system, root = self._place
        with tempfile.TemporaryDirectory() as place:
            paths = [Path(place, str(number), PurePosixPath(name).name) for number, name in enumerate(names)]
            for name, path in zip(names, paths, strict=True):
                path.parent.mkdir()
                if system.exists(f"{root}/{name}"):
                    system.get_file(f"{root}/{name}", str(path))
            yield paths

    def put(self, folder: Path, name: str) -> None:
        """Write all files of a local folder."""
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                self.write(f"{name}/{path.relative_to(folder).as_posix()}", path.read_bytes())

    # --- rows ---

    def write_part(self, stage: str, row: Row) -> None:
        """Write the result of one recording."""
        text = json.dumps(row, ensure_ascii=False, allow_nan=False)
        self.write(f"parts/{stage}/{row['id']}.json", text.encode())

    def part(self, stage: str, identity: str) -> Row | None:
        """Result of one recording that no dataset has yet; None if there is none."""
        content = self.read(f"parts/{stage}/{identity}.json")
        return None if content is None else dict(json.loads(content))

    def parts(self, stage: str) -> list[Row]:
        """Results that no dataset has yet: those of a run that was ended."""
        found = []
        for name in self.names(f"parts/{stage}"):
            if name.endswith(".json") and (row := self.part(stage, name.removesuffix(".json"))) is not None:
                found.append(row)
        return found

    def rows(self, stage: str, axis: str | None = None) -> list[Row]:
        """Rows of the dataset of a stage, of one axis or of all; without those that are empty in the schema."""
        system, root = self._place
        if axis is not None:
            content = self.read(f"{stage}/axis={axis}/rows.parquet")
            return [] if content is None else pq.read_table(pa.BufferReader(content)).to_pylist()
        files = [path for path in system.find(f"{root}/{stage}") if path.endswith("/rows.parquet")]
        if not files:
            return []
        table = ds.dataset(sorted(files), filesystem=system, format="parquet").to_table()
        return [dict(row) for row in table.to_pylist()]

    def axes(self, stage: str) -> list[str]:
        """Axes in the dataset of a stage."""
        return [name.removeprefix("axis=") for name in self.names(stage) if name.startswith("axis=")]

    def write_rows(self, stage: str, axis: str, rows: Sequence[Row], schema: pa.Schema) -> None:
        """Write the dataset of an axis anew."""
        buffer = pa.BufferOutputStream()
        pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), buffer, compression="zstd")
        self.write(f"{stage}/axis={axis}/rows.parquet", buffer.getvalue().to_pybytes())
