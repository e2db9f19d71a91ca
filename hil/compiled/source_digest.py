"""Digest of the sources that a compiled kernel inlines: numba's cache sees only the file that a kernel stands in."""

import hashlib
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_TWIN = ("compiled", "control", "twin")
_added: list[Path] = []


def add_source(path: Path) -> None:
    """Count a file outside the package among the sources."""
    _added.append(path)


def source_digest(*more: str) -> str:
    """SHA-256 of the sources of the twin and the control law, and of `more` folders or files of the package."""
    digest = hashlib.sha256()
    for name in (*_TWIN, *more):
        place = _PACKAGE / name
        for path in sorted(place.rglob("*.py")) if place.is_dir() else (place,):
            digest.update(path.read_bytes())
    for path in _added:
        digest.update(path.read_bytes())
    return digest.hexdigest()
