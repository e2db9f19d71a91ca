"""The reproduction of the source has a row for every misprint of the reading notes."""

from __future__ import annotations

from pathlib import Path

import pytest
from measured_recordings import SHARED

from hil.validation.paper import run_paper

pytestmark = pytest.mark.net


def test_every_misprint_of_the_reading_notes_has_its_row(tmp_path: Path) -> None:
    path = SHARED.parent / "paper" / "paper-notes.md"
    if not path.exists():
        pytest.skip("the reading notes of the paper are not beside the repository")
    text, result = path.read_text(encoding="utf-8"), run_paper(tmp_path)
    named = [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| ")][1:]
    wheres = " ".join(r.where for r in result.rows) + " " + " ".join(r.quantity for r in result.rows)
    known = {"text after Eq. 23": "Sec. 3.2.2"}
    assert len(named) >= 9
    for name in named:
        wanted = known.get(name, name.removeprefix("Appendix "))
        assert wanted in wheres, name
