"""Folders and files of results, written completely or not at all, and never into a folder in use."""

import json
import math
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import InputError


def default_folder(what: str) -> Path:
    """runs/WHAT-DATE-TIME, for results without a given folder; of WHAT only letters, digits, points, - and _."""
    plain = re.sub(r"[^\w.-]+", "_", what)[:80]
    return Path("runs") / f"{plain}-{datetime.now():%Y%m%d-%H%M%S}"


def refuse_used(folder: Path) -> None:
    """Raise InputError where `folder` holds something already."""
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise InputError(
            f"{folder}: exists and is not empty; old and new results would mix: give another --out, or remove it"
        )


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """A folder to fill, which becomes `folder` when the block ends without an exception, else vanishes.

    Raises InputError where `folder` holds something already, is the working folder, or cannot be made.
    """
    if not folder.name:
        raise InputError(f"{folder}: given the working folder or the root, allowed a new folder; name one as --out")
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    try:
        refuse_used(folder)
        made = [parent for parent in folder.parents if not parent.exists()]
        part.mkdir(parents=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror}); give a folder with rights as --out") from None
    try:
        yield part
        if folder.is_dir():
            folder.rmdir()
        part.rename(folder)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        for parent in made:
            with suppress(OSError):  # another process may have written there
                parent.rmdir()
        raise


@contextmanager
def rewritten_folder(folder: Path, mark: str) -> Iterator[Path]:
    """A folder to fill, which takes the place of `folder` when the block ends without an exception.

    Raises InputError where `folder` holds something without the file `mark` of an earlier time.
    """
    if folder.is_dir() and not (folder / mark).is_file():
        refuse_used(folder)
    part, old = (folder.with_name(f".{folder.name}.{os.getpid()}.{end}") for end in ("new", "old"))
    try:
        with new_folder(part) as filled:
            yield filled
        if folder.is_dir():
            folder.rename(old)
        part.rename(folder)
    finally:
        if old.is_dir() and not folder.is_dir():  # interrupted between both
            old.rename(folder)
        for rest in (part, old):
            shutil.rmtree(rest, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write a file through a temporary one beside it. Raises InputError where it cannot be written."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); choose a folder with rights and space"
        ) from None
    finally:
        part.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Write numbers, text, lists and mappings as JSON.

    Raises ValueError at NaN or infinity, naming the place: such a value is no result.
    """
    write_text(path, json.dumps(_plain(data, "$"), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _plain(value: Any, place: str) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item, f"{place}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, f"{place}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), place)
    if isinstance(value, Enum):
        return _plain(value.value, place)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{place}: must be a finite number, got {value}")
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"{place}: must be a number, text, list or mapping, got {type(value).__name__}")
