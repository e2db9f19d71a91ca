"""A second drive protocol on the port: ASCII lines to a drive with its own small motor, in one process."""

from collections.abc import Callable

from drivers.port import Condition, Drive, DriveFault, DriveGoal, DriveSample, Master
from hil.bench.axis_models import TwoMass
from hil.bench.bench_file import Bench
from hil.bench.hardware import DriveSection
from hil.loop.devices import Devices

_OFF, _ENABLED = 2, 4  # numbers of the states READY_TO_SWITCH_ON and OPERATION_ENABLED


class AsciiMotor:
    """The device: answers `S` with position and torque, takes `E torque` (enabled) and `D` (disabled)."""

    def __init__(self, inertia_kg_m2: float, period_s: float) -> None:
        self.inertia_kg_m2, self.period_s = inertia_kg_m2, period_s
        self.position_rad = self.velocity_rad_s = self.torque_n_m = 0.0
        self.enabled, self.trips = False, 0

    def ask(self, line: str) -> str:
        """Return the answer to one line."""
        word, *values = line.split()
        if word == "S":
            self.velocity_rad_s += self.torque_n_m / self.inertia_kg_m2 * self.period_s
            self.position_rad += self.velocity_rad_s * self.period_s
            return f"{self.position_rad!r} {self.torque_n_m!r} {int(self.enabled)} {self.trips}"
        self.enabled = word == "E" and not self.trips
        self.torque_n_m = float(values[0]) if self.enabled else 0.0
        return "ok"


class AsciiDrive(Drive, Master):
    """Drive and its own master: one request a tick."""

    def __init__(self, motor: AsciiMotor) -> None:
        self.motor, self.goal, self.tripped = motor, DriveGoal.DISABLED, Condition.OK
        self.sample = DriveSample(0.0, 0, _OFF, 0.0, 0.0, 0, Condition.OK, False, False)

    def set_up(self) -> None:
        self.motor.ask("D")

    def clear_fault(self) -> None:
        self.motor.trips = 0

    def start(self, now_s: float) -> None:
        self.sync(now_s)

    def sync(self, now_s: float) -> None:
        position, torque, enabled, trips = self.motor.ask("S").split()
        self.tripped = Condition.FAULT if trips != "0" else Condition.OK
        on = enabled == "1"
        state = _ENABLED if on else _OFF
        self.sample = DriveSample(now_s, 0, state, float(position), float(torque), 0, self.tripped, on, on)

    @property
    def poll(self) -> Callable[..., None]:
        return lambda now_s, timeout_s=0.0: None

    def read(self, now_s: float) -> DriveSample:
        return self.sample

    def command(self, now_s: float, setpoint: float) -> None:
        self.motor.ask(f"E {setpoint if self.sample.enabled else 0.0!r}" if self.goal is DriveGoal.ENABLED else "D")

    def confirm_off(self, now_s: float) -> bool:
        self.motor.ask("D")
        return not self.motor.enabled

    def check(self) -> None:
        if self.tripped:
            raise DriveFault("tripped", where="ASCII drive", given=f"code {self.error_code}")

    @property
    def error_code(self) -> int:
        return self.motor.trips

    @property
    def status(self) -> str:
        return "enabled" if self.sample.enabled else "off"


class AsciiDevices(Devices):
    """The devices of a bench without a linear encoder; PROTOCOLS takes this class."""

    def __init__(self, bench: Bench, seed: int | None = None) -> None:
        assert isinstance(bench.axis, TwoMass)
        self.bench, self.section = bench, bench.drive or DriveSection()
        inertia_kg_m2 = (bench.axis.motor_mass_kg + bench.axis.table_mass_kg) * bench.gains.ratio_m_rad**2
        self.motor = AsciiMotor(inertia_kg_m2, bench.gains.period_s)
        self.drive = self.master = AsciiDrive(self.motor)
        self.encoder = None
