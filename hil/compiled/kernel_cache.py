"""Cache folder of compiled kernels where numba finds no writable one.

Numba tries the folder NUMBA_CACHE_DIR, then `__pycache__` beside the source, then the user's cache folder, and fails
with all of them read-only, as in a container or a shared installation.
"""

import os
import stat
import tempfile
from pathlib import Path

from hil.errors import HilError

PACKAGE = Path(__file__).parents[1]


def provide_kernel_cache() -> None:
    """Set NUMBA_CACHE_DIR to a folder of this user's under the temporary one if no usual place is writable; before
    numba is imported. Raises HilError if that one is not writable either."""
    user_caches = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    usual = [PACKAGE / "__pycache__", Path(user_caches) / "numba"]
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        usual.insert(0, Path(given))
    if any(_writable(folder) for folder in usual):
        return
    try:
        folder = Path(tempfile.gettempdir()) / f"hil-kernels-{os.getuid()}"
        if not _writable(folder) or not _private(folder):  # kernels are code: other users must not write there
            folder = Path(tempfile.mkdtemp(prefix="hil-kernels-"))
    except OSError:
        raise HilError(
            f"NUMBA_CACHE_DIR: given {given or 'nothing'}; no folder for compiled kernels is writable, "
            f"neither {', '.join(map(str, usual))} nor a temporary one; set it to one that is"
        ) from None
    os.environ["NUMBA_CACHE_DIR"] = str(folder)


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _private(folder: Path) -> bool:
    """Check that a folder is this user's own, no link, and closed to others."""
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
