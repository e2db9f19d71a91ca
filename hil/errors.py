"""Errors of the project; the command line turns each into its message and its exit code, without a trace.

HilError          1   something went wrong that the user can act on
├── StillPowered  3   the drive does not confirm that its power stage is off
├── StoppedByUser 130 ctrl-C or a signal before anything moved
└── InputError    2   a file or an argument is wrong; the message says what, where, what is allowed
    ├── FieldError    the same, at one field of a model whose file is known to the caller only
    ├── RateNeeded    a file without times; the command that reads it takes its rate
    └── PartOfAxis    a file without the position or the torque of the axis; another one may have it
"""

from collections.abc import Iterable
from typing import Self

LONGEST_NAME = 60  # characters of a name of a file in a message
FieldPath = tuple[str | int, ...]


class HilError(Exception):
    """Base of all errors raised on purpose."""

    exit_code = 1


class StillPowered(HilError):
    """The power stage of the drive is on, or may be: nothing this program can send has confirmed that it is off."""

    exit_code = 3


class StoppedByUser(HilError):
    """The user asked for a stop before there was anything to record."""

    exit_code = 130


class InputError(HilError):
    """A file or an argument is wrong."""

    exit_code = 2


class FieldError(InputError, ValueError):
    """A value inside a model is wrong; `field` is its path, such as ("segments", 3, "to_m").

    Raised by validators and planners. It is a ValueError so that pydantic collects it, and
    `hil.files.yaml_model.load_model` puts the file and the line in front.
    """

    def __init__(self, field: FieldPath, message: str) -> None:
        super().__init__(f"{field_name(field)}: {message}" if field else message)
        self.field = field
        self.message = message

    def inside(self, *outer: str | int) -> Self:
        """The same error seen from the model that contains this one."""
        return type(self)((*outer, *self.field), self.message)


class RateNeeded(InputError):
    """The rows of a file have no usable times; `problem` says why, a command that takes a rate names itself."""

    def __init__(self, problem: str, command: str = "hil import FILE") -> None:
        super().__init__(f"{problem}; say the rate of the rows: {command} --rate HZ")
        self.problem = problem


class PartOfAxis(InputError):
    """A file lacks the position or the torque of the axis, which another file of the same run may have."""

    def __init__(self, problem: str) -> None:
        super().__init__(f"{problem}; or, if another file of the same run has it, give both: hil explain FILE FILE")
        self.problem = problem


def listed(names: Iterable[str], most: int = 20) -> str:
    """The first names of a file for a message, each up to `LONGEST_NAME`, and how many there are more."""
    every = [name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..." for name in names]
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + more


def field_name(field: FieldPath) -> str:
    """("segments", 3, "to_m") -> "segments[3].to_m"."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in field)
    return text.removeprefix(".")
