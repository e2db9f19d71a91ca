"""Driver of a CiA 406 linear encoder: step and range read by SDO, then one TPDO after each SYNC."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drivers.canopen_master import CanopenMaster
from drivers.canopen_node import CanopenNode, condition_names
from drivers.counting import Unwrapper
from drivers.emcy import Emergency
from drivers.object_index import ObjectIndex as Index
from drivers.pdo import EVERY_SYNC, Entry, layout
from drivers.port import Condition, ConfigurationError, Encoder, EncoderError, EncoderSample
from drivers.sdo_setup import EDS_FOLDER, DeviceSetup

PROCESS_DATA: Final = (Entry(Index.ENCODER_POSITION, 0, 32, True),)
_POSITION: Final = layout(PROCESS_DATA)
_PLAIN_DIRECTION, _REVERSED = 0x0000, 0x0008  # 0x6000 bit 3: measuring direction
_OK = Condition.OK
_new = tuple.__new__  # makes a named tuple without its Python-level constructor


@dataclass(frozen=True, slots=True)
class EncoderSettings:
    """Settings of the encoder. step_m: as described by the bench; None: as the device says (0x6005:1, nm)."""

    node_id: int = 6
    eds: Path = EDS_FOLDER / "linear_encoder.eds"
    serial_number: int | None = None
    step_m: float | None = None
    reversed: bool = False  # counts grow against the positive direction of the axis
    heartbeat_s: float = 0.02
    missed_answers_allowed: int = 3


class CanopenEncoder(CanopenNode, Encoder):
    """CiA 406 encoder on the bus of a master."""

    settings: EncoderSettings

    def __init__(self, master: CanopenMaster, settings: EncoderSettings) -> None:
        super().__init__(master, settings, "encoder")
        self.step_m = 0.0
        self._unwrapper = Unwrapper(1 << 32)
        self._condition = Condition.OK

    def set_up(self) -> None:
        """Identity, step, direction, range, watchdog, PDO; blocking.

        Raises ResponseTimeout, IdentityError or ConfigurationError (another step than the bench describes).
        """
        settings, master = self.settings, self._master
        with DeviceSetup(master.network, settings.node_id, settings.eds) as device:
            device.wait_answer()
            device.check_identity(406, settings.serial_number)
            step_m = device.read(Index.ENCODER_STEP_SETTINGS, 1) / 1e9
            if step_m <= 0 or (settings.step_m is not None and not math.isclose(step_m, settings.step_m)):
                raise ConfigurationError(
                    "another measuring step than described", where=f"{self.name}, object 0x6005:01",
                    given=f"{step_m:g} m", allowed=f"{settings.step_m or '> 0'} m",
                    advice="Correct the bench description or the encoder's settings.",
                )  # fmt: skip
            self.step_m = step_m
            device.disable_pdos()
            device.write(Index.ENCODER_OPERATING_PARAMETERS, 0, _REVERSED if settings.reversed else _PLAIN_DIRECTION)
            device.write(Index.PRODUCER_HEARTBEAT_TIME, 0, round(1000 * settings.heartbeat_s))
            device.map_pdo(Index.TPDO_COMMUNICATION, PROCESS_DATA, EVERY_SYNC, 0x180 + settings.node_id)
            self._unwrapper = Unwrapper(
                device.read(Index.ENCODER_MEASURING_RANGE) or 1 << 32, device.read(Index.ENCODER_POSITION)
            )
        self._begin()

    def preset(self, position_m: float) -> None:
        """Set the reading at the present position to `position_m` (object 0x6003); blocking."""
        with DeviceSetup(self._master.network, self.settings.node_id, self.settings.eds) as device:
            device.write_only(Index.ENCODER_PRESET, 0, round(position_m / self.step_m))
            self._unwrapper.restart(device.read(Index.ENCODER_POSITION))

    def _on_tpdo(self, can_id: int, data: bytes, now_s: float) -> None:
        if len(data) != 4:
            self.malformed_frames += 1
            return
        self._unwrapper.update(_POSITION.unpack(data)[0])
        self._take_answer(now_s)

    def _latch(self, emergency: Emergency) -> None:
        # An EMCY with error code 0 ends the alarm; an encoder needs no acknowledgement.
        self._latched = self._latched | Condition.ALARM if emergency.active else self._latched & ~Condition.ALARM

    def read(self, now_s: float) -> EncoderSample:
        """Return the sample of the latest answered SYNC and its fault bits. Never raises, never waits."""
        age = self._master.syncs - self._answered
        self._condition = _OK
        if age or self._latched or self._health.state or now_s > self._heartbeat_deadline_s:
            self._condition = self._node_condition(age, now_s)
        counts = self._unwrapper.total
        return _new(EncoderSample, (self._sample_time_s, age, counts * self.step_m, counts, self._condition))

    def check(self) -> None:
        """Raise EncoderError if the sample read last cannot be trusted."""
        condition = self._condition & ~(Condition.LATE | Condition.BUS_PASSIVE)
        if condition:
            raise EncoderError(
                condition_names(condition),
                where=self.name,
                given=self._cause(),
                advice="Check the encoder, its supply and its wiring.",
            )

    def close(self) -> None:
        """Do nothing: the bus belongs to the master."""
