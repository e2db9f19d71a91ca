"""Before the loop: a device is configured by SDO, with the object dictionary of the canopen package.

Every write is read back. What a device takes some time for is asked for until it comes, with a bound.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from canopen.objectdictionary import ObjectDictionaryError, ODVariable, datatypes
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from drivers.object_index import ObjectIndex as Index
from drivers.pdo import PDO_INVALID, PDO_NO_RTR, Entry, layout
from drivers.port import ConfigurationError, IdentityError, ResponseTimeout
from drivers.sdo_client import MOST_ANSWERS, RESPONSE_TIMEOUT_S, PumpedNode, SetupNetwork

EDS_FOLDER: Final = Path(__file__).parent / "eds"
BOOT_LIMIT_S: Final = 5.0  # drives take some seconds from power-on to their first answer
_NMT_PRE_OPERATIONAL: Final = 128
_ASK_AGAIN_S: Final = 0.01
_MOST_EDS_BYTES: Final = 2_000_000  # ten times the EDS of a large drive


def _node(node_id: int, eds: Path) -> PumpedNode:
    """Node of an EDS. Raises ConfigurationError for a file that is no readable EDS."""
    where, advice = f"{eds}", "Give the EDS file of the device, as its maker supplies it."
    if not eds.is_file() or eds.stat().st_size > _MOST_EDS_BYTES:  # a pipe or a device may never end
        raise ConfigurationError("is no EDS file", where=where, allowed=f"up to {_MOST_EDS_BYTES} bytes", advice=advice)
    try:
        return PumpedNode(node_id, str(eds))
    except Exception as error:  # canopen and configparser raise many kinds for a damaged file
        text = (str(error) or type(error).__name__).splitlines()[0]
        raise ConfigurationError(f"is no readable EDS file ({text})", where=where, advice=advice) from None


class SettingRefused(ConfigurationError):
    """The device aborts the transfer of an object."""


class DeviceSetup:
    """Configures one node by SDO. Errors name node, object, value and what the device said.

    Raises ResponseTimeout (no answer), ConfigurationError (refused, or reads back differently), IdentityError. `kept`:
    settings that a device need not have and keeps as they are, in words.
    """

    def __init__(self, network: SetupNetwork, node_id: int, eds: Path) -> None:
        self._node = _node(node_id, eds)
        self._network = network
        self.node_id, self.eds = node_id, eds
        self.dictionary = self._node.object_dictionary
        self.kept: list[str] = []

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

    def wait_answer(self) -> None:
        """Enter NMT pre-operational and wait until the device answers: it may still boot."""
        started_s = self._network.time_s
        while True:
            self._network.send_message(0x000, bytes([_NMT_PRE_OPERATIONAL, self.node_id]))
            try:
                self.read(Index.DEVICE_TYPE)
                return
            except ResponseTimeout as error:
                if self._network.time_s - started_s >= BOOT_LIMIT_S:
                    waited = f"waited {self._network.time_s - started_s:.1f} s"
                    raise ResponseTimeout(error.what, where=error.where, given=waited, advice=error.advice) from error

    def wait(self, index: int, good: Callable[[int], bool], limit_s: float) -> int:
        """Read an object until its value is good, limit_s at most. Returns the last value, good or not."""
        started_s = self._network.time_s
        while not good(value := self.read(index)) and self._network.time_s - started_s < limit_s:
            again_s = self._network.time_s + _ASK_AGAIN_S
            while self._network.time_s < again_s:
                self._network.pump()
        return value

    def peek(self, index: int, subindex: int = 0) -> int | None:
        """Value of an object; None if the EDS does not know it or the device refuses."""
        try:
            return self.read(index, subindex) if self.has(index, subindex) else None
        except SettingRefused:
            return None

    def prefer(self, index: int, subindex: int, value: int) -> int | None:
        """Write a setting that a device need not have. Returns the value it has then, None if that is unknown."""
        try:
            if self.has(index, subindex):
                self.write(index, subindex, value)
                return value
        except SettingRefused:
            pass
        got = self.peek(index, subindex)
        self.kept.append(f"{self._object(index, subindex)} {'unknown' if got is None else got} instead of {value}")
        return got

    def write(self, index: int, subindex: int, value: int, *, mask: int = -1) -> None:
        """Write, read back and compare the bits of the mask. A refusal is none if the device has the value already."""
        try:
            self.write_only(index, subindex, value)
        except SettingRefused:
            got = self.peek(index, subindex)
            if got is None or (got ^ value) & mask:
                raise
            return
        got = self.read(index, subindex)
        if (got ^ value) & mask:
            raise ConfigurationError(
                "reads back another value than was written", where=self._where(index, subindex),
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
        """Write a PDO as CiA 301 prescribes (invalid, number 0, entries, number, type, valid), reading each back.

        A mapping that is as wanted is left alone: some devices have fixed ones.
        """
        layout(entries)
        mapping = communication + 0x200
        flags = 0 if communication < Index.TPDO_COMMUNICATION else PDO_NO_RTR
        self._invalidate(communication, cob_id | flags)
        words = [entry.word for entry in entries]
        if self.read(mapping, 0) != len(words) or [self.peek(mapping, k + 1) for k in range(len(words))] != words:
            self.write_only(mapping, 0, 0)
            for k, word in enumerate(words, start=1):
                self.write(mapping, k, word)
            self.write(mapping, 0, len(words))
        self.write(communication, 2, transmission_type)
        self.write(communication, 1, cob_id | flags, mask=~PDO_NO_RTR)  # devices without RTR fix this bit

    def disable_pdos(self) -> None:
        """Set all PDOs of the EDS invalid, so that none acts on the drive or loads the bus unintended."""
        first = (Index.RPDO_COMMUNICATION, Index.TPDO_COMMUNICATION)
        for index in (communication + k for communication in first for k in range(4)):
            cob_id = self.peek(index, 1)
            if cob_id is not None and not cob_id & PDO_INVALID:
                self._invalidate(index, cob_id)

    def _invalidate(self, communication: int, cob_id: int) -> None:
        """Set a PDO invalid; one that is fixed stays valid, and does not act in NMT pre-operational."""
        with contextlib.suppress(SettingRefused):
            self.write_only(communication, 1, cob_id | PDO_INVALID)

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
        return f"node {self.node_id}, object {self._object(index, subindex)}"

    def _object(self, index: int, subindex: int) -> str:
        variable = self.dictionary.get_variable(index, subindex)
        return f"0x{index:04X}:{subindex:02X}" + (f" ({variable.name})" if variable is not None else "")

    def _transfer(self, index: int, subindex: int, action: Callable[[], Any], value: int | None = None) -> Any:
        self._node.sdo.answers_left = MOST_ANSWERS
        try:
            return action()
        except SdoAbortedError as error:
            raise SettingRefused(
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
