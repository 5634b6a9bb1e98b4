"""The documentation as a site: it builds without a warning, holds what it promises, and asks nothing of the network."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import layerfit

pytest.importorskip("mkdocs", reason="pip install mkdocs-material 'mkdocstrings[python]'")
REPOSITORY = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(out)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return out


class _Asked(HTMLParser):
    """What a browser fetches for a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []

    def handle_starttag(self, tag, attrs):
        fetched = {"script": "src", "img": "src", "link": "href", "iframe": "src"}
        self.links += [value for key, value in attrs if key == fetched.get(tag) and value]


def test_pages_are_whole_and_ask_nothing_of_the_network(site):
    pages = sorted(site.glob("*.html"))
    assert len(pages) > 12
    for page in pages:
        asked = _Asked()
        asked.feed(page.read_text())
        for link in asked.links:
            assert not re.match(r"(https?:)?//", link), f"{page.name}: {link}"
            if page.name != "404.html" and not link.startswith(("data:", "#")):
                assert (site / link.partition("#")[0].partition("?")[0]).exists(), f"{page.name}: {link}"


def test_notebooks_are_pages_with_their_words_and_code(site):
    for path in sorted((REPOSITORY / "examples").glob("*.ipynb")):
        page = (site / "examples" / f"{path.stem}.html").read_text()
        assert path.name in page
        assert "use_compilation_cache" in page
        assert f"examples/{path.stem}.html" in (site / "guide_researchers.html").read_text()


def test_every_public_name_and_command_has_its_place(site):
    python, commands = (site / "python.html").read_text(), (site / "commands.html").read_text()
    for name in layerfit.__all__:
        assert re.search(rf'id="layerfit\.[\w.]*\b{name}"', python), name
    for command in ("fit", "export", "verify", "truth"):
        assert f'id="layerfit-{command}"' in commands
