"""A headless Chromium for tests of pages: WebGL 2 by SwiftShader, so that no GPU is needed."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import FLAGS, executable


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="pages are tested with playwright: pip install playwright")
    with playwright.sync_playwright() as p:
        found = executable(p)
        if not Path(found).exists():
            pytest.skip("no Chromium to test pages in: apt-get install chromium, or playwright install chromium")
        browser = p.chromium.launch(executable_path=found, args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def opened(browser: Any, address: str, **options: Any) -> Iterator[Any]:
    """A page when its scripts are ready. It may say nothing on the console and ask for nothing but itself."""
    page = browser.new_page(viewport={"width": 900, "height": 600}, **options)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: said.append(request.url) if request.url != address else None)
    page.goto(address)
    until(page, "globalThis.layerfit?.ready")
    yield page
    page.close()
    said = [text for text in said if "GPU stall due to ReadPixels" not in text]  # the test's own reading
    assert not said, said


def until(page: Any, expression: str) -> None:
    """Wait for something to be so in a page. (Playwright's own wait evaluates text, which the page forbids.)"""
    for _ in range(600):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    pytest.fail(f"{expression} has not become so in half a minute")


MIDDLE = """(view) => {
    const seen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    seen.drawImage(view.canvas, view.canvas.width >> 1, view.canvas.height >> 1, 1, 1, 0, 0, 1, 1);
    return Array.from(seen.getImageData(0, 0, 1, 1).data);
}"""


def middle(page: Any, view: str) -> np.ndarray:
    """The colour in the middle of a viewer's picture, when it is whole."""
    until(page, f"{view}.passes >= {view}.limit")
    return np.array(page.evaluate(f"({MIDDLE})({view})")[:3])


def evaluated(page: Any, script: str, value: Any = None) -> Any:
    """What a script gives, without lists of arrays that turn to objects on their way."""
    return json.loads(page.evaluate(f"async (x) => JSON.stringify(await ({script})(x))", value))


def small(side: str) -> str:
    """A script that makes every picture of a gallery so small that a processor draws it at once."""
    return f"document.querySelectorAll('.tile .picture').forEach((e) => {{ e.style.width = e.style.height = '{side}'; }})"


def pictured(page: Any, k: int) -> None:
    """A tile that is not live shows a picture."""
    image = page.locator(".tile img").nth(k)
    assert image.is_visible()
    assert image.evaluate("(e) => e.complete && e.naturalWidth > 0")
