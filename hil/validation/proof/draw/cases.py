"""Draft cases: an axis over its motions, with effects of wanted sizes."""

from dataclasses import dataclass

from drivers.sim.effects import Effect
from drivers.sim.packing import StepTooLong
from hil.validation.proof.draw import motions
from hil.validation.proof.draw.axes import Belief, DrawnAxis, draw_axis
from hil.validation.proof.draw.axis_kinds import Kind, Rng, log_uniform
from hil.validation.proof.draw.effect_size import EffectSizes
from hil.validation.proof.draw.effects import DrawScale, applicable, draw_effect, scaled
from hil.validation.proof.draw.motions import Runs
from hil.validation.proof.draw.unknown_effects import EncoderFault

Sizes = tuple[float, float]
Sized = tuple[Effect, float]
TRIES = 8  # draws on one axis before it is scaled or given up
_PAIRS = 3  # draws of two effects; each costs new sensitivities
_ON_RUNG = 0.05  # relative tolerance of a wanted size
_STEPS = 8  # of scaling


@dataclass(frozen=True, eq=False)
class CaseDraft:
    """A case before it is recorded, with its right answer: effects and their sizes, the one to be found first.

    `forgotten`: the way of `less_known.WAYS` in which less is known than was recorded; empty if all is known.
    """

    axis: DrawnAxis
    runs: Runs
    verdict: str
    effects: tuple[tuple[Effect | EncoderFault, float], ...] = ()
    rivals: tuple[str, ...] = ()
    not_testable: tuple[str, ...] = ()
    forgotten: str = ""


@dataclass(frozen=True, eq=False)
class AxisOnMotions:
    """An axis over good motions, without effects."""

    axis: DrawnAxis
    runs: Runs
    sizes: EffectSizes
    scale: DrawScale


def stage(rng: Rng, kind: Kind | None, belief: Belief = "wrong", hard: bool = False) -> AxisOnMotions:
    """Draw an axis and its motions."""
    axis = draw_axis(rng, kind, belief, hard)
    runs = motions.good(rng, axis)
    sizes = EffectSizes(axis, runs[:2])
    scale = DrawScale(axis, sizes.peak_torque(), min(motion.duration_s for motion in runs[:2]))
    return AxisOnMotions(axis, runs, sizes, scale)


def name_on(axis: DrawnAxis, effect: str | None, rng: Rng) -> str | None:
    """Return the wanted effect, or any; None if it needs another kind of axis."""
    names = applicable(axis)
    if effect is None:
        return str(rng.choice(names))
    return effect if effect in names else None


def one(rng: Rng, on: AxisOnMotions, name: str, sizes: Sizes) -> CaseDraft | None:
    """Draft a case with one effect of a size between two limits."""
    found = sized(rng, on, name, sizes)
    return CaseDraft(on.axis, on.runs, "missing_physics", (found,)) if found else None


def two(
    rng: Rng, on: AxisOnMotions, names: tuple[str, str], sizes: Sizes, second: Sizes, ratio: Sizes
) -> CaseDraft | None:
    """Draft a case with two effects, each within limits of its size beside the other; `ratio`: second to first."""
    for _ in range(_PAIRS):
        one, another = sized(rng, on, names[0], sizes), sized(rng, on, names[1], second)
        if one is None or another is None:
            return None
        first, other = one[0], another[0]
        size = on.sizes.size([first], [other])
        if not sizes[0] <= size <= sizes[1]:
            continue
        beside = on.sizes.size([other], [first])
        if second[0] <= beside <= second[1] and ratio[0] <= beside / size <= ratio[1]:
            return CaseDraft(on.axis, on.runs, "missing_physics", ((first, size), (other, beside)))
    return None


def sized(rng: Rng, on: AxisOnMotions, name: str, sizes: Sizes) -> Sized | None:
    """Draw an effect of a size between two limits; scale it if no draw falls between them."""
    for _ in range(TRIES):
        effect = draw_effect(name, on.scale, rng)
        size = on.sizes.size([effect])
        if sizes[0] <= size <= sizes[1]:
            return effect, size
    found = at_size(effect, log_uniform(rng, *sizes), on)
    return found if found and sizes[0] <= found[1] <= sizes[1] else None


def at_size(effect: Effect, wanted: float, on: AxisOnMotions) -> Sized | None:
    """Scale the effect until its size is the wanted one; None if that fails."""
    found: Effect | None = effect
    for _ in range(_STEPS):
        if found is None:
            return None
        try:
            size = on.sizes.size([found])
        except StepTooLong:  # a stiffness beyond the internal step of the simulated axis
            return None
        if abs(size / wanted - 1.0) < _ON_RUNG:
            return found, size
        # sizes are about proportional to the strength; limited steps for effects with a threshold
        found = scaled(found, min(max(wanted / max(size, 1e-6), 0.2), 3.0), on.scale)
    return None
