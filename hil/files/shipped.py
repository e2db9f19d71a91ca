"""Benches, profiles and maps that come with the package, by their short names."""

from pathlib import Path
from typing import Literal

from hil.errors import InputError
from hil.files.input_file import is_file

Shipped = Literal["bench", "profile", "map"]
# folders of the package; `profiles` is a link to the folder of the repository, whose files the wheel holds
_FOLDERS: dict[Shipped, str] = {"bench": "benches", "profile": "profiles", "map": "maps"}


def shipped_files(kind: Shipped) -> dict[str, Path]:
    """Short name -> file of all that are shipped."""
    folder = Path(__file__).parents[1] / _FOLDERS[kind]
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def given_or_shipped(source: str | Path, kind: Shipped) -> Path:
    """Return the path as it is given, or the file of a shipped name. Raises InputError for an unknown name."""
    path = Path(source)
    if path.suffix in (".yaml", ".yml") or is_file(path):
        return path
    shipped = shipped_files(kind)
    if str(source) not in shipped:
        raise InputError(f"{source}: no such {kind}; give a .yaml file or one of {', '.join(shipped)}")
    return shipped[str(source)]
