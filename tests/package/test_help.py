"""Help texts are printed as they are written, and Tab completes commands and options."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import pytest
import typer
from processes import DEADLINE_S
from typer.testing import CliRunner

from hil.cli import COMMANDS, app

GROUP: Any = typer.main.get_command(app)


def plain(text: str) -> str:
    """Text without the breaks of lines, which also divide words at hyphens."""
    return "".join(text.split())


@pytest.mark.parametrize("name", [name for name, _ in COMMANDS])
def test_every_help_text_is_printed_whole(name: str) -> None:
    command = GROUP.commands[name]
    printed = plain(CliRunner().invoke(app, [name, "--help"]).output)
    told = [command.help, *(parameter.help for parameter in command.params if parameter.help)]
    assert [text for text in told if plain(text) not in printed] == []
    assert plain(command.help.split("\n\n")[0]) in plain(CliRunner().invoke(app, ["--help"]).output)


def test_words_in_square_brackets_are_no_markup() -> None:
    probe = typer.Typer(rich_markup_mode=app.rich_markup_mode)
    probe.command(help="Position [m]; pip install 'hil-servo[docs]'.")(lambda: None)
    assert "Position [m]; pip install 'hil-servo[docs]'." in CliRunner().invoke(probe, ["--help"]).output


@pytest.mark.parametrize(("words", "at", "wanted"), [("hil diag", 1, "diagnose"), ("hil run --ben", 2, "--bench")])
def test_tab_completes(words: str, at: int, wanted: str) -> None:
    asked = os.environ | {"_HIL_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(at)}
    code = "import sys; sys.argv = ['hil']; from hil.cli import main; main()"
    ran = subprocess.run(
        [sys.executable, "-c", code], env=asked, capture_output=True, text=True, timeout=DEADLINE_S, check=True
    )
    assert wanted in ran.stdout.split()
