"""The loop: profile -> controller -> drive -> encoders -> recorder, with the live twin, tick by tick.

    ARM        the drive goes to OPERATION ENABLED; until then its target is zero (CSP: its present position)
    RUN        set-points of the trajectory, which begins at the position of the axis
    STOP       set-points of the shortest stop (ruckig) from the present set-point or measured state
    QUICK_STOP the drive stops by its own ramp, or has tripped; recorded until its power stage is off
    DISARM     power stage off, confirmed by the drive; else StillPowered

Every failure stops the drive as follows; the recording stays readable:

    drive trips (EMCY, fault, stale, heartbeat lost, bus-off, rebooted)  -> QUICK_STOP
    linear encoder lost: fed back to the position loop -> QUICK_STOP, else -> STOP
    following error, travel limit, loop too late, ctrl-C                -> STOP; a second time -> QUICK_STOP
    wrong sign: faster against the torque, or in a STOP                 -> QUICK_STOP; its ramp too -> power off
    exception in the loop, third ctrl-C                                 -> QUICK_STOP unrecorded, then the exception
    stop command without answer                                         -> SYNC, heartbeat, RPDO withheld, NMT stop
"""

import contextlib
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Protocol

from drivers.port import Condition, DriveGoal, DriveSample, EncoderSample
from hil.errors import HilError, StillPowered, StoppedByUser
from hil.loop.clock import SKIP_FROM, Clock, LatenessLog, next_due
from hil.loop.cycle import STOP_SEGMENT, Cycle, Samples
from hil.loop.devices import Devices, driver_errors
from hil.loop.outcome import Outcome, with_stop
from hil.loop.stall import NO_STALL, stalled
from hil.loop.stopping import LONGEST_STOP_S, plan_stop
from hil.loop.supervision import Ending, find
from hil.motion.pieces import MotionLimits
from hil.motion.time_optimal import MotionState
from hil.motion.trajectory import Trajectory

ARM_TIMEOUT_S = 2.0
SETTLE_S = 0.1  # hold after a controlled stop
QUICK_STOP_LIMIT_S = 2.0  # longest wait for the end of a quick stop
AFTERMATH_S = 0.1  # recorded after the power stage is off
DISARM_TIMEOUT_S = 0.2  # beside a ramp of the drive
_AROUND_S = ARM_TIMEOUT_S + LONGEST_STOP_S + SETTLE_S + QUICK_STOP_LIMIT_S + AFTERMATH_S + DISARM_TIMEOUT_S
_NO_ENCODER = EncoderSample(0.0, 0, 0.0, 0, Condition.OK)


class LoopPhase(IntEnum):
    """Phase of the loop after arming."""

    RUN = 0
    STOP = 1
    QUICK_STOP = 2


class Rows(Protocol):
    """Destination of the rows of a session, for example a `Recorder`."""

    def record(self, row: Sequence[float]) -> None: ...


class FastForward(Protocol):
    """Runs the first ticks of a session without the bus, as `hil.loop.virtual.CompiledTicks`."""

    def run(
        self, cycle: Cycle, sample: DriveSample, seen: EncoderSample, stop_asked: Callable[[], bool]
    ) -> tuple[int, DriveSample, EncoderSample]:
        """Run ticks from 0 on, whose samples are given, and record them.

        Returns the tick to continue with over the bus, and its samples.
        """


