"""hil guide: every page is printed, and every file, program and command of a page does what the page says."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import hil, refused
from guide_pages import NEEDS_HARDWARE, ROOT, Step, prepared, run, steps

from hil.manual.topics import FOLDER, GUIDE, TOPICS, for_terminal, guide_page, title

SLOW = re.compile(
    r"hil (demo|run|explain|diagnose|investigate|compare|identify|fleet)\b|--seconds|hil\.diagnose"
    r"|compensate|profiles/(positioning|circle|frequency_response)"
)


def at_the_desk(topic: str) -> list[Step]:
    """Steps of a page that need no hardware."""
    return [step for step in steps(topic) if NEEDS_HARDWARE not in step.text]


def is_slow(step: Step) -> bool:
    return bool(SLOW.search(step.text)) or "register" in step.text or step.name.endswith(".py")


@pytest.mark.parametrize("topic", GUIDE)
def test_the_quick_steps_of_a_page_work(topic: str, tmp_path: Path) -> None:
    """Up to the first slow one, whose results later steps may need; files after it too."""
    folder = prepared(tmp_path)
    every = at_the_desk(topic)
    slow = next((index for index, step in enumerate(every) if is_slow(step)), len(every))
    for step in [*every[:slow], *(step for step in every[slow:] if step.name.endswith(".yaml"))]:
        run(step, folder)


@pytest.mark.long
@pytest.mark.parametrize("topic", GUIDE)
def test_all_steps_of_a_page_work(topic: str, tmp_path: Path) -> None:
    folder = prepared(tmp_path)
    told = "".join(run(step, folder) for step in at_the_desk(topic))
    for said in re.findall(r'"(The twin [^".]+|No physics[^".]+)"', guide_page(topic)):
        assert said in told


@pytest.mark.parametrize("topic", GUIDE)
def test_every_block_of_a_page_is_executed(topic: str) -> None:
    fences = re.findall(r"^```", guide_page(topic), re.MULTILINE)
    assert len(fences) == 2 * len([step for step in steps(topic) if step.name])
    assert guide_page(topic).startswith("# ")
    assert not re.search(r"https?://", guide_page(topic))


def test_the_pages_are_those_of_the_folder() -> None:
    assert {path.stem for path in FOLDER.glob("*.md")} == set(GUIDE)
    assert FOLDER.resolve() == ROOT / "docs" / "guide"


def test_without_a_topic_it_lists_all(tmp_path: Path) -> None:
    ran = hil(tmp_path, "guide")
    assert ran.returncode == 0
    lines = dict(line.split(None, 1) for line in ran.stdout.splitlines()[1:])
    assert {name: text.strip() for name, text in lines.items()} == {topic: title(topic) for topic in TOPICS}


@pytest.mark.parametrize("topic", TOPICS)
def test_a_page_is_plain_markdown_without_a_terminal(topic: str, tmp_path: Path) -> None:
    ran = hil(tmp_path, "guide", topic)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(f"# {title(topic)}\n")
    assert "\x1b" not in ran.stdout


def test_an_unknown_topic_names_the_known_ones(tmp_path: Path) -> None:
    assert "TOPIC: given 'drives', allowed one of start, recording" in refused(tmp_path, "guide", "drives")


def test_links_name_topics_and_files_in_a_terminal() -> None:
    text = for_terminal(
        "[a](drive.md), [b](../reference/channels.md#x), [c](../hardware.md), [d](../../SAFETY.md), [e](#f)"
    )
    assert text == "a (`hil guide drive`), b (`hil guide channels`), c (`docs/hardware.md`), d (`SAFETY.md`), e"


def test_a_terminal_gets_a_formatted_page(tmp_path: Path) -> None:
    """In a real terminal of 80 columns: headings without #, tables with lines, no line too wide."""
    ours, theirs = pty.openpty()
    environment = {**os.environ, "COLUMNS": "80", "TERM": "xterm"}
    with subprocess.Popen(
        [sys.executable, "-m", "hil.cli", "guide", "start"], stdout=theirs, stderr=theirs, env=environment, cwd=tmp_path
    ) as program:
        os.close(theirs)
        shown = b""
        try:
            while part := os.read(ours, 65536):
                shown += part
        except OSError:  # Linux: the other side is closed
            pass
        assert program.wait() == 0
    os.close(ours)
    lines = re.sub(r"\x1b\[[0-9;]*m", "", shown.decode()).splitlines()
    assert max(len(line.rstrip()) for line in lines) <= 80
    assert any("Start in five minutes" in line and "#" not in line for line in lines)


def test_the_messages_of_troubleshooting_are_those_of_the_program() -> None:
    """Each text in backticks at the beginning of a row stands in the sources."""
    sources = "".join(
        path.read_text(encoding="utf-8") for top in ("hil", "drivers") for path in (ROOT / top).rglob("*.py")
    )
    joined = re.sub(r'"\s*\n\s*f?"', "", sources)  # texts that go over several lines
    named = re.findall(r"^\| `([^`]+)` \|", guide_page("troubleshooting"), re.MULTILINE)
    assert len(named) > 20
    assert [text for text in named if text not in joined] == []
