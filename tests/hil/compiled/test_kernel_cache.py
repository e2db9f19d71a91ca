"""The folder of compiled kernels: one for each state of all sources that are compiled."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from numba.core import types
from numba.core.dispatcher import Dispatcher

from hil.compiled import kernel_cache
from hil.compiled.kernel_cache import KEPT, SOURCES, provide_kernel_cache, source_digest

ROOT = Path(__file__).parents[3]
# Compiles only the control law.
REPLAY = """
import numpy as np
from hil.control import cascade
from hil.compiled.kernel_cache import provide_kernel_cache
gains = cascade.Gains(*[1.0] * len(cascade.Gains._fields))
torque, _ = cascade.replay(gains, cascade.init(0.0), *np.ones((4, 2)))
print(provide_kernel_cache(), torque[0], len(cascade.replay.stats.cache_hits))
"""


def counted(path: Path) -> bool:
    return any(path == ROOT / source or ROOT / source in path.parents for source in SOURCES)


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the packages without kernels, whose folder of kernels is asked for."""
    for package in ("hil", "drivers"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(kernel_cache, "PACKAGE", tmp_path / "hil")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.delitem(sys.modules, "numba")  # its setting stays as it is
    return tmp_path


def replay(copy: Path) -> tuple[Path, float, int]:
    """Folder, first torque, and number of kernels that came from the folder, in a process of its own."""
    environment = {"PATH": os.environ["PATH"], "NUMBA_CACHE_DIR": str(copy / "kernels")}
    ran = subprocess.run(
        [sys.executable, "-c", REPLAY], cwd=copy, env=environment, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    folder, torque, hits = ran.stdout.split()
    return Path(folder), float(torque), int(hits)


def test_every_module_with_a_kernel_is_counted() -> None:
    found = [path for package in ("hil", "drivers") for path in (ROOT / package).rglob("*.py")
             if re.search(r"^\s*(from|import) numba", path.read_text(), re.MULTILINE)]  # fmt: skip
    assert len(found) > 20
    assert [str(path.relative_to(ROOT)) for path in found if not counted(path)] == []


def records(kind: types.Type) -> Iterator[type]:
    """Named tuples within the type of an argument; numba's cache holds them by name."""
    if isinstance(kind, types.BaseNamedTuple):
        yield kind.instance_class
    if isinstance(kind, types.BaseTuple):
        for part in kind:
            yield from records(part)


def test_every_record_that_a_kernel_takes_is_counted() -> None:
    kernels = {
        value
        for name, module in list(sys.modules.items())
        if name.split(".")[0] in ("hil", "drivers")
        for value in vars(module).values()
        if isinstance(value, Dispatcher)
    }
    found = {record for kernel in kernels for given in kernel.signatures for kind in given for record in records(kind)}
    assert {"Gains", "Response", "Axis"} <= {record.__name__ for record in found}
    assert [record for record in found if not counted(Path(sys.modules[record.__module__].__file__ or ""))] == []


@pytest.mark.parametrize(
    "file",
    ["hil/compiled/rounding.py", "hil/twin/mechanisms/backlash.py", "hil/loop/cycle.py", "drivers/sim/contact.py"],
)
def test_a_changed_source_has_another_folder(copy: Path, file: str) -> None:
    before = source_digest()
    (copy / file).write_text((copy / file).read_text() + "\n")
    assert source_digest() != before
    assert provide_kernel_cache().name == f"hil-kernels-{source_digest()[:16]}"


def test_kernels_of_renamed_records_and_changed_inlined_functions_are_not_read(copy: Path) -> None:
    first, torque, hits = replay(copy)
    assert hits == 0
    assert replay(copy) == (first, torque, 1)
    law, rounding = copy / "hil" / "control" / "cascade.py", copy / "hil" / "compiled" / "rounding.py"
    law.write_text(law.read_text().replace("Outputs", "Answers"))
    renamed, same, hits = replay(copy)
    assert (renamed != first, same, hits) == (True, torque, 0)
    # the file of the kernel stays as it is
    rounding.write_text(rounding.read_text().replace("_fence(product)", "_fence(2.0 * product)"))
    changed, other, hits = replay(copy)
    assert (len({first, renamed, changed}), other != torque, hits) == (3, True, 0)


def test_a_process_takes_the_folder_of_the_one_that_started_it(copy: Path) -> None:
    folder = provide_kernel_cache()
    assert folder.parent == copy / "kernels"
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)
    assert provide_kernel_cache() == folder
    (copy / "hil" / "control" / "cascade.py").write_text("")  # another version, started by this one
    other = provide_kernel_cache()
    assert (other.parent, other == folder) == (folder.parent, False)


def test_folders_of_old_sources_are_removed_but_for_the_last_used(copy: Path) -> None:
    place = copy / "kernels"
    old = [place / f"hil-kernels-{number:016x}" for number in range(KEPT + 3)]
    for age, folder in enumerate(old):
        (folder / "stepping").mkdir(parents=True)
        os.utime(folder, (1e9 - age, 1e9 - age))
    (place / "hil-kernels-mine").mkdir()
    new = provide_kernel_cache()
    assert {path.name for path in place.iterdir()} == {
        "hil-kernels-mine",
        new.name,
        *(path.name for path in old[: KEPT - 1]),
    }


def test_kernels_compiled_at_installation_are_taken_along(copy: Path) -> None:
    installed = copy / "hil" / "__pycache__" / f"hil-kernels-{source_digest()[:16]}"
    installed.mkdir(parents=True)
    (installed / "kernel").write_text("compiled")
    folder = provide_kernel_cache()
    assert folder.parent == copy / "kernels"
    assert (folder / "kernel").read_text() == "compiled"
    (folder / "kernel").write_text("compiled again")
    assert (provide_kernel_cache() / "kernel").read_text() == "compiled again"
