"""Joint input-output estimate: answers of several channels to one reference that no noise reaches.

In a closed loop the torque answers to the noise of the encoders, so that position over torque is biased (with much
noise towards -1 / controller). The set-points are independent of the noise: the responses of torque and position to
them are unbiased, and their quotient is the response of the plant (Pintelon, Schoukens: System Identification, 2012,
sec. 2.5-2.7; Ljung: System Identification, 1999, sec. 13.5).

    Z = S_xr / S_rr                            H1 over blocks: laps of a periodic excitation, or segments (Welch)
    C = sum E E^H / (averages - 1),  E = X - Z R      noise of the channels, from block to block
    cov Z = C / sum |R|^2
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hil.arrays import FloatArray

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """Responses `answer` (c, k) of c channels to a reference at k frequencies, with their covariance (c, c, k).

    `coherence` (c, k) is that of each channel with the reference, `averages` the number of independent blocks.
    """

    answer: ComplexArray
    covariance: ComplexArray
    coherence: FloatArray
    averages: float

    def quotient(self, over: int, under: int) -> tuple[ComplexArray, FloatArray]:
        """Answer of a channel over that of another one (k,), and its standard error (k,), sqrt(E |error|^2)."""
        a, b = self.answer[over], self.answer[under]
        parts = (
            self.covariance[over, over].real / np.abs(a) ** 2
            + self.covariance[under, under].real / np.abs(b) ** 2
            - 2.0 * (self.covariance[over, under] / (a * b.conj())).real
        )
        return a / b, np.asarray(np.abs(a / b) * np.sqrt(np.maximum(parts, 0.0)))

    def error(self, channel: int) -> FloatArray:
        """Standard error (k,) of the answer of a channel."""
        return np.asarray(np.sqrt(self.covariance[channel, channel].real))

    @cached_property
    def radius(self) -> float:
        """Radius of the circle that holds the true response with 95 %, in standard errors.

        |error|^2 / variance follows F(2, 2 (averages - 1)).
        """
        from scipy.stats import f

        return float(np.sqrt(f.ppf(0.95, 2.0, 2.0 * (self.averages - 1.0))))


def joint_estimate(reference: ComplexArray, channels: ComplexArray, overlap: float = 1.0) -> JointEstimate:
    """Estimate from spectra of blocks: reference (b, k) and channels (b, c, k).

    `overlap` >= 1: variance of a mean over the blocks, relative to that of independent ones. Raises ValueError for
    fewer than two independent blocks.
    """
    averages = reference.shape[0] / overlap
    if averages < 2.0:
        raise ValueError(f"given {averages:.3g} independent blocks, allowed 2 or more")
    power = np.sum(np.abs(reference) ** 2, axis=0)
    answer = np.einsum("bck,bk->ck", channels, reference.conj()) / power
    left = channels - answer * reference[:, None, :]
    noise = np.einsum("bck,bdk->cdk", left, left.conj()) / (averages - 1.0) / overlap
    explained = np.abs(answer) ** 2 * power
    rest = np.sum(np.abs(left) ** 2, axis=0)
    coherence = explained / np.maximum(explained + rest, np.finfo(float).tiny)
    return JointEstimate(answer, noise * overlap / power, coherence, averages)
