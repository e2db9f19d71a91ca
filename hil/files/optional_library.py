"""Libraries that the base install does not have: imported where a file or a command asks for one."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hil.errors import InputError

# extra -> libraries that its commands import
EXTRAS = {
    "report": ("matplotlib", "bokeh"),
    "scope": ("starlette", "uvicorn", "websockets"),
    "fleet": ("distributed", "fsspec"),
}
_OF_LINUX = ("fcntl", "resource", "tty")  # modules of Python that Windows does not have


def optional_library(path: Path, module: str, library: str, extra: str) -> Any:
    """Import `module` of `library`. Raises InputError where it is not installed, with the command that installs it."""
    try:
        return import_module(module)
    except ImportError:
        raise InputError(
            f"{path}: {path.suffix} files are read and written by {library}, which is not installed; install it: "
            f"{pip_install(extra)}"
        ) from None


def missing_of(extra: str) -> list[str]:
    """The libraries of an extra that are not installed."""
    return [library for library in EXTRAS[extra] if find_spec(library) is None]


def page_line(page: Path) -> str:
    """Say where a page is, or what to install to get one."""
    if missing := missing_of("report"):
        return f"No page and no pictures: they need {' and '.join(missing)}: {pip_install('report')}"
    return f"Report: {page}"


def how_to_install(error: ModuleNotFoundError) -> str:
    """Say which extra, or system, has the module that an import did not find; empty for any other module."""
    library = (error.name or "").partition(".")[0]
    if library in _OF_LINUX:
        return f"this command needs Linux: this system has no {library}"
    extra = next((extra for extra, libraries in EXTRAS.items() if library in libraries), None)
    return f"this command needs {library}, which is not installed: {pip_install(extra)}" if extra else ""


def pip_install(extra: str) -> str:
    """The command that installs an extra."""
    return f"pip install 'hil-servo[{extra}]'"
