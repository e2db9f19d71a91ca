"""Seal the truth: it is written and fixed by its SHA-256 before any diagnosis starts.

    DIR/cases/NAME/          recordings and bench: the input of the diagnosis
    DIR/sealed/truths.json   concealed effects of each case, and the SHA-256 of each of its files
    DIR/seal.json            SHA-256 of truths.json, with command, seed and code

Files are sealed, not seeds: the linear algebra of another machine may change the last digits of a case.
"""

import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.report.console import Progress
from hil.validation.proof.code import code_sha256
from hil.validation.proof.draw.generator import Truth, draw, write
from hil.validation.proof.draw.mujoco_plant import draw_mujoco
from hil.validation.proof.draw.plan import Planned
from hil.workers.code import versions
from hil.workers.pool import side_by_side

CASES, SEALED, SEAL = "cases", "sealed", "seal.json"
_TRUTHS = f"{SEALED}/truths.json"
_PACKAGE = Path(__file__).parents[2]


def draw_cases(
    folder: Path, planned: Sequence[Planned], seed: int, jobs: int, progress: Progress, plant: str = "simulated"
) -> None:
    """Draw and write cases of a plant, several at once; those that exist are kept.

    Raises InputError if `folder` holds cases of another plan.
    """
    todo = []
    for case in planned:
        part = _part(folder, case.name)
        if not part.exists():
            todo.append(case)
            continue
        truth = json.loads(part.read_text())["truth"]
        if (truth["tier"], truth["number"], truth["seed"]) != (case.tier, case.number, seed):
            raise InputError(
                f"{part}: given a case of another plan, allowed one of --seed {seed} and as many --cases; "
                "give another --out"
            )
    drawn = side_by_side(partial(_draw, folder, seed, plant), todo, jobs)
    for done, _ in enumerate(drawn, len(planned) - len(todo) + 1):
        progress("drawing cases", done / len(planned))


def seal(folder: Path, planned: Sequence[Planned], command: str, seed: int) -> dict[str, Any]:
    """Write the truths into one file and seal it; returns the content of seal.json."""
    parts = [_part(folder, case.name) for case in planned]
    write_json(folder / _TRUTHS, {path.stem: json.loads(path.read_text()) for path in parts})
    about = {
        "truths_sha256": sha256(folder / _TRUTHS),
        "cases": len(planned),
        "seed": seed,
        "command": command,
        "sealed_at": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        **_commit(),
        "code_sha256": code_sha256(),
        "versions": versions(),
    }
    write_json(folder / SEAL, about)
    for path in parts:
        path.unlink()
    return about


def read_seal(folder: Path) -> dict[str, Any] | None:
    """Read seal.json; None if nothing is sealed yet. Raises HilError if it cannot be read."""
    if not (folder / SEAL).exists():
        return None
    try:
        about: dict[str, Any] = json.loads((folder / SEAL).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise HilError(f"{folder / SEAL}: cannot be read ({error}); the seal is lost: give another --out") from None
    return about


def unseal(folder: Path) -> dict[str, Truth]:
    """Read the truths by case. Raises HilError if they, a recording or a bench have changed since the seal."""
    return {name: Truth.from_json(truth) for name, truth in unsealed(folder).items()}


def unsealed(folder: Path) -> dict[str, dict[str, Any]]:
    """Read the truths by case as plain data. Raises HilError as `unseal`."""
    about, path = read_seal(folder), folder / _TRUTHS
    if about is None:
        raise HilError(f"{folder}: nothing is sealed here; give the --out of hil prove")
    if not path.exists() or sha256(path) != about["truths_sha256"]:
        raise HilError(
            f"{path}: is not what was sealed (SHA-256 {about['truths_sha256']}); nothing can be scored: "
            "give another --out"
        )
    truths = {}
    for name, entry in json.loads(path.read_text(encoding="utf-8")).items():
        place = folder / CASES / name
        if not place.is_dir() or _digests(place) != entry["sha256"]:
            raise HilError(
                f"{place}: recordings or bench are not what was sealed; nothing can be scored: give another --out"
            )
        truths[name] = entry["truth"]
    return truths


def write_part(folder: Path, name: str, truth: dict[str, Any]) -> None:
    """Write the truth of a drawn case, whose files stand, until all are sealed."""
    part = _part(folder, name)
    part.parent.mkdir(parents=True, exist_ok=True)
    write_json(part, {"truth": truth, "sha256": _digests(folder / CASES / name)})


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _draw(folder: Path, seed: int, plant: str, case: Planned) -> None:
    drawn = (draw_mujoco if plant == "mujoco" else draw)(case.tier, case.number, seed)
    # the number within the tier would reveal the tier
    drawn = replace(drawn, name=case.name, truth=replace(drawn.truth, name=case.name))
    shutil.rmtree(folder / CASES / case.name, ignore_errors=True)
    write(drawn, folder / CASES)
    write_part(folder, case.name, drawn.truth.as_json())


def _digests(place: Path) -> dict[str, str]:
    return {path.name: sha256(path) for path in sorted(place.iterdir())}


def _part(folder: Path, name: str) -> Path:
    return folder / SEALED / f"{name}.json"


def _commit() -> dict[str, Any]:
    """Return the commit of the code and whether it was changed since; None without a repository."""

    def git(*arguments: str) -> str | None:
        try:
            command, quick = ["git", "-C", str(_PACKAGE), *arguments], os.environ | {"GIT_OPTIONAL_LOCKS": "0"}
            ran = subprocess.run(command, capture_output=True, text=True, check=True, env=quick)
        except (OSError, subprocess.CalledProcessError):
            return None
        return ran.stdout.strip()

    commit = git("rev-parse", "HEAD")
    return {
        "git_commit": commit,
        "git_changed": bool(git("status", "--porcelain", "--", str(_PACKAGE))) if commit else None,
    }
