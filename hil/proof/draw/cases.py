"""Drafts of cases: an axis over its motions, with effects of wanted sizes."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.sim.effects import Effect
from hil.motion.trajectory import Trajectory
from hil.proof.draw import motions
from hil.proof.draw.axes import Belief, DrawnAxis, draw_axis
from hil.proof.draw.axis_kinds import Kind
from hil.proof.draw.effect_size import Visibility
from hil.proof.draw.effects import LIBRARY, Scene, applicable, draw_effect, scaled
from hil.proof.draw.random_draws import Rng, log_uniform
from hil.proof.draw.unknown_effects import EncoderFault

Runs = tuple[Trajectory, Trajectory, Trajectory]
Sizes = tuple[float, float]
Sized = tuple[Effect, float]
TRIES = 8  # draws on one axis
_PAIRS = 3  # draws of two, each of which takes new sensitivities
_ON_RUNG = 0.05  # relative, of a size wanted
_STEPS = 8  # towards it


@dataclass(frozen=True, eq=False)
class Draft:
    """What is to be recorded, and the answer: effects with their sizes, first the one that the case is about."""

    axis: DrawnAxis
    runs: Runs
    verdict: str
    effects: tuple[tuple[Effect | EncoderFault, float], ...] = ()
    rivals: tuple[str, ...] = ()
    not_testable: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Stage:
    """An axis over good motions, before anything is concealed."""

    axis: DrawnAxis
    runs: Runs
    visibility: Visibility
    scene: Scene


def stage(rng: Rng, kind: Kind | None, belief: Belief = "wrong", hard: bool = False) -> Stage:
    """An axis and its motions at random."""
    axis = draw_axis(rng, kind, belief, hard)
    train = motions.training(rng, axis)
    visibility = Visibility(axis, train)
    scene = Scene(axis, visibility.peak_torque(), min(motion.duration_s for motion in train))
    return Stage(axis, (*train, motions.holdout(rng, axis)), visibility, scene)


def name_on(axis: DrawnAxis, effect: str | None, forced: bool, rng: Rng) -> str | None:
    """The effect asked for, or any; None where another kind of axis must be drawn for it.

    Raises ValueError for an effect that no axis has, or not the kind that is `forced`.
    """
    names = applicable(axis)
    if effect is None:
        return str(rng.choice(names))
    if effect in names:
        return effect
    if forced or effect not in LIBRARY:
        raise ValueError(f"effect: must be one of {', '.join(names if forced else LIBRARY)}, got {effect!r}")
    return None


def one(rng: Rng, on: Stage, name: str, sizes: Sizes) -> Draft | None:
    """One effect of a size between two."""
    found = sized(rng, on, name, sizes)
    return Draft(on.axis, on.runs, "missing_physics", (found,)) if found else None


def two(rng: Rng, on: Stage, names: tuple[str, str], sizes: Sizes, second: Sizes, ratio: Sizes) -> Draft | None:
    """Two effects, each of a size between two beside the other; `ratio`: of the second to the first."""
    for _ in range(_PAIRS):
        one, another = sized(rng, on, names[0], sizes), sized(rng, on, names[1], second)
        if one is None or another is None:
            return None
        first, other = one[0], another[0]
        size = on.visibility.size([first], [other])
        if not sizes[0] <= size <= sizes[1]:
            continue
        beside = on.visibility.size([other], [first])
        if second[0] <= beside <= second[1] and ratio[0] <= beside / size <= ratio[1]:
            return Draft(on.axis, on.runs, "missing_physics", ((first, size), (other, beside)))
    return None


def sized(rng: Rng, on: Stage, name: str, sizes: Sizes) -> Sized | None:
    """An effect of a size between two: as drawn, or turned up or down where no draw comes to lie there."""
    for _ in range(TRIES):
        effect = draw_effect(name, on.scene, rng)
        size = on.visibility.size([effect])
        if sizes[0] <= size <= sizes[1]:
            return effect, size
    found = at_size(effect, log_uniform(rng, *sizes), on)
    return found if found and sizes[0] <= found[1] <= sizes[1] else None


def at_size(effect: Effect, wanted: float, on: Stage) -> Sized | None:
    """The effect turned up or down until its size is the wanted one; None where it cannot be."""
    found: Effect | None = effect
    for _ in range(_STEPS):
        if found is None:
            return None
        size = on.visibility.size([found])
        if abs(size / wanted - 1.0) < _ON_RUNG:
            return found, size
        # sizes grow about as the strength does; what has a threshold is led there in smaller steps
        found = scaled(found, min(max(wanted / max(size, 1e-6), 0.2), 3.0), on.scene)
    return None
