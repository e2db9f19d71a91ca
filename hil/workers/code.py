"""Code and libraries of a process: results of two of them must not mix."""

import hashlib
import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = ("hil-servo", "numpy", "scipy", "numba")


def code_of(packages: Iterable[str]) -> str:
    """Return the SHA-256 of packages of hil, beside the modules at its root."""
    digest = hashlib.sha256()
    paths = (path for part in packages for path in (_PACKAGE / part).rglob("*.py"))
    for path in sorted([*_PACKAGE.glob("*.py"), *paths]):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that results depend on."""
    return {"python": platform.python_version(), **{name: version(name) for name in _LIBRARIES}}
