"""Topics of `hil guide`: pages of the guide, and references."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "guide"  # docs/guide of the repository
GUIDE = (
    "start",
    "recording",
    "diagnosis",
    "compensate",
    "wrong-axis",
    "profile",
    "frequency-response",
    "iso-230",
    "fleet",
    "drive",
    "real-time",
    "python",
    "extend",
    "troubleshooting",
)
# topic -> title
REFERENCES = {
    "commands": "Commands",
    "bench-keys": "Keys of a bench file",
    "profile-keys": "Keys of a profile file",
    "map-keys": "Keys of a map file",
    "channels": "Channels of a recording",
    "mechanisms": "Mechanisms",
    "effects": "Effects of the simulated axis",
}
TOPICS = (*GUIDE, *REFERENCES)


def title(topic: str) -> str:
    """The heading of a page."""
    return REFERENCES.get(topic) or guide_page(topic).split("\n", 1)[0].removeprefix("# ")


def guide_page(topic: str) -> str:
    """The Markdown text of a page of the guide."""
    return (FOLDER / f"{topic}.md").read_text(encoding="utf-8")


def reference_page(topic: str, group: Any, picture: Callable[[str], str] = lambda name: "") -> str:
    """The Markdown text of a reference, under its title.

    `group` is the click group of the commands; `picture` gives the Markdown of the picture of a mechanism by its id.
    """
    from hil.manual import reference  # the library of mechanisms takes a second

    text = {
        "commands": lambda: reference.commands(group),
        "bench-keys": lambda: reference.keys("bench"),
        "profile-keys": lambda: reference.keys("profile"),
        "map-keys": lambda: reference.keys("map"),
        "channels": reference.channels,
        "mechanisms": lambda: reference.mechanisms(picture),
        "effects": reference.effects,
    }[topic]()
    return f"# {REFERENCES[topic]}\n\n{text}"


def for_terminal(text: str) -> str:
    """A page whose links name commands and files, because a terminal follows none."""

    def named(link: re.Match[str]) -> str:
        words, target = link[1], link[2].partition("#")[0]
        topic = Path(target).stem
        if topic in TOPICS:
            return f"{words} (`hil guide {topic}`)"
        if target.startswith("../../"):
            return f"{words} (`{target.removeprefix('../../')}`)"
        return f"{words} (`docs/{target.removeprefix('../')}`)" if target.startswith("../") else words

    return re.sub(r"\[([^\]]+)\]\(([^)]*)\)", named, text)
