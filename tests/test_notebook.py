"""Materials in a notebook: the widget in a real Chromium, its parameters both ways, and what results show of themselves."""

import base64
import json

import numpy as np
import pytest

import layerfit as lf
from browser import chromium, middle, until
from layerfit.errors import InputError, MachineError
from layerfit.report import pages

pytest.importorskip("anywidget", reason="pip install 'layerfit[notebook]'")
formatters = pytest.importorskip("IPython.core.formatters")

NAME = "bare_concrete"
"""Its shader is the quickest to compile."""

HOST = """<!doctype html><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src blob:; style-src 'unsafe-inline'">
<body data-jp-theme-light="false"><div id="cell" style="width: 700px"></div></body>"""
"""As strict as a notebook's page may be, VS Code's among them: the module itself, styles, and neither requests nor evaluated text."""

MODEL = """([source, material, values]) => {
    const bytes = Uint8Array.from(atob(material), (c) => c.charCodeAt(0));
    const state = { _material: new DataView(bytes.buffer), values };
    const heard = new Set();
    const tell = () => heard.forEach((f) => f());
    const model = {
        get: (key) => state[key],
        set: (key, value) => { state[key] = value; tell(); },
        save_changes: () => { window.saved.push(JSON.parse(JSON.stringify(state.values))); },
        on: (event, f) => { if (event === "change:values") heard.add(f); },
        off: (event, f) => { heard.delete(f); },
    };
    Object.assign(window, { saved: [], model, heard });
    const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    return import(url).then(async ({ default: widget }) => {
        window.end = await widget.render({ model, el: document.getElementById("cell") });
        window.view = document.querySelector(".layerfit").view;
        window.view.limit = 2;
    });
}"""
"""What a notebook is to a widget: numbers that both sides set, and who wants to hear of it."""


@pytest.fixture(scope="module")
def widget():
    return lf.live(NAME)


@pytest.fixture(scope="module")
def cell(widget):
    """The widget drawn in a page, which says nothing on its console."""
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 900, "height": 700})
        said = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if not request.url.startswith("blob:") else None)
        page.set_content(HOST)
        page.evaluate(MODEL, [widget._esm, base64.b64encode(widget._material).decode(), widget.values])
        until(page, "view.passes > 0")
        yield page
        page.close()
        assert not [text for text in said if "GPU stall due to ReadPixels" not in text], said


def test_the_widget_draws_the_material(cell, widget):
    assert middle(cell, "view").max() > 20
    assert cell.locator("fieldset legend").all_inner_texts() == [lf.read_preset(NAME).base.name]
    assert cell.evaluate("getComputedStyle(document.querySelector('.layerfit')).colorScheme") == "dark"


def test_a_slider_sets_the_value_in_python(cell, widget):
    """What the page saves is what Python takes: the widget's own state message."""
    name = next(iter(widget.values))
    box = cell.get_by_label(f"{name}{' r' if isinstance(widget.values[name], list) else ''}, number")
    box.fill("0.9")
    box.press("Enter")
    saved = cell.evaluate("saved.at(-1)")
    widget.set_state({"values": saved})
    value = np.ravel(widget[name])
    assert value[0] == 0.9
    layer = widget.material.base
    assert np.ravel(getattr(layer, name.rpartition(".")[2]))[0] == 0.9


def test_a_value_in_python_moves_the_picture_and_the_slider(cell, widget):
    name = next(iter(widget.values))
    sent = []
    widget.observe(lambda change: sent.append(change["new"]), "values")
    before = middle(cell, "view")
    widget[name] = 0.02
    cell.evaluate("(values) => model.set('values', values)", sent[-1])
    assert middle(cell, "view").max() < 0.6 * before.max()
    box = cell.get_by_label(f"{name}{' r' if isinstance(widget.values[name], list) else ''}, number")
    assert float(box.input_value()) == 0.02
    assert cell.evaluate("saved.length") == 1, "it would send back what it was sent"


def test_back_to_the_start_is_told_too(cell, widget):
    cell.get_by_role("button", name="Back to the start").click()
    start = lf.live(NAME).values
    for name, value in cell.evaluate("saved.at(-1)").items():
        np.testing.assert_allclose(value, start[name], rtol=1e-6)


def test_a_change_of_the_theme_is_followed(cell):
    cell.evaluate("document.body.dataset.jpThemeLight = 'true'")
    until(cell, "document.querySelector('.layerfit').style.colorScheme === 'light'")


def test_a_cell_that_goes_gives_everything_back(cell):
    """Last: the view is gone after it."""
    cell.evaluate("end()")
    assert cell.evaluate("heard.size") == 0
    assert cell.evaluate("document.querySelectorAll('.layerfit').length") == 0
    passes = cell.evaluate("view.change() ?? view.passes")
    cell.wait_for_timeout(200)
    assert cell.evaluate("view.passes") == passes == 0


def test_where_no_widget_is_shown_it_is_a_table(widget):
    shown, _ = formatters.DisplayFormatter().format(widget)
    assert shown["text/html"] == widget.material._repr_html_()
    assert "application/vnd.jupyter.widget-view+json" in shown


def test_values_are_checked(widget):
    with pytest.raises(InputError, match=r"unknown parameter 'concrete.albdo' \(did you mean"):
        widget["concrete.albdo"] = 0.5
    name = next(iter(widget.values))
    with pytest.raises(InputError, match="should be a number from"):
        widget[name] = 7.0
    with pytest.raises(KeyError):
        widget["nothing"]


def test_a_colour_may_be_set_by_one_number(widget):
    name = next(name for name, value in widget.values.items() if isinstance(value, list))
    widget[name] = 0.25
    assert widget[name] == [0.25] * 3
    one = lf.live(lf.Stack((), lf.Lambert(albedo=0.5)))
    with pytest.raises(InputError, match="is one number here"):
        one["base.albedo"] = [0.1, 0.2, 0.3]


def test_the_module_is_the_viewer_of_the_pages(widget):
    """No second one: every script of it is that of the pages, but for the last."""
    for script in pages.VIEWER:
        assert pages.text(script) in widget._esm
    assert json.dumps(pages.text("page.css")) in widget._esm


def test_without_the_extra_it_says_what_to_install(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "anywidget", None)
    monkeypatch.delitem(sys.modules, "layerfit.notebook.widget", raising=False)
    with pytest.raises(MachineError, match=r"pip install 'layerfit\[notebook\]'"):
        lf.live(NAME)
