"""The words of `lexicon.yaml` in five languages: names of columns, units and header constants. Read at first use."""

import re
import unicodedata
from enum import StrEnum
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, PositiveFloat, model_validator

from hil.errors import FieldError
from hil.files.yaml_model import load_model
from hil.quantities import UNITS

LEXICON = Path(__file__).with_name("lexicon.yaml")
UNITS_BY_CONSTANT = (
    "counts",
    "counts/s",
    "A",
    "mA",
    "V",
    "mV",
    "%",
    "permille",
)  # units that become SI by a constant of the axis
_LANGUAGE = re.compile("all|[a-z]{2}")


class Quantity(StrEnum):
    """Physical quantity of a column. OTHER is known, but no channel: errors, temperatures, states."""

    TIME = "time"
    POSITION = "position"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    EFFORT = "effort"  # force, torque, current or voltage
    OTHER = "other"
    UNKNOWN = "unknown"


class RowKind(StrEnum):
    """Kind of a row above the numbers: by a word before its fields, else by the fields (TEXT, UNKNOWN)."""

    NAMES = "names"
    UNITS = "units"
    TYPES = "types"
    SCALE = "scale"
    OFFSET = "offset"
    PERIOD = "period"
    TEXT = "text"
    UNKNOWN = "unknown"


class Constant(StrEnum):
    """Constant that a file may give beside its columns."""

    PERIOD = "period"  # [s], of the rows
    RATE = "rate"  # [Hz], of the rows
    TORQUE = "torque_constant"  # [N m/A]
    FORCE = "force_constant"  # [N/A]
    TORQUE_GAIN = "torque_gain"  # [N m/V], of an output of a controller or a drive
    FORCE_GAIN = "force_gain"  # [N/V]
    LEAD = "lead"  # [m]
    COUNTS = "counts_per_rev"
    COUNTS_PER_M = "counts_per_m"
    RATED_TORQUE = "rated_torque"  # [N m]
    RATED_FORCE = "rated_force"  # [N]
    RATED_CURRENT = "rated_current"  # [A]
    LOAD_MASS = "load_mass_kg"  # of a load that slides
    LOAD_INERTIA = "load_inertia_kg_m2"  # of a load that turns, at the load
    MOTOR_INERTIA = "motor_inertia_kg_m2"  # of the motor and what turns with it, without its load
    STIFFNESS = "stiffness_n_m"  # of the transmission, at a load that slides
    TORSION = "stiffness_n_m_rad"  # at a load that turns


# Told in sentences, see `nominal_values`.
NOMINAL = (
    Constant.LOAD_MASS, Constant.LOAD_INERTIA, Constant.MOTOR_INERTIA, Constant.STIFFNESS, Constant.TORSION,
)  # fmt: skip


def _lines(given: object) -> list[str]:
    """The lines of all languages."""
    lines: dict[str, Any] = given if isinstance(given, dict) else {"all": given}
    for language, line in lines.items():
        if not _LANGUAGE.fullmatch(language) or not isinstance(line, str):
            raise ValueError(f"given {language}: {line!r}, allowed lines LANGUAGE: WORDS, such as de: weg hub")
    return list(lines.values())


def _words(given: object) -> tuple[str, ...]:
    return tuple(word for line in _lines(given) for word in line.split())


def _pattern(given: object) -> str:
    pattern = "|".join(_lines(given))
    try:
        re.compile(pattern)
    except re.error as error:
        raise ValueError(f"given {pattern!r}, allowed regular expressions ({error})") from None
    return pattern


Words = Annotated[tuple[str, ...], BeforeValidator(_words)]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ConstantWords(_Entry):
    """Regular expressions of the words of a constant, and factors of its units to SI; `alone` is a whole statement."""

    words: Annotated[str, BeforeValidator(_pattern)]
    units: dict[str, PositiveFloat]
    alone: Annotated[str, BeforeValidator(_pattern)] = "(?!)"


