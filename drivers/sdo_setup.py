"""Before the loop: SDO, NMT and object dictionary by the canopen package, without its threads.

The Network of canopen reads the bus in a Notifier thread, which an exception ends without a message. Here the caller
that waits for an SDO response polls the port itself: one thread, the same on real and simulated buses. Every write is
read back.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import canopen
from canopen.objectdictionary import ObjectDictionaryError, ODVariable, datatypes
from canopen.sdo import SdoAbortedError, SdoClient, SdoCommunicationError

from drivers.bus import CanPort
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import PDO_INVALID, PDO_NO_RTR, Entry, layout
from drivers.port import ConfigurationError, IdentityError, ResponseTimeout

EDS_FOLDER: Final = Path(__file__).parent / "eds"
RESPONSE_TIMEOUT_S: Final = 0.5
_PUMP_S: Final = 0.001
_SDO_BYTES: Final = 8  # CiA 301: every SDO frame has eight bytes
_MOST_ANSWERS: Final = 16  # of one transfer: the objects used here have 8 bytes or less, in two segments
_PDO_COMMUNICATION: Final = (*range(0x1400, 0x1600), *range(0x1800, 0x1A00))  # of up to 512 each way, CiA 301
_MOST_EDS_BYTES: Final = 2_000_000  # ten times the EDS of a large drive


class SetupNetwork(canopen.Network):  # type: ignore[misc]  # canopen is not typed
    """canopen's Network on a `CanPort`. `time_s` is the set-up's own time: it moves while a response is awaited."""

    def __init__(self, port: CanPort) -> None:
        self.port = port
        self.time_s = 0.0
        super().__init__()

    def subscribe(self, can_id: int, callback: Callable[[int, bytes, float], None]) -> None:
        super().subscribe(can_id, callback)
        self.port.listen(can_id, callback)

    def unsubscribe(self, can_id: int, callback: Callable[[int, bytes, float], None] | None = None) -> None:
        for gone in [callback] if callback else list(self.subscribers[can_id]):
            self.port.ignore(can_id, gone)
        super().unsubscribe(can_id, callback)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self.port.send(can_id, bytes(data), self.time_s)

    def pump(self) -> None:
        """Take in what has arrived; waits up to a millisecond on a real bus, passes one on a simulated bus."""
        self.time_s += _PUMP_S
        self.port.poll(self.time_s, _PUMP_S)


class _PumpedSdoClient(SdoClient):  # type: ignore[misc]
    """canopen's SDO client, waiting by pumping the port. answers_left: that one transfer may still take."""

    answers_left = 0

    def read_response(self) -> bytes:
        deadline_s = self.network.time_s + RESPONSE_TIMEOUT_S
        while self.responses.empty():
            if self.network.time_s >= deadline_s:
                raise SdoCommunicationError("No SDO response received")
            self.network.pump()
        response: bytes = self.responses.get_nowait()
        self.answers_left -= 1
        if self.answers_left < 0:  # also ends a segmented answer without end
            raise SdoCommunicationError(f"more than {_MOST_ANSWERS} answers to one request")
        if len(response) != _SDO_BYTES:
            raise SdoCommunicationError(f"an answer of {len(response)} bytes, allowed {_SDO_BYTES}")
        if response[0] == 0x80:
            raise SdoAbortedError(struct.unpack_from("<L", response, 4)[0])
        return response


class _PumpedNode(canopen.RemoteNode):  # type: ignore[misc]
    """canopen's RemoteNode with the pumped client."""

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SdoClient:
        client = _PumpedSdoClient(rx_cobid, tx_cobid, self.object_dictionary)
        self.sdo_channels.append(client)
        if self.has_network():
            self.network.subscribe(client.tx_cobid, client.on_response)
        return client


