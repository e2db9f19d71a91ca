"""The sentence of a term: its mechanism in an engineer's words, with values that are rounded by their errors."""

from collections.abc import Sequence
from typing import NamedTuple

from hil.bench.bench_file import Bench
from hil.diagnosis.turning import of_load
from hil.diagnosis.wording import unit_in, value_in_words, wave
from hil.identification.terms import Term
from hil.quantities import quantity, reading_unit, with_error
from hil.twin.library import BY_ID
from hil.twin.mechanism import Mechanism
from hil.twin.parameter import Dimension, Parameter, Role

_SEEN = {"measured": "the measured torque shows it", "hidden": "the measured torque does not show it"}
_LITTLE = 0.01  # of the largest strength of a mechanism: a harmonic below is not told by its own value
_UNTOLD = {Dimension.TIME: "a time", Dimension.LENGTH: "a length", Dimension.ANGLE: "an angle"}
_MINUTE_S = 60.0


class TermErrors(NamedTuple):
    """Standard errors of the values of a term, and that of its strength if its other values are given."""

    values: Sequence[float]
    strength: float


def sentence(term: Term, bench: Bench, errors: TermErrors | None = None) -> str:
    """Describe a term in a sentence with its values, and its variant in brackets.

    With errors a value is rounded by its own, and one within it is said not to be told.
    """
    mechanism, axis = BY_ID[term.effect], bench.axis
    variant = mechanism.variants[term.variant]
    # forms of a transmission are forces, which a rigid axis does not have
    forms = bool(axis.SPRINGS) or not mechanism.in_transmission
    told_by = variant.text if variant.text and forms else mechanism.text
    text, opposite = told_by.sentence, told_by.reversed
    given = list(term.values)
    of_values = errors.values if errors else [0.0] * len(given)
    if given[mechanism.strength] < 0.0 and opposite:
        text, given[mechanism.strength] = opposite, -given[mechanism.strength]
    values = {}
    sizes = [abs(given[place]) for place in mechanism.indices(Role.STRENGTH)]
    for parameter, value, error in zip(mechanism.parameters, given, of_values, strict=True):
        most = 0.0  # of a harmonic that is little, or within its error
        if parameter.role is Role.STRENGTH and abs(value) < max(sizes):
            most = max(_LITTLE * max(sizes), abs(value) + error if abs(value) < error else 0.0)
        bound = f"less than {value_in_words(most, parameter, bench)}"
        values[parameter.name] = bound if abs(value) < most else _told(value, error, parameter, bench)
    if told_by.rate and (rate := rate_in_words(term, bench, errors)):
        text, values["rate"] = told_by.rate, rate
    orders = mechanism.indices(Role.ORDER)
    values["wave"] = wave(given[orders[0]], bench, of_values[orders[0]]) if orders else ""
    values["viscous_speed"] = quantity(bench.axis.physics().viscous_speed, "m/s" if axis.linear else "rad/s")
    told = of_load(text, axis.turns).format(**values, variant=variant.name)
    if not variant.name or not forms or "{variant}" in text or variant.name in told:
        return told
    return f"{told.removesuffix('.')} ({_variant_in_words(variant.name)})."


def _told(value: float, error: float, parameter: Parameter, bench: Bench) -> str:
    """A value in words: with its error or as not told where it is within it, as a bound where the fit ended at one."""
    if parameter.role is Role.SHAPE and 0.0 < value in (parameter.low, parameter.high):
        return f"at {'most' if value == parameter.low else 'least'} {value_in_words(value, parameter, bench)}"
    if parameter.role in (Role.EDGE, Role.PHASE) or not abs(value) < error:
        return value_in_words(value, parameter, bench, error)
    if parameter.role is not Role.STRENGTH:
        return f"{_UNTOLD.get(parameter.dimension, 'a value')} that is not told"
    factor, unit = reading_unit(unit_in(bench, parameter), value)
    return f"{' ± '.join(with_error(factor * value, factor * error))} {unit}".rstrip()


def rate_in_words(term: Term, bench: Bench, errors: TermErrors | None) -> str:
    """Strength per minute of a change that goes on beyond the recording; "" for another one."""
    mechanism = BY_ID[term.effect]
    duration = _open_end(mechanism, term.values, errors.values) if errors and mechanism.text.rate else 0.0
    if not errors or not duration:
        return ""
    per_minute, strength = _MINUTE_S / duration, mechanism.parameters[mechanism.strength]
    return value_in_words(per_minute * term.values[mechanism.strength], strength, bench, per_minute * errors.strength)


def _open_end(mechanism: Mechanism, values: Sequence[float], errors: Sequence[float]) -> float:
    """The time in which a change comes to its end, if it is within its error; 0 if it is told."""
    for parameter, value, error in zip(mechanism.parameters, values, errors, strict=True):
        if parameter.role is Role.SHAPE and parameter.dimension is Dimension.TIME and abs(value) < error:
            return value
    return 0.0


def _variant_in_words(variant: str) -> str:
    """The name of a variant, with what it says of the measured torque in words."""
    return "; ".join(_SEEN.get(word, word) for word in variant.split()) if variant.split()[0] in _SEEN else variant
