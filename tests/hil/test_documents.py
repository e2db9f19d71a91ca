"""Documents: links, files, commands and published tables that they name exist; they stay short."""

import re
from pathlib import Path

import pytest
import typer

from hil.cli import app
from hil.manual.topics import REFERENCES
from hil.validation.proof.score.tables import PUBLISHED

ROOT = Path(__file__).parents[2]
GUIDE_PAGES = sorted(ROOT.glob("docs/guide/*.md"))
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
MOST_LINES = {"README.md": 120, "ARCHITECTURE.md": 200, "PROOF.md": 120, "CHANGELOG.md": 150}
each_document = pytest.mark.parametrize("path", [*DOCUMENTS, *GUIDE_PAGES], ids=lambda path: path.name)


@each_document
def test_links_lead_to_files(path: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8"))
    made = {f"../reference/{topic}.md" for topic in REFERENCES}  # pages of the site that are made from the code
    assert [
        link for link in links if "://" not in link and link not in made and not (path.parent / link).exists()
    ] == []


@each_document
def test_files_that_are_named_exist(path: Path) -> None:
    named = set(re.findall(r"`((?:hil|drivers|tests|profiles)/[\w./]+)`", path.read_text(encoding="utf-8")))
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []


@each_document
def test_commands_and_their_options_exist(path: Path) -> None:
    """`hil COMMAND ... --option`, in code spans and indented blocks."""
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    text = path.read_text(encoding="utf-8")
    for name, rest in re.findall(r"(?:`|^    (?:[\w./]+/)?)hil ([a-z][\w-]*)([^`\n#]*)", text, re.MULTILINE):
        assert name in commands, f"hil {name}"
        options = {option for parameter in commands[name].params for option in parameter.opts}
        assert set(re.findall(r"(?<!\S)(--[a-z][\w-]*)", rest)) <= options | {"--help"}, f"hil {name}{rest}"


@each_document
def test_published_tables_that_are_named_exist(path: Path) -> None:
    names = set(re.findall(r"--show (\w+)", path.read_text(encoding="utf-8"))) - {"NAME"}
    assert names <= {table.stem for table in PUBLISHED.glob("*.json")}


def test_all_published_tables_are_listed() -> None:
    text = (ROOT / "docs" / "proof-history.md").read_text(encoding="utf-8")
    assert [table.stem for table in PUBLISHED.glob("*.json") if table.stem not in text] == []


def test_documents_stay_short() -> None:
    lines = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in DOCUMENTS}
    assert {name: lines[name] for name, most in MOST_LINES.items() if lines[name] >= most} == {}
    assert sum(lines.values()) < 1500


def test_pages_of_the_guide_stay_short() -> None:
    lines = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in GUIDE_PAGES}
    assert {name: count for name, count in lines.items() if count >= 120} == {}
    assert sum(lines.values()) < 1060
