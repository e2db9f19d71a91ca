"""The stop of a drive as its answers show it: under way, too long, or an acceleration."""

import math
from collections import deque
from enum import IntEnum
from typing import Final, NamedTuple

_TRANSITION_S: Final = 0.01  # some drives take several ms for a transition of the state machine
_RAMP_MARGIN: Final = 1.5  # measured speed and the drive's ramp differ by its following error
_RAMP_EXTRA_S: Final = 0.1  # standstill detection of drives takes some 10 ms
_FASTER_S: Final = 0.02  # of the ramp: what a loop that swings adds to the speed is below
_HALF: Final = 4  # answers between two rises of the speed that are compared
_UNBROKEN: Final = 0.9  # share: a loop that takes over a weight slows its rise by more, one of the wrong sign does not
_NOISE_COUNTS: Final = 4  # of the encoder, between two answers


class StopVerdict(IntEnum):
    """What is to be done about a stop."""

    GOES_ON = 0
    ACCELERATES = 1  # the drive brakes with the wrong sign: no ramp of it can stop the axis
    LATE = 2  # the drive does not follow its controlword, or its ramp does not end


class StopAnswer(NamedTuple):
    """What an answer says: speed without sign since the one before, and one count in a period [rad/s]; enabled:
    the stop did not begin yet; fresh: it belongs to the latest SYNC."""

    speed: float
    one_count: float
    enabled: bool
    fresh: bool


class StopWatch:
    """Watches one stop after the other; `reset` between them.

    A drive that stays enabled is late after the cycles of an answer, one under power after its ramp, or after an answer
    once it accelerated.
    """

    def __init__(self, period_s: float, missed_answers_allowed: int) -> None:
        self._period_s = period_s
        # the effect of a command is reported at the second SYNC after it, and some answers may be missed
        self._answer_cycles = max(missed_answers_allowed + 3, _TRANSITION_S / period_s)
        self.reset()

    def reset(self) -> None:
        """Forget the stop before."""
        self._cycles, self._limit = 0, math.inf
        self._top = 0.0  # highest speed until the answer that reports the stop, which tells of the period before
        self._begins = True
        self._speeds: deque[float] = deque(maxlen=2 * _HALF + 1)
        self._accelerated = False

    def step(self, answer: StopAnswer, ramp_rad_s2: float, margin: float = 0.0, slowest_s: float = 0.0) -> StopVerdict:
        """Judge one cycle of a stop.

        ramp_rad_s2: deceleration of the drive (0x6085), 0 or infinite: unknown. margin: speed [rad/s] that a sound stop
        may reach beyond that at its begin; 0: what the ramp takes off in 20 ms. slowest_s: that the drive takes for a
        transition, if longer than most do.
        """
        if self._cycles == 0:
            ramp_s = _RAMP_MARGIN * answer.speed / ramp_rad_s2 if ramp_rad_s2 else math.inf
            self._limit = (ramp_s + _RAMP_EXTRA_S) / self._period_s
        if answer.enabled or self._begins:
            self._top = max(self._top, answer.speed)
        elif answer.fresh:
            self._speeds.append(answer.speed)
        self._begins = answer.enabled
        cycles, self._cycles = self._cycles, self._cycles + 1
        margin = margin or _FASTER_S * ramp_rad_s2
        if not self._accelerated and ramp_rad_s2 and self._runs_away(answer.one_count, margin):
            self._accelerated, self._limit = True, cycles + self._answer_cycles
            return StopVerdict.ACCELERATES
        answer_cycles = max(self._answer_cycles, slowest_s / self._period_s)
        late = cycles >= (answer_cycles if answer.enabled else self._limit)
        return StopVerdict.LATE if late else StopVerdict.GOES_ON

    def _runs_away(self, count: float, margin: float) -> bool:
        """Return True if the speed is beyond that before the stop, and rises no slower than some answers ago."""
        if len(self._speeds) < 2 * _HALF + 1:
            return False
        noise, speeds = _NOISE_COUNTS * count, self._speeds
        before, lately = speeds[_HALF] - speeds[0], speeds[-1] - speeds[_HALF]
        beyond = speeds[-1] > self._top + margin + noise
        return beyond and lately > noise and lately >= _UNBROKEN * before