def _node(node_id: int, eds: Path) -> _PumpedNode:
    """Node of an EDS. Raises ConfigurationError for a file that is no readable EDS."""
    where, advice = f"{eds}", "Give the EDS file of the device, as its maker supplies it."
    if not eds.is_file() or eds.stat().st_size > _MOST_EDS_BYTES:  # a pipe or a device may never end
        raise ConfigurationError("is no EDS file", where=where, allowed=f"up to {_MOST_EDS_BYTES} bytes", advice=advice)
    try:
        return _PumpedNode(node_id, str(eds))
    except Exception as error:  # canopen and configparser raise many kinds for a damaged file
        text = (str(error) or type(error).__name__).splitlines()[0]
        raise ConfigurationError(f"is no readable EDS file ({text})", where=where, advice=advice) from None


class DeviceSetup:
    """Configures one node by SDO. Errors name node, object, value and what the device said.

    Raises ResponseTimeout (no answer), ConfigurationError (refused, or reads back differently), IdentityError.
    """

    def __init__(self, network: SetupNetwork, node_id: int, eds: Path) -> None:
        self._node = _node(node_id, eds)
        self._network = network
        self.node_id, self.eds = node_id, eds
        self.dictionary = self._node.object_dictionary

    def __enter__(self) -> DeviceSetup:
        self._node.associate_network(self._network)
        return self

    def __exit__(self, *exception: object) -> None:
        self._node.remove_network()

    def read(self, index: int, subindex: int = 0) -> int:
        """An integer object."""
        variable = self._variable(index, subindex)
        data = self._transfer(index, subindex, lambda: self._node.sdo.upload(index, subindex))
        try:
            return int(variable.decode_raw(data))
        except (ObjectDictionaryError, ValueError, TypeError, struct.error) as error:
            raise ConfigurationError(
                f"the answer is no number as the EDS describes it ({error})", where=self._where(index, subindex),
                given=f"{bytes(data[:8]).hex(' ') or 'no byte'}", allowed=f"{len(variable) // 8} bytes",
                advice="Give the EDS of the device that is connected.",
            ) from error  # fmt: skip

    def has(self, index: int, subindex: int = 0) -> bool:
        """Return True if the EDS has the object."""
        return self.dictionary.get_variable(index, subindex) is not None

    def write(self, index: int, subindex: int, value: int, *, read_back: tuple[int, int] | None = None) -> None:
        """Write, then read the same object (or `read_back`) and compare."""
        self.write_only(index, subindex, value)
        where = read_back or (index, subindex)
        got = self.read(*where)
        if got != value:
            raise ConfigurationError(
                "reads back another value than was written", where=self._where(*where),
                given=f"{value} (0x{value & 0xFFFFFFFF:X})", allowed=f"the drive keeps {got} (0x{got & 0xFFFFFFFF:X})",
                advice="The device does not support this setting.",
            )  # fmt: skip

    def write_only(self, index: int, subindex: int, value: int) -> None:
        """Write without reading back."""
        try:
            data = self._variable(index, subindex).encode_raw(value)
        except (ValueError, OverflowError, struct.error) as error:
            raise ConfigurationError(
                f"the value does not fit the object ({error})", where=self._where(index, subindex), given=str(value),
                advice="Correct the bench description.",
            ) from error  # fmt: skip
        self._transfer(index, subindex, lambda: self._node.sdo.download(index, subindex, data), value)

    def check_identity(self, profile: int, serial_number: int | None = None) -> None:
        """Device profile (0x1000), vendor, product, major revision (0x1018) as in the EDS; serial number if given."""
        information = self.dictionary.device_information
        expected = [
            ("device profile", Index.DEVICE_TYPE, 0, 0xFFFF, profile),
            ("vendor-ID", Index.IDENTITY, 1, 0xFFFFFFFF, information.vendor_number),
            ("product code", Index.IDENTITY, 2, 0xFFFFFFFF, information.product_number),
            ("major revision", Index.IDENTITY, 3, 0xFFFF0000, information.revision_number),
            ("serial number", Index.IDENTITY, 4, 0xFFFFFFFF, serial_number),
        ]
        for name, index, subindex, mask, value in expected:
            if value is None:
                continue
            got = self.read(index, subindex) & mask
            if got != value & mask:
                raise IdentityError(
                    f"another {name} than described", where=self._where(index, subindex), given=f"0x{got:X}",
                    allowed=f"0x{value & mask:X} ({self.eds.name})",
                    advice="Check node-ID and wiring, or give the EDS of the device that is connected.",
                )  # fmt: skip

    def map_pdo(self, communication: int, entries: Sequence[Entry], transmission_type: int, cob_id: int) -> None:
        """Write a PDO as CiA 301 prescribes (invalid, number 0, entries, number, type, valid), reading each back."""
        layout(entries)
        mapping = communication + 0x200
        flags = 0 if communication < Index.TPDO_COMMUNICATION else PDO_NO_RTR
        self.write_only(communication, 1, cob_id | flags | PDO_INVALID)
        self.write_only(mapping, 0, 0)
        for k, entry in enumerate(entries, start=1):
            self.write(mapping, k, entry.word)
        self.write(mapping, 0, len(entries))
        self.write(communication, 2, transmission_type)
        self.write(communication, 1, cob_id | flags)

    def disable_pdos(self) -> None:
        """Set all PDOs of the EDS invalid, so that none acts on the drive or loads the bus unintended."""
        for index in _PDO_COMMUNICATION:
            if self.has(index, 1):
                self.write_only(index, 1, self.read(index, 1) | PDO_INVALID)

    def set_interpolation_time(self, period_s: float) -> None:
        """0x60C2: value x 10^index seconds; exact or refused."""
        for exponent in range(0, -7, -1):
            value = round(period_s / 10.0**exponent)
            if 1 <= value <= 255 and abs(value * 10.0**exponent - period_s) < 1e-9 * period_s:
                self.write(Index.INTERPOLATION_TIME, 2, exponent)
                self.write(Index.INTERPOLATION_TIME, 1, value)
                return
        raise ConfigurationError(
            "the period cannot be expressed", where=self._where(Index.INTERPOLATION_TIME, 1), given=f"{period_s} s",
            allowed="1..255 x 10^n s", advice="Choose a period of 1, 2, 4 or 5 ms, or 500 or 250 us.",
        )  # fmt: skip

    def entry(self, index: int, subindex: int = 0) -> Entry:
        """Mapping entry of an object, its length from the EDS."""
        variable = self._variable(index, subindex)
        return Entry(index, subindex, len(variable), variable.data_type in datatypes.SIGNED_TYPES)

    def _variable(self, index: int, subindex: int) -> ODVariable:
        variable = self.dictionary.get_variable(index, subindex)
        if variable is None:
            raise ConfigurationError(
                "the EDS does not know the object", where=self._where(index, subindex), given=self.eds.name,
                advice="Give the EDS of the device that is connected.",
            )  # fmt: skip
        return variable

    def _where(self, index: int, subindex: int) -> str:
        variable = self.dictionary.get_variable(index, subindex)
        name = f" ({variable.name})" if variable is not None else ""
        return f"node {self.node_id}, object 0x{index:04X}:{subindex:02X}{name}"

    def _transfer(self, index: int, subindex: int, action: Callable[[], Any], value: int | None = None) -> Any:
        self._node.sdo.answers_left = _MOST_ANSWERS
        try:
            return action()
        except SdoAbortedError as error:
            raise ConfigurationError(
                f"the device refuses ({error})", where=self._where(index, subindex),
                given="" if value is None else f"{value} (0x{value & 0xFFFFFFFF:X})",
                advice="See the device's manual for what it accepts in this state.",
            ) from error  # fmt: skip
        except SdoCommunicationError as error:
            silent = "No SDO response" in str(error)
            raise ResponseTimeout(
                "no SDO answer" if silent else f"no usable SDO answer ({error})", where=self._where(index, subindex),
                given=f"{RESPONSE_TIMEOUT_S} s",
                advice="Is the device powered, its node-ID and bit rate right, the bus terminated?",
            ) from error  # fmt: skip
