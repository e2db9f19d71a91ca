"""Frames of a CAN log by python-can's readers, and the objects and process data that they carry (CiA 301)."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.bus import foreign_kind
from drivers.canopen_master import SYNC
from drivers.object_index import ObjectIndex as Index
from drivers.object_types import is_signed
from drivers.pdo import PDO_INVALID, Entry
from hil.arrays import FloatArray
from hil.errors import InputError, listed
from hil.files.input_file import MOST_BYTES, check_file, check_values, inflated, parsing

LOG_ENDINGS: Final = (".blf", ".asc", ".log")
_VALUES_OF_FRAME: Final = 8  # memory of a frame that is kept, in numbers
_CONTAINER: Final = 10  # BLF: type of an object that holds others, compressed
_SDO_ANSWER, _SDO_REQUEST = 0x580, 0x600
_EMERGENCY, _TPDO, _RPDO = 0x080, 0x180, 0x200
_DRIFT_ROWS: Final = 1000  # over which two clocks differ by less than half a period at 1 kHz
_VIRTUAL: Final = 0.25  # of a period
_PDOS: Final = 4  # whose identifiers CiA 301 predefines


class Frame(NamedTuple):
    """A frame: number of frames and of SYNCs before it, and its data."""

    order: int
    syncs: int
    data: bytes


@dataclass(frozen=True, eq=False)
class BusFrames:
    """Data frames by identifier, in order; `syncs` (n,) are the stamps of the SYNCs [s]."""

    path: Path
    by_id: dict[int, list[Frame]]
    syncs: FloatArray

    @property
    def identifiers(self) -> str:
        """Identifiers in the log, for a message."""
        return listed(f"0x{one:03X}" for one in sorted(self.by_id)) or "none"

    def tick_times(self, period_s: float) -> FloatArray:
        """Time of each SYNC since the first (n,): whole periods, of which the loop may have left some out.

        The program that logs may stamp a frame late, but never early: only what stays late until the end was left out.
        Much shorter steps than a period, as of a run in virtual time, tell nothing: one period each. Raises InputError
        for another period.
        """
        count = self.syncs.size
        late = (self.syncs - self.syncs[0]) / period_s - np.arange(count)
        step = float(np.median(np.diff(self.syncs))) / period_s
        if step < _VIRTUAL:
            return np.asarray(np.arange(count) * period_s)
        if abs(step - 1.0) > _VIRTUAL:
            raise InputError(
                f"{self.path}: SYNC comes every {step * period_s:.3g} s, allowed {period_s:g} s as in the bench; give "
                "the bench of this log"
            )
        if count > 10 * _DRIFT_ROWS:  # the clock of another PC
            late = late - np.median(late[_DRIFT_ROWS:] - late[:-_DRIFT_ROWS]) / _DRIFT_ROWS * np.arange(count)
        stays = np.minimum.accumulate(late[::-1])[::-1]
        return np.asarray((np.arange(count) + np.round(stays - stays[0])) * period_s)


def read_frames(path: Path) -> BusFrames:
    """Read a log by its ending. Raises InputError: another ending, damaged, too many frames."""
    import can

    if path.suffix.lower() not in LOG_ENDINGS:
        raise InputError(f"{path}: given the ending {path.suffix!r} with --bench, allowed {', '.join(LOG_ENDINGS)}")
    check_file(path, f"the log of a CAN bus: {', '.join(LOG_ENDINGS)}")
    if path.suffix.lower() == ".blf":
        _check_blf_size(path)
    by_id, syncs, frames = dict[int, list[Frame]](), list[float](), 0
    readers = {".blf": can.BLFReader, ".asc": can.ASCReader, ".log": can.CanutilsLogReader}
    with parsing(path, "log of a CAN bus"), _opened(path) as file:
        for message in readers[path.suffix.lower()](file):
            if foreign_kind(message):
                continue
            if message.arbitration_id == SYNC:
                syncs.append(message.timestamp)
                continue
            by_id.setdefault(message.arbitration_id, []).append(Frame(frames, len(syncs), bytes(message.data)))
            frames += 1
            check_values(path, _VALUES_OF_FRAME * frames, f"more than {frames} frames")
    return BusFrames(path, by_id, np.array(syncs, dtype=np.float64))


def _opened(path: Path) -> IO[Any]:
    return path.open("rb") if path.suffix.lower() == ".blf" else path.open(encoding="utf-8", errors="replace")


def _check_blf_size(path: Path) -> None:
    """Refuse containers that expand to too many bytes. Raises InputError.

    Layout (Vector BLF): "LOBJ", size of the header of 2 bytes, version of 2, size and type of the object of 4 each;
    a container has its method in 2 bytes, 14 others, and a zlib stream.
    """
    content, expanded = path.read_bytes(), 0
    at = content.find(b"LOBJ")
    while at >= 0:
        size, kind = struct.unpack_from("<II", content.ljust(at + 16, b"\0"), at + 8)
        if kind == _CONTAINER:
            expanded += len(inflated(content[at + 32 : at + max(size, 32)], MOST_BYTES - expanded + 1))
            check_values(path, -(-expanded // 8), f"{len(content)} bytes that expand to more than {MOST_BYTES}")
        at = content.find(b"LOBJ", at + 4)


class Node:
    """What a log tells of one node. outputs, inputs: its TPDOs and RPDOs where the log does not have their mapping."""

    def __init__(
        self,
        frames: BusFrames,
        node_id: int,
        outputs: Mapping[int, Sequence[Entry]],
        inputs: Mapping[int, Sequence[Entry]],
    ) -> None:
        self._frames, self._node_id = frames, node_id
        self._objects = _objects(frames, node_id)
        self._outputs, self._inputs = outputs, inputs

    def object(self, index: int, subindex: int) -> int | None:
        """The last value of an object that the log has; None without one."""
        data = self._objects.get((index, subindex))
        return None if data is None else int.from_bytes(data, "little", signed=is_signed(index, subindex))

    def sampled(self, index: int) -> FloatArray | None:
        """An object of a TPDO as answered to each SYNC (n,), the value before without an answer; None without any."""
        found = self._process_data(index, _TPDO, Index.TPDO_COMMUNICATION, self._outputs)
        if found is None:
            return None
        values = _held(found, self._frames.syncs.size)
        return _unwrapped(values) if index in (Index.POSITION_ACTUAL, Index.ENCODER_POSITION) else values

    def commanded(self, index: int) -> FloatArray | None:
        """An object of an RPDO as sent after each SYNC (n,); None without one."""
        found = self._process_data(index, _RPDO, Index.RPDO_COMMUNICATION, self._inputs)
        return None if found is None else _held(found, self._frames.syncs.size)

    def error_codes(self) -> FloatArray:
        """Code of the last emergency message since the first SYNC at each SYNC (n,), 0 without one."""
        frames = self._frames.by_id.get(_EMERGENCY + self._node_id, [])
        # those before the first SYNC belong to the set-up
        codes = {one.syncs - 1: float(int.from_bytes(one.data[:2], "little")) for one in frames if one.syncs}
        return _held({0: 0.0} | codes, self._frames.syncs.size)

    def _process_data(
        self, index: int, first_id: int, communication: int, usual: Mapping[int, Sequence[Entry]]
    ) -> dict[int, float] | None:
        """Value of an object by the number of the SYNC before it, from the first PDO that has it."""
        for number in range(_PDOS):
            entries, at = self._mapping(communication + 0x200 + number) or usual.get(number, ()), 0
            cob_id = self.object(communication + number, 1) or first_id + 0x100 * number + self._node_id
            for entry in entries:
                if entry.index == index and not cob_id & PDO_INVALID:
                    return self._values(cob_id & 0x7FF, at, entry, sum(one.bits for one in entries)) or None
                at += entry.bits
        return None

    def _mapping(self, index: int) -> tuple[Entry, ...]:
        """Mapped objects as the log has them."""
        words = [self.object(index, sub + 1) for sub in range(min(self.object(index, 0) or 0, 64))]
        return tuple(Entry(word >> 16, word >> 8 & 0xFF, word & 0xFF) for word in words if word)

    def _values(self, can_id: int, at: int, entry: Entry, bits: int) -> dict[int, float]:
        signed, mask = is_signed(entry.index, entry.subindex), (1 << entry.bits) - 1
        sign = 1 << (entry.bits - 1) if signed and entry.bits else 0
        values = dict[int, float]()
        for _, syncs, data in self._frames.by_id.get(can_id, []):
            if syncs and 8 * len(data) == bits:  # as the drivers: one of another length is not acted on
                raw = int.from_bytes(data, "little") >> at & mask
                values[syncs - 1] = float((raw ^ sign) - sign)
        return values


def _objects(frames: BusFrames, node_id: int) -> dict[tuple[int, int], bytes]:
    """Objects of up to four bytes in expedited SDO transfers, by index and sub-index (CiA 301, 7.2.4.3)."""
    found = dict[tuple[int, int], bytes]()
    # download initiate of the master, upload initiate of the node; both expedited, with their size
    kinds = {_SDO_REQUEST: 0x23, _SDO_ANSWER: 0x43}
    both = [
        (frame.order, kind, frame.data)
        for first, kind in kinds.items()
        for frame in frames.by_id.get(first + node_id, [])
    ]
    for _, kind, data in sorted(both):
        if len(data) == 8 and data[0] & 0xE3 == kind:
            index, subindex = struct.unpack_from("<HB", data, 1)
            found[index, subindex] = data[4 : 8 - (data[0] >> 2 & 3)]
    return found


def _held(values: Mapping[int, float], size: int) -> FloatArray:
    """Values by row (size,), the last one where a row has none, NaN before the first."""
    rows: NDArray[np.float64] = np.full(size, np.nan)
    for row, value in values.items():
        if row < size:
            rows[row] = value
    given = np.flatnonzero(np.isfinite(rows))
    if given.size:
        last = np.searchsorted(given, np.arange(size), side="right") - 1
        rows = np.where(last >= 0, rows[given[np.maximum(last, 0)]], np.nan)
    return rows


def _unwrapped(counts: FloatArray) -> FloatArray:
    """Counts (n,) of 32 bits counted on over their wrap."""
    good = np.isfinite(counts)
    steps = np.diff(counts[good])
    steps = (steps + 2.0**31) % 2.0**32 - 2.0**31
    unwrapped = counts.copy()
    unwrapped[good] = counts[good][:1].repeat(good.sum()) + np.r_[0.0, np.cumsum(steps)] if good.any() else []
    return unwrapped
