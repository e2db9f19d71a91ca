"""Texts for mechanisms, terms and locations."""

from collections.abc import Iterable, Sequence

from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS
from hil.diagnosis.result import Finding, Location
from hil.diagnosis.turning import of_load, speed_unit
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.quantities import digits, quantity, unit_of
from hil.twin.library import BY_ID
from hil.twin.parameter import Parameter, Role

_SEEN = {"measured": "the measured torque shows it", "hidden": "the measured torque does not show it"}
_LITTLE = 0.01  # of the largest strength of a mechanism: a harmonic below is not told by its own value


def title(effect: str) -> str:
    """Replace the underscores of an id by spaces: "constant_load" -> "constant load"."""
    return effect.replace("_", " ")


def titles(effects: Iterable[str]) -> str:
    """List ids in words, separated by commas."""
    return ", ".join(map(title, effects))


def spoken(channel: str) -> str:
    """Name of a recorded channel in words, without its unit: "motor_position_rad" -> "motor position"."""
    unit = unit_of(channel)
    ending = next((one for one in (unit.replace(" ", "_").lower(),) if channel.endswith(f"_{one}")), "")
    return title(channel.removesuffix(f"_{ending}"))


def named(finding: Finding) -> str:
    """Name a finding with its equal rivals: its confidence is that of the set."""
    return " or ".join(map(title, (finding.effect, *finding.equivalents)))


def listed(texts: Sequence[str]) -> str:
    """Join texts as a list of a sentence: "a, b and c"."""
    return " and ".join(filter(None, (", ".join(texts[:-1]), *texts[-1:])))


def by_chance(p: float) -> str:
    """Probability of a structure by chance, in words."""
    return f"by chance {p:.1g}" if p > 1e-12 else "by chance less than 1e-12"


def channel_names(bench: Bench, run: Measured) -> dict[str, str]:
    """Map channels of the twin to names of recorded channels."""
    names = AXIS_CHANNELS[run.kind]
    found = {"motor": names.motor_position, "torque": names.torque, "command": names.torque_command}
    if bench.has_table_encoder:
        found["table"] = names.table_position
    return found


def label(term: Term, bench: Bench) -> str:
    """Name a term, with its period, order or variant if the effect may act more than once."""
    mechanism = BY_ID[term.effect]
    if mechanism.most == 1:
        return title(term.effect)
    period_m, order = (mechanism.named(role, term.values) for role in (Role.PERIOD, Role.ORDER))
    if period_m is not None:
        return f"{title(term.effect)}, every {quantity(period_m, 'm')}"
    which = mechanism.forms[term.variant] if order is None else _wave(order, bench)
    return f"{title(term.effect)}, {which}"


def _wave(order: float, bench: Bench) -> str:
    """How often an effect repeats: per revolution, or along the travel where no revolution is known."""
    if bench.axis.physics().turn_known:
        return f"{digits(order)} times per revolution"
    return f"every {quantity(1.0 / order, 'm')} of travel"


def unit_in(bench: Bench, parameter: Parameter) -> str:
    """SI unit of a parameter of a mechanism on the axis of a bench."""
    if parameter.role is Role.ORDER and not bench.axis.physics().turn_known:
        return "1/m"
    return parameter.dimension.unit(bench.axis.drive_unit, bench.axis.turns)


def value_in_words(value: float, parameter: Parameter, bench: Bench) -> str:
    """Value of a parameter with its unit; edges of windows to a hundredth of a second, early and late ones alike."""
    return f"{value:.2f} s" if parameter.role is Role.EDGE else quantity(value, unit_in(bench, parameter))


def sentence(term: Term, bench: Bench) -> str:
    """Describe a term in a sentence with its values, and its variant in brackets."""
    mechanism, axis = BY_ID[term.effect], bench.axis
    variant = mechanism.variants[term.variant]
    # forms of a transmission are forces, which a rigid axis does not have
    forms = bool(axis.SPRINGS) or not mechanism.in_transmission
    told_by = variant.text if variant.text and forms else mechanism.text
    text, opposite = told_by.sentence, told_by.reversed
    given = list(term.values)
    if given[mechanism.strength] < 0.0 and opposite:
        text, given[mechanism.strength] = opposite, -given[mechanism.strength]
    values = {}
    least = _LITTLE * max((abs(given[place]) for place in mechanism.indices(Role.STRENGTH)), default=0.0)
    for parameter, value in zip(mechanism.parameters, given, strict=True):
        little = parameter.role is Role.STRENGTH and abs(value) < least
        told = value_in_words(least if little else value, parameter, bench)
        values[parameter.name] = f"less than {told}" if little else told
    order = mechanism.named(Role.ORDER, term.values)
    values["wave"] = "" if order is None else _wave(order, bench)
    values["viscous_speed"] = quantity(bench.axis.physics().viscous_speed, "m/s" if axis.linear else "rad/s")
    told = of_load(text, axis.turns).format(**values, variant=variant.name)
    if not variant.name or not forms or "{variant}" in text or variant.name in told:
        return told
    return f"{told.removesuffix('.')} ({_variant_in_words(variant.name)})."


def _variant_in_words(variant: str) -> str:
    """The name of a variant, with what it says of the measured torque in words."""
    return "; ".join(_SEEN.get(word, word) for word in variant.split()) if variant.split()[0] in _SEEN else variant


def where(location: Location, turns: bool) -> dict[str, str]:
    """Describe a location: aspect (block, element, channels, phases, ...) -> text. `turns`: of a load that turns."""
    phases = [f"{title(phase.kind)} {100.0 * phase.share:.0f} %" for phase in location.phases if phase.share >= 0.005]
    found = {
        "block": title(location.block),
        "element": location.element,
        "channels": ", ".join(map(spoken, location.channels)),
        "phases of motion": ", ".join(phases),
        "windows of the first recording": ", ".join(f"{a:.2f} to {b:.2f} s" for a, b in location.windows_s),
    }
    if location.position_m:
        found["position"] = "{:.1f} to {:.1f} mm".format(*(1e3 * value for value in location.position_m))
    if location.speed_m_s:
        factor, unit = speed_unit(turns)
        found["speed"] = "{:.3g} to {:.3g}".format(*(factor * value for value in location.speed_m_s)) + f" {unit}"
    if location.order_per_rev:
        found["repetition"] = f"{digits(location.order_per_rev)} times per revolution of the screw"
    elif location.period_m:
        found["repetition"] = f"every {quantity(location.period_m, 'm')} of travel"
    elif location.frequency_hz:
        found["repetition"] = f"{digits(location.frequency_hz)} Hz"
    return {what: of_load(text, turns) for what, text in found.items() if text}


def where_in_short(location: Location, turns: bool) -> str:
    """Describe block, phases, ranges and repetition of a location in one clause."""
    wanted = ("block", "phases of motion", "position", "speed", "repetition")
    return ", ".join(f"{what} {text}" for what, text in where(location, turns).items() if what in wanted)
