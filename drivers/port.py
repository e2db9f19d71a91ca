"""Port between the loop and its devices: abstract drive, encoder and master, their samples and errors.

One tick of a loop at `now_s` (time = tick x period; nothing reads a clock or blocks):

    master.sync(now_s)                      # SYNC: every node latches its position and answers; heartbeat when due
    master.poll(now_s)                      # process received frames; repeat until age_cycles is 0
    drive_sample = drive.read(now_s)        # motor position and torque of this SYNC
    encoder_sample = encoder.read(now_s)    # table position of this SYNC
    drive.command(now_s, torque_n_m)        # set-point and controlword; acts until the next command

Before it, once and blocking: `drive.set_up()`, `encoder.set_up()`, `master.start(now_s)`. To arm, set
`drive.goal = DriveGoal.ENABLED` and go on ticking until `sample.enabled`; to disarm set another goal. The samples carry
a `condition`, whose bits are faults (none: `Condition.OK`); `drive.check()` and `encoder.check()` raise these faults as
an error with cause and advice.

    DriverError                     what, where, given, allowed, advice
    ├── BusError                    the bus cannot be opened, is closed or off
    ├── ConfigurationError          a device refuses a setting or reads back another one
    │   └── IdentityError           another device than the one described
    ├── DriveFault                  the drive tripped: EMCY, fault state, lost heartbeat, stale data
    ├── EncoderError                the encoder reports an alarm, is stale, or its line is gone
    └── ResponseTimeout             a device does not answer during set-up
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import NamedTuple, Protocol

__all__ = [
    "BusError",
    "Condition",
    "ConfigurationError",
    "Drive",
    "DriveFault",
    "DriveGoal",
    "DriveSample",
    "DriverError",
    "Encoder",
    "EncoderError",
    "EncoderSample",
    "IdentityError",
    "Master",
    "PlantLike",
    "ResponseTimeout",
    "ServoLike",
]


class DriverError(Exception):
    """Base of all driver errors; the message gives place, fault, given and allowed values, and advice."""

    def __init__(self, what: str, *, where: str, given: str = "", allowed: str = "", advice: str = "") -> None:
        self.what, self.where, self.given, self.allowed, self.advice = what, where, given, allowed, advice
        parts = [f"{where}: {what}"]
        parts += [f"{label} {text}" for label, text in (("given:", given), ("allowed:", allowed)) if text]
        super().__init__("; ".join(parts) + (f". {advice}" if advice else ""))


class BusError(DriverError):
    """The bus cannot be opened, was closed, or is off."""


class ConfigurationError(DriverError):
    """A device refuses a setting, or reads back another value than was written."""


class IdentityError(ConfigurationError):
    """Object 0x1018 belongs to another device than the one described."""


class DriveFault(DriverError):
    """The drive has stopped because of a fault."""


class EncoderError(DriverError):
    """The encoder reports an alarm, is stale, or its line is gone."""


class ResponseTimeout(DriverError):
    """A device did not answer during set-up."""


class Condition(IntFlag):
    """Faults of a device, detected by the loop; several bits may be set."""

    OK = 0
    LATE = 1  # no answer to the last SYNC yet: the sample is one or more cycles old
    STALE = 2  # more answers missed in a row than the settings allow
    HEARTBEAT_LOST = 4  # heartbeat consumer time-out
    EMERGENCY = 8  # an EMCY with a non-zero error code is active
    FAULT = 16  # drive in FAULT or FAULT REACTION ACTIVE
    BUS_PASSIVE = 32  # error frames drove the controller to error passive
    BUS_OFF = 64  # the controller left the bus
    NOT_OPERATIONAL = 128  # the node rebooted or left NMT operational by itself
    ALARM = 256  # encoder: device alarm
    CORRUPT = 512  # encoder: frames with a wrong checksum since the last read
    LINE_LOST = 1024  # encoder: the serial line is gone
    DISABLED = 2048  # the drive left OPERATION ENABLED by itself
    OTHER_SETPOINT = 8192  # the set-point that acts in the drive is none of those commanded
    UNANSWERED = 4096  # the drive did not follow a stop command; the master has cut it off
    RUNAWAY = 16384  # the drive's own stop accelerated the motor; it gets "disable voltage"


class DriveGoal(IntEnum):
    """Goal of the drive; its commands follow from the goal and its state."""

    DISABLED = 0  # power stage off, READY TO SWITCH ON
    ENABLED = 1  # OPERATION ENABLED
    QUICK_STOP = 2  # decelerate on the quick-stop ramp, then off


class DriveSample(NamedTuple):
    """One answer of the drive to one SYNC. A named tuple is made three times as fast as a frozen dataclass.

    motor_position_rad and torque_n_m (linear drives: m and N) were latched at the SYNC sent at `time_s`; torque is the
    mean since the SYNC before. `age_cycles` = 0 means: belongs to the latest SYNC. `state` is the CiA 402 state number
    (0 to 7), which is recorded; the loop decides by `enabled` (follows set-points) and `powered` (may produce torque).
    """

    time_s: float
    age_cycles: int
    state: int
    motor_position_rad: float
    torque_n_m: float
    statusword: int
    condition: Condition
    enabled: bool
    powered: bool


class EncoderSample(NamedTuple):
    """Position of a linear encoder, unwrapped, in metres; `time_s` is the instant it was latched (CANopen) or
    received (serial line); `age_cycles` as in `DriveSample` (serial line: reads without a new frame)."""

    time_s: float
    age_cycles: int
    position_m: float
    counts: int
    condition: Condition


class Master(Protocol):
    """Timing of the devices: starts their cyclic operation and requests one sample per tick from all of them."""

    @abstractmethod
    def start(self, now_s: float) -> None:
        """Begin cyclic operation; call `sync` every period from here on."""

    @abstractmethod
    def sync(self, now_s: float) -> None:
        """Request the samples of this tick. Does not wait."""

    @property
    @abstractmethod
    def poll(self) -> Callable[..., None]:
        """Function (now_s, timeout_s = 0) that processes received frames. A property: a bus supplies its own."""


class Drive(Protocol):
    """Drive of an axis. `command` takes N m (CST), rad/s (CSV) or rad (CSP), linear axes N, m/s, m.

    Implementations name this class as their base, so that mypy and the interpreter refuse an incomplete one.
    """

    goal: DriveGoal
    tripped: Condition  # conditions that tripped the drive since its last reset
    notes: tuple[str, ...] = ()  # what the set-up found that the user should know

    @abstractmethod
    def set_up(self) -> None:
        """Check and configure the device; blocking, power stage off. Raises DriverError."""

    @abstractmethod
    def clear_fault(self) -> None:
        """Reset a fault that the drive has latched; blocking, before `set_up`. Raises DriverError if it remains."""

    @abstractmethod
    def read(self, now_s: float) -> DriveSample:
        """Return the latest sample. Never raises, never waits."""

    @abstractmethod
    def command(self, now_s: float, setpoint: float) -> None:
        """Send goal and set-point; the target is zero, or the position held, until the drive is enabled."""

    @abstractmethod
    def confirm_off(self, now_s: float) -> bool:
        """Switch the power stage off by another way than the cyclic data, and ask for its state; blocking.

        For the end of a loop whose samples do not tell that power is off. True: the drive says so. `status` then holds
        the last report. Raises DriverError if the drive refuses or does not answer.
        """

    @abstractmethod
    def check(self) -> None:
        """Raise `DriveFault` with the reason if the drive tripped."""

    @property
    @abstractmethod
    def error_code(self) -> int:
        """Last error code of the device, 0 without one."""

    @property
    @abstractmethod
    def status(self) -> str:
        """State of the device in words, for messages; with what keeps it from being enabled, if it is to be."""


class Encoder(Protocol):
    """Linear encoder. Implementations name this class as their base, as for `Drive`."""

    @abstractmethod
    def set_up(self) -> None:
        """Check and configure the device; blocking. Raises DriverError."""

    @abstractmethod
    def read(self, now_s: float) -> EncoderSample:
        """Return the latest sample. Never raises, never waits."""

    @abstractmethod
    def check(self) -> None:
        """Raise `EncoderError` with the reason if the sample read last cannot be trusted."""

    @abstractmethod
    def close(self) -> None:
        """Release the connection of this device."""


class PlantLike(Protocol):
    """Plant moved and read by a simulated drive and encoder (sensor values as digitised by the devices)."""

    @property
    def motor_position_rad(self) -> float: ...

    @property
    def table_position_m(self) -> float: ...

    @property
    def torque_n_m(self) -> float:
        """Measured torque, mean over the last period."""

    def advance(self, torque_command_n_m: float, period_s: float) -> None:
        """Hold the torque command for one period."""


@dataclass(frozen=True, slots=True)
class ServoTarget:
    """Set-point of the loops inside a simulated drive."""

    velocity_rad_s: float
    position_rad: float | None = None  # None: velocity loop only


class ServoLike(Protocol):
    """Loops inside a simulated drive (CSV, CSP, quick stop, homing): target and motor position -> torque."""

    def reset(self, motor_position_rad: float) -> None: ...

    def torque(self, target: ServoTarget, motor_position_rad: float, period_s: float) -> float: ...
