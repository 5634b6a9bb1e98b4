"""The live material in JupyterLab itself, in a browser: parameters both ways, between its sliders and its kernel.

LAYERFIT_LAB=PROGRAM names the `jupyter-lab` of an environment that has layerfit with its extra `notebook`.
"""

import os
import socket
import subprocess
import time
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from browser import chromium, until

LAB = os.environ.get("LAYERFIT_LAB")
NAME = "concrete.albedo"
CELLS = [
    'import layerfit as lf\nw = lf.live("bare_concrete")\nw',
    f'print("HAS", w["{NAME}"])',
    f'w["{NAME}"] = 0.02\nprint("SET")',
]
OURS = ("layerfit", "WebGL", "GL Driver", "anywidget", "blob:")
"""Of what JupyterLab's console says, what would be about the widget."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(LAB is None, reason="LAYERFIT_LAB=PROGRAM: a jupyter-lab beside layerfit[notebook]"),
]


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A server of a notebook with the cells."""
    folder = tmp_path_factory.mktemp("lab")
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    nbformat.write(new_notebook(cells=[new_code_cell(text) for text in CELLS], metadata=kernel), folder / "live.ipynb")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ["--no-browser", "--allow-root", "--ip=127.0.0.1", f"--port={port}", f"--ServerApp.root_dir={folder}"]
    said = folder / "said.txt"
    with said.open("w") as out:
        server = subprocess.Popen([str(LAB), *options, "--IdentityProvider.token="], stdout=out, stderr=out)
    try:
        _up(f"http://127.0.0.1:{port}/api", server, said)
        yield f"http://127.0.0.1:{port}/lab/tree/live.ipynb?reset"
    finally:
        server.terminate()
        server.wait(30)


def _up(place: str, server: subprocess.Popen, said: Path) -> None:
    for _ in range(300):
        try:
            urlopen(place)
        except URLError:
            assert server.poll() is None, said.read_text()
            time.sleep(0.5)
        else:
            return
    pytest.fail(f"JupyterLab does not answer:\n{said.read_text()}")


def _run(page, k):
    """Until it does: keys that come before the kernel are lost."""
    for _ in range(60):
        page.locator(".jp-Cell .cm-content").nth(k).click()
        page.keyboard.press("Shift+Enter")
        page.wait_for_timeout(1000)
        if page.locator(".jp-CodeCell .jp-InputPrompt").nth(k).inner_text() != "[ ]:":
            return
    pytest.fail(f"cell {k} does not run")


def test_parameters_go_both_ways(address):
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        said = []
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.set_default_timeout(180_000)
        page.goto(address)
        page.locator(".jp-Notebook-ExecutionIndicator[data-status=idle]").wait_for()
        _run(page, 0)
        page.locator(".layerfit").wait_for()
        page.evaluate("document.querySelector('.layerfit').view.limit = 4")
        until(page, "document.querySelector('.layerfit').view.passes > 0")
        box = page.get_by_label(f"{NAME} r, number")
        box.fill("0.77")
        box.press("Enter")
        _run(page, 1)
        has = page.locator(".jp-RenderedText", has_text="HAS")
        has.wait_for()
        assert has.inner_text().startswith("HAS [0.77, ")
        _run(page, 2)
        page.locator(".jp-RenderedText", has_text="SET").wait_for()
        until(page, f"document.querySelector('.layerfit').view.numbers()['{NAME}'].every((x) => Math.abs(x - 0.02) < 1e-9)")
        assert float(box.input_value()) == 0.02
        assert not [text for text in said if any(word in text for word in OURS)]
