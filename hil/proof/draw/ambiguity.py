"""Cases that their motion cannot decide: one effect, and a rival that does the same over this motion.

Each couple is known from the mechanics: a torque of the motor angle and friction of the position are one thing while
the axis moves one way; a spring is a constant load where it does not stretch; a motor encoder that errs, or a linear
one, is a screw that errs as long as nothing accelerates. That a case cannot be decided is not believed but worked out:
all parameters of the rival and of the axis are fitted to what the effect does.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

from drivers.sim.effects import Effect
from hil.proof.draw import motions
from hil.proof.draw.axis_kinds import Kind
from hil.proof.draw.cases import Draft, stage
from hil.proof.draw.effect_size import Visibility
from hil.proof.draw.effects import Scene, scaled
from hil.proof.draw.motions import Poor
from hil.proof.draw.random_draws import Rng, any_phase, log_uniform

Both = tuple[Effect, Effect]
Couple = Callable[[Scene, Rng], Both | None]

_SEEN = 1.0  # smallest size: something is there
_SAME = 5.0  # sum of squares over the noise's variance: with less between the two, no test tells them
_LONGEST_SCALE_M = 0.01  # of the period of a linear encoder's error in the library
_STEPS = 4  # towards a strength at which they cannot be told


def ambiguous(rng: Rng, effect: str | None, kind: Kind | None) -> Draft | None:
    """An effect, its rival, and motions that show that one of them is there but not which."""
    if effect is not None and effect not in _EFFECTS:
        raise ValueError(f"effect: must be one of {', '.join(sorted(_EFFECTS))}, got {effect!r}")
    on = stage(rng, kind)
    couple, how = _COUPLES[int(rng.integers(len(_COUPLES)))]
    found = couple(on.scene, rng)
    if found is None or effect not in (None, found[0].id):
        return None
    first, second = found  # the effect, and what is taken for it
    runs = (motions.poor(rng, on.axis, how), motions.poor(rng, on.axis, how), motions.poor(rng, on.axis, how))
    visibility = Visibility(on.axis, runs[:2])
    for _ in range(_STEPS):
        size = visibility.size([first])
        if size < _SEEN:
            return None
        apart = visibility.separation(first, second, _SAME)
        if apart < _SAME:
            return Draft(on.axis, runs, "missing_physics", ((first, size),), rivals=(second.id,))
        # the evidence grows with the square of the strength
        factor = max((0.5 * _SAME / apart) ** 0.5, 0.2)
        weaker, rival = scaled(first, factor, on.scene), scaled(second, factor, on.scene)
        if weaker is None or rival is None:
            return None
        first, second = weaker, rival
    return None


def _either(rng: Rng, one: Effect, other: Effect) -> Both:
    """One of two is the effect, the other its rival."""
    return (one, other) if rng.random() < 0.5 else (other, one)


def _angle_or_position(s: Scene, rng: Rng) -> Both:
    cycles, phase, fraction = float(rng.integers(2, 6)), any_phase(rng), log_uniform(rng, 0.05, 0.3)
    cogging = Effect(
        "cogging_torque", {"amplitude_n_m": fraction * s.coulomb, "cycles_per_rev": cycles, "phase_rad": phase}
    )
    friction = Effect(
        "position_dependent_friction",
        {"fraction": fraction, "phase_rad": phase + pi, "period_m": s.axis.truth.lead_m / cycles},
    )
    return _either(rng, cogging, friction)


def _spring_or_load(s: Scene, rng: Rng) -> Both:
    rest_m = s.axis.travel_m * rng.uniform(0.6, 1.5)
    force_n = s.coulomb / s.ratio * log_uniform(rng, 0.1, 0.8)
    spring = Effect("spring_load", {"stiffness_n_m": force_n / rest_m, "rest_position_m": rest_m})
    return spring, Effect("constant_load", {"load_torque_n_m": -force_n * s.ratio})


def _encoder_or_screw(s: Scene, rng: Rng) -> Both | None:
    if not s.axis.has_table:
        return None
    error_m, phase = log_uniform(rng, 0.5e-6, 6e-6), any_phase(rng)
    return _either(
        rng,
        Effect("encoder_eccentricity", {"amplitude_rad": error_m / s.ratio, "phase_rad": phase}),
        Effect("periodic_lead_error", {"amplitude_m": error_m, "phase_rad": phase + pi}),
    )


def _scale_or_screw(s: Scene, rng: Rng) -> Both | None:
    lead_m = s.axis.truth.lead_m
    if not s.axis.has_table or lead_m > _LONGEST_SCALE_M:
        return None
    error_m, phase = log_uniform(rng, 0.5e-6, 6e-6), any_phase(rng)
    reading = Effect("scale_interpolation_error", {"amplitude_m": error_m, "period_m": lead_m, "phase_rad": phase})
    return _either(rng, reading, Effect("periodic_lead_error", {"amplitude_m": error_m, "phase_rad": phase}))


_COUPLES: tuple[tuple[Couple, Poor], ...] = (
    (_angle_or_position, "one_way"),
    (_spring_or_load, "local"),
    (_encoder_or_screw, "slow"),
    (_scale_or_screw, "slow"),
)
_EFFECTS = frozenset(
    {
        "cogging_torque",
        "position_dependent_friction",
        "spring_load",
        "encoder_eccentricity",
        "periodic_lead_error",
        "scale_interpolation_error",
    }
)
