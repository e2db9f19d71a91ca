"""An independent servo drive for tests: durand's CiA 301 slave, and a CiA 402 machine of its own from the standard.

It shares no code with `drivers`. It has the manners of real drives, which take their time and refuse what they need
not have. No thread: `poll` takes in the frames of a python-can bus and passes the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import can
from durand import MinimalNode, Record, Variable, set_scheduler
from durand.datatypes import DatatypeEnum as Type
from durand.scheduler import VirtualScheduler
from durand.services.nmt import StateEnum
from durand.services.sdo.server import SDODomainAbort
from polled_network import PolledNetwork

NOT_NOW, READ_ONLY, BAD_VALUE, GENERAL = 0x08000022, 0x06010002, 0x06090030, 0x08000000  # CiA 301, SDO abort codes
INITIALISING, DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, REACTION, FAULT = range(8)
# CiA 402-2, table "state coding"; quick stop bit as after a shutdown command
CODING = {INITIALISING: 0x00, DISABLED: 0x40, READY: 0x21, SWITCHED_ON: 0x23, ENABLED: 0x27, QUICK_STOP: 0x07,
          REACTION: 0x0F, FAULT: 0x08}  # fmt: skip
# command -> (mask, value) of the controlword, table "command coding"; then state -> next state
COMMANDS: tuple[tuple[int, int, Mapping[int, int]], ...] = (
    (0x82, 0x00, {READY: DISABLED, SWITCHED_ON: DISABLED, ENABLED: DISABLED, QUICK_STOP: DISABLED}),  # disable voltage
    (0x86, 0x02, {READY: DISABLED, SWITCHED_ON: DISABLED, ENABLED: QUICK_STOP}),  # quick stop
    (0x87, 0x06, {DISABLED: READY, SWITCHED_ON: READY, ENABLED: READY}),  # shutdown
    (0x8F, 0x07, {READY: SWITCHED_ON, ENABLED: SWITCHED_ON}),  # switch on, disable operation
    (0x8F, 0x0F, {SWITCHED_ON: ENABLED}),  # enable operation
)
COUNTS_PER_REV = 65536
RATED_MN_M = 4000
OBJECTS: Mapping[int, tuple[Type, str, int]] = {
    0x1006: (Type.UNSIGNED32, "rw", 0), 0x1019: (Type.UNSIGNED8, "rw", 0),
    0x6007: (Type.INTEGER16, "rw", 0), 0x603F: (Type.UNSIGNED16, "ro", 0), 0x6040: (Type.UNSIGNED16, "rw", 0),
    0x6041: (Type.UNSIGNED16, "ro", 0), 0x605A: (Type.INTEGER16, "rw", 2), 0x605E: (Type.INTEGER16, "rw", 2),
    0x6060: (Type.INTEGER8, "rw", 0), 0x6061: (Type.INTEGER8, "ro", 0), 0x6064: (Type.INTEGER32, "ro", 0),
    0x6071: (Type.INTEGER16, "rw", 0), 0x6072: (Type.UNSIGNED16, "rw", 3000), 0x6074: (Type.INTEGER16, "ro", 0),
    0x6075: (Type.UNSIGNED32, "ro", 5000), 0x6076: (Type.UNSIGNED32, "ro", RATED_MN_M),
    0x6077: (Type.INTEGER16, "ro", 0), 0x607A: (Type.INTEGER32, "rw", 0), 0x6085: (Type.UNSIGNED32, "rw", 10**7),
    0x60FF: (Type.INTEGER32, "rw", 0), 0x6502: (Type.UNSIGNED32, "ro", 0x380),
}  # fmt: skip
RECORDS: Mapping[int, Mapping[int, tuple[Type, int]]] = {
    0x1016: {1: (Type.UNSIGNED32, 0)}, 0x1029: {1: (Type.UNSIGNED8, 0)},
    0x608F: {1: (Type.UNSIGNED32, COUNTS_PER_REV), 2: (Type.UNSIGNED32, 1)},
    0x60C2: {1: (Type.UNSIGNED8, 10), 2: (Type.INTEGER8, -3)},
}  # fmt: skip


@dataclass(frozen=True)
class Manners:
    """How the drive differs from an ideal one. Times [s] from the event that begins them."""

    boots_s: float = 0.0
    answers_sdo_s: float = 0.0
    transition_s: float = 0.0
    reset_s: float = 0.0  # inf: the cause of the fault lasts
    mode_s: float = 0.0  # until 0x6061 follows; inf: it never does
    shows_mode_enabled: bool = False  # 0x6061 is 0 before
    refuses_mode_0: bool = False
    initialises_s: float = math.inf
    fixed_mapping: bool = False  # of the PDOs, as `values` say; else as a usual client wants it
    keeps_mode: int | None = None  # acknowledges 0x6060 and keeps this one
    voltage_s: float = 0.0  # main voltage after the first shutdown command
    remote: bool = True
    ignores_rpdo: bool = False
    quick_stop_input: bool = False
    operational_s: float = 0.0  # SYNCs are not answered for so long after NMT start
    second_master_halts: bool = False
    trips_when_off: bool = False  # a lost master is a fault in every state
    stands_at_rad: float = 1.0
    begins: int = DISABLED
    error_code: int = 0
    status_bits: int = 0
    values: Mapping[tuple[int, int], int] = field(default_factory=dict)
    refuses: Mapping[tuple[int, int], int] = field(default_factory=dict)  # write -> SDO abort code
    lacks: tuple[int, ...] = ()


class Slave:
    """The drive: a rigid mass behind a torque, or at the target position in CSP. A port for `PumpedPort`."""

    def __init__(
        self, bus: can.BusABC, manners: Manners, *, node_id: int = 5, inertia_kg_m2: float = 1.8e-3,
        period_s: float = 0.001,
    ) -> None:  # fmt: skip
        self.manners, self.inertia_kg_m2, self.period_s = manners, inertia_kg_m2, period_s
        self.position_rad, self.velocity_rad_s, self.torque_n_m = manners.stands_at_rad, 0.0, 0.0
        self.largest_step_rad = 0.0
        self._mode = manners.values.get((0x6061, 0), 10 if manners.begins == ENABLED else 0)
        self.network = PolledNetwork(bus, manners.answers_sdo_s)
        self._scheduler = VirtualScheduler()
        set_scheduler(self._scheduler)
        self.node = MinimalNode(self.network, node_id)
        self.od = self.node.object_dictionary
        self._build()
        self.state, self._next = manners.begins, (manners.begins, 0.0)
        self.seen = [self.state]  # states in order
        self._clock_s: float | None = None  # of the caller, which may begin anew
        self._mode_due_s = self._voltage_due_s = self._operational_s = self._rpdo_s = self._beat_s = math.inf
        self._reset_bit = 0
        self.network.alive = not manners.boots_s
        self._measure()
        self._refresh()

    @property
    def eds(self) -> str:
        """The EDS that durand makes of the dictionary, COB-IDs with $NodeID."""
        self.node.eds.device_info.VendorNumber = 0x1234
        return str(self.node.eds.content)

    # -- objects ----------------------------------------------------------------------------------------------------

    def _build(self) -> None:
        od, manners = self.od, self.manners
        od[0x1000] = Variable(Type.UNSIGNED32, "ro", 0x00020192, name="Device type")
        od.lookup(0x1018, 1).value = 0x1234
        for index, (kind, access, value) in OBJECTS.items():
            if index not in manners.lacks:
                od[index] = Variable(kind, access, value, name=f"Object {index:04X}")
        for index, entries in RECORDS.items():
            if index not in manners.lacks:
                od[index] = Record(name=f"Object {index:04X}")
                for subindex, (kind, value) in entries.items():
                    od[index][subindex] = Variable(kind, "rw", value, name=f"Object {index:04X} {subindex}")
        if 0x1400 not in manners.lacks:
            od[0x1400][5] = Variable(Type.UNSIGNED16, "rw", 0, name="Event timer")
        if manners.fixed_mapping:
            self.node.rpdo[0].mapping = [(0x6040, 0), (0x6071, 0)]
            self.node.tpdo[0].mapping = [(0x6041, 0), (0x6064, 0), (0x6077, 0)]
            self.node.tpdo[1].mapping = [(0x6074, 0)]
        for (index, subindex), value in manners.values.items():
            od.write(index, subindex, value)
        if manners.begins == ENABLED:
            od.write(0x6040, 0, 0x0F)
            od.write(0x6060, 0, 10)
            od.write(0x6061, 0, 10)
        for key, code in manners.refuses.items():
            self._validate(*key, lambda value, code=code: code)
        for pdo in (0x1400, 0x1401, 0x1800, 0x1801):
            for subindex in range(9):
                self._validate(pdo + 0x200, subindex, lambda value, pdo=pdo: self._mapping_refused(pdo))
            self._validate(pdo, 1, lambda value: NOT_NOW if self._powered else 0)
        self._validate(0x6060, 0, self._mode_refused)
        if 0x1019 not in manners.lacks:
            self._validate(0x1019, 0, lambda value: NOT_NOW if od.read(0x1006, 0) else 0)
        od.download_callbacks[(0x6040, 0)].add(self._on_controlword)
        od.download_callbacks[(0x6060, 0)].add(self._on_mode)
        od.download_callbacks[(0x1016, 1)].add(self._on_consumer)
        self.node.nmt.state_callbacks.add(self._on_nmt)
        self.network.takes = self._takes

    def _validate(self, index: int, subindex: int, refused: Callable[[int], int]) -> None:
        def check(value: int) -> None:
            if code := refused(value):
                raise SDODomainAbort(code, (index, subindex))

        self.od.validate_callbacks[(index, subindex)].add(check)

    def _mapping_refused(self, pdo: int) -> int:
        """CiA 301: a mapping is changed only while its PDO is not valid; some drives not while they are enabled."""
        if self.manners.fixed_mapping:
            return READ_ONLY
        return NOT_NOW if self._powered or not self.od.read(pdo, 1) >> 31 else 0

    def _mode_refused(self, value: int) -> int:
        if self._powered:
            return NOT_NOW
        return (
            0
            if value in (8, 9, 10, self.manners.keeps_mode) or (value == 0 and not self.manners.refuses_mode_0)
            else BAD_VALUE
        )

    @property
    def _powered(self) -> bool:
        return self.state in (ENABLED, QUICK_STOP, REACTION)

    # -- events -----------------------------------------------------------------------------------------------------

    def _on_controlword(self, value: int) -> None:
        edge, self._reset_bit = value & 0x80 and not self._reset_bit, value & 0x80
        if self.manners.second_master_halts:
            self.od.write(0x6040, 0, value | 0x100)
        if edge and self.state == FAULT:
            self._next = (DISABLED, self.network.now_s + self.manners.reset_s)

    def _on_mode(self, value: int) -> None:
        self._mode_due_s = self.network.now_s + self.manners.mode_s
        if self.manners.keeps_mode is not None:
            self.od.write(0x6060, 0, self.manners.keeps_mode)

    def _on_consumer(self, value: int) -> None:
        self._beat_s = math.inf  # CiA 301: from the next heartbeat on

    def _on_nmt(self, state: StateEnum) -> None:
        if state == StateEnum.OPERATIONAL:
            self._operational_s = self.network.now_s + self.manners.operational_s
        self._rpdo_s = math.inf

    def _takes(self, can_id: int, data: bytes) -> bool:
        """See each frame before durand does; False keeps it from it."""
        if can_id == 0x701:
            self._beat_s = self.network.now_s
        if can_id == 0x200 + self.node.node_id:
            self._rpdo_s = self.network.now_s
            return not self.manners.ignores_rpdo
        if can_id != 0x080:
            return True
        if bool(self.od.read(0x1019, 0) if 0x1019 in self.od else 0) != bool(data):
            self.node.emcy.set(0x8240, 0x11)
        self._move()
        return self.network.now_s >= self._operational_s

    # -- time -------------------------------------------------------------------------------------------------------

    def poll(self, now_s: float, timeout_s: float = 0.0) -> None:
        """Take in the frames and pass the time since the last call."""
        self.network.receive()
        passed_s = max(0.0, now_s - self._clock_s) if self._clock_s is not None else 0.0
        self._clock_s = now_s
        end_s = self.network.now_s + passed_s
        while end_s - self.network.now_s > 1e-9:  # in steps: every timer runs out in its turn
            step_s = min(0.001, end_s - self.network.now_s)
            self.network.now_s += step_s
            self._scheduler.run(step_s)
            self._pass()
        self._pass()
        self.network.receive()

    def _pass(self) -> None:
        now_s, manners = self.network.now_s, self.manners
        if not self.network.alive:
            if now_s < manners.boots_s:
                return
            self.network.alive = True
            self.node.nmt.reset()
        lost_s = (self.od.read(0x1016, 1) & 0xFFFF) / 1000 if 0x1016 in self.od else 0
        deadline_s = self.od.read(0x1400, 5) / 1000 if 0x1400 not in manners.lacks else 0
        if lost_s and now_s - self._beat_s > lost_s:
            self._beat_s = math.inf
            self._lost(0x8130)
        if deadline_s and now_s - self._rpdo_s > deadline_s:
            self._rpdo_s = math.inf
            self._lost(0x8250)
        if now_s >= self._mode_due_s:
            self._mode = self.od.read(0x6060, 0)
        hidden = manners.shows_mode_enabled and self.state != ENABLED
        if self.od.read(0x6061, 0) != (shown := 0 if hidden else self._mode):
            self.od.write(0x6061, 0, shown)
        self._step(now_s)

    def _lost(self, code: int) -> None:
        """A lost connection: EMCY (CiA 301), and a fault if 0x6007 is 1, of most drives only while they are enabled."""
        self.node.emcy.set(code, 0x11)
        if (self._powered or self.manners.trips_when_off) and (0x6007 not in self.od or self.od.read(0x6007, 0) == 1):
            self.od.write(0x603F, 0, code)
            self._enter(FAULT)

    def _step(self, now_s: float) -> None:
        """Carry out the transition that is due; begin the one that the controlword asks for."""
        target, due_s = self._next
        if target != self.state:
            if now_s >= due_s:
                self._enter(target)
            return
        controlword = self.od.read(0x6040, 0)
        if self.manners.remote and not self.manners.quick_stop_input and not controlword & 0x100:
            for mask, value, transitions in COMMANDS:
                target = transitions.get(self.state, self.state) if controlword & mask == value else self.state
                if target == SWITCHED_ON and now_s < self._voltage_due_s:
                    continue
                if target != self.state:
                    self._next = (target, now_s + self.manners.transition_s)
                    self._step(now_s) if not self.manners.transition_s else None
                    return
        if self.state == INITIALISING and now_s >= self.manners.initialises_s:
            self._enter(DISABLED)
        if self.state == QUICK_STOP and self.velocity_rad_s == 0.0:
            self._enter(DISABLED)

    def _enter(self, state: int) -> None:
        self.state, self._next = state, (state, 0.0)
        self.seen.append(state)
        if state == READY and self._voltage_due_s == math.inf:
            self._voltage_due_s = self.network.now_s + self.manners.voltage_s
        if state == DISABLED:
            self.od.write(0x603F, 0, 0)
        self._refresh()

    def _refresh(self) -> None:
        word = CODING[self.state] | self.manners.status_bits | 0x200 * self.manners.remote
        word &= ~0x20 if self.manners.quick_stop_input else 0xFFFF
        word |= 0x10 * (self.network.now_s >= self._voltage_due_s or not self.manners.voltage_s)
        self.od.write(0x6041, 0, word)
        if self.state == FAULT and not self.od.read(0x603F, 0):
            self.od.write(0x603F, 0, self.manners.error_code)

    def _measure(self) -> None:
        self.od.write(0x6064, 0, round(self.position_rad * COUNTS_PER_REV / (2 * math.pi)))

    def _move(self) -> None:
        """One period of the mass."""
        mode, od = self._mode, self.od
        torque = od.read(0x6071, 0) if self.state == ENABLED and mode == 10 else 0
        self.torque_n_m = torque * RATED_MN_M / 1e6
        before_rad, acceleration = self.position_rad, self.torque_n_m / self.inertia_kg_m2
        if self.state == ENABLED and mode == 8:
            self.position_rad = od.read(0x607A, 0) * 2 * math.pi / COUNTS_PER_REV
            self.velocity_rad_s = (self.position_rad - before_rad) / self.period_s
        elif self.state in (ENABLED, DISABLED, READY, SWITCHED_ON):
            self.position_rad += self.velocity_rad_s * self.period_s + acceleration * self.period_s**2 / 2
            self.velocity_rad_s += acceleration * self.period_s
        else:
            self.velocity_rad_s = 0.0  # an ideal ramp
        self.largest_step_rad = max(self.largest_step_rad, abs(self.position_rad - before_rad))
        self._measure()
        if 0x6074 in od:
            od.write(0x6074, 0, torque)
        od.write(0x6077, 0, torque)
        self._refresh()
