"""The boundary to files that others wrote: every file is checked before it is opened, and bounded while it is read.

A file is held by two bounds. Its size: what a file holds, and what its compressed parts say that they expand to, is
summed before it is read, and refused above `MOST_VALUES`. Then processor time and memory: functions marked `bounded`
end with a refusal after `LONGEST_S`, or when the process has grown by `MOST_GROWTH`. The second needs Python code in
which it can interrupt; the first holds what libraries do in one call.
"""

import functools
import itertools
import signal
import stat
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from mmap import PAGESIZE
from pathlib import Path
from types import FrameType
from typing import Concatenate, ParamSpec, TextIO, TypeVar

from hil.errors import InputError

MOST_VALUES = 50_000_000  # of 8 bytes: 400 MB, 75 min at 1 kHz with 11 channels
MOST_BYTES = 8 * MOST_VALUES  # of a file; of text this is eight characters for each value
MOST_IN_LINE = 200_000  # characters of a line of text: a thousand columns have 20 000
LONGEST_S = 15.0  # of processor time for one file
MOST_GROWTH = 1_500_000_000  # bytes of memory
WIDE = (b"\xff\xfe", b"\xfe\xff")  # marks at the beginning of UTF-16
_BEGINNING = 4096
_LOOK_S = 0.05  # of processor time between two looks

Given = ParamSpec("Given")
Read = TypeVar("Read")
Name = TypeVar("Name", bound=str | Path)


def check_file(path: Path, allowed: str, most_bytes: int = MOST_BYTES) -> None:
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
    if found.st_size > most_bytes:
        raise InputError(f"{path}: given {found.st_size} bytes, allowed {most_bytes}; give {allowed}")


def first_bytes(path: Path) -> bytes:
    """The beginning of a file, by which its kind is told."""
    with path.open("rb") as file:
        return file.read(_BEGINNING)


def is_text(start: bytes) -> bool:
    """True if a file that begins so is text: UTF-16 with its mark, or hardly a control character."""
    controls = sum(byte < 9 or 13 < byte < 32 for byte in start)
    return start.startswith(WIDE) or (b"\x00" not in start and controls <= len(start) // 50)


def check_values(path: Path, values: int, given: str) -> None:
    """Refuse a file that would become more than `MOST_VALUES` numbers. given: what holds them, such as "3 rows".

    Raises InputError.
    """
    if values > MOST_VALUES:
        raise InputError(
            f"{path}: given {given}, allowed {MOST_VALUES} values together; cut the recording, or record fewer channels"
        )


def inflated(data: bytes, most: int) -> bytes:
    """The first `most` bytes of a zlib stream; none where it is damaged, or is no stream."""
    try:
        return zlib.decompressobj().decompress(data, most)
    except zlib.error:
        return b""


def is_file(path: Path) -> bool:
    """True for a file that is there; False also for a path that cannot be one, such as a name of 300 characters."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def lines_of(path: Path, file: TextIO) -> Iterator[str]:
    """Lines of a text, with their ends. Raises InputError for one of more than `MOST_IN_LINE` characters."""
    for number in itertools.count(1):
        line = file.readline(MOST_IN_LINE)
        if len(line) == MOST_IN_LINE:
            raise InputError(
                f"{path}:{number}: given a line of {MOST_IN_LINE} characters or more, allowed less; give a file with a "
                "row of numbers in each line"
            )
        if not line:
            return
        yield line


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
        text = "" if isinstance(error, LookupError) else str(error)  # a key or number that says nothing to the reader
        text = (text or type(error).__name__).splitlines()[0]
        raise InputError(f"{path}: is no readable {what} ({text}); {advice}") from None


def bounded(read: Callable[Concatenate[Name, Given], Read]) -> Callable[Concatenate[Name, Given], Read]:
    """Mark a function that reads the file of its first argument: it ends with InputError above time or memory.

    It looks at both in a timer of processor time, which only the main thread of a process has, and Windows does not
    have; inside another marked function the outer one looks. Libraries that catch all exceptions are interrupted again
    at the next look.
    """

    @functools.wraps(read)
    def within(path: Name, /, *args: Given.args, **kwargs: Given.kwargs) -> Read:
        timed = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
        if not timed or any(signal.getitimer(signal.ITIMER_VIRTUAL)):
            return read(path, *args, **kwargs)
        start_s, start_bytes, exceeded = time.process_time(), _resident(), ""

        def look(number: int, frame: FrameType | None) -> None:
            nonlocal exceeded
            if time.process_time() - start_s > LONGEST_S:
                exceeded = f"takes more than {LONGEST_S:g} s of processor time"
            elif _resident() - start_bytes > MOST_GROWTH:
                exceeded = f"takes more than {MOST_GROWTH / 1e9:g} GB of memory"
            if exceeded:
                raise _Exceeded

        before = signal.signal(signal.SIGVTALRM, look)
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, _LOOK_S, _LOOK_S)
            try:
                return read(path, *args, **kwargs)
            finally:
                signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        except MemoryError:
            exceeded = exceeded or "takes more memory than there is"
        except RecursionError:
            exceeded = exceeded or "is nested too deeply"
        except BaseException:  # a library may turn the interruption into an error of its own
            if not exceeded:
                raise
        finally:
            signal.signal(signal.SIGVTALRM, before)
        raise InputError(f"{path}: {exceeded} to be read; it is damaged, or too long: cut it into shorter files")

    return within


class _Exceeded(BaseException):
    """A bound is exceeded; no `except Exception` catches it."""


def _resident() -> int:
    """Memory of this process [bytes]; 0 where the system does not tell, as macOS."""
    with suppress(FileNotFoundError), open("/proc/self/statm", "rb") as file:
        return int(file.read().split()[1]) * PAGESIZE
    return 0
