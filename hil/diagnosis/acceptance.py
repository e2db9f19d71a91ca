"""Accept or refute a mechanism by rules, each a pure function of measured quantities (`hil.diagnosis.ledger`).

The comment on a rule is its reason. `promises` decides before a candidate is fitted; rules are asked at six moments,
and on a twin without new terms at a seventh (`hil.diagnosis.reproduced`):

    VALUES     on the fitted values of a candidate
    ADDED      on the fit with one more term, against the fit without it; HARMLESS: and its channels
    NEEDED     on each term beside the others
    COMPARED   on another explanation of the same residual, against the named one
    HELD_OUT   on each term of the final fit, by the recordings that nothing was fitted to
    EXPLAINED  on all terms together
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hil.diagnosis.criteria import CRITERIA, Criteria
from hil.diagnosis.ledger import EXPLAINS, SHAPE, Answer, Rule
from hil.diagnosis.reproduced import REPRODUCED

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.diagnosis.search.addition import Addition, Harm
    from hil.diagnosis.search.events import InsideWindows
    from hil.diagnosis.search.forward_selection import Need
    from hil.diagnosis.search.rivals import RivalFit
    from hil.diagnosis.verdict.cross_validation import Ablation
    from hil.diagnosis.verdict.judge import Remainder
    from hil.identification.residuals import ChannelEnergy


def _values(valid: bool, c: Criteria) -> Answer:
    return valid, {}


def promises(shares: Mapping[str, float], channels: Mapping[str, ChannelEnergy], c: Criteria = CRITERIA) -> bool:
    """True if a score, a share of the residual energy of each channel, promises the evidence of a term in one of them.

    Rao's score test: what a linear step explains bounds what a small effect can explain. Else it is not fitted.
    """
    return any(
        shares.get(name, 0.0) > 1.0 - math.exp(-c.evidence / own.rows)  # of white residuals: the evidence of a term
        and shares.get(name, 0.0) * own.energy > c.material_alone * own.noise
        for name, own in channels.items()
    )


def _evidence(of: Addition | Need, c: Criteria) -> Answer | None:
    if of.log_chance is not None:  # the noise of a row says nothing of thousands of rows
        return None
    return of.evidence >= c.evidence, {"evidence": of.evidence, "needed": c.evidence}


def _material(of: Addition | Need, c: Criteria) -> Answer | None:
    if of.log_chance is not None:
        return None
    return of.removed >= c.material_alone, {"removed": of.removed, "needed": c.material_alone}


def _worth(of: Addition, c: Criteria) -> Answer | None:
    share = c.worth if of.beside < c.several else c.series
    return None if of.explained is None else (of.explained >= share, {"explained": of.explained, "needed": share})


def _laps(of: Addition, c: Criteria) -> Answer | None:
    left, before = of.unrepeated
    if not left and not before:  # no motion repeats
        return None
    return c.repeats * left <= before, {"without_over_with": before / left if left else math.inf}


def _shape(of: Addition | Need, c: Criteria) -> Answer | None:
    if of.log_chance is None:
        return None
    return of.log_chance < math.log(c.significance), {"chance": math.exp(of.log_chance)}


def _constant(of: Addition, c: Criteria) -> Answer | None:
    seen = of.inside
    return None if seen is None else (is_event(seen, c), {"left": seen.left / (seen.before or 1.0)})


def is_event(seen: InsideWindows | None, c: Criteria = CRITERIA) -> bool:
    """True if a constant force explains its windows nearly whole, or as well as the rest of their recordings.

    What comes with each acceleration is no event.
    """
    if seen is None:
        return True
    if seen.chance < c.significance:
        return False
    share = c.push if seen.one_push else c.form
    return seen.left <= share * seen.before or seen.mean <= c.inside * max(seen.mean_outside, 1.0)


def _channels(of: Addition | Ablation, c: Criteria) -> Answer:
    worse = paying(of.harm, c)
    return not worse, {"channels": ", ".join(sorted(worse))} if worse else {}


def paying(channels: Mapping[str, Harm], c: Criteria = CRITERIA) -> set[str]:
    """Channels above their noise with which a term pays for others.

    Such a channel is worse in a recording than without the term and by the bench file, and loses more than a share of
    what the term explains, or is worse than by the bench file at all.
    """

    def harmed(ratio: float, *others: float) -> bool:
        return ratio > max(c.floor, c.worse * min(others))

    return {
        name
        for name, one in channels.items()
        if any(harmed(*ratios) for ratios in one.ratios)
        and (-one.gain > c.paid * one.total or any(harmed(ratio, given) for ratio, _, given in one.ratios))
    }


def _not_behind(of: RivalFit, c: Criteria) -> Answer:
    stands = not (of.evidence >= c.tied and of.more >= (c.discrepancy if of.by_shape else c.alike))
    unit = f"{of.more:.2%} of the torque" if of.by_shape else f"{of.more:.3g} noise² per row"
    return stands, {"against": of.evidence, "more": f", {unit} more" if math.isfinite(of.more) else ""}


def _no_objection(of: RivalFit, c: Criteria) -> Answer:
    return not of.objection, {"objection": of.objection} if of.objection else {}


def _predicts(of: Ablation, c: Criteria) -> Answer | None:
    if of.gain is None or (of.torque and of.torque[1] - of.torque[0] > c.discrepancy):
        return None  # the torque is its witness: a position counts bursts and slow motion more
    return of.gain >= (0.0 if of.acts else -c.tied), {"evidence": of.gain}


def _repeats(of: Ablation, c: Criteria) -> Answer | None:
    return None if of.laps is None else (of.laps >= c.repeats, {"without_over_with": of.laps})


def _strength(of: Ablation, c: Criteria) -> Answer:
    return of.clear, {}


def _moves(of: Ablation, c: Criteria) -> Answer:
    return not of.quiet, {}


def _torque(of: Addition | Ablation, c: Criteria) -> Answer | None:
    if of.torque is None:  # not told
        return None
    left, without = of.torque
    return left - without <= c.discrepancy, {"left": left, "without": without}


def _explains(of: Remainder, c: Criteria) -> Answer:
    """Little is left beside noise; with open inputs, or at the floor, less than half; not asked below the noise."""
    stands = (
        of.below_noise
        or (of.left < 1.0 and names_stand(of.told, of.above, c))
        or (of.open_inputs and of.left <= c.most_left)
        or (of.at_floor and (of.left <= c.most_left or of.above <= c.floor))
    )
    return stands, {"left": of.told if of.left < 1.0 else of.left, "above": of.above}


def names_stand(left: float, above: float, c: Criteria = CRITERIA) -> bool:
    """True if terms that leave a share `left` of the energy above the floor explain a mismatch.

    `above` is the largest mean square of a channel over its noise. False for values that are not a number.
    """
    return left <= c.most_left and (left <= c.little or above <= c.floor or left * above**0.5 <= c.far)


# Schwarz 1978; Kass and Raftery 1995, with the price of a search over the library
_EVIDENCE: Rule[Addition | Need] = Rule(
    "evidence",
    "the evidence for it is {evidence:.0f} (BIC difference), needed {needed:.0f}",
    "the evidence for it is {evidence:.0f} (BIC difference), needed {needed:.0f}",
    _evidence,
)
# two correct simulations of one axis differ by less; quiet channels do not hide what it removes from another
_MATERIAL: Rule[Addition | Need] = Rule(
    "material energy",
    "it removes {removed:.3g} noise² per row of a channel, needed {needed:.3g}",
    "it removes {removed:.3g} noise² per row of a channel, needed {needed:.3g}",
    _material,
)
# a torque with noise drives the twin: a term that passes less of it leaves less, and explains nothing
_SHAPE: Rule[Addition | Need] = Rule(
    SHAPE,
    "its shape is in what the twin leaves below the noise (by chance {chance:.1g})",
    "its shape is not in what the twin leaves below the noise (by chance {chance:.1g}): it only passes less noise",
    _shape,
)
# the motion that a sensor gives, and the torques on the axis, show in the torque that it needs
_TORQUE: Rule[Addition | Ablation] = Rule(
    "torque",
    "the torque of the motion is predicted no worse with it",
    "with it the twin leaves {left:.2%} of the torque, without it {without:.2%}",
    _torque,
)
# a real effect pays with no channel for another
_CHANNELS: Rule[Addition | Ablation] = Rule(
    "channels",
    "it makes no channel worse",
    "with it the training recordings are reproduced worse in {channels}",
    _channels,
)
VALUES: tuple[Rule[bool], ...] = (
    # the condition of each mechanism (`Mechanism.is_claimable`): else its name does not apply
    Rule(
        "values",
        "its values are valid for the mechanism, and its block is observed",
        "its values are not valid for the mechanism, or its block is not observed",
        _values,
    ),
)
FORM: tuple[Rule[Addition], ...] = (
    # what repeats with the motion is no matter of chance
    Rule("repeated laps", "repeated laps are reproduced as well", "with it repeated laps are reproduced worse", _laps),
    _SHAPE,
    # an external force; what depends on place or speed leaves its form inside
    Rule(
        "constant force",
        "the force is constant within its windows, and these do not follow the motion",
        "the force is not constant within its windows, or these follow the motion",
        _constant,
    ),
    _TORQUE,
)
ADDED: tuple[Rule[Addition], ...] = (
    _EVIDENCE,
    _MATERIAL,
    # many small terms are a series expansion of one effect
    Rule(
        "share of the mismatch",
        "it removes {explained:.1%} of the energy above the noise, needed {needed:.0%}",
        "it removes {explained:.1%} of the energy above the noise, needed {needed:.0%}: such terms are a series",
        _worth,
    ),
    *FORM,
)
HARMLESS: tuple[Rule[Addition | Ablation], ...] = (_CHANNELS,)
NEEDED: tuple[Rule[Addition | Need], ...] = (_EVIDENCE, _MATERIAL, _SHAPE)
COMPARED: tuple[Rule[RivalFit], ...] = (
    # a rival is refuted by very strong evidence and, above the noise, by more than the model discrepancy
    Rule(
        "beside the named one",
        "the recordings do not separate them: evidence against it {against:.0f}{more}",
        "the named one explains more: evidence against it {against:.0f}{more}",
        _not_behind,
    ),
    # the conditions of a term
    Rule("as the cause", "nothing speaks against it as the cause", "{objection}", _no_objection),
)
HELD_OUT: tuple[Rule[Ablation], ...] = (
    # prediction, in torque where that tells; motion without its effect does not refute it
    Rule(
        "held-out recordings",
        "held-out recordings are reproduced no worse with it",
        "it improves the fit to the training recordings, but worsens that to held-out recordings",
        _predicts,
    ),
    # what repeats with the motion is no matter of chance
    Rule(
        "repeated laps, held out",
        "repeated laps are reproduced as well as without it",
        "it improves the fit to the training recordings, but worsens that to repeated laps",
        _repeats,
    ),
    # `verdict.noise_free`
    Rule(
        "motion without noise",
        "it acts on the motion, not only on the noise of the sensors",
        "it changes what the noise of the sensors does in the twin, and hardly the motion",
        _moves,
    ),
    # sandwich estimator of `standard_errors`
    Rule(
        "strength",
        "its strength is above its standard error",
        "its strength is below its standard error",
        _strength,
    ),
    _TORQUE,
    _CHANNELS,
)
EXPLAINED: tuple[Rule[Remainder], ...] = (
    # the true mechanism in another form leaves little
    Rule(
        EXPLAINS,
        "all terms leave {left:.1%} of the energy above the noise",
        "all terms leave {left:.1%} of the energy above the noise, a channel {above:.3g} times its noise (square)",
        _explains,
    ),
)
RULES = tuple(dict.fromkeys((*VALUES, *ADDED, *HARMLESS, *COMPARED, *HELD_OUT, *EXPLAINED, *REPRODUCED)))
