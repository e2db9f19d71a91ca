"""PDOs of a simulated node: communication and mapping parameters (CiA 301, 7.5.2.35 ff.) compiled to struct packers."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter
from struct import Struct
from typing import Any, Final

from drivers.bus import CanPort, Listener
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import PDO_INVALID, layout
from drivers.sim.object_dictionary import Dictionary, Item, key_of
from drivers.sim.sdo_server import AbortCode, SdoAbort

RPDO_COMMUNICATION, RPDO_MAPPING = int(Index.RPDO_COMMUNICATION), int(Index.RPDO_MAPPING)
TPDO_COMMUNICATION, TPDO_MAPPING = int(Index.TPDO_COMMUNICATION), int(Index.TPDO_MAPPING)
_LENGTH_TOO_SHORT: Final = 0x8210  # EMCY: PDO not processed due to length error
_LENGTH_EXCEEDED: Final = 0x8220  # EMCY: PDO length exceeded


@dataclass(slots=True)
class _Pdo:
    cob_id: int
    transmission_type: int
    packer: Struct
    keys: tuple[int, ...]
    get: Callable[[dict[int, Any]], Any]
    pending: bytes = b""  # synchronous RPDO: waits for the SYNC; event-driven TPDO: sent last
    syncs: int = 0
    timeout_s: float = 0.0  # RPDO: its event timer, sub-index 5; 0: not supervised
    deadline_s: float = math.inf  # RPDO: of the next one, once the first has come


class ProcessData:
    """Unpacks RPDOs into the values of the dictionary and packs TPDOs from them.

    received(now_s): called after an RPDO was taken in; emergency(code, register, now_s): CiA 301 length errors.
    """

    def __init__(
        self,
        dictionary: Dictionary,
        port: CanPort,
        received: Callable[[float], None],
        emergency: Callable[[int, int, float], None],
    ) -> None:
        self._dictionary, self._values, self._port = dictionary, dictionary.values, port
        self._received, self._emergency = received, emergency
        self._takers: list[tuple[int, Listener]] = []
        self._synchronous: list[_Pdo] = []  # RPDOs that wait for the SYNC
        self._every_sync: list[tuple[int, Callable[..., bytes], Callable[[dict[int, Any]], Any]]] = []
        self._tpdos: list[_Pdo] = []  # of all other transmission types
        self._supervised: list[_Pdo] = []  # RPDOs with an event timer
        self.deadline_s = math.inf  # the earliest of them
        self._operational = False
        for index in {key >> 8 for key in dictionary.items}:
            if RPDO_COMMUNICATION <= index < RPDO_MAPPING or TPDO_COMMUNICATION <= index < TPDO_MAPPING:
                dictionary.on_write(index, self._on_communication)
            elif RPDO_MAPPING <= index < TPDO_COMMUNICATION or TPDO_MAPPING <= index < TPDO_MAPPING + 0x200:
                dictionary.on_write(index, self._on_mapping)

    def configure(self, *, operational: bool) -> None:
        """Compile the PDOs that are valid now; none outside NMT operational."""
        for cob_id, take in self._takers:
            self._port.ignore(cob_id, take)
        self._operational = operational
        self._takers, self._synchronous, self._every_sync, self._tpdos = [], [], [], []
        self._supervised, self.deadline_s = [], math.inf
        if not operational:
            return
        rpdos = self._compile(RPDO_COMMUNICATION, RPDO_MAPPING)
        self._synchronous = [pdo for pdo in rpdos if pdo.transmission_type <= 240]
        self._supervised = [pdo for pdo in rpdos if pdo.timeout_s]
        self._takers = [(pdo.cob_id, self._taker(pdo)) for pdo in rpdos]
        tpdos = self._compile(TPDO_COMMUNICATION, TPDO_MAPPING)
        self._every_sync = [(pdo.cob_id, pdo.packer.pack, pdo.get) for pdo in tpdos if pdo.transmission_type == 1]
        self._tpdos = [pdo for pdo in tpdos if pdo.transmission_type != 1]
        for cob_id, take in self._takers:
            self._port.listen(cob_id, take)

    def _compile(self, communication: int, mapping: int) -> list[_Pdo]:
        pdos = []
        for n in range(4):
            if key_of(communication + n, 1) not in self._values:
                continue
            cob_id = self._dictionary.number(communication + n, 1)
            items = self._mapped(mapping + n, self._dictionary.number(mapping + n))
            if cob_id & PDO_INVALID or not items:
                continue
            keys = tuple(key_of(item.index, item.subindex) for item in items)
            # itemgetter of one key would return the bare value.
            get = itemgetter(*keys) if len(keys) > 1 else _tuple_getter(keys[0])
            packer = layout([item.entry for item in items])
            timer = communication == RPDO_COMMUNICATION and key_of(communication + n, 5) in self._values
            timeout_s = self._dictionary.number(communication + n, 5) / 1000 if timer else 0.0
            transmission_type = self._dictionary.number(communication + n, 2)
            pdos.append(_Pdo(cob_id & 0x7FF, transmission_type, packer, keys, get, timeout_s=timeout_s))
        return pdos

    def _mapped(self, index: int, count: int) -> list[Item]:
        words = [self._dictionary.number(index, k) for k in range(1, count + 1)]
        return [self._dictionary.item(word >> 16, word >> 8 & 0xFF) for word in words]

    # -- hooks: writes that CiA 301 allows a master -----------------------------------------------------------------

    def _on_communication(self, index: int, subindex: int, value: int) -> None:
        if subindex == 2 and 240 < value < 254:
            raise SdoAbort(AbortCode.INVALID_VALUE)
        self._dictionary.values[key_of(index, subindex)] = value
        self.configure(operational=self._operational)

    def _on_mapping(self, index: int, subindex: int, value: int) -> None:
        """Accept a mapping only while the PDO is invalid, an entry only while the number of entries is 0."""
        if not self._dictionary.number(index - 0x200, 1) & PDO_INVALID:
            raise SdoAbort(AbortCode.NOT_IN_THIS_STATE)
        if subindex == 0:
            if key_of(index, value) not in self._values:
                raise SdoAbort(AbortCode.PDO_TOO_LONG)
            if sum(item.entry.bits for item in self._mapped(index, value)) > 64:
                raise SdoAbort(AbortCode.PDO_TOO_LONG)
            return
        if self._dictionary.number(index):
            raise SdoAbort(AbortCode.NOT_IN_THIS_STATE)
        item = self._dictionary.item(value >> 16, value >> 8 & 0xFF)
        allowed = item.mappable and (item.writable or index >= TPDO_MAPPING)
        if not allowed or not item.code or item.entry.bits != value & 0xFF:
            raise SdoAbort(AbortCode.NOT_MAPPABLE)

    # -- in the loop ------------------------------------------------------------------------------------------------

    def _taker(self, pdo: _Pdo) -> Listener:
        """Return the listener of one RPDO. Its objects are looked up here, not for each frame."""
        update, keys, unpack, size = self._values.update, pdo.keys, pdo.packer.unpack, pdo.packer.size
        received, waits = self._received, pdo.transmission_type <= 240

        def take(can_id: int, data: bytes, now_s: float) -> None:
            if len(data) != size:
                self._emergency(_LENGTH_TOO_SHORT if len(data) < size else _LENGTH_EXCEEDED, 0x11, now_s)
                if len(data) < size:
                    return
                data = data[:size]
            if pdo.timeout_s:
                pdo.deadline_s = now_s + pdo.timeout_s
                self.deadline_s = min(each.deadline_s for each in self._supervised)
            if waits:
                pdo.pending = data
                return
            update(zip(keys, unpack(data)))  # noqa: B905  the packer has one value for each key
            received(now_s)

        return take

    def restart_deadlines(self) -> None:
        """Supervise each RPDO again from its next frame on: after a time-out, or when the time base was reset."""
        for pdo in self._supervised:
            pdo.deadline_s = math.inf
        self.deadline_s = math.inf

    def on_sync(self, now_s: float) -> None:
        """Apply the synchronous RPDOs, then send the TPDOs that are due."""
        for pdo in self._synchronous:
            if pdo.pending:
                self._values.update(zip(pdo.keys, pdo.packer.unpack(pdo.pending), strict=True))
                pdo.pending = b""
                self._received(now_s)
        values, send = self._values, self._port.send
        for cob_id, pack, get in self._every_sync:
            send(cob_id, pack(*get(values)), now_s)
        for pdo in self._tpdos:
            data = pdo.packer.pack(*pdo.get(values))
            pdo.syncs += 1
            cyclic = 1 < pdo.transmission_type <= 240
            due = pdo.syncs % pdo.transmission_type == 0 if cyclic else data != pdo.pending  # 0, 254, 255: on change
            if due:
                pdo.pending = data
                send(pdo.cob_id, data, now_s)


def _tuple_getter(key: int) -> Callable[[dict[int, Any]], tuple[Any]]:
    return lambda values: (values[key],)
