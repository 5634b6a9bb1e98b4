"""Pictures of the pages for the documentation, light beside dark, as a browser draws them: into docs/images.

    python tools/screenshots.py            the report of a fit, the view of a preset, the gallery
    python tools/screenshots.py view       one of them
    xvfb-run python tools/screenshots.py window    the window of a preset, on a display of its own

Needs playwright and a Chromium; without a GPU, SwiftShader draws.
"""

import argparse
import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from chromium import FLAGS, executable
from PIL import Image
from playwright.sync_api import sync_playwright

import layerfit as lf
from layerfit import view
from layerfit._data import references
from layerfit.report import gallery

IMAGES = Path(__file__).parents[1] / "docs" / "images"
SIZE = (1000, 860)
"""Of the window; a picture is two of them side by side, at half their width."""
PASSES = 32
"""Of each view: its lights are soft by then."""
QUALITY = 82
SECONDS = 1800


def report(folder: Path) -> Path:
    """The page of a fit."""
    lf.fit_scene(references() / "lacquered_copper.toml", folder)
    return folder / "report.html"


def preset(folder: Path) -> Path:
    """The page of a preset."""
    path = folder / "view.html"
    path.write_text(view.page(lf.read_preset("lacquered_oak"), "lacquered_oak"))
    return path


def presets(folder: Path) -> Path:
    """The page of all presets."""
    path = folder / "gallery.html"
    path.write_text(gallery.page(lf.shipped_presets()))
    return path


PAGES = {"report": (report, ".viewer"), "view": (preset, "h1"), "gallery": (presets, "h1")}
"""What makes each page, and what stands at the top of its picture."""


@contextmanager
def opened(path: Path, said: list[str]) -> Iterator[Any]:
    """A page when its scripts are ready; what it says on its console is added to `said`."""
    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=executable(p), args=FLAGS)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(path.as_uri())
        until(page, "globalThis.layerfit?.ready")
        yield page
        browser.close()


def until(page: Any, expression: str) -> None:
    """Wait for something to be so. (Playwright's own wait evaluates text, which the pages forbid.)"""
    for _ in range(10 * SECONDS):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(100)
    raise TimeoutError(f"{expression} has not become so in {SECONDS} s")


SEEN = "layerfit.views.filter((v) => v.visible)"


def shots(path: Path, top: str) -> Iterator[Image.Image]:
    """A page in light and in dark, from an element downwards, when all in sight is drawn."""
    with opened(path, []) as page:
        page.evaluate(f"layerfit.views.forEach((v) => {{ v.limit = {PASSES}; v.wanted = true; }})")
        page.evaluate(f"window.scrollTo(0, document.querySelector({top!r}).getBoundingClientRect().top - 24)")
        page.wait_for_timeout(500)  # until the page knows what is in sight
        until(page, f"{SEEN}.length && {SEEN}.every((v) => v.passes >= v.limit)")
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            yield Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def window() -> Image.Image:
    """The window of a preset, as its display has it."""
    from layerfit.window import picture
    from layerfit.window.screen import Screen

    picture.SLOW_S = SECONDS  # all its pixels, on any machine
    screen = Screen(lf.read_preset("lacquered_oak"), "lacquered_oak", Path())
    for _ in range(PASSES):
        screen.picture.advance()
    screen.draw()
    size = screen.window.buffer_size
    return Image.frombytes("RGB", size, screen.window.fbo.read()).transpose(Image.Transpose.FLIP_TOP_BOTTOM)


def write(name: str) -> None:
    if name == "window":
        window().save(IMAGES / "window.webp", quality=QUALITY, method=6)
        return
    make, top = PAGES[name]
    with tempfile.TemporaryDirectory() as folder:
        path = make(Path(folder))
        both = list(shots(path, top))
    picture = Image.new("RGB", (2 * SIZE[0], SIZE[1]))
    for k, one in enumerate(both):
        picture.paste(one, (k * SIZE[0], 0))
    picture.resize((SIZE[0] * 8 // 5, SIZE[1] * 4 // 5), Image.Resampling.LANCZOS).save(
        IMAGES / f"{name}.webp", quality=QUALITY, method=6
    )
    print(f"{name}.webp: {(IMAGES / f'{name}.webp').stat().st_size // 1000} kB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", nargs="*", metavar="|".join([*PAGES, "window"]))
    asked = parser.parse_args()
    for name in asked.page or PAGES:
        write(name)
