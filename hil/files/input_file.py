"""The boundary to files that others wrote: what may be opened, and what a library that parses them may raise."""

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.errors import InputError


def check_file(path: Path, allowed: str, most_bytes: int | None = None) -> None:
    """Refuse what is no regular file, before it is opened: reading a pipe or a device may never end.

    allowed: what to give instead. Raises InputError, also for a file of more than `most_bytes`.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; give {allowed}") from None
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}); give {allowed}") from None
    if not stat.S_ISREG(found.st_mode):
        kind = "Is a directory" if stat.S_ISDIR(found.st_mode) else "a pipe or device"
        raise InputError(f"{path}: is no regular file ({kind}); give {allowed}")
    if most_bytes is not None and found.st_size > most_bytes:
        raise InputError(f"{path}: given {found.st_size} bytes, allowed {most_bytes}; give {allowed}")


@contextmanager
def parsing(path: Path, what: str, advice: str = "it is cut or damaged") -> Iterator[None]:
    """Around calls of a library that parses a file: libraries raise errors of many kinds for a damaged one.

    Raises InputError for any of them.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        text = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{path}: is no readable {what} ({text}); {advice}") from None
