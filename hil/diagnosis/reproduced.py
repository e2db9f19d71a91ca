"""Rules on a twin without new terms: whether it reproduces the recordings, so that nothing is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.diagnosis.criteria import Criteria
from hil.diagnosis.ledger import Answer, Rule

if TYPE_CHECKING:
    from hil.diagnosis.verdict.reproduction import Reproduced


def _within_noise(of: Reproduced, c: Criteria) -> Answer:
    return of.worst <= (c.coloured if of.noisy else c.floor), {"worst": of.worst**0.5}


def _within_noise_elsewhere(of: Reproduced, c: Criteria) -> Answer | None:
    if of.held_out is None:
        return None
    return of.held_out <= (c.coloured if of.noisy else c.elsewhere), {"worst": of.held_out**0.5}


def _without_structure(of: Reproduced, c: Criteria) -> Answer:
    return not of.structure, {"structure": of.structure}


def _no_worse_than_plain(of: Reproduced, c: Criteria) -> Answer | None:
    if of.torque is None:
        return None
    left, plain = of.torque
    return left - plain <= c.discrepancy, {"left": left, "plain": plain}


REPRODUCED: tuple[Rule[Reproduced], ...] = (
    # measurement noise of each channel: `hil.identification.noise_floor`
    Rule(
        "within the noise",
        "every channel is within its noise, {worst:.3g} times its rms at most",
        "a channel is at {worst:.3g} times its noise (rms)",
        _within_noise,
    ),
    # prediction; errors of fitted parameters leave as much as the noise
    Rule(
        "within the noise, held out",
        "held-out recordings are within their noise, {worst:.3g} times its rms at most",
        "on held-out recordings a channel is at {worst:.3g} times its noise (rms)",
        _within_noise_elsewhere,
    ),
    # noise depends on nothing: `hil.identification.structure`, with errors that count autocorrelation and the questions
    Rule(
        "structure",
        "the residuals do not depend on position, angle, speed, load or time",
        "the residuals have a structure: {structure}",
        _without_structure,
    ),
    # a twin that inertia, friction and gravity by least squares beat lacks something, or has a structure too many
    Rule(
        "plain model",
        "it predicts the torque of held-out motion no worse than plain least squares",
        "it leaves {left:.2%} of the torque on held-out motion, plain least squares {plain:.2%}",
        _no_worse_than_plain,
    ),
)
