"""The tiers of the proof: each has a recipe that draws an axis, its motions and its concealed effects.

A recipe returns None if its draws failed on this axis; the next call draws another axis.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from math import inf

from hil.validation.proof.draw import motions
from hil.validation.proof.draw.ambiguity import ambiguous
from hil.validation.proof.draw.axes import Belief
from hil.validation.proof.draw.axis_kinds import Kind, Rng
from hil.validation.proof.draw.cases import TRIES, CaseDraft, at_size, name_on, one, stage, two
from hil.validation.proof.draw.effect_size import EffectSizes
from hil.validation.proof.draw.effects import applicable, draw_effect
from hil.validation.proof.draw.expected import block, inseparable, same_law
from hil.validation.proof.draw.less_known import possible
from hil.validation.proof.draw.unknown_effects import EncoderFault, draw_novel, novel

Recipe = Callable[[Rng, str | None, Kind | None], CaseDraft | None]
VISIBLE = (1.5, 100.0)  # sizes of an effect that is to be named, in units of noise
RUNGS = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 13.0, 20.0, 30.0)
_MASKED = (1.0, 6.0)  # sizes of the masked effect
_MASKING = (4.0, 100.0)  # ratio of the masking effect to it
_NOVEL = (3.0, 100.0)
_CLEAR = (5.0, 100.0)  # where less is known: the noise floor is higher there
_INVISIBLE = 5.0  # sum of squares over the noise's variance: below half of the threshold of any test
_OTHER_BLOCK = 0.8  # share of the pairs whose effects lie in different blocks


def single(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal one visible effect."""
    on = stage(rng, kind)
    name = name_on(on.axis, effect, rng)
    return one(rng, on, name, VISIBLE) if name else None


def ladder(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal one effect of 0.5 to 30 times the noise."""
    on = stage(rng, kind)
    wanted = float(rng.choice(RUNGS))
    name = name_on(on.axis, effect, rng)
    found = at_size(draw_effect(name, on.scale, rng), wanted, on) if name else None
    return CaseDraft(on.axis, on.runs, "missing_physics", (found,)) if found else None


def pair(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal two effects, each visible beside the other, mostly in different blocks."""
    on = stage(rng, kind)
    first = name_on(on.axis, effect, rng)
    if first is None:
        return None
    others = [name for name in applicable(on.axis) if name not in inseparable(first)]
    if rng.random() < _OTHER_BLOCK:
        others = [name for name in others if block(name) != block(first)]
    return two(rng, on, (first, str(rng.choice(others))), VISIBLE, VISIBLE, (0.0, inf))


def masked(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal a small effect behind noise and coarse encoders, or behind a larger effect."""
    hard = bool(rng.random() < 0.5)
    on = stage(rng, kind, hard=hard)
    name = name_on(on.axis, effect, rng)
    if name is None or hard:
        return one(rng, on, name, _MASKED) if name else None
    others = [other for other in applicable(on.axis) if other not in inseparable(name)]
    return two(rng, on, (name, str(rng.choice(others))), _MASKED, VISIBLE, _MASKING)


def novel_physics(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal physics that the library lacks."""
    on = stage(rng, kind)
    names = novel(on.axis)
    name = effect or str(rng.choice(names))
    for _ in range(TRIES if name in names else 0):
        found = draw_novel(name, on.scale, rng)
        if isinstance(found, EncoderFault):
            size = max(found.size(run.position_m, on.axis, rng) for run in on.runs)
        else:
            size = on.sizes.size([found])
        if _NOVEL[0] <= size <= _NOVEL[1]:
            return CaseDraft(on.axis, on.runs, "unexplained", ((found, size),))
    return None


def insufficient(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal an effect that good motions show, and record motions that do not: it must be reported as not testable."""
    on = stage(rng, kind)
    poor = {how: motions.poor(rng, on.axis, how) for how in motions.POOR}
    unseen = {how: EffectSizes(on.axis, runs[:2]) for how, runs in poor.items()}
    for _ in range(TRIES):
        name = name_on(on.axis, effect, rng)
        # a recording that ends before the window of a force says nothing about its motion
        if name is None or name == "external_force":
            continue
        found, how = draw_effect(name, on.scale, rng), motions.POOR[int(rng.integers(len(motions.POOR)))]
        if unseen[how].evidence([found]) > _INVISIBLE or not VISIBLE[0] <= on.sizes.size([found]) <= VISIBLE[1]:
            continue
        concealed = ((found, unseen[how].size([found])),)
        return CaseDraft(on.axis, poor[how], "parameter_error", concealed, not_testable=same_law(name))
    return None


def less_known(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Conceal one clear effect and forget a part of what is known; it is to be named, or said not to be testable."""
    on = stage(rng, kind)
    name = name_on(on.axis, effect, rng)
    draft = one(rng, on, name, _CLEAR) if name else None
    if name is None or draft is None:
        return None
    ways = possible(on.axis)
    return replace(draft, not_testable=same_law(name), forgotten=ways[int(rng.integers(len(ways)))])


def _nothing(belief: Belief, verdict: str, rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft:
    """Conceal nothing; the parameters of the bench file are exact or wrong."""
    on = stage(rng, kind, belief)
    return CaseDraft(on.axis, on.runs, verdict)


RECIPES: Mapping[str, Recipe] = {
    "single": single,
    "ladder": ladder,
    "pair": pair,
    "null": partial(_nothing, "exact", "no_mismatch"),
    "parameters_only": partial(_nothing, "wrong", "parameter_error"),
    "masked": masked,
    "novel": novel_physics,
    "ambiguous": ambiguous,
    "insufficient": insufficient,
    "less_known": less_known,
}
