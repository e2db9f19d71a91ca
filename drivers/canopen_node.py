"""Supervision of a CANopen node by its master: EMCY, heartbeat, missed answers and bus state as `Condition` bits."""

import math
from typing import Final, Protocol

from drivers.bus import BusState
from drivers.canopen_master import CONSUMED_HEARTBEATS, CanopenMaster
from drivers.emcy import Emergency, decode_emergency
from drivers.port import Condition

_OPERATIONAL: Final = 5
_NMT_STATES: Final = (0, 4, _OPERATIONAL, 127)  # CiA 301: boot-up, stopped, operational, pre-operational
_KEPT_EMERGENCIES: Final = 100  # a device that sends them without end does not fill the memory


class NodeSettings(Protocol):
    """Settings that a node of any device profile has."""

    @property
    def node_id(self) -> int: ...

    @property
    def heartbeat_s(self) -> float: ...

    @property
    def missed_answers_allowed(self) -> int: ...


class CanopenNode:
    """Base of drive and encoder on a master's bus; `name` is used in messages."""

    settings: NodeSettings

    def __init__(self, master: CanopenMaster, settings: NodeSettings, name: str) -> None:
        self._master, self.settings, self._health = master, settings, master.health
        self.name = f"{name} node {settings.node_id}"
        self.emergencies: list[Emergency] = []  # newest last
        self.malformed_frames = 0  # of a length or value that they cannot have; not acted on
        self._sample_time_s = 0.0
        self._begin()
        master.port.listen(0x180 + settings.node_id, self._on_tpdo)
        master.port.listen(0x080 + settings.node_id, self._on_emergency)
        master.port.listen(0x700 + settings.node_id, self._on_heartbeat)

    def _begin(self) -> None:
        """Reset after a set-up: no answer, no heartbeat and no EMCY yet."""
        self._answered = self._set_up_at = self._master.syncs  # number of the SYNC answered last
        self._latched = 0  # Condition bits; an int: the truth test of an IntFlag runs Python code, which is slow
        self._heartbeat_deadline_s = math.inf  # until the first answered SYNC
        self.emergencies.clear()

    def _on_tpdo(self, can_id: int, data: bytes, now_s: float) -> None:
        raise NotImplementedError

    def _take_answer(self, now_s: float) -> None:
        """Note that the latest SYNC is answered. From the first answer on heartbeats are awaited: CiA 301 begins with
        the first heartbeat, but the node was told to send them (0x1017), and one that never does is not supervised."""
        if self._answered == self._set_up_at:
            self._heartbeat_deadline_s = now_s + CONSUMED_HEARTBEATS * self.settings.heartbeat_s
        self._answered = self._master.syncs
        self._sample_time_s = self._master.sync_time_s

    def _on_emergency(self, can_id: int, data: bytes, now_s: float) -> None:
        emergency = decode_emergency(data, now_s)
        self.emergencies.append(emergency)
        del self.emergencies[:-_KEPT_EMERGENCIES]
        self._latch(emergency)

    def _latch(self, emergency: Emergency) -> None:
        raise NotImplementedError

    def _on_heartbeat(self, can_id: int, data: bytes, now_s: float) -> None:
        if len(data) != 1 or data[0] not in _NMT_STATES:
            self.malformed_frames += 1
            return
        if self._answered == self._set_up_at:
            return  # before the first answered SYNC the node may be in another NMT state
        self._heartbeat_deadline_s = now_s + CONSUMED_HEARTBEATS * self.settings.heartbeat_s
        if data[0] != _OPERATIONAL:
            self._latched |= Condition.NOT_OPERATIONAL  # boot-up (0) included: it lost its configuration

    def _node_condition(self, age: int, now_s: float) -> Condition:
        """Return the fault bits: latched ones, age of the sample in SYNCs, heartbeat, bus."""
        condition = Condition(self._latched)
        if age:
            condition |= Condition.LATE
        if age > self.settings.missed_answers_allowed:
            condition |= Condition.STALE
        if now_s > self._heartbeat_deadline_s:
            condition |= Condition.HEARTBEAT_LOST
        if self._health.state is BusState.PASSIVE:
            condition |= Condition.BUS_PASSIVE
        elif self._health.state is BusState.OFF:
            condition |= Condition.BUS_OFF
        return condition

    def _cause(self) -> str:
        """Text of the last active EMCY, else the last error of the bus."""
        active = [emergency.text for emergency in self.emergencies if emergency.active]
        return active[-1] if active else self._health.last_error


def condition_names(condition: Condition) -> str:
    """Names of the bits that are set."""
    return " | ".join(str(flag.name) for flag in Condition if flag in condition)
