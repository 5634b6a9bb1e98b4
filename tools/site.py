"""What the documentation site has beside docs/*.md: pages made from where their text already stands.

The front page is the README, the commands are what `layerfit --help` says, the Python pages are the docstrings of the public names, and
the tutorials are the notebooks.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from typing import Any

from mkdocs.structure.files import File, Files

REPOSITORY = Path(__file__).parents[1]
PUBLIC = REPOSITORY / "src" / "layerfit" / "__init__.pyi"
NOTEBOOKS = sorted((REPOSITORY / "examples").rglob("*.ipynb"))
BESIDE = ("shaders/presets/*.*", "shaders/README.md", "examples/references/README.md", "CONTRIBUTING.md")
"""Files outside docs/ that pages link to."""


def on_files(files: Files, config: Any) -> Files:
    """Add what is made, and what pages link to outside docs/."""
    made = {
        "index.md": from_root((REPOSITORY / "README.md").read_text()),
        "changes.md": from_root((REPOSITORY / "CHANGELOG.md").read_text()),
        "commands.md": commands(),
        "python.md": python(PUBLIC.read_text()),
    }
    made |= {path.relative_to(REPOSITORY).with_suffix(".md").as_posix(): notebook(path) for path in NOTEBOOKS}
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    for pattern in BESIDE:
        for path in sorted(REPOSITORY.glob(pattern)):
            files.append(File.generated(config, path.relative_to(REPOSITORY).as_posix(), abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Pages of docs/ link to what stands beside it; on the site that stands beside them, and a notebook is a page."""
    markdown = re.sub(r"\.ipynb\)", ".md)", markdown)
    return re.sub(r"\]\(\.\./", "](", markdown) if "/" not in page.file.src_uri else from_root(markdown, up="../")


def notebook(path: Path) -> str:
    """A notebook as a page: its words, and its code. (mkdocs-jupyter brings pages that fetch scripts from elsewhere.)"""
    cells = json.loads(path.read_text())["cells"]
    parts = [
        "".join(cell["source"]) if cell["cell_type"] == "markdown" else f"```python\n{''.join(cell['source'])}\n```"
        for cell in cells
    ]
    name = path.relative_to(REPOSITORY).as_posix()
    where = f"This page is the notebook `{name}`: run it in Jupyter or VS Code, where its figures and sliders show."
    return "\n\n".join([parts[0], where, *parts[1:]])


def from_root(text: str, up: str = "") -> str:
    """A page that links to docs/, as one in it."""
    return re.sub(r"\]\((?:\.\./)*docs/", f"]({up}", text)


def commands() -> str:
    """Every command with its options, as the command line tells them."""
    told = subprocess.run(
        [sys.executable, "-m", "typer", "layerfit.cli", "utils", "docs", "--name", "layerfit", "--title", "Commands"],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "NO_COLOR": "1"},
    )
    # What help keeps line by line is code on a page.
    return re.sub(r"\x08\n(.*:)\n((?:  .*\n)+)", lambda kept: f"{kept[1]}\n\n```sh\n{dedent(kept[2])}```\n", told.stdout)


def python(public: str) -> str:
    """A section of each module with public names, and its names."""
    sections: dict[str, list[str]] = {}
    for module, names in re.findall(r"^from \.([\w.]+) import (\([^)]*\)|.*)$", public, re.MULTILINE):
        for name in re.findall(r"(\w+) as \w+", names):
            sections.setdefault(module, []).append(name)
    lines = ["# Python", "", "All of these are names of `layerfit`: `import layerfit as lf`, then `lf.fit`.", ""]
    for module, names in sorted(sections.items()):
        lines += [f"## {module.removeprefix('_')}", ""]
        lines += [f"::: layerfit.{module}.{name}\n" for name in names]
    return "\n".join(lines)