class MassWords(_Entry):
    """Words of what a mass or an inertia is of, and of one that is not of the load, or not of the motor, alone.

    And the words of a stiffness, of one that is not that of the transmission, of parts of it, of which one alone tells
    nothing, and of a limit or a wish.
    """

    load: Words
    motor: Words
    neither: Words
    stiffness: Words
    other_stiffness: Words
    parts: Words
    limits: Words
    mass_units: dict[str, PositiveFloat]
    inertia_units: dict[str, PositiveFloat]
    stiffness_units: dict[str, PositiveFloat]
    torsion_units: dict[str, PositiveFloat]


class ScalarNames(_Entry):
    """Whole names of scalars."""

    rate: Words
    period: Words
    constant: Words


class SeriesWords(_Entry):
    """Words in the names of columns of rows of one value each, and beginnings of the texts of a bad quality."""

    name: Words
    value: Words
    unit: Words
    quality: Words
    bad: Words


class Lexicon(_Entry):
    """The content of `lexicon.yaml`, words of all languages together; the file explains its keys."""

    quantities: dict[Quantity, Words]
    alone: Words
    command: Words
    planned: Words
    stamps: Words
    measured: Words
    motor: Words
    table: Words
    steps: Words
    step_units: Words
    encoder: Words
    linear_scale: Words
    part: Words
    attached_after: Words
    attached_before: Words
    electric: dict[Literal["A", "V"], Words]
    torque: Words
    force: Words
    angle: Words
    angular_speed: Words
    length: Words
    units: dict[str, Words]
    addresses: dict[str, str]
    objects: dict[Literal["permille"], Words]
    after_unit: Words
    of_rated: Words
    constants: dict[Constant, ConstantWords]
    other_constants: Words
    joints: Words
    both: Words
    masses: MassWords
    scalars: ScalarNames
    series: SeriesWords
    enumerated: Words
    missing: Words
    infinite: Words
    rows: dict[RowKind, Annotated[str, BeforeValidator(_pattern)]]
    types: Words

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        for field, given, allowed in (
            ("quantities", self.quantities, set(Quantity) - {Quantity.UNKNOWN}),
            ("constants", self.constants, set(Constant) - set(NOMINAL)),
        ):
            if set(given) != allowed:
                raise FieldError((field,), f"given {', '.join(given)}, needed {', '.join(sorted(allowed))}; correct it")
        for unit in self.units:
            if unit not in UNITS and unit not in UNITS_BY_CONSTANT:
                raise FieldError(("units", unit), "is no unit of a map; correct it")
        spelled = [(plain_spelling(one), unit) for unit, spellings in self.units.items() for one in spellings]
        for spelling, unit in spelled:
            if self.unit_of[spelling] != unit:
                raise FieldError(("units",), f"{spelling!r} stands for two units, allowed one; remove one")
        return self

    @cached_property
    def unit_of(self) -> dict[str, str]:
        """Unit of a map by the `plain_spelling` in files."""
        return {plain_spelling(one): unit for unit, spellings in self.units.items() for one in spellings}


def plain_spelling(unit: str) -> str:
    """Text of a unit in lower case, without blanks, multiplication signs and points, with plain digits."""
    key = unicodedata.normalize("NFKC", unit).strip().lower().replace("μ", "µ")
    return re.sub(r"/se[ck]\b", "/s", re.sub(r"[\s·・*⋅.]+", "", key))


def without_accents(text: str) -> str:
    """Text with plain Latin letters and signs; letters of other scripts stay."""
    plain = unicodedata.normalize("NFKD", text.replace("ß", "ss"))
    return unicodedata.normalize("NFC", "".join(one for one in plain if not "\u0300" <= one < "\u0370"))


@cache
def lexicon() -> Lexicon:
    """The lexicon. Raises InputError with line and field if the file is damaged."""
    return load_model(LEXICON, Lexicon)