class Session:
    """One run on an opened rig. The rig is set up and at rest; `trajectory` begins at its position.

    fast_forward: runs the uneventful ticks after arming; None: every tick goes over the bus. `ask_stop` may be called
    from a signal handler.
    """

    def __init__(
        self,
        rig: Devices,
        cycle: Cycle,
        trajectory: Trajectory,
        limits: MotionLimits,
        clock: Clock,
        recorder: Rows,
        fast_forward: FastForward | None = None,
    ) -> None:
        self._rig, self._cycle, self._clock, self._recorder = rig, cycle, clock, recorder
        self._fast_forward = fast_forward
        self._trajectory, self._limits = trajectory, limits
        self._master, self._drive, self._encoder = rig.master, rig.drive, rig.encoder
        gains = rig.bench.gains
        self._period_s, self._ratio = gains.period_s, gains.ratio_m_rad
        self._response_s = rig.section.response * gains.period_s
        self._skip_from_s = SKIP_FROM * gains.period_s
        self._from_table = gains.position_from_table
        self._late_limit_s = rig.late_limit_s
        self._own_late_s = 0.0  # of the tick, without those left out before it
        self._stall = NO_STALL  # the last time that ticks were left out
        self._now_s = 0.0  # of the tick: tick x period
        self._clock_tick = 0  # ticks since the clock was started; the rows count from the first after arming
        self.skipped = 0  # ticks left out between the rows
        self._left_out = 0  # ticks left out since the first row, also while the power is switched off
        self._stops_asked = 0
        self._phase = LoopPhase.RUN
        self._ending, self._reason = Ending.COMPLETE, "the profile is done"
        self._last_tick = len(trajectory) - 1  # row at which the phase ends
        cycle.follow(trajectory)  # not when the axis is armed: a long one takes memory and time
        self.late = LatenessLog(len(trajectory) + self._ticks(_AROUND_S))

    def ask_stop(self) -> None:
        """Stop the axis: under control the first time, by the drive's own ramp the second, unrecorded the third. Only
        counts for the next tick: an exception raised here could come between two lines that switch the power off."""
        self._stops_asked += 1

    def run(self) -> Outcome:
        """Arm, run, stop, disarm. Raises HilError when the drive cannot be armed or a device fails in the loop, and
        StillPowered instead of any other error or outcome when the drive does not confirm that its power is off."""
        with driver_errors():
            try:
                self._clock.start()
                self._master.start(0.0)
                sample, seen = self._arm()
                rows = self._loop(sample, seen)
            except BaseException as error:
                self._power_off(DriveGoal.QUICK_STOP, f"{type(error).__name__}: {error}", error)
                raise
        self._power_off(DriveGoal.DISABLED, f"{self._ending}: {self._reason}")
        ending, reason = with_stop(self._ending, self._reason, self._drive.tripped)
        return Outcome(ending, reason, rows, self.late.values, self.skipped, self._stops_asked > 0)

    # -- one tick -------------------------------------------------------------------------------------------------

    def _exchange(self) -> tuple[DriveSample, EncoderSample]:
        """Wait for the next tick that can be in time, send SYNC, take in the answers."""
        tick = self._clock_tick = self._clock_tick + 1
        lateness_s, period_s, skipped = self._clock.wait(tick), self._period_s, 0
        if lateness_s > self._skip_from_s:
            tick, lateness_s, skipped = next_due(self._clock, tick, period_s, lateness_s, self._late_limit_s)
            self._clock_tick = tick
            self._left_out += skipped
        start_s, self._own_late_s = tick * period_s, lateness_s - skipped * period_s
        self.late.add(lateness_s)
        self._master.sync(start_s)
        self._now_s = now_s = start_s + self._response_s
        drive, encoder = self._drive, self._encoder
        self._master.poll(now_s)
        sample = drive.read(now_s)
        seen = _NO_ENCODER if encoder is None else encoder.read(now_s)
        while (sample.age_cycles or seen.age_cycles) and self._clock.may_wait(tick, self._response_s):
            self._master.poll(now_s, 1e-4)
            sample = drive.read(now_s)
            seen = _NO_ENCODER if encoder is None else encoder.read(now_s)
        return sample, seen

    def _arm(self) -> tuple[DriveSample, EncoderSample]:
        """Tick until the drive is enabled; raises HilError if it does not come."""
        self._drive.goal = DriveGoal.ENABLED
        for _ in range(self._ticks(ARM_TIMEOUT_S)):
            sample, seen = self._exchange()
            if self._drive.tripped and (late_s := max(*self.late.values, self._late_s())) > self._late_limit_s:
                raise HilError(f"the loop was {late_s:.3f} s late while the drive was armed, which stops the drive "
                               f"(allowed: {self._late_limit_s:.3f} s): take load off the machine")  # fmt: skip
            self._drive.check()
            if sample.enabled and not sample.age_cycles:
                self._check_start(sample, seen)
                return sample, seen
            self._drive.command(self._now_s, 0.0)
            if self._stops_asked:
                raise StoppedByUser("interrupted while the drive was armed; nothing moved")
        raise HilError(f"the drive did not enable within {ARM_TIMEOUT_S:.0f} s: it is {self._drive.status}; check its "
                       "enable input and safe torque off")  # fmt: skip

    def _check_start(self, sample: DriveSample, seen: EncoderSample) -> None:
        start_m = self._trajectory.position_m[0]
        actual_m = self._position_m(sample, seen)
        if abs(actual_m - start_m) > self._rig.section.following_error_m:
            raise HilError(
                f"the axis stands at {actual_m:.6f} m, the set-points begin at {start_m:.6f} m: it moved "
                "while the drive was armed; find out why"
            )

    def _loop(self, sample: DriveSample, seen: EncoderSample) -> int:
        """Run from tick 0, whose samples are given, to the end. Returns the number of recorded rows."""
        cycle, drive, clock, record = self._cycle, self._drive, self._clock, self._recorder.record
        step, row, exchange = cycle.step, cycle.row, self._exchange
        late = self.late
        late.begin()
        late_limit_s, bench = self._late_limit_s, self._rig.bench
        tick, error_code, cycle_s, skipped = 0, 0, 0.0, 0
        self.skipped = self._left_out = 0
        if self._fast_forward is not None:
            tick, sample, seen = self._fast_forward.run(cycle, sample, seen, lambda: self._stops_asked > 0)
            late.begin(tick)
        while True:
            motor, torque = sample.motor_position_rad, sample.torque_n_m
            if skipped != self._left_out:
                cycle.skip(tick + skipped, tick + self._left_out - 1, motor)
                skipped = self.skipped = self._left_out
                self._stall = stalled(bench, late.last_s, tick + skipped, cycle.setpoint(tick + skipped)[1])
            setpoint, passed = step(tick, Samples(motor, seen.position_m, torque, sample.state, error_code,
                                                  late.last_s, cycle_s, sample.age_cycles, seen.age_cycles,
                                                  skipped))  # fmt: skip
            drive.command(self._now_s, setpoint)
            if tick:
                record(row(tick - 1))
            too_late = late.last_s > late_limit_s
            if sample.condition or seen.condition or passed or too_late or self._stops_asked or self._phase:
                self._supervise(tick + skipped, sample, seen, passed)
                error_code = drive.error_code
            cycle_s = clock.since(self._clock_tick) - self._own_late_s
            if tick + skipped >= self._last_tick:
                break
            sample, seen = exchange()
            tick += 1
        sample, seen = exchange()  # the torque of the last tick
        record(cycle.complete(tick, sample.torque_n_m, cycle_s))
        drive.command(self._now_s, setpoint)
        return tick + 1

    def _late_s(self) -> float:
        """Lateness of the tick so far: a loop that stalls inside it finds what the drive did meanwhile."""
        return max(self.late.last_s, self._clock.since(self._clock_tick))

    # -- faults and stops ----------------------------------------------------------------------------------

    def _supervise(self, tick: int, sample: DriveSample, seen: EncoderSample, passed: int) -> None:
        """Change the phase and the set-points from this tick on if a rule requires it; KeyboardInterrupt for a third
        request to stop."""
        if self._stops_asked > 2:
            raise KeyboardInterrupt
        if self._phase is LoopPhase.QUICK_STOP:
            if not sample.powered:
                self._last_tick = min(self._last_tick, tick + self._ticks(AFTERMATH_S))
            return
        stopping = self._phase is LoopPhase.STOP
        stall = self._stall if self._stall.acts(tick, self._rig.bench.gains) else NO_STALL
        findings = list(find(self._rig, seen, passed, self._late_s(), self._stops_asked, stopping=stopping,
                             stall=stall))  # fmt: skip
        quick = any(finding.quick for finding in findings)
        if not findings or (stopping and not quick):  # a controlled stop goes on
            return
        if self._phase is LoopPhase.RUN or findings[0].ending in (Ending.SIGN, Ending.STOP_FAILS):  # the graver
            self._ending, self._reason = findings[0].ending, findings[0].reason
        stop = None if quick else self._stop(tick, sample, seen, measured=passed != 0)
        if stop is None:  # the drive stops by itself
            self._cycle.hold(tick, STOP_SEGMENT)
            self._phase = LoopPhase.QUICK_STOP
            self._drive.goal = DriveGoal.QUICK_STOP
            self._last_tick = tick + self._ticks(QUICK_STOP_LIMIT_S)
        else:
            self._cycle.follow(stop, tick, STOP_SEGMENT)
            self._phase = LoopPhase.STOP
            self._last_tick = tick + len(stop) + self._ticks(SETTLE_S)

    def _stop(self, tick: int, sample: DriveSample, seen: EncoderSample, *, measured: bool) -> Trajectory | None:
        """Plan the shortest stop from the set-point, or from the measured state when the axis does not follow."""
        state = MotionState(*self._cycle.setpoint(tick))
        if measured:
            state = MotionState(self._position_m(sample, seen), self._cycle.velocity_m_s, 0.0)
        return plan_stop(state, self._limits, self._cycle.bounds, self._period_s)

    def _position_m(self, sample: DriveSample, seen: EncoderSample) -> float:
        """Position of the axis from the encoder of the position loop."""
        return seen.position_m if self._from_table else self._ratio * sample.motor_position_rad

    def _power_off(self, goal: DriveGoal, ended: str, cause: BaseException | None = None) -> None:
        """Switch the power stage off, unrecorded: by its controlword, then by another way (`Drive.confirm_off`), which
        would end a ramp. Nothing that fails here ends it before the drive was asked. Raises StillPowered from `cause`
        if it does not say in two fresh answers, or to that question, that its power is off. ended: how the run ended.
        """
        drive = self._drive
        drive.goal, confirmed, braking = goal, 0, False
        for tick in range(self._ticks(DISARM_TIMEOUT_S + QUICK_STOP_LIMIT_S)):
            with contextlib.suppress(Exception):
                sample, _ = self._exchange()
                confirmed = 0 if sample.powered or sample.age_cycles else confirmed + 1
                braking = braking if sample.age_cycles else sample.powered and not sample.enabled
            if confirmed == 2:
                return
            if tick >= self._ticks(DISARM_TIMEOUT_S) and not braking:
                break
            with contextlib.suppress(Exception):
                drive.command(self._now_s, 0.0)
        said = f"The drive still reports {drive.status}"
        try:
            if drive.confirm_off(self._now_s):
                return
            said = f"The drive still reports {drive.status}"
        except Exception as error:
            said = f"The drive does not answer ({error}); it reported last {drive.status}"
        raise StillPowered(f"{said}: switch it off at the mains. The run ended by {ended}") from cause

    def _ticks(self, duration_s: float) -> int:
        return round(duration_s / self._period_s)
