"""Cache folder of compiled kernels, one for each state of their sources.

Numba compares a cached kernel with the file that it stands in, not with the functions from other files that are
compiled into it, and it unpickles the types of the arguments before it compares. So the folder has a digest of all
these sources in its name: a kernel of other sources is in another folder and never read.
"""

import hashlib
import os
import re
import shutil
import stat
import sys
from contextlib import suppress
from pathlib import Path

from hil.errors import HilError

PACKAGE = Path(__file__).parents[1]
# All that is compiled or gives a kernel its types and constants; a test compares it with the imports of numba.
_MODULES = ("checks", "columns", "cycle", "limits", "sign_check", "virtual")
_OF_THE_LOOP = tuple(f"hil/loop/{name}.py" for name in _MODULES)
_OF_THE_SEARCH = "hil/diagnosis/search/change_points.py"
SOURCES = ("hil/compiled", "hil/control", "hil/twin", *_OF_THE_LOOP, _OF_THE_SEARCH, "drivers/sim")
# Versions and worktrees that share NUMBA_CACHE_DIR or the user's cache; a folder takes some 10 MB.
KEPT = 8
_KEYED = re.compile(r"hil-kernels-[0-9a-f]{16}")
_added: set[Path] = set()


def provide_kernel_cache(source: Path | None = None) -> Path:
    """Let numba keep kernels in the folder of these sources; returns it. Call it before kernels are imported.

    The folder is made in the first place that is writable: NUMBA_CACHE_DIR, `__pycache__` of the package, the user's
    cache, a private folder under the temporary one. source: a file outside the package that is compiled too. Raises
    HilError if no place is writable, as can be in a container.
    """
    if source is not None:
        _added.add(source)
    name = f"hil-kernels-{source_digest()[:16]}"
    folder = _first_writable(name)
    os.environ["NUMBA_CACHE_DIR"] = str(folder)  # also for the processes that this one starts
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    return folder


def source_digest() -> str:
    """SHA-256 of the sources of all compiled kernels."""
    digest, root = hashlib.sha256(), PACKAGE.parent
    places = [root / source for source in SOURCES]
    files = [file for place in places for file in (sorted(place.rglob("*.py")) if place.is_dir() else [place])]
    for file in (*files, *sorted(_added)):
        digest.update(str(file.relative_to(root) if file in files else file).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _first_writable(name: str) -> Path:
    installed = PACKAGE / "__pycache__"
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "numba"
    usual = [installed, user]
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        own = Path(given)  # set by this function, here or in the process that started this one
        usual.insert(0, own.parent if _KEYED.fullmatch(own.name) else own)
    for place in usual:
        if _writable(place / name, installed / name):
            return place / name
    import tempfile

    try:
        place = Path(tempfile.gettempdir()) / f"hil-kernels-{os.getuid()}"
        with suppress(FileExistsError):
            place.mkdir(mode=0o700)
        if not _private(place):  # kernels are code: other users must not write there
            place = Path(tempfile.mkdtemp(prefix="hil-kernels-"))
        if _writable(place / name, installed / name):
            return place / name
    except OSError:
        pass
    raise HilError(
        f"NUMBA_CACHE_DIR: given {given or 'nothing'}; no folder for compiled kernels is writable, "
        f"neither {', '.join(map(str, usual))} nor a temporary one; set it to one that is"
    )


def _writable(folder: Path, installed: Path) -> bool:
    """Make the folder if it is not there, with the kernels that were compiled when the package was installed."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if not folder.exists():
            part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
            part.mkdir()
            with suppress(OSError):  # none there, or one that another process compiles just now
                shutil.copytree(installed, part, dirs_exist_ok=True)
            with suppress(OSError):  # another process was first
                part.rename(folder)
            shutil.rmtree(part, ignore_errors=True)
            _remove_old(folder.parent)
        os.utime(folder)  # in use
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def _remove_old(place: Path) -> None:
    """Remove the folders of other sources but for the last used; numba compiles again what is missing."""
    found = [folder for folder in place.iterdir() if _KEYED.fullmatch(folder.name)]
    for folder in sorted(found, key=lambda folder: -folder.stat().st_mtime)[KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)


def _private(folder: Path) -> bool:
    """Check that a folder is this user's own, no link, and closed to others."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
