"""What results show of themselves in a notebook, and figures: their numbers are those of what is shown."""

import re
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import layerfit as lf
from layerfit.batch import Batch
from layerfit.errors import InputError, MachineError
from layerfit.fit.candidates import Candidate
from layerfit.fit.structures import StructureChoice, Tried
from layerfit.report.told import Told


@pytest.fixture
def pyplot(monkeypatch):
    matplotlib = pytest.importorskip("matplotlib", reason="pip install 'layerfit[plot]'")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield pyplot
    pyplot.close("all")


def cells(html):
    """Words of a table, a list for each line."""
    return [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]


def test_a_material_shows_its_numbers():
    stack = lf.Stack((lf.Coat(name="varnish", alpha=0.1, eta=1.5, tau=[0.1, 0.2, 0.3]),), lf.Lambert(albedo=0.5))
    html = stack._repr_html_()
    assert html.startswith("<p>Coat over Lambert, corrected form</p>")
    assert len(re.findall("<t[hd]", html)) == html.count("text-align: left"), "notebooks set cells to the right"
    rows = {row[0]: row[1:] for row in cells(html)}
    assert rows["varnish.tau"][0] == "0.1, 0.2, 0.3"
    assert rows["base.albedo"][0] == "0.5"
    assert rows["base.albedo"][2] == "0 to 1"
    assert "varnish.tau_s" not in rows, "what it does without"


def test_a_shipped_preset_shows_its_picture():
    html = lf.shipped_presets("lacquered_copper")[0]._repr_html_()
    assert '<img alt="" src="data:image/png;base64,iVBOR' in html
    assert "rough copper under an amber lacquer" in html


def test_a_batch_shows_a_line_for_each_scene():
    rows = [
        {"scene": "a.toml", "error": None, "misfit": 0.01234, "coat.alpha": 0.12345, "coat.alpha.sigma": 0.002, "flags": ""},
        {"scene": "<b>.toml", "error": "no <light>"},
    ]
    shown = cells(Batch({"done": 1, "failed": 1}, rows, False)._repr_html_())
    assert shown[0] == ["scene", "error", "misfit", "coat.alpha", "flags"]
    assert shown[1] == ["a.toml", "", "0.01234", "0.1235 \u00b1 0.0020", ""]
    assert shown[2][:2] == ["&lt;b&gt;.toml", "no &lt;light&gt;"]


def test_a_choice_of_structure_shows_what_was_tried():
    bare = lf.Stack((), lf.Lambert())

    class Result:
        free = type("Free", (), {"size": 3})

    tried = [
        Tried(Candidate(name, name, bare, ()), Result(), error, bic) for name, error, bic in (("b", 0.2, 5.0), ("a", 0.1, -7.0))
    ]  # pyright: ignore
    shown = cells(StructureChoice(tried, tried[1], "log", 9, 9.0, 1.0, None)._repr_html_())
    assert [row[0] for row in shown[1:]] == ["a", "b"]
    assert shown[1][1:] == ["0", "3", "0.1", "-7.0", "chosen"]


def test_a_study_is_its_document_and_shows_its_tables():
    from rich.table import Table

    made = Table("form", "error")
    made.add_row("precise", "[red]1 %")
    told = Told({"schema": "x"}, made, "In a sentence.")
    assert told == {"schema": "x"}
    html = told._repr_html_()
    assert "precise" in html
    assert "In a sentence." in html
    assert html.startswith("<pre>")


def test_a_plane_is_drawn_of_the_brdf(pyplot):
    stacks = {"half": lf.Stack((), lf.Lambert(albedo=0.5)), "dark": lf.Stack((), lf.Lambert(albedo=[0.1, 0.1, 0.1]))}
    ax = lf.plot_plane(stacks, 60.0)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list(stacks)
    for line, albedo in zip(ax.get_lines(), (0.5, 0.1), strict=True):
        np.testing.assert_allclose(line.get_ydata(), albedo / np.pi * 0.5, rtol=1e-5)
    metal = lf.plot_plane(lf.read_preset("brushed_steel"), 40.0, ax=pyplot.subplots()[1]).get_lines()[0]
    assert abs(metal.get_xdata()[np.argmax(metal.get_ydata())] - 40.0) < 3.0, "the mirror side is positive"
    with pytest.raises(InputError, match="from 0 to 89 degrees"):
        lf.plot_plane(stacks, 90.0)


def test_convergence_is_drawn_of_the_trace(pyplot):
    from layerfit.fit.result import Row

    trace = [
        Row(0.1, "coarse 1", 0, 0, 1.0),
        Row(0.2, "coarse 1", 1, 0, 0.9),
        Row(0.3, "coarse 1", 0, 1, 0.5),
        Row(0.6, "fine", 0, 0, 0.01),
    ]
    result = type("Result", (), {"trace": trace})()
    ax = lf.plot_convergence(result)  # pyright: ignore
    drawn = [(list(line.get_xdata()), list(line.get_ydata())) for line in ax.get_lines()]
    assert drawn == [([0.1, 0.3], [1.0, 0.5]), ([0.2], [0.9]), ([0.6], [0.01])]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["coarse", "fine"]


def test_a_tradeoff_is_drawn_with_its_front(pyplot):
    tiers = [
        {"tier": name, "x_phong": x, "p999_rel": error, "walk": None}
        for name, x, error in (("exact", 9.0, 1e-6), ("compact", 3.0, 0.01), ("poor", 5.0, 0.1))
    ]
    ax = lf.plot_tradeoff({"tiers": tiers})
    assert sorted(text.get_text() for text in ax.texts) == ["compact", "exact", "poor"]
    assert list(ax.get_lines()[-1].get_xdata()) == [3.0, 9.0]
    with pytest.raises(InputError, match="'exact' or 'walk'"):
        lf.plot_tradeoff({"tiers": tiers}, "truth")


def test_figures_without_the_extra_say_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MachineError, match=r"pip install 'layerfit\[plot\]'"):
        lf.plot_plane(lf.Stack((), lf.Lambert()))


def test_a_study_that_ran_shows_itself(gl, tmp_path):
    told = lf.specialise("bare_concrete", Path(__file__).parents[1] / "examples/references/brushed_steel.toml", tmp_path)
    assert isinstance(told, Told)
    assert told["in_words"][0] in re.sub(r"\s+", " ", told._repr_html_())


def test_what_matplotlib_itself_lacks_is_not_said_to_be_matplotlib(monkeypatch):
    package: Any = types.ModuleType("matplotlib")
    package.__path__ = []
    monkeypatch.setitem(sys.modules, "matplotlib", package)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ModuleNotFoundError):
        lf.plot_plane(lf.Stack((), lf.Lambert()))
