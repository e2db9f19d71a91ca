"""Arguments of `hil prove`: refused ones, and the published results."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.cli import app
from hil.errors import InputError
from hil.proof.score.tables import PUBLISHED, published


def test_all_and_some_at_once_is_refused(tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["prove", "--full", "--cases", "3", "--out", str(tmp_path / "new")])
    assert isinstance(ran.exception, InputError)
    assert str(ran.exception) == "--full: given with --cases 3, allowed one of them"
    assert not (tmp_path / "new").exists()


def test_without_a_folder_the_message_says_what_to_give() -> None:
    ran = CliRunner().invoke(app, ["prove", "--cases", "3"])
    assert isinstance(ran.exception, InputError)
    assert str(ran.exception).startswith("--out: not given, allowed a folder")


def test_published_results_are_printed_and_an_unknown_name_lists_them() -> None:
    names = sorted(path.stem for path in PUBLISHED.glob("*.json"))
    assert "20261206" in names
    for name in names:
        text = published(name)
        assert text.startswith("# ")
        assert text.count("| --- |") >= 1
    ran = CliRunner().invoke(app, ["prove", "--show", "20261206"])
    assert ran.exit_code == 0
    assert "| singles: named first | ≥ 92.0 % | 98.3 % | 91.0–99.7 % | 59 | yes |" in ran.output
    with pytest.raises(InputError, match=r"--show: given x, allowed 20261204, .*20261206"):
        published("x")
