"""A folder that is written anew takes the place of the former one whole, or leaves it."""

from pathlib import Path

import pytest

from hil.errors import InputError
from hil.files.output import rewritten_folder

MARK = "report.html"


def report(folder: Path, text: str) -> None:
    with rewritten_folder(folder, MARK) as part:
        (part / MARK).write_text(text)


def test_it_takes_the_place_of_the_former_one(tmp_path: Path) -> None:
    folder = tmp_path / "report"
    report(folder, "first")
    (folder / "old.png").write_text("of the first")
    report(folder, "second")
    assert [path.name for path in tmp_path.iterdir()] == ["report"]
    assert [path.name for path in folder.iterdir()] == [MARK]
    assert (folder / MARK).read_text() == "second"


def test_an_interrupt_while_it_is_filled_leaves_the_former_one(tmp_path: Path) -> None:
    folder = tmp_path / "report"
    report(folder, "first")

    def interrupted() -> None:
        with rewritten_folder(folder, MARK) as part:
            (part / MARK).write_text("second")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [path.name for path in tmp_path.iterdir()] == ["report"]
    assert (folder / MARK).read_text() == "first"


def test_an_interrupt_between_both_leaves_the_former_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, rename = tmp_path / "report", Path.rename
    report(folder, "first")

    def interrupted(self: Path, target: Path) -> Path:
        if self.name.endswith(".new") and target == folder:
            raise KeyboardInterrupt
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        report(folder, "second")
    assert [path.name for path in tmp_path.iterdir()] == ["report"]
    assert (folder / MARK).read_text() == "first"


def test_a_folder_without_the_mark_is_not_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        report(folder, "first")
    assert (folder / "mine.txt").read_text() == "mine"
