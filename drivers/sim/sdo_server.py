"""SDO server of a simulated node: expedited and segmented transfers (CiA 301, 7.2.4.3).

One request frame in, one response frame out; block transfers are aborted, as CiA 301 allows a server without them.
"""

import struct
from collections.abc import Callable
from enum import IntEnum
from typing import Final

_HEADER: Final = struct.Struct("<BHB")
_ABORT: Final = struct.Struct("<BHBI")


class AbortCode(IntEnum):
    """SDO abort codes of CiA 301 that the simulated nodes use."""

    TOGGLE_NOT_ALTERNATED = 0x05030000
    UNKNOWN_COMMAND = 0x05040001
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    NO_SUCH_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_TOO_LONG = 0x06040042
    WRONG_LENGTH = 0x06070010
    NO_SUCH_SUBINDEX = 0x06090011
    INVALID_VALUE = 0x06090030
    VALUE_TOO_HIGH = 0x06090031
    VALUE_TOO_LOW = 0x06090032
    NOT_IN_THIS_STATE = 0x08000022


class SdoAbort(Exception):
    """Refusal of an SDO; `code` is sent to the client."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(code.name)
        self.code = code


class SdoServer:
    """read(index, subindex) -> bytes; write(index, subindex, data). Both raise `SdoAbort` to refuse."""

    def __init__(self, read: Callable[[int, int], bytes], write: Callable[[int, int, bytes], None]) -> None:
        self._read, self._write = read, write
        self._object = (0, 0)
        self._buffer = bytearray()
        self._toggle = 0

    def answer(self, request: bytes) -> bytes | None:
        """Response to one request frame; None where CiA 301 forbids an answer (client's abort, malformed frame)."""
        if len(request) != 8:
            return None
        command = request[0]
        specifier = command >> 5
        try:
            if specifier == 2:
                return self._start_upload(request)
            if specifier == 3:
                return self._upload_segment(command)
            if specifier == 1:
                return self._start_download(request)
            if specifier == 0:
                return self._download_segment(request)
            if specifier == 4:  # abort by the client
                self._buffer.clear()
                return None
            self._object = _HEADER.unpack_from(request)[1:]
            raise SdoAbort(AbortCode.UNKNOWN_COMMAND)
        except SdoAbort as refused:
            self._buffer.clear()
            return _ABORT.pack(0x80, *self._object, refused.code)

    def _start_upload(self, request: bytes) -> bytes:
        _, index, subindex = _HEADER.unpack_from(request)
        self._object = (index, subindex)
        data = self._read(index, subindex)
        if 0 < len(data) <= 4:  # expedited, size indicated
            return _HEADER.pack(0x43 | (4 - len(data)) << 2, index, subindex) + data.ljust(4, b"\0")
        self._buffer = bytearray(data)
        self._toggle = 0
        return _HEADER.pack(0x41, index, subindex) + len(data).to_bytes(4, "little")

    def _upload_segment(self, command: int) -> bytes:
        self._check_toggle(command)
        segment = bytes(self._buffer[:7])
        del self._buffer[:7]
        head = self._toggle | (7 - len(segment)) << 1 | (not self._buffer)
        self._toggle ^= 0x10
        return bytes([head]) + segment.ljust(7, b"\0")

    def _start_download(self, request: bytes) -> bytes:
        command, index, subindex = _HEADER.unpack_from(request)
        self._object = (index, subindex)
        if command & 0x02:  # expedited; without a size indication all four bytes count
            size = 4 - (command >> 2 & 3) if command & 0x01 else 4
            self._write(index, subindex, request[4 : 4 + size])
        else:
            self._buffer.clear()
            self._toggle = 0
        return _HEADER.pack(0x60, index, subindex) + bytes(4)

    def _download_segment(self, request: bytes) -> bytes:
        command = request[0]
        self._check_toggle(command)
        self._buffer += request[1 : 8 - (command >> 1 & 7)]
        if command & 0x01:
            self._write(*self._object, bytes(self._buffer))
            self._buffer.clear()
        response = bytes([0x20 | self._toggle]) + bytes(7)
        self._toggle ^= 0x10
        return response

    def _check_toggle(self, command: int) -> None:
        if command & 0x10 != self._toggle:
            raise SdoAbort(AbortCode.TOGGLE_NOT_ALTERNATED)
