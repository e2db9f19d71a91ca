"""Draft ambiguous cases: one effect, and a rival with the same consequences on the recorded motion.

Couples from mechanics: torque of the motor angle and friction of the position are equal while the axis moves one way; a
spring over a short stroke is a constant load; errors of the motor encoder, of the linear encoder and of the screw are
equal without acceleration. Each case is verified: all parameters of rival and axis are fitted to the effect.
"""

from collections.abc import Callable
from math import pi

from drivers.sim.effects import Effect
from hil.validation.proof.draw import motions
from hil.validation.proof.draw.axis_kinds import Kind, Rng, any_phase, log_uniform
from hil.validation.proof.draw.cases import CaseDraft, stage
from hil.validation.proof.draw.effect_size import EffectSizes
from hil.validation.proof.draw.effects import DrawScale, scaled
from hil.validation.proof.draw.motions import Poor

Both = tuple[Effect, Effect]
Couple = Callable[[DrawScale, Rng], Both | None]

_SEEN = 1.0  # smallest size: above the noise
_SAME = 5.0  # sum of squares over the noise's variance: no test separates two effects that differ by less
_LONGEST_SCALE_M = 0.01  # of the period of a linear encoder's error in the library
_STEPS = 4  # of weakening until they cannot be separated


def ambiguous(rng: Rng, effect: str | None, kind: Kind | None) -> CaseDraft | None:
    """Draft an effect, its rival, and motions that detect them but cannot separate them."""
    on = stage(rng, kind)
    couple, how = _COUPLES[int(rng.integers(len(_COUPLES)))]
    found = couple(on.scale, rng)
    if found is None or effect not in (None, found[0].id):
        return None
    first, second = found  # the effect and its rival
    runs = motions.poor(rng, on.axis, how)
    sizes = EffectSizes(on.axis, runs[:2])
    for _ in range(_STEPS):
        size = sizes.size([first])
        if size < _SEEN:
            return None
        apart = sizes.separation(first, second, _SAME)
        if apart < _SAME:
            return CaseDraft(on.axis, runs, "missing_physics", ((first, size),), rivals=(second.id,))
        # the evidence grows with the square of the strength
        factor = max((0.5 * _SAME / apart) ** 0.5, 0.2)
        weaker, rival = scaled(first, factor, on.scale), scaled(second, factor, on.scale)
        if weaker is None or rival is None:
            return None
        first, second = weaker, rival
    return None


def _either(rng: Rng, one: Effect, other: Effect) -> Both:
    """Choose one of two as the effect, the other as its rival."""
    return (one, other) if rng.random() < 0.5 else (other, one)


def _angle_or_position(s: DrawScale, rng: Rng) -> Both:
    cycles, phase, fraction = float(rng.integers(2, 6)), any_phase(rng), log_uniform(rng, 0.05, 0.3)
    cogging = Effect(
        "cogging_torque", {"amplitude_n_m": fraction * s.coulomb, "cycles_per_rev": cycles, "phase_rad": phase}
    )
    friction = Effect(
        "position_dependent_friction",
        {"fraction": fraction, "phase_rad": phase + pi, "period_m": s.axis.truth.lead_m / cycles},
    )
    return _either(rng, cogging, friction)


def _spring_or_load(s: DrawScale, rng: Rng) -> Both:
    rest_m = s.axis.travel_m * rng.uniform(0.6, 1.5)
    force_n = s.coulomb / s.ratio * log_uniform(rng, 0.1, 0.8)
    spring = Effect("spring_load", {"stiffness_n_m": force_n / rest_m, "rest_position_m": rest_m})
    return spring, Effect("constant_load", {"load_torque_n_m": -force_n * s.ratio})


def _encoder_or_screw(s: DrawScale, rng: Rng) -> Both | None:
    if not s.axis.has_table:
        return None
    error_m, phase = log_uniform(rng, 0.5e-6, 6e-6), any_phase(rng)
    return _either(
        rng,
        Effect("encoder_eccentricity", {"amplitude_rad": error_m / s.ratio, "phase_rad": phase}),
        Effect("periodic_lead_error", {"amplitude_m": error_m, "phase_rad": phase + pi}),
    )


def _scale_or_screw(s: DrawScale, rng: Rng) -> Both | None:
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
