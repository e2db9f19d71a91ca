"""The tiers of the proof: for each a recipe that draws an axis, its motions and what is concealed.

A recipe gives None when its draws came to nothing on this axis; the next call draws another one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

from hil.proof.draw import motions
from hil.proof.draw.ambiguity import ambiguous
from hil.proof.draw.axes import Belief
from hil.proof.draw.axis_kinds import Kind
from hil.proof.draw.cases import TRIES, Draft, at_size, name_on, one, stage, two
from hil.proof.draw.effect_size import Visibility
from hil.proof.draw.effects import applicable, draw_effect
from hil.proof.draw.expected import block, inseparable, same_law
from hil.proof.draw.random_draws import Rng
from hil.proof.draw.unknown_effects import NOVEL, EncoderFault, draw_novel, novel

Recipe = Callable[[Rng, str | None, Kind | None], Draft | None]
VISIBLE = (1.5, 100.0)  # sizes of an effect that is to be named, in units of noise
RUNGS = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 13.0, 20.0, 30.0)
_MASKED = (1.0, 6.0)  # sizes of what hides
_MASKING = (4.0, 100.0)  # times as large is what it hides behind
_NOVEL = (3.0, 100.0)
_INVISIBLE = 5.0  # sum of squares over the noise's variance: less than half of what any test asks for
_OTHER_BLOCK = 0.8  # share of the pairs whose effects lie in different blocks


def single(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """One effect that shows."""
    on = stage(rng, kind)
    name = name_on(on.axis, effect, kind is not None, rng)
    return one(rng, on, name, VISIBLE) if name else None


def ladder(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """One effect of a size between half the noise and thirty times of it."""
    on = stage(rng, kind)
    wanted = float(rng.choice(RUNGS))
    name = name_on(on.axis, effect, kind is not None, rng)
    found = at_size(draw_effect(name, on.scene, rng), wanted, on) if name else None
    return Draft(on.axis, on.runs, "missing_physics", (found,)) if found else None


def pair(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """Two effects, each visible beside the other, mostly of different blocks."""
    on = stage(rng, kind)
    first = name_on(on.axis, effect, kind is not None, rng)
    if first is None:
        return None
    others = [name for name in applicable(on.axis) if name not in inseparable(first)]
    if rng.random() < _OTHER_BLOCK:
        others = [name for name in others if block(name) != block(first)]
    return two(rng, on, (first, str(rng.choice(others))), VISIBLE, VISIBLE, (0.0, inf))


def null(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """Nothing concealed, the owner right about everything."""
    return _nothing(rng, effect, kind, "exact", "no_mismatch")


def parameters_only(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """Nothing concealed, the owner's parameters wrong."""
    return _nothing(rng, effect, kind, "wrong", "parameter_error")


def masked(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """A small effect behind noise and coarse encoders, or behind a larger effect."""
    hard = bool(rng.random() < 0.5)
    on = stage(rng, kind, hard=hard)
    name = name_on(on.axis, effect, kind is not None, rng)
    if name is None or hard:
        return one(rng, on, name, _MASKED) if name else None
    others = [other for other in applicable(on.axis) if other not in inseparable(name)]
    return two(rng, on, (name, str(rng.choice(others))), _MASKED, VISIBLE, _MASKING)


def novel_physics(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """Physics that the library has not."""
    on = stage(rng, kind)
    names = novel(on.axis)
    possible = names if kind is not None else NOVEL
    if effect is not None and effect not in possible:
        raise ValueError(f"effect: must be one of {', '.join(possible)}, got {effect!r}")
    name = effect or str(rng.choice(names))
    for _ in range(TRIES if name in names else 0):
        found = draw_novel(name, on.scene, rng)
        if isinstance(found, EncoderFault):
            size = max(found.size(run.position_m, on.axis, rng) for run in on.runs)
        else:
            size = on.visibility.size([found])
        if _NOVEL[0] <= size <= _NOVEL[1]:
            return Draft(on.axis, on.runs, "unexplained", ((found, size),))
    return None


def insufficient(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """An effect that good motions would show, and a motion that does not: it must be called not testable."""
    on = stage(rng, kind)
    poor = {how: tuple(motions.poor(rng, on.axis, how) for _ in range(3)) for how in motions.POOR}
    unseen = {how: Visibility(on.axis, runs[:2]) for how, runs in poor.items()}
    for _ in range(TRIES):
        name = name_on(on.axis, effect, kind is not None, rng)
        # that a recording does not reach the window of a force is no shortcoming of its motion
        if name is None or name == "external_force":
            continue
        found, how = draw_effect(name, on.scene, rng), motions.POOR[int(rng.integers(len(motions.POOR)))]
        if unseen[how].evidence([found]) > _INVISIBLE or not VISIBLE[0] <= on.visibility.size([found]) <= VISIBLE[1]:
            continue
        first, second, last = poor[how]
        return Draft(
            on.axis,
            (first, second, last),
            "parameter_error",
            ((found, unseen[how].size([found])),),
            not_testable=same_law(name),
        )
    return None


def _nothing(rng: Rng, effect: str | None, kind: Kind | None, belief: Belief, verdict: str) -> Draft:
    if effect is not None:
        raise ValueError(f"effect: must be left out where nothing is concealed, got {effect!r}")
    on = stage(rng, kind, belief)
    return Draft(on.axis, on.runs, verdict)


RECIPES: Mapping[str, Recipe] = {
    "single": single,
    "ladder": ladder,
    "pair": pair,
    "null": null,
    "parameters_only": parameters_only,
    "masked": masked,
    "novel": novel_physics,
    "ambiguous": ambiguous,
    "insufficient": insufficient,
}
