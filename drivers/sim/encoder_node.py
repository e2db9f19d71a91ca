"""Simulated linear encoder on CANopen (CiA 406, class C2): position 0x6004 after each SYNC, direction, preset, range.

    value = (+-counts + offset) wrapped into the measuring range,   counts = table position / measuring step

Connect it to the bus after the drive node, which moves the plant at the SYNC.
"""

from pathlib import Path

from drivers.bus import CanPort
from drivers.object_index import ObjectIndex as Index
from drivers.port import PlantLike
from drivers.sim.can_node import EDS_FOLDER, SimulatedDevice
from drivers.sim.object_dictionary import key_of

_POSITION, _OFFSET, _ALARMS = key_of(Index.ENCODER_POSITION), key_of(Index.ENCODER_OFFSET), key_of(Index.ENCODER_ALARMS)
_STEP, _RANGE, _PARAMETERS = (
    key_of(Index.ENCODER_STEP_SETTINGS, 1),
    key_of(Index.ENCODER_MEASURING_RANGE),
    key_of(Index.ENCODER_OPERATING_PARAMETERS),
)
_REVERSED = 0x0008
_SENSOR_FAULT = 0x7310  # EMCY of the position error alarm
_POSITION_ERROR = 0x0001  # alarm bit 0


class SimulatedEncoder(SimulatedDevice):
    """The encoder node. range_counts 0: 2^32 (the value wraps as an INTEGER32), else it wraps into 0..range - 1."""

    def __init__(
        self,
        port: CanPort,
        plant: PlantLike,
        *,
        node_id: int = 6,
        step_m: float = 0.5e-6,
        range_counts: int = 0,
        eds: Path = EDS_FOLDER / "linear_encoder.eds",
    ) -> None:
        self.plant, self._step_m, self._delivered_range = plant, step_m, range_counts
        super().__init__(port, eds, node_id)
        self.dictionary.on_write(Index.ENCODER_OPERATING_PARAMETERS, self._on_parameters)
        self.dictionary.on_write(Index.ENCODER_MEASURING_RANGE, self._on_range)
        self.dictionary.on_write(Index.ENCODER_PRESET, self._on_preset)
        self._power_up()

    def _power_up(self) -> None:
        values = self.values
        values[_STEP] = values[key_of(Index.ENCODER_SINGLE_TURN_RESOLUTION)] = round(self._step_m * 1e9)
        values[_RANGE] = self._delivered_range
        self._set_range(self._delivered_range)
        self._refresh(values[_PARAMETERS], 0)

    def reset(self, now_s: float) -> None:
        super().reset(now_s)
        self._power_up()

    def _refresh(self, parameters: int, offset: int) -> None:
        sign = -1 if parameters & _REVERSED else 1
        self._counts_per_m = sign / self._step_m
        self.values[_OFFSET] = self._offset = offset
        self.process_sync(self._last_s)

    def _on_parameters(self, index: int, subindex: int, value: int) -> None:
        self._refresh(value, 0)

    def _on_range(self, index: int, subindex: int, value: int) -> None:
        self._set_range(value)
        self.process_sync(self._last_s)

    def _set_range(self, counts: int) -> None:
        """Return modulus and negative range of the value: INTEGER32 without a range, else 0..range - 1."""
        self._modulus, self._half = (counts, 0) if counts else (1 << 32, 1 << 31)

    def _on_preset(self, index: int, subindex: int, value: int) -> None:
        self._refresh(self.values[_PARAMETERS], value - round(self.plant.table_position_m * self._counts_per_m))

    def process_sync(self, now_s: float) -> None:
        values = self.values
        if not values[_ALARMS]:  # without a scale signal the last position is repeated
            counts = round(self.plant.table_position_m * self._counts_per_m) + self._offset
            values[_POSITION] = (counts + self._half) % self._modulus - self._half

    def raise_alarm(self, now_s: float) -> None:
        """Raise the position error alarm: the reading head does not see the scale."""
        self.values[_ALARMS] = _POSITION_ERROR
        self.emergency(_SENSOR_FAULT, 0x21, now_s)

    def clear_alarm(self, now_s: float) -> None:
        """Clear the position error alarm."""
        self.values[_ALARMS] = 0
        self.emergency(0, 0, now_s)
