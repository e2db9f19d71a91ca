"""Map file: which column of a foreign recording is which channel; `hil.importing.by_map` applies it.

    value [SI] = sign x scale x factor(unit) x column + offset

A map is a YAML file, such as the shipped `hil/maps/emps.yaml`.
"""

from math import isclose, pi
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, model_validator

from hil.channels import AXIS_CHANNELS, CHANNELS, AxisChannels, AxisKind
from hil.errors import FieldError
from hil.files.date_stamps import DAY_S
from hil.quantities import ROTARY_LEAD_M, UNITS, si_factor, units_of

SECONDS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "100 ns": 1e-7,
    "ns": 1e-9,
    "min": 60.0,
    "d": DAY_S,
    "date": 1.0,
}  # of a unit of time
# units that need a constant, and the fields that may give it
_CONSTANTS = {
    "counts": ("counts_per_rev", "counts_per_m"),
    "A": ("torque_constant_n_m_a", "force_constant_n_a"),
    "%": ("rated",),
    "permille": ("rated",),
    "V": ("gain",),
    "counts/s": ("counts_per_rev", "counts_per_m"),
}

_OF_LENGTHS = (
    " (angle and length convert if lead_m is given; the channels of a linear motor are motor_position_m and force_n)"
)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SeriesColumns(_Strict):
    """The columns of a table with one value in each row. A channel has the texts of `names`, joined by points."""

    time: str = Field(description="column of the stamps")
    names: tuple[str, ...] = Field(min_length=1, description="columns whose texts name the channel")
    value: str = Field(description="column of the values")
    unit: str | None = Field(default=None, description="column of the units of the values")
    quality: str | None = Field(default=None, description="column of their quality: bad values are left out")

    @property
    def columns(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(name for name in (self.time, *self.names, self.value, self.unit, self.quality) if name)


class CsvOptions(_Strict):
    """Format of a CSV file."""

    delimiter: str = Field(default=",", min_length=1, max_length=1, description="between the fields")
    decimal_point: Literal[".", ","] = Field(default=".", description="of the numbers")
    thousands: Literal["", ".", ",", "'", " "] = Field(default="", description="mark between thousands")
    skip_lines: int = Field(default=0, ge=0, le=1_000_000, description="lines above the header")
    skip_rows: int = Field(
        default=0, ge=0, le=1_000_000, description="rows between header and numbers, such as one of units"
    )
    column_names: tuple[str, ...] | None = Field(default=None, description="names for a file without a header")
    encoding: str = Field(default="utf-8", description="of the text")
    series: SeriesColumns | None = Field(default=None, description="columns of rows of one value each")
    only: dict[str, Annotated[str, Field(coerce_numbers_to_str=True)]] = Field(
        default={}, description="rows to take, as of one joint or state: column -> its text in them"
    )


class TimeColumn(_Strict):
    """The column of time stamps."""

    column: str = Field(description="name in the file")
    unit: Literal["s", "ms", "us", "100 ns", "ns", "min", "d", "date"] = Field(
        description="of the stamps; d: days, date: text such as 2024-03-01 12:00:00.001 or 12:00:00.001"
    )
    scale: PositiveFloat = Field(default=1.0, description="factor beside the unit")
    wraps_at: PositiveFloat | None = Field(
        default=None, description="range of a counter that starts again, in the unit of the column"
    )
    fraction: Self | None = Field(default=None, description="column of the part of a second, added to this one")

    @property
    def seconds(self) -> float:
        """Seconds for 1 in the column."""
        return self.scale * SECONDS[self.unit]


class ChannelSource(_Strict):
    """Source of a channel. NAME[i] is column i (from 0) of the matrix NAME in a .mat file."""

    column: str = Field(description="name in the file")
    unit: str = Field(description="of the column, such as mm, deg, rpm, counts, A, V")
    scale: float = Field(default=1.0, description="factor beside the unit")
    offset: float = Field(default=0.0, description="added after scaling, in the SI unit of the channel")
    wraps_at: PositiveFloat | None = Field(
        default=None, description="range of a counter or angle that starts again, in the unit of the column"
    )
    empty: Literal["missing", "hold"] = Field(
        default="missing", description="an empty cell: no value, or hold the last one, of a column written on change"
    )
    time: TimeColumn | None = Field(
        default=None, description="stamps of this channel, if it has its own: it is interpolated to those of the file"
    )
    sign: Literal[1, -1] = Field(default=1, description="-1 if the column is positive the other way")
    counts_per_rev: PositiveFloat | None = Field(
        default=None, description="counts of a rotary encoder, for the units counts and counts/s [1/rev]"
    )
    counts_per_m: PositiveFloat | None = Field(
        default=None, description="counts of a linear encoder, for the units counts and counts/s [1/m]"
    )
    torque_constant_n_m_a: PositiveFloat | None = Field(
        default=None, description="torque per current, for the unit A [N m/A]"
    )
    force_constant_n_a: PositiveFloat | None = Field(
        default=None, description="force per current, for the unit A [N/A]"
    )
    rated: PositiveFloat | None = Field(default=None, description="value in SI at 100 %, for the units % and permille")
    gain: float | str | None = Field(
        default=None, description="unit V: SI unit per volt, a number or the name of a scalar in a .mat file"
    )

    @model_validator(mode="after")
    def _has_the_constant_of_its_unit(self) -> Self:
        wanted = _CONSTANTS.get(self.unit, ())
        for fields in _CONSTANTS.values():
            for field in fields:
                if getattr(self, field) is not None and field not in wanted:
                    raise FieldError(
                        (field,), f"is of no use for the unit {self.unit!r}; remove it or correct the unit"
                    )
        if wanted and sum(getattr(self, field) is not None for field in wanted) != 1:
            raise FieldError(("unit",), f"{self.unit!r} needs exactly one of {', '.join(wanted)}; add it")
        return self

    @property
    def turns(self) -> bool:
        """True if the column is an angle."""
        return self.counts_per_rev is not None or UNITS.get(self.unit, ("",))[0] == "rad"

    @property
    def constant_of_one(self) -> str | None:
        """Name of a torque or force constant that is 1, which stands for an unknown one; None without such."""
        efforts = [field for unit, fields in _CONSTANTS.items() if not unit.startswith("counts") for field in fields]
        return next((field for field in efforts if getattr(self, field) == 1.0), None)

    def factor_to(self, si: str, lead_m: float | None, gain: float = 1.0) -> float | None:
        """Factor from the column to the SI unit `si`, with sign and scale; None if the unit does not convert.

        `gain` is the value of a gain that is given by name.
        """
        own, constant, per_s = self.unit, 1.0, "/s" if self.unit == "counts/s" else ""
        if self.counts_per_rev is not None:
            own, constant = f"rad{per_s}", 2 * pi / self.counts_per_rev
        elif self.counts_per_m is not None:
            own, constant = f"m{per_s}", 1 / self.counts_per_m
        elif self.torque_constant_n_m_a is not None:
            own, constant = "N m", self.torque_constant_n_m_a
        elif self.force_constant_n_a is not None:
            own, constant = "N", self.force_constant_n_a
        elif self.rated is not None:
            own, constant = si, self.rated * (1e-2 if self.unit == "%" else 1e-3)
        elif self.gain is not None:
            own, constant = si, gain if isinstance(self.gain, str) else self.gain
        factor = si_factor(own, si, lead_m)
        return None if factor is None else self.sign * self.scale * constant * factor


class NominalValues(_Strict):
    """Values that the owner gives for the parts of an axis. A recording shows only the sum of the masses."""

    load_mass_kg: PositiveFloat | None = Field(default=None, description="of a load that slides [kg]")
    load_inertia_kg_m2: PositiveFloat | None = Field(
        default=None, description="of a load that turns, about its own shaft [kg m^2]"
    )
    motor_inertia_kg_m2: PositiveFloat | None = Field(
        default=None, description="of the motor and what turns with it, without the load [kg m^2]"
    )
    stiffness_n_m: PositiveFloat | None = Field(
        default=None, description="of the transmission, at a load that slides [N/m]"
    )
    stiffness_n_m_rad: PositiveFloat | None = Field(
        default=None, description="of the transmission, at a load that turns [N m/rad]"
    )


class RecordingMap(_Strict):
    """A map: the clock (a time column or a sample rate) and the source of each channel."""

    about: str = Field(description="what is imported and where it comes from")
    time: TimeColumn | None = Field(default=None, description="column of time stamps")
    sample_rate_hz: PositiveFloat | None = Field(default=None, description="instead of a column of time stamps")
    resample_hz: PositiveFloat | None = Field(
        default=None, description="rate to which stamps with uneven steps are interpolated"
    )
    rows_per_sample: float | None = Field(
        default=None, gt=1.0, description="of a logger that ran faster than the loop: each sample is kept once"
    )
    missing: Literal["refuse", "leave_out"] = Field(
        default="refuse",
        description="rows without a value, up to 5 % of the file, and those of a slower channel: refuse, or leave out",
    )
    csv: CsvOptions = Field(default=CsvOptions(), description="how a CSV file is written")
    lead_m: PositiveFloat | None = Field(default=None, description="lead of the screw, to convert angle and length")
    nominal: NominalValues = Field(
        default=NominalValues(),
        description="masses of the parts of the axis, which split the one that is found, and its stiffness to compare",
    )
    channels: dict[str, ChannelSource] = Field(description="channel name -> where it comes from")

    @property
    def travel_per_turn_m(self) -> float | None:
        """Lead [m]; of a load that turns 2 pi, one metre for one radian. None: not told.

        A load turns whose encoder tells an angle, or whose set-points and motor do where no lead is given.
        """
        names = (self.axis.table_position, self.axis.motor_position, "position_command_m")
        table, motor, command = (name in self.channels and self.channels[name].turns for name in names)
        return ROTARY_LEAD_M if table or (motor and command and self.lead_m is None) else self.lead_m

    @property
    def axis(self) -> AxisChannels:
        """Names of the channels of this kind of axis."""
        return AXIS_CHANNELS[AxisKind.of(self.channels)]

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if (self.time is None) == (self.sample_rate_hz is None):
            raise FieldError(
                ("time",),
                "given neither or both of time and sample_rate_hz, allowed one; "
                "name the column of time stamps, or the rate if there is none",
            )
        lead_m = self.travel_per_turn_m
        if self.lead_m is not None and lead_m is not None and not isclose(self.lead_m, lead_m, rel_tol=1e-3):
            raise FieldError(
                ("lead_m",),
                f"given {self.lead_m:g} beside {self.axis.table_position} as an angle, allowed none: a load that "
                "turns has no lead, its gear ratio is found from the encoders; remove it",
            )
        for name, source in self.channels.items():
            if name not in CHANNELS or name == "time_s":
                known = ", ".join(channel for channel in CHANNELS if channel != "time_s")
                turns = name.removesuffix("_rad") + "_m"
                like = f"; of a load that turns {turns} with the unit rad or deg" if turns in CHANNELS else ""
                raise FieldError(("channels", name), f"is no channel, allowed {known}{like}; correct the name")
            si = CHANNELS[name].unit
            if source.factor_to(si, lead_m) is None:
                allowed = [*units_of(si, lead_m), *_CONSTANTS]
                lead = "" if lead_m else _OF_LENGTHS
                raise FieldError(
                    ("channels", name, "unit"),
                    f"given {source.unit!r}, allowed {', '.join(allowed)}{lead}; correct the unit",
                )
        axis = self.axis
        if not {axis.motor_position, axis.motor_velocity} & set(self.channels):
            raise FieldError(
                ("channels",),
                f"{axis.motor_position} is missing, and {axis.motor_velocity} too (motor_position_m, "
                "motor_velocity_m_s on a linear axis); add one",
            )
        if not {axis.torque, axis.torque_command, axis.table_position} & set(self.channels):
            raise FieldError(
                ("channels",),
                f"{axis.torque} and {axis.torque_command} are missing; add one, or {axis.table_position} to tell the "
                "transmission alone",
            )
        return self
