"""Code and libraries that a diagnosis uses: answers of two of them must not mix."""

import hashlib
import platform
from importlib.metadata import version
from pathlib import Path

_PACKAGE = Path(__file__).parents[2]
# Packages that a diagnosis uses, beside the modules at the root.
_ANSWERING = ("bench", "compiled", "control", "diagnosis", "files", "identification", "motion", "recording", "twin")
_LIBRARIES = ("hil-servo", "numpy", "scipy", "numba")


def code_sha256() -> str:
    """Return the SHA-256 of the code that a diagnosis uses."""
    digest = hashlib.sha256()
    packages = (path for part in _ANSWERING for path in (_PACKAGE / part).rglob("*.py"))
    for path in sorted([*_PACKAGE.glob("*.py"), *packages]):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that a diagnosis uses."""
    return {"python": platform.python_version(), **{name: version(name) for name in _LIBRARIES}}
