"""make docs: the site builds without a warning, has every page, and needs no network to be read."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil.manual.topics import GUIDE, REFERENCES
from hil.twin.library import LIBRARY

ROOT = Path(__file__).parents[3]
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(importlib.util.find_spec("material") is None, reason="the extra docs is not installed"),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    ran = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert "WARNING" not in ran.stderr
    return folder


def test_every_page_and_picture_is_there(site: Path) -> None:
    assert (site / "index.html").is_file()
    assert [topic for topic in GUIDE if not (site / "docs" / "guide" / f"{topic}.html").is_file()] == []
    assert [topic for topic in REFERENCES if not (site / "docs" / "reference" / f"{topic}.html").is_file()] == []
    assert [one.id for one in LIBRARY if not (site / "docs" / "reference" / f"{one.id}.svg").is_file()] == []
    page = (site / "docs" / "reference" / "mechanisms.html").read_text(encoding="utf-8")
    assert all(f'src="{mechanism.id}.svg"' in page for mechanism in LIBRARY)


def test_nothing_is_fetched_from_a_network(site: Path) -> None:
    """No script, style sheet, font or picture of another host; links that a reader may follow are allowed."""
    asset = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?(?:src|href)=[\"']?(?:https?:)?//[^\"'> ]+")
    found = {match[0] for path in site.rglob("*.html") for match in asset.finditer(path.read_text(encoding="utf-8"))}
    assert found == set()
    styles = "".join(path.read_text(encoding="utf-8") for path in site.rglob("*.css"))
    assert not re.search(r"(?:url\(|@import )[\"']?(?:https?:)?//", styles)
