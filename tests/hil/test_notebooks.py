"""The notebooks of docs/notebooks: stored without outputs, and every cell runs in a kernel of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
QUICK = ("5_friction",)  # without a diagnosis
LONGEST_S = 1800  # of a cell: a diagnosis on a machine in use, its kernels compiled first
MOST_BYTES = 300_000  # of what a cell shows

# In a process of its own, as a user's Jupyter: the kernel is another one, and warnings of theirs are not ours.
EXECUTE = """
import sys, nbformat
from nbclient import NotebookClient
source, target, deadline_s = sys.argv[1:]
book = nbformat.read(source, as_version=4)
NotebookClient(book, timeout=int(deadline_s), kernel_name="python3").execute()
nbformat.write(book, target)
"""


def executed(path: Path, folder: Path) -> list[dict[str, Any]]:
    """Code cells of a notebook after it ran in `folder`."""
    target = folder / "executed.ipynb"
    environment = {
        **os.environ, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "", "IPYTHONDIR": str(folder / "ipython"),
        "JUPYTER_CONFIG_DIR": str(folder / "jupyter"), "JUPYTER_RUNTIME_DIR": str(folder / "runtime"),
    }  # fmt: skip
    ran = subprocess.run(
        [sys.executable, "-c", EXECUTE, str(path), str(target), str(LONGEST_S)],
        cwd=folder, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr[-3000:]
    return [cell for cell in json.loads(target.read_text())["cells"] if cell["cell_type"] == "code"]


def shown(cells: list[dict[str, Any]], form: str) -> list[str]:
    """What the cells show of a form, such as text/html."""
    found = [output["data"][form] for cell in cells for output in cell["outputs"] if form in output.get("data", {})]
    return ["".join(one) for one in found]


def test_there_are_six() -> None:
    assert [path.stem[0] for path in NOTEBOOKS] == list("123456")
    assert set(QUICK) <= {path.stem for path in NOTEBOOKS}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path: Path) -> None:
    book = json.loads(path.read_text(encoding="utf-8"))
    assert book["cells"][0]["cell_type"] == "markdown"
    assert "".join(book["cells"][0]["source"]).startswith("# ")
    code = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert any("assert " in line for cell in code for line in cell["source"])  # it says what must come out
    assert path.name in (ROOT / "docs" / "guide" / "python.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[] if path.stem in QUICK else pytest.mark.long) for path in NOTEBOOKS],
    ids=lambda path: path.stem,
)
def test_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    cells = executed(path, tmp_path)
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert [output["text"] for output in outputs if output.get("name") == "stderr"] == []
    assert all(len(json.dumps(output)) < 1.4 * MOST_BYTES for output in outputs)  # base64 with lines
    cards = [one for one in shown(cells, "text/html") if "data:image/png;base64," in one]
    assert cards, "no result shows itself with its picture"
    assert all(len(one.encode()) <= MOST_BYTES for one in cards)
    figures = sum(".plot(" in "".join(cell["source"]).splitlines()[-1] for cell in cells)
    assert len(shown(cells, "image/png")) == figures  # a figure as the last value of a cell is shown, once
