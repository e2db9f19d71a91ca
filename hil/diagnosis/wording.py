"""Texts for mechanisms, terms and locations."""

from collections.abc import Iterable, Sequence

from hil.bench.bench_file import Bench
from hil.channels import AXIS_CHANNELS
from hil.diagnosis.result import Finding, Location
from hil.diagnosis.turning import of_load, speed_unit
from hil.identification.measured import Measured
from hil.identification.terms import Term
from hil.quantities import digits, known_quantity, quantity, reading_unit, unit_of
from hil.twin.library import BY_ID
from hil.twin.parameter import Parameter, Role

FIRST_PART, MIDDLE_PART, LAST_PART = "first part", "middle part", "last part"  # of a recording; one is held out
HELD_OUT_NOTE = "No held-out recording was given:"


def whole_name(name: str) -> str:
    """Name of the recording of which one with this name may be a part."""
    return name.removesuffix(f" ({part})") if (part := part_of(name)) else name


def part_of(name: str) -> str:
    """The part of a recording that has this name; empty for a whole one."""
    return next((part for part in (FIRST_PART, MIDDLE_PART, LAST_PART) if name.endswith(f" ({part})")), "")


def title(effect: str) -> str:
    """Replace the underscores of an id by spaces: "constant_load" -> "constant load"."""
    return effect.replace("_", " ")


def titles(effects: Iterable[str]) -> str:
    """List ids in words, separated by commas."""
    return ", ".join(map(title, effects))


def spoken(channel: str) -> str:
    """Name of a channel or a parameter in words, without its unit: "motor_position_rad" -> "motor position"."""
    ending = unit_of(channel).replace("^", "").replace("/", "_").replace(" ", "_").lower()
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
    which = mechanism.forms[term.variant] if order is None else wave(order, bench)
    return f"{title(term.effect)}, {which}"


def wave(order: float, bench: Bench, error: float = 0.0) -> str:
    """How often an effect repeats: per revolution, or along the travel where no revolution is known."""
    if bench.axis.physics().turn_known and order < 1.0:  # of a pulley or wheel behind the motor
        return f"once in {known_quantity(1.0 / order, error / order**2, '')} revolutions"
    if bench.axis.physics().turn_known:
        return f"{known_quantity(order, error, '1/rev')} times per revolution"
    return f"every {known_quantity(1.0 / order, error / order**2, 'm')} of travel"


def spoken_key(key: str) -> str:
    """A key of corrections in words: "constant_load.load_torque_n_m" -> "constant load: load torque".

    That of an axis stays as the bench file has it.
    """
    effect, _, name = key.rpartition(".")
    return f"{title(effect)}: {parameter_of(effect, name).spoken}" if effect in BY_ID else key


def parameter_of(effect: str, name: str) -> Parameter:
    """The parameter of a mechanism by its name."""
    return next(one for one in BY_ID[effect].parameters if one.name == name)


def unit_in(bench: Bench, parameter: Parameter) -> str:
    """SI unit of a parameter of a mechanism on the axis of a bench."""
    if parameter.role is Role.ORDER and not bench.axis.physics().turn_known:
        return "1/m"
    return parameter.dimension.unit(bench.axis.drive_unit, bench.axis.turns)


def value_in_words(value: float, parameter: Parameter, bench: Bench, error: float = 0.0) -> str:
    """Value of a parameter with its unit, rounded by its standard error where this is given.

    Edges of windows are told to a hundredth of a second, early and late ones alike.
    """
    if parameter.role is Role.EDGE:
        return f"{value:.2f} s"
    return known_quantity(value, error, unit_in(bench, parameter))


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
        factor, unit = reading_unit("rad" if turns else "m", max(map(abs, location.position_m)))
        found["position"] = " to ".join(digits(factor * value, 4) for value in location.position_m) + f" {unit}"
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
