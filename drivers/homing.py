"""Homing of a CiA 402 drive, tick by tick (CiA 402-2, homing mode)."""

from drivers.canopen_drive import CanopenDrive
from drivers.cia402 import Controlword, HomingPhase, next_homing_phase
from drivers.port import DriveSample


class HomingRun:
    """Homing of a drive in OperationMode.HOMING, tick by tick, until it is at rest with the reference found.

    Call `step` with each sample, then `drive.command(now_s, 0.0)`, until `phase` is DONE or FAILED.

    standstill_rad_s: speed below which the axis counts as at rest (linear axis: m/s). The run has no time-out of its
    own: give up after as many ticks as the longest search may take, by setting the drive's goal.
    """

    def __init__(self, drive: CanopenDrive, standstill_rad_s: float) -> None:
        self._drive, self._standstill_rad_s = drive, standstill_rad_s
        self._last: DriveSample | None = None
        self.phase = HomingPhase.READY

    def step(self, sample: DriveSample) -> HomingPhase:
        """Process one sample; set or clear the homing-start bit of the next controlword."""
        last, self._last = self._last, sample
        if last is not None and sample.time_s > last.time_s:
            speed = (sample.motor_position_rad - last.motor_position_rad) / (sample.time_s - last.time_s)
            self.phase = next_homing_phase(self.phase, sample.statusword, speed, self._standstill_rad_s)
        running = self.phase in (HomingPhase.STARTED, HomingPhase.RUNNING)
        self._drive.controlword_bits = int(Controlword.HOMING_START) if running else 0
        return self.phase
