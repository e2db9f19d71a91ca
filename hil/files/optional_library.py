"""Libraries of single file formats, which the base install does not have: imported where a file asks for one."""

from importlib import import_module
from pathlib import Path
from typing import Any

from hil.errors import InputError


def optional_library(path: Path, module: str, library: str, extra: str) -> Any:
    """Import `module` of `library`. Raises InputError where it is not installed, with the command that installs it."""
    try:
        return import_module(module)
    except ImportError:
        raise InputError(
            f"{path}: {path.suffix} files are read and written by {library}, which is not installed; install it: "
            f"pip install 'hil-servo[{extra}]'"
        ) from None
