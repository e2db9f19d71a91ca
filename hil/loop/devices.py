"""Open the devices of a bench: bus, drive, linear encoder; simulated if the bench has a `simulation` section.

On the in-process bus a SYNC returns when every node has answered. On a python-can bus the simulated nodes have their
own connection, which the loop polls in its own thread, because a second thread would delay it.
Another protocol is a subclass of `Devices` and one line in `PROTOCOLS`.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from types import TracebackType
from typing import Self

from drivers.bus import BusConfig, CanPort, PumpedPort, PythonCanPort, open_bus
from drivers.canopen_drive import CanopenDrive, DriveSettings
from drivers.canopen_encoder import CanopenEncoder, EncoderSettings
from drivers.canopen_master import CanopenMaster
from drivers.canopen_node import CanopenNode
from drivers.inprocess import InProcessBus
from drivers.modelled_bus import frame_bits
from drivers.port import Drive, DriverError, Encoder, Master, PlantLike
from drivers.serial_encoder import SerialEncoder, SerialFormat, SerialSettings
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode, DriveSection
from hil.errors import FieldError, HilError
from hil.loop.eds_files import MODES, check_eds_files, drive_eds, encoder_eds
from hil.loop.simulated_bench import SimulatedNodes
from hil.loop.stall import command_deadline_s, late_limit_s

_TARGET_BYTES = {DriveMode.CST: 2, DriveMode.CSV: 4, DriveMode.CSP: 4}


@contextmanager
def driver_errors() -> Iterator[None]:
    """Raise errors of the drivers as HilError; `drivers` may not import `hil`."""
    try:
        yield
    except DriverError as error:
        raise HilError(str(error)) from error


LOAD_SHARE = 0.5  # of the torque that can act: weight and process forces of a usable axis are below


class Devices:
    """Opened devices of a bench behind `drivers.port`; a context manager. Each protocol has a subclass."""

    bench: Bench
    section: DriveSection
    master: Master
    drive: Drive
    encoder: Encoder | None
    notes: tuple[str, ...] = ()  # what the description of the devices leaves in doubt

    def set_up(self) -> None:
        """Configure the devices, power stage off; blocking. Raises HilError if a device refuses."""
        with driver_errors():
            self.drive.set_up()
            if self.encoder is not None:
                self.encoder.set_up()

    @cached_property
    def late_limit_s(self) -> float:
        """Lateness of a tick at which the axis is stopped."""
        return late_limit_s(self.bench)

    @property
    def acting_torque(self) -> float:
        """Highest torque that can act: limit of the control law, or of the drive if it is lower [N m or N]."""
        return self.bench.gains.torque_limit_n_m

    @property
    def load_torque(self) -> float:
        """Torque up to which weight and process may drive the axis against its motor [N m or N]."""
        return self.section.supervision.load_torque or LOAD_SHARE * self.acting_torque

    def bus_load(self) -> float:
        """Share of the bus's time used in each period; 0 where the protocol has no limit."""
        return 0.0

    def release(self) -> None:
        """Leave devices whose power is off, so that they do not trip when the loop has ended. Does not wait."""

    def misses_this_pc(self) -> bool:
        """Return True if the drive has shown that it notices when this program ends, or where none can show it."""
        return True

    def take_notes(self) -> Iterator[str]:
        """Yield what was received and not acted on since the last call."""
        yield from ()

    def close(self) -> None:
        """Close the connections."""
        if self.encoder is not None:
            self.encoder.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Rig(Devices):
    """CANopen bus, CiA 402 drive and encoder of a bench. `nodes` are the simulated devices, None on real ones; `ports`
    the connections to a python-can bus, the master's first.

    bus: an in-process bus to use instead of opening one (for injecting faults). plant: moved by the simulated devices
    instead of the bench's axis. Raises FieldError for a bench that cannot be run, HilError if a device cannot be
    opened.
    """

    master: CanopenMaster
    drive: CanopenDrive
    encoder: CanopenEncoder | SerialEncoder | None

    def __init__(
        self, bench: Bench, seed: int | None = None, bus: InProcessBus | None = None, plant: PlantLike | None = None
    ) -> None:
        self.bench, self.section = bench, bench.drive or DriveSection()
        check_runnable(bench)
        self.notes = check_eds_files(bench)
        self.nodes: SimulatedNodes | None = None
        self.encoder = None
        self.ports: list[CanPort] = []
        with driver_errors():
            try:
                self.port = self._connect(bus, lambda port: SimulatedNodes(bench, port, seed, plant))
                self.master = CanopenMaster(
                    self.port, node_id=self.section.master_node_id, heartbeat_s=self.section.heartbeat_s
                )
                self.drive = CanopenDrive(self.master, self._drive_settings())
                if bench.has_table_encoder:
                    self.encoder = self._open_encoder()
            except DriverError:
                self.close()
                raise

    def set_up(self) -> None:
        super().set_up()
        velocity_gain = self.bench.gains.velocity_gain_n_m_s_rad  # alone it holds the load at this speed
        self.drive.stop_margin = self.load_torque / velocity_gain if velocity_gain > 0.0 else math.inf

    @property
    def acting_torque(self) -> float:
        return min(super().acting_torque, self.drive.info.max_torque_n_m)

    def bus_load(self) -> float:
        """Share of the bus's time that SYNC, RPDO, TPDOs and encoder take, with the longest bit stuffing."""
        target = _TARGET_BYTES[self.section.mode]
        frames = [0, 2 + target, 8] + [target] * self.drive.info.reports_demand
        if isinstance(self.encoder, CanopenEncoder):
            frames.append(4)
        return sum(map(frame_bits, frames)) / (self.section.bitrate * self.bench.gains.period_s)

    def release(self) -> None:
        if not self.master.silent and not self.drive.read(self.master.sync_time_s).powered:
            self.master.release(self.section.node_id)

    def misses_this_pc(self) -> bool:
        return self.drive.info.watches_master

    def take_notes(self) -> Iterator[str]:
        foreign = self.master.health.foreign
        if foreign:
            kinds = ", ".join(f"{count} x {kind}" for kind, count in sorted(foreign.items()))
            yield f"bus: frames that CANopen does not have (CiA 301) came and were not acted on: {kinds}"
            foreign.clear()
        for node in (self.drive, self.encoder):
            if isinstance(node, CanopenNode) and node.malformed_frames:
                yield f"{node.name}: {node.malformed_frames} frames of a wrong length or value were not acted on"
                node.malformed_frames = 0

    def close(self) -> None:
        super().close()
        for port in self.ports:
            port.close()
        if self.nodes is not None:
            self.nodes.close()
        self.ports = []

    def _connect(self, bus: InProcessBus | None, simulate: Callable[[CanPort], SimulatedNodes]) -> CanPort:
        if self.section.interface == "inprocess":
            bus = bus or InProcessBus()
            self.nodes = simulate(bus.port())  # before the master's port, which so gets no boot-up messages
            bus.clocks.append(self.nodes.drive.clock)
            return bus.port()
        config = BusConfig(self.section.interface, self.section.channel, self.section.bitrate)
        port = PythonCanPort(open_bus(config))
        self.ports.append(port)
        if self.bench.simulation is None:
            return port
        far_end = PythonCanPort(open_bus(config))
        self.ports.append(far_end)
        self.nodes = simulate(far_end)
        return PumpedPort(port, far_end, clock=self.nodes.drive.clock)

    def _drive_settings(self) -> DriveSettings:
        section = self.section
        return DriveSettings(
            node_id=section.node_id, mode=MODES[section.mode], period_s=self.bench.gains.period_s,
            eds=drive_eds(section), serial_number=section.serial_number, heartbeat_s=section.heartbeat_s,
            missed_answers_allowed=section.missed_answers, rated_torque_n_m=section.rated_torque_n_m,
            command_deadline_s=command_deadline_s(self.bench), watch_setpoint=section.watch_setpoint)  # fmt: skip

    def _open_encoder(self) -> CanopenEncoder | SerialEncoder:
        connection, table = self.section.encoder, self.bench.encoders.table
        assert table is not None
        if connection.interface == "canopen":
            return CanopenEncoder(self.master, EncoderSettings(
                node_id=connection.node_id, serial_number=connection.serial_number, step_m=table.resolution_m,
                eds=encoder_eds(self.section), reversed=table.direction < 0, heartbeat_s=self.section.heartbeat_s,
                missed_answers_allowed=self.section.missed_answers))  # fmt: skip
        serial_line = self.nodes.serial if self.nodes is not None else None
        device = serial_line.device if serial_line is not None else str(connection.device)
        return SerialEncoder(SerialSettings(
            device, connection.baudrate, SerialFormat(connection.format), table.resolution_m,
            reversed=table.direction < 0, latency_s=connection.latency_s))  # fmt: skip


