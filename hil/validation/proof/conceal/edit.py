"""An exact edit of one recorded channel, of a strength that is still open, with the right answer about it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor

import numpy as np

from hil.arrays import FloatArray
from hil.twin.library import LIBRARY
from hil.twin.mechanism import Mechanism
from hil.twin.parameter import Role
from hil.validation.proof.conceal.half import EditedChannel

_TAPS = 32  # rows on either side that the interpolation reads
_BETA = 8.0  # of the Kaiser window: passes up to 0.9 of the Nyquist frequency within 1e-3
_DIFFERENCE = 1e-3  # of the largest strength: step that gives the shape of an edit


@dataclass(frozen=True, eq=False)
class Edit:
    """An edit. `change` gives the channel (n,) of a strength of at most `largest`, of either sign if it is `signed`.

    mechanism, variant, values: the effect of the library that the edit is, with the parameters of a strength; None for
    a shape that the library lacks. told: indices of the parameters whose true values are known in spite of what else
    the axis has. rivals: other effects that these channels cannot separate from it. instead: regressor of the plain
    model that is the same shape. adds: an effect of the same kind that is there already adds to it. whole: strength
    that is a whole row, of a channel that is late. error: standard error of the strength where least squares cannot
    tell the shape, since parameters of the bench explain it: no name is right. moment_s: row time from which the axis
    is another one; no name is right, the answer is the moment.
    """

    channel: EditedChannel
    change: Callable[[float], FloatArray]
    largest: float
    mechanism: Mechanism | None = None
    values: Callable[[float], tuple[float, ...]] = lambda strength: (strength,)
    variant: int = 0
    told: tuple[int, ...] = ()
    rivals: tuple[Mechanism, ...] = ()
    instead: str = ""
    signed: bool = False
    adds: bool = False
    whole: float = 0.0
    error: float = 0.0
    moment_s: float | None = None

    @property
    def shape(self) -> FloatArray:
        """Change of the channel (n,) for a small strength, per strength."""
        small = _DIFFERENCE * self.largest
        return np.asarray((self.change(small) - self.change(0.0)) / small)

    @property
    def right(self) -> tuple[str, ...]:
        """Ids of the library that are right: of the effect, of the same law under another name, of its rivals."""
        if self.mechanism is None:
            return ()
        own = self.mechanism
        same = [one.id for one in LIBRARY if own.id == one.same_torque(0) or one.id == own.same_torque(self.variant)]
        return tuple(dict.fromkeys([own.id, *same, *(rival.id for rival in self.rivals)]))

    def parameters(self, strength: float) -> dict[str, float]:
        """Parameters of the effect by name; empty for a shape that the library lacks."""
        if self.mechanism is None:
            return {}
        return dict(zip(self.mechanism.names, map(float, self.values(strength)), strict=False))

    def compared(self, strength: float) -> dict[str, float]:
        """True values of the parameters that an answer is compared with; of the same law under all its names."""
        if self.mechanism is None:
            return {}
        names, values = self.mechanism.names, self.values(strength)
        found = {names[index]: float(values[index]) for index in self.told}
        if self.mechanism.strength in self.told and len(names) == 1:
            for one in LIBRARY:
                if one.id in self.right and len(one.indices(Role.STRENGTH)) == len(one.names) == 1:
                    found[one.names[0]] = float(values[0])
        return found


def later(samples: FloatArray, rows: float) -> FloatArray:
    """Delay samples (n,) by a number of rows, whole ones by moving them, others by bandlimited interpolation.

    A sinc in a Kaiser window, scaled to pass a constant. The ends are continued by point reflection; a case leaves them
    out. T. I. Laakso et al., IEEE Signal Processing Magazine 13 (1996) 30.
    """
    whole = floor(rows + 0.5)
    part = rows - whole
    more = abs(whole) + _TAPS
    longer = np.pad(samples, more, mode="reflect", reflect_type="odd")
    if abs(part) < 1e-9:
        return np.asarray(longer[more - whole : more - whole + samples.size], dtype=np.float64)
    taps = np.arange(-_TAPS, _TAPS + 1)
    weights = np.sinc(taps - part) * np.kaiser(taps.size, _BETA)
    delayed = np.convolve(longer, weights / weights.sum(), mode="same")
    return np.asarray(delayed[more - whole : more - whole + samples.size], dtype=np.float64)


def ends(rows: float) -> int:
    """Rows at either end that `later` computes from samples that were not recorded."""
    return ceil(abs(rows)) + _TAPS


def current_for(torque: FloatArray, falling: float) -> FloatArray:
    """Current u (n,) that gives a torque T = u (1 - c u^2) (n,), in torque by the nominal constant; Newton's method.

    `falling` is c; |T| must be below 2 / (3 sqrt(3 c)), where no current gives more.
    """
    current = torque.copy()
    for _ in range(20):
        current = current - (current - falling * current**3 - torque) / (1.0 - 3.0 * falling * current**2)
    return current
