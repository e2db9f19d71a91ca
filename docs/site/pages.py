"""Pages of the site of the manual, for mkdocs (`hooks` of mkdocs.yml): documents, guide, references, pictures.

Documents keep the places that they have in the repository, so that their links hold. References are made from the code.
"""

import shutil
import tempfile
from pathlib import Path

import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from hil.cli import app
from hil.manual.pictures import draw_mechanisms
from hil.manual.topics import GUIDE, REFERENCES, reference_page

ROOT = Path(__file__).parents[2]
BESIDE = ["README.md", "SAFETY.md", "PROOF.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE"]
PICTURES = Path(tempfile.mkdtemp(prefix="hil-manual-"))


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Set the navigation."""
    config.nav = [
        {"Overview": "README.md"},
        {"Guide": [f"docs/guide/{topic}.md" for topic in GUIDE]},
        {"Reference": [f"docs/reference/{topic}.md" for topic in REFERENCES]},
        {"Hardware": ["docs/hardware.md", "SAFETY.md", "docs/supervision.md", "docs/service.md"]},
        {"Recordings and Python": ["docs/recordings.md", "docs/api.md"]},
        {
            "Measured": [
                "PROOF.md",
                "docs/proof-history.md",
                "docs/proof-real.md",
                "docs/reliability.md",
                "docs/criteria.md",
            ]
        },
        {"The code": ["ARCHITECTURE.md", "docs/decisions.md", "CONTRIBUTING.md", "CHANGELOG.md"]},
    ]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Replace the files of `docs` by those of the repository at their places, and add references and pictures."""
    documents = [ROOT / name for name in BESIDE]
    for file in [one for one in files if one.src_dir == config.docs_dir]:
        files.remove(file)
        if not file.src_uri.endswith(".py"):
            documents.append(ROOT / "docs" / file.src_uri)
    for path in documents:
        files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    for path in draw_mechanisms(PICTURES):
        files.append(File.generated(config, f"docs/reference/{path.name}", abs_src_path=str(path)))
    group = typer.main.get_command(app)
    for topic in REFERENCES:
        text = reference_page(topic, group, lambda name: f"![Change of the axis by {name}]({name}.svg)")
        files.append(File.generated(config, f"docs/reference/{topic}.md", content=text))
    return files


def on_post_build(config: MkDocsConfig) -> None:
    """Remove the pictures, which are in the site now."""
    shutil.rmtree(PICTURES, ignore_errors=True)
