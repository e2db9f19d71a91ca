"""Result of `hil.frf`: measured frequency responses of an axis beside those of its twin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.arrays import FloatArray
from hil.frequency.curves import Resonances, ResponseCurve
from hil.frequency.margins import StabilityMargins
from hil.frequency.picture import overview
from hil.frequency.table import as_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Measured frequency responses of an axis beside those of its twin.

    `measured` and `twin` map the same names to a `ResponseCurve`: "plant_motor" (torque to motor position),
    "plant_table" (torque to table position, with a linear encoder), and with a known control law "velocity_open",
    "velocity_closed", "position_open", "position_closed" (position command to table position, without a linear encoder
    to motor position). `margins` and `twin_margins` have the open loops. `bandwidth_hz` and `twin_bandwidth_hz` are
    -3 dB of the closed loops. `method`: "periods" or "welch"; `averages` independent blocks, `resolution_hz` apart.
    `coherence` (k,) at `frequency_hz` (k,) is that of torque and motor with the set-points; `trusted_hz` the range in
    which the plant is known to a tenth. `distorted`: the axis stopped in the excitation, so that friction is in the
    responses beyond their errors. Printing it gives the table of `rows`; `plot` draws it.
    """

    name: str
    bench: str
    method: str
    averages: float
    resolution_hz: float
    measured: Mapping[str, ResponseCurve]
    twin: Mapping[str, ResponseCurve]
    margins: Mapping[str, StabilityMargins]
    twin_margins: Mapping[str, StabilityMargins]
    bandwidth_hz: Mapping[str, float]
    twin_bandwidth_hz: Mapping[str, float]
    resonances: Resonances
    twin_resonances: Resonances
    distorted: bool = False
    notes: tuple[str, ...] = ()

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies (k,) of the plant [Hz]."""
        return self.measured["plant_motor"].frequency_hz

    @property
    def coherence(self) -> FloatArray:
        """Coherence (k,) of torque and motor with the set-points, the smaller one."""
        return self.measured["plant_motor"].coherence

    @property
    def trusted_hz(self) -> tuple[float, float]:
        """Range [Hz] in which the response of the plant is known to a tenth."""
        return self.measured["plant_motor"].trusted_hz

    def __str__(self) -> str:
        return as_text(self)

    __repr__ = __str__

    def plot(self) -> "Figure":
        """Draw magnitude and phase of plant and loops, measured with 95 % bounds over the twin, and the coherence."""
        return overview(self)
