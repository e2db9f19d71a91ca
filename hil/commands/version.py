"""hil --version: the release, and the commit where one is known."""

import json
import os
import subprocess
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from hil import __version__

_ROOT = Path(__file__).parents[2]  # the repository, or site-packages


def version_line() -> str:
    """Release; of a repository also its state as git describes it, of an installation from git its commit."""
    state = _described() if (_ROOT / ".git").exists() else _installed_commit()
    return f"hil-servo {__version__}" + (f" ({state})" if state else "")


def _described() -> str:
    """Nearest tag, commits since, commit, and whether files were changed; empty without git."""
    command = ["git", "-C", str(_ROOT), "describe", "--tags", "--always", "--dirty=, changed"]
    quick = os.environ | {"GIT_OPTIONAL_LOCKS": "0"}
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, env=quick).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def _installed_commit() -> str:
    """The commit that pip installed from git (PEP 610); empty for a wheel from elsewhere."""
    try:
        origin = json.loads(distribution("hil-servo").read_text("direct_url.json") or "{}")
    except PackageNotFoundError:
        return ""
    return str(origin.get("vcs_info", {}).get("commit_id", ""))[:12]
