"""Before the loop: a device is configured by SDO, with the object dictionary of the canopen package.

Every write is read back. What a device takes some time for is asked for until it comes, with a bound.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from canopen.objectdictionary import ODVariable, datatypes
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from drivers.eds_file import read_eds
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import PDO_INVALID, PDO_NO_RTR, Entry, layout
from drivers.port import ConfigurationError, IdentityError, ResponseTimeout
from drivers.sdo_client import MOST_ANSWERS, RESPONSE_TIMEOUT_S, PumpedSdoClient, SetupNetwork

EDS_FOLDER: Final = Path(__file__).parent / "eds"
BOOT_LIMIT_S: Final = 5.0  # drives take some seconds from power-on to their first answer
_NMT_PRE_OPERATIONAL: Final = 128
_ASK_AGAIN_S: Final = 0.01
_PDO_COMMUNICATION: Final = (*range(0x1400, 0x1600), *range(0x1800, 0x1A00))  # of up to 512 each way, CiA 301


class SettingRefused(ConfigurationError):
    """The device aborts the transfer of an object."""


class DeviceSetup:
    """Configures one node by SDO. Errors name node, object, value and what the device said.

    Types are those of the EDS, signs those of CiA 301, 402 and 406. Raises EdsError, ResponseTimeout (no answer),
    ConfigurationError (refused, or reads back differently), IdentityError. `kept`: settings that a device need not have
    and keeps as they are, in words.
    """

    def __init__(self, network: SetupNetwork, node_id: int, eds: Path) -> None:
        self._description = read_eds(eds, node_id)
        self.node_id, self.eds = node_id, eds
        self.dictionary = self._description.dictionary
        self._network = network
        self._sdo = PumpedSdoClient(0x600 + node_id, 0x580 + node_id, self.dictionary)
        self._sdo.network = network
        self.kept: list[str] = []

    def __enter__(self) -> DeviceSetup:
        self._network.subscribe(self._sdo.tx_cobid, self._sdo.on_response)
        return self

    def __exit__(self, *exception: object) -> None:
        self._network.unsubscribe(self._sdo.tx_cobid, self._sdo.on_response)

    def read(self, index: int, subindex: int = 0) -> int:
        """An integer object. A longer answer than the EDS says is right if its value has room in the type."""
        variable = self._integer(index, subindex)
        data = self._transfer(index, subindex, lambda: self._sdo.upload(index, subindex))
        size, signed = len(variable) // 8, _is_signed(variable)
        value = int.from_bytes(data, "little", signed=signed)
        lowest = -(1 << (8 * size - 1)) if signed else 0
        if len(data) < size or not lowest <= value < lowest + (1 << 8 * size):
            raise ConfigurationError(
                "the answer is no number as the EDS describes it", where=self._where(index, subindex),
                given=f"{data[:8].hex(' ') or 'no byte'}", allowed=f"{size} bytes",
                advice="Give the EDS of the device that is connected.",
            )  # fmt: skip
        return value

    def has(self, index: int, subindex: int = 0) -> bool:
        """Return True if the EDS has the object."""
        return self.dictionary.get_variable(index, subindex) is not None

    def check_types(self, entries: Sequence[Entry]) -> None:
        """Raise EdsError unless the EDS has process data as they are sent."""
        self._description.check(entries)

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
            variable = self._integer(index, subindex)
            data = int(value).to_bytes(len(variable) // 8, "little", signed=_is_signed(variable))
        except OverflowError as error:
            raise ConfigurationError(
                f"the value does not fit the object ({error})", where=self._where(index, subindex), given=str(value),
                advice="Correct the bench description.",
            ) from error  # fmt: skip
        self._transfer(index, subindex, lambda: self._sdo.download(index, subindex, data), value)

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
        self.check_types(entries)
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
        for index in _PDO_COMMUNICATION:
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

    def _integer(self, index: int, subindex: int) -> ODVariable:
        variable = self._variable(index, subindex)
        if variable.data_type not in datatypes.INTEGER_TYPES:
            raise ConfigurationError(
                "the EDS has another data type than an integer", where=self._where(index, subindex),
                given=self._description.where(index, subindex), advice=f"Correct {self.eds.name}.",
            )  # fmt: skip
        return variable

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
        self._sdo.answers_left = MOST_ANSWERS
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


def _is_signed(variable: ODVariable) -> bool:
    return variable.data_type in datatypes.SIGNED_TYPES
