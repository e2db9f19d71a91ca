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
    """Return the file of a shipped name, or the path as it is given. Raises InputError for what is neither."""
    path, shipped = Path(source), shipped_files(kind)
    if str(source) in shipped:
        return shipped[str(source)]
    longest = 255  # bytes of a name (Linux, NAME_MAX): the reader of a longer one tells that
    if path.suffix not in (".yaml", ".yml") and len(path.name.encode()) <= longest and not is_file(path):
        raise InputError(f"{source}: no such {kind}; give a .yaml file or one of {', '.join(shipped)}")
    return path
