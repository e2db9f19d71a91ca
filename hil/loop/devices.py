"""The devices of a bench, opened: bus, drive, linear encoder; simulated where the bench has a `simulation` section.

On the in-process bus a SYNC returns when every node has answered. On a python-can bus the simulated nodes have their
own connection and are served by the loop's own polling, so that no second thread disturbs it; real devices answer
by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from drivers.bus import BusConfig, CanPort, PumpedPort, PythonCanPort, open_bus
from drivers.canopen_drive import CanopenDrive, DriveSettings
from drivers.canopen_encoder import CanopenEncoder, EncoderSettings
from drivers.canopen_master import CanopenMaster
from drivers.cia402 import OperationMode
from drivers.inprocess import InProcessBus
from drivers.modelled_bus import frame_bits
from drivers.port import ConfigurationError, Drive, DriverError, Encoder, Master, PlantLike
from drivers.sdo_setup import EDS_FOLDER
from drivers.serial_encoder import SerialEncoder, SerialFormat, SerialSettings
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveMode, DriveSection
from hil.errors import FieldError, HilError
from hil.loop.simulated_bench import SimulatedNodes

MODES = {
    DriveMode.CST: OperationMode.CYCLIC_SYNC_TORQUE,
    DriveMode.CSV: OperationMode.CYCLIC_SYNC_VELOCITY,
    DriveMode.CSP: OperationMode.CYCLIC_SYNC_POSITION,
}
_TARGET_BYTES = {DriveMode.CST: 2, DriveMode.CSV: 4, DriveMode.CSP: 4}


class Devices(Protocol):
    """What a session needs: the bench, its devices behind the port, and nothing of their protocol."""

    bench: Bench
    section: DriveSection

    @property
    def master(self) -> Master: ...

    @property
    def drive(self) -> Drive: ...

    @property
    def encoder(self) -> Encoder | None: ...


class Rig:
    """Bus, drive and encoder of a bench; a context manager. `nodes` are the simulated devices, None on real ones;
    `ports` the connections to a python-can bus, the master's first.

    bus: an in-process bus to use instead of opening one (for injecting faults). plant: what the simulated devices move
    instead of the bench's axis. Raises FieldError for a bench that cannot be run, HilError when a device cannot be
    opened.
    """

    def __init__(
        self, bench: Bench, seed: int | None = None, bus: InProcessBus | None = None, plant: PlantLike | None = None
    ) -> None:
        self.bench, self.section = bench, bench.drive or DriveSection()
        check_runnable(bench)
        self.nodes: SimulatedNodes | None = None
        self.encoder: CanopenEncoder | SerialEncoder | None = None
        self.ports: list[CanPort] = []
        try:
            self.port = self._connect(bus, lambda port: SimulatedNodes(bench, port, seed, plant))
            self.master = CanopenMaster(
                self.port, node_id=self.section.master_node_id, heartbeat_s=self.section.heartbeat_s
            )
            self.drive = CanopenDrive(self.master, self._drive_settings())
            if bench.has_table_encoder:
                self.encoder = self._open_encoder()
        except DriverError as error:
            self.close()
            raise HilError(str(error)) from error

    def set_up(self) -> None:
        """Configure the devices, power stage off; blocking. Raises HilError with what a device refused."""
        try:
            self.drive.set_up()
            rated = self.section.rated_torque_n_m
            if rated is not None and abs(self.drive.info.rated_torque_n_m - rated) > 0.001 * rated:
                raise ConfigurationError(
                    "another rated torque than described",
                    where=f"drive node {self.section.node_id}, object 0x6076",
                    given=f"{self.drive.info.rated_torque_n_m} N m",
                    allowed=f"{rated} N m",
                    advice="Correct drive.rated_torque_n_m in the bench file, or the drive.",
                )
            if self.encoder is not None:
                self.encoder.set_up()
        except DriverError as error:
            raise HilError(str(error)) from error

    def bus_load(self) -> float:
        """Share of the bus's time that SYNC, RPDO, TPDO and encoder take, with the longest bit stuffing."""
        frames = [0, 2 + _TARGET_BYTES[self.section.mode], 8]
        if isinstance(self.encoder, CanopenEncoder):
            frames.append(4)
        return sum(map(frame_bits, frames)) / (self.section.bitrate * self.bench.gains.period_s)

    def close(self) -> None:
        """Close encoder line and bus."""
        if self.encoder is not None:
            self.encoder.close()
        for port in self.ports:
            port.close()
        if self.nodes is not None:
            self.nodes.close()
        self.ports = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _connect(self, bus: InProcessBus | None, simulate: Callable[[CanPort], SimulatedNodes]) -> CanPort:
        if self.section.interface == "inprocess":
            bus = bus or InProcessBus()
            self.nodes = simulate(bus.port())  # before the master: they boot unheard
            return bus.port()
        config = BusConfig(self.section.interface, self.section.channel, self.section.bitrate)
        port = PythonCanPort(open_bus(config))
        self.ports.append(port)
        if self.bench.simulation is None:
            return port
        far_end = PythonCanPort(open_bus(config))
        self.ports.append(far_end)
        self.nodes = simulate(far_end)
        return PumpedPort(port, far_end)

    def _drive_settings(self) -> DriveSettings:
        section = self.section
        return DriveSettings(
            node_id=section.node_id, mode=MODES[section.mode], period_s=self.bench.gains.period_s,
            eds=Path(section.eds) if section.eds else EDS_FOLDER / "servo_drive.eds",
            serial_number=section.serial_number, heartbeat_s=section.heartbeat_s,
            missed_answers_allowed=section.missed_answers)  # fmt: skip

    def _open_encoder(self) -> CanopenEncoder | SerialEncoder:
        connection, table = self.section.encoder, self.bench.encoders.table
        assert table is not None
        if connection.interface == "canopen":
            return CanopenEncoder(self.master, EncoderSettings(
                node_id=connection.node_id, serial_number=connection.serial_number, step_m=table.resolution_m,
                eds=Path(connection.eds) if connection.eds else EDS_FOLDER / "linear_encoder.eds",
                reversed=table.direction < 0, heartbeat_s=self.section.heartbeat_s,
                missed_answers_allowed=self.section.missed_answers))  # fmt: skip
        serial_line = self.nodes.serial if self.nodes is not None else None
        device = serial_line.device if serial_line is not None else str(connection.device)
        return SerialEncoder(SerialSettings(
            device, connection.baudrate, SerialFormat(connection.format), table.resolution_m,
            reversed=table.direction < 0, latency_s=connection.latency_s))  # fmt: skip


def check_runnable(bench: Bench) -> None:
    """Raise FieldError at the field for which a bench cannot be run."""
    section = bench.drive or DriveSection()
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