# Protocol of the drive (`drive.protocol` of the bench file) -> its devices, made from bench and seed of the sensors.
PROTOCOLS: dict[str, Callable[[Bench, int | None], Devices]] = {"canopen": Rig}


def open_devices(bench: Bench, seed: int | None = None) -> Devices:
    """Open the devices of a bench by its protocol. Raises FieldError for an unknown one, and as the protocol does."""
    protocol = (bench.drive or DriveSection()).protocol
    if protocol not in PROTOCOLS:
        raise FieldError(("drive", "protocol"), f"given {protocol}, allowed {', '.join(PROTOCOLS)}; correct it")
    with driver_errors():
        return PROTOCOLS[protocol](bench, seed)


def check_runnable(bench: Bench) -> None:
    """Raise FieldError at the field for which a bench cannot be run over CANopen."""
    section = bench.drive or DriveSection()
    control = bench.known_control  # raises
    if control.setpoint_delay_s:
        raise FieldError(
            ("control", "setpoint_delay_s"),
            f"given {control.setpoint_delay_s:g}, allowed 0 for a run: its loop uses set-points at once; remove it",
        )
    if control.velocity_setpoint != "recorded":
        raise FieldError(
            ("control", "velocity_setpoint"),
            f"given {control.velocity_setpoint}, allowed for recordings alone: a run has the velocity of its profile; "
            "remove it",
        )
    if bench.drive is None and bench.simulation is None:
        raise FieldError(
            ("drive",),
            "given nothing, allowed the section `drive` of the bench (and `simulation` to run "
            "it without hardware); add it",
        )
    if bench.simulation is None and section.interface == "inprocess":
        raise FieldError(
            ("drive", "interface"),
            "given inprocess without a section `simulation`, allowed socketcan, "
            "virtual or udp_multicast for real devices; choose one or add `simulation`",
        )
    if section.heartbeat_s < bench.gains.period_s:
        raise FieldError(
            ("drive", "heartbeat_s"),
            f"given {section.heartbeat_s:g}, allowed the period of the loop, which sends it, or more: "
            f"{bench.gains.period_s:g}; raise it",
        )
    if bench.encoders.motor.direction < 0:
        raise FieldError(
            ("encoders", "motor", "direction"),
            "given -1, allowed 1: the drive turns its direction (object 0x607E); set it there",
        )
    if bench.gains.position_from_table and section.mode is DriveMode.CSP:
        raise FieldError(
            ("drive", "mode"),
            "given csp with position_feedback: table, allowed cst or csv: in csp the "
            "drive closes the position loop on its own encoder",
        )
    connection = section.encoder.interface
    if bench.has_table_encoder and connection == "none":
        raise FieldError(
            ("drive", "encoder", "interface"),
            "given none with a table encoder, allowed canopen or serial; connect it or say encoders.table: null",
        )
    if connection == "serial" and bench.simulation is None and section.encoder.device is None:
        raise FieldError(("drive", "encoder", "device"), "given nothing, allowed the serial line, as /dev/ttyUSB0")
