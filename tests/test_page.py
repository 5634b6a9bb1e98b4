"""Pages in a browser: they draw the exported shader, to the number; their sliders compute its constants as JAX does."""

import dataclasses
import json
from queue import Queue
from threading import Thread
from urllib.error import HTTPError
from urllib.request import urlopen

import jax
import numpy as np
import pytest
from gallery import same

from browser import chromium, evaluated, opened, pictured, small, until
from commands import layerfit
from helpers import APPROXIMATE, STACKS
from layerfit import view
from layerfit.fit.metrics import display
from layerfit.preset import read_preset, stack_of
from layerfit.report import gallery, pages
from layerfit.report.comparison import Pair
from layerfit.report.gallery import for_web
from layerfit.report.html import page as report_page
from layerfit.report.viewer import live
from layerfit.shader.export import print_material
from layerfit.shader.program import program
from layerfit.shader.verify import check_pairs
from layerfit.shipped import shipped_presets
from layerfit.stack import Stack, prepared
from test_report import DOCUMENT

CONSTANTS = 1e-4
"""Constants by a program whose tables are float32: coefficients of polynomials of degree 7 have their rounding some hundred times over.
What they come to is compared as tightly as any shader."""


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def stack():
    return read_preset("lacquered_copper")


@pytest.fixture(scope="module")
def pair():
    rng = np.random.default_rng(0)
    reference = rng.uniform(0.0, 2.0, (20, 30, 3))
    covered = np.ones((20, 30), bool)
    covered[0] = False
    return Pair("copper <1>", reference, reference * 1.1, covered, 1.5)


@pytest.fixture(scope="module")
def report(browser, stack, pair, tmp_path_factory):
    """The report of a fit, open in the browser."""
    fitted = {"lacquer.tau": {"sigma": [0.01, 0.02, None]}, "copper.alpha": {"sigma": 0.003}}
    trace = [(0.1, "coarse", 0, 1.0), (0.5, "fine 1", 0, 1e-3)]
    text = report_page("copper", DOCUMENT, [pair], b"", trace, "void main() {}", live(stack, "copper", fitted))
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(text)
    with opened(browser, path.as_uri()) as page:
        page.evaluate(
            "layerfit.views.forEach((view) => { view.canvas.style.width = view.canvas.style.height = '80px'; view.limit = 3; })"
        )
        yield page


def test_a_pass_in_strips_is_the_pass(report):
    """To the bit: on a slow machine a few rows are drawn a frame."""
    whole, strips = evaluated(report, STRIPS)
    assert max(whole) > 0.1
    assert whole == strips


STRIPS = """() => {
    const { renderer, material, values } = layerfit.views[0];
    const seen = camera(0.3, 0.2, 5, 40, 40);
    const lights = layerfit.views[0].lights(0);
    return [[40], [1, 7, 13, 19]].map((heights) => {
        const target = renderer.target(40, 40, true);
        let row = 0;
        for (const rows of heights) {
            renderer.draw(target, material, values, "sphere", seen, lights, row, rows);
            row += rows;
        }
        return Array.from(renderer.read(target));
    });
}"""


def constants(page):
    return [np.asarray(v) for v in evaluated(page, "() => layerfit.views[0].constants().map((a) => Array.from(a))")]


def shader_with(page, stack):
    """The shader of a material with the constants that the page has computed."""
    shader = print_material(stack, "copper", "prepared")
    made = zip(shader.uniforms.items(), constants(page), strict=True)
    return dataclasses.replace(shader, uniforms={name: np.reshape(new, value.shape) for (name, value), new in made})


def test_sliders_give_the_shader_of_what_they_show(gl, report, stack):
    """Alpha and index of the coat too: what they bring about is computed in the page, curves and bounces and all."""
    assert check_pairs(shader_with(report, stack), 4096).passed
    before = report.locator(".stage").screenshot()
    for name, value in {"lacquer.alpha": "0.3", "lacquer.eta": "1.7"}.items():
        box = report.get_by_label(f"{name}, number")
        box.fill(value)
        box.press("Enter")
    document = json.loads(report.evaluate("layerfit.views[0].saved()"))
    changed = stack_of({key: document[key] for key in ("model", "interface", "layers", "base")}, "saved")
    assert float(changed.layers[0].alpha) == 0.3
    assert float(changed.layers[0].eta) == 1.7
    assert check_pairs(shader_with(report, changed), 4096).passed
    until(report, "layerfit.views[0].passes > 1")
    assert report.locator(".stage").screenshot() != before
    report.get_by_role("button", name="Back to the start").click()
    assert check_pairs(shader_with(report, stack), 4096).passed


def test_a_slider_moves_by_keys_and_marks_what_was_fitted(report):
    slider = report.get_by_label("copper.alpha", exact=True)
    slider.focus()
    slider.press("ArrowRight")
    assert float(report.get_by_label("copper.alpha, number").input_value()) > 0.2
    row = report.locator(".number", has=slider)
    assert row.locator(".mark").count() == row.locator(".sigma").count() == 1
    clear = report.locator(".number", has=report.get_by_label("copper.k r", exact=True))
    assert clear.locator(".sigma").count() == 0


def test_view_and_light_turn_by_keys_and_mouse(report):
    read = "() => { const { orbit, light } = layerfit.views[0]; return { ...orbit, light: light.yaw }; }"
    first = evaluated(report, read)
    report.locator(".stage canvas").focus()
    report.keyboard.press("ArrowRight")
    report.keyboard.press("+")
    turned = evaluated(report, read)
    assert turned["yaw"] != first["yaw"]
    assert turned["distance"] < first["distance"]
    assert turned["light"] == first["light"]
    report.locator(".sun").focus()
    report.keyboard.press("ArrowLeft")
    assert evaluated(report, read)["light"] != first["light"]
    box = report.locator(".stage canvas").bounding_box()
    report.mouse.move(box["x"] + 40, box["y"] + 40)
    report.mouse.down()
    report.mouse.move(box["x"] + 60, box["y"] + 40)
    report.mouse.up()
    assert evaluated(report, read)["yaw"] != turned["yaw"]


def test_pictures_are_compared_pixel_by_pixel(report, pair):
    swept = report.locator("[data-compare] canvas").first
    swept.scroll_into_view_if_needed()
    box = swept.bounding_box()
    report.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 0.5 * box["height"])
    said = report.locator(".said").inner_text()
    want = pair.reference[10, 22]
    assert said.startswith("x 22, y 10: reference " + " ".join(f"{v:.3f}"[:4] for v in want)[:4])
    assert f"the fit is off by {100 * 0.1 * want.mean() / 1.5:.2f}"[:21] in said
    colour = "(at) => { const c = document.querySelector('[data-compare] canvas'); return Array.from(c.getContext('2d').getImageData(...at, 1, 1).data); }"  # noqa: E501
    left, right = (evaluated(report, colour, [x, 10])[:3] for x in (3, 27))
    np.testing.assert_allclose(left, 255.0 * display(pair.reference[10, 3], 1.5), atol=1.0)
    np.testing.assert_allclose(right, 255.0 * display(pair.fit[10, 27], 1.5), atol=1.0)
    at_line = evaluated(report, colour, [23, 10])[:3]  # the first right of the line
    np.testing.assert_allclose(at_line, 255.0 * display(pair.fit[10, 23], 1.5), atol=1.0, err_msg="the line hides a pixel")


def test_the_line_between_pictures_is_a_slider_for_keys(report):
    swept = report.locator("[data-compare] canvas").first
    swept.focus()
    for key, at in (("Home", "0"), ("ArrowRight", "2"), ("End", "100"), ("ArrowLeft", "98")):
        report.keyboard.press(key)
        assert (swept.get_attribute("role"), swept.get_attribute("aria-valuenow")) == ("slider", at)


def test_a_stage_says_what_it_waits_for(browser, tmp_path):
    path = tmp_path / "view.html"
    path.write_text(view.page(read_preset("bare_concrete"), "bare_concrete"))
    said = "getComputedStyle(document.querySelector('.stage'), '::before').content"
    with opened(browser, path.as_uri()) as page:
        page.evaluate("Object.assign(layerfit.views[0], { limit: 0 }).change()")
        page.evaluate("document.querySelector('.stage').classList.add('waiting')")
        assert "compiled" in page.evaluate(said)
        page.evaluate("({ style }) => { style.width = style.height = '40px'; }", page.locator(".stage canvas").element_handle())
        page.evaluate("layerfit.views[0].change({ limit: 1 })")
        until(page, "layerfit.views[0].passes === 1")
        until(page, f"{said} === 'none'")


def test_a_view_comes_back_after_its_driver(browser, tmp_path):
    """As after a driver's fault, or a laptop that slept: the same picture, without a word of the page's own."""
    path = tmp_path / "view.html"
    path.write_text(view.page(read_preset("bare_concrete"), "bare_concrete"))
    page = browser.new_page(viewport={"width": 500, "height": 500})
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(path.as_uri())
    until(page, "globalThis.layerfit?.ready")
    page.evaluate(
        "(({ style }) => { style.width = style.height = '80px'; })(layerfit.views[0].canvas)"
    )  # few enough for any machine
    page.evaluate("layerfit.views[0].change({ limit: 2 })")
    drawn = "layerfit.views[0].passes === 2"
    until(page, drawn)
    first = page.locator(".stage canvas").screenshot()
    page.evaluate("globalThis.driver = layerfit.views[0].renderer.gl.getExtension('WEBGL_lose_context'); driver.loseContext()")
    until(page, "layerfit.views[0].renderer.lost")
    page.evaluate("layerfit.views[0].change()")
    page.wait_for_timeout(200)
    page.evaluate("driver.restoreContext()")
    until(page, f"layerfit.views[0].age > 1 && {drawn}")
    assert page.locator(".stage canvas").screenshot() == first
    page.close()
    assert not faults


def test_a_shader_that_a_driver_refuses_is_said_in_its_place(browser, tmp_path):
    """And the others are drawn."""
    path = tmp_path / "gallery.html"
    path.write_text(gallery.page(shipped_presets("concrete")))
    page = browser.new_page(viewport={"width": 500, "height": 500})
    faults = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(path.as_uri())
    until(page, "globalThis.layerfit?.ready")
    page.evaluate(small("40px"))
    page.evaluate("layerfit.views[1].fragment = layerfit.views[1].fragment.replace('void main()', 'void main(')")
    page.locator(".tile canvas").nth(1).focus()
    until(page, "layerfit.views[1].failed && layerfit.views[0].passes > 0")
    said = page.locator(".tile .said")
    assert said.count() == 1
    assert said.inner_text().startswith("There is no live view here: ERROR: ")
    page.close()
    assert not faults


def test_programs_compute_what_jax_computes(browser, tmp_path):
    """One material of each way to prepare one, in double precision."""
    kinds = (
        "corrected over lambert",
        "corrected, three layers",
        "milky over lambert",
        "precise, anisotropic",
        "precise, two coats",
    )
    stacks = {name: (STACKS | APPROXIMATE)[name] for name in (*kinds, "conductor, Lazanyi")}
    stacks |= {name: read_preset(name) for name in ("anodised_titanium", "patinated_copper", "polished_weathered_brass")}
    cases = {}
    for name, stack in stacks.items():
        inputs = [np.asarray(leaf, float).ravel().tolist() for leaf in jax.tree.leaves(stack.astype(float))]
        cases[name] = {"program": program(Stack.prepare, stack.astype(float)), "inputs": inputs}
    page = browser.new_page()
    page.add_script_tag(content=f"{pages.text('program.js')}; globalThis.compile = compile;")
    run = "(cases) => Object.values(cases).map(({ program, inputs }) => compile(program)(inputs.map((a) => Float64Array.from(a))).map((a) => Array.from(a)))"  # noqa: E501
    for (name, stack), made in zip(stacks.items(), evaluated(page, run, cases), strict=True):
        wanted = jax.tree.leaves(prepared(stack.astype(float)))
        assert len(made) == len(wanted), name
        for got, want in zip(made, wanted, strict=True):
            np.testing.assert_allclose(
                got, np.ravel(want), rtol=0.0, atol=CONSTANTS * max(np.abs(want).max(), 1.0), err_msg=name
            )
    page.close()


def test_a_gallery_draws_what_is_pointed_at(browser, tmp_path):
    """With the shaders that lie beside the presets, which are what is printed for the web but for the first lines; until then, pictures."""
    ran = layerfit("gallery", "lacquered", "-o", tmp_path / "all")
    assert ran.code == 0
    found = shipped_presets("lacquered")
    assert f"{len(found)} materials" in ran.err
    printed = print_material(read_preset(found[0].path), found[0].name).text("essl300")
    assert same(for_web(found[0].path.with_suffix(".frag").read_text()), printed)
    with opened(browser, (tmp_path / "all" / "index.html").as_uri()) as page:
        page.evaluate("layerfit.views.forEach((view) => { view.limit = 1; })")
        page.evaluate(small("40px"))
        assert page.evaluate("layerfit.views.length") == len(found)
        until(page, "layerfit.views[0].passes > 0")
        page.wait_for_timeout(100)
        assert page.locator(".tile.live").count() == 1, "another that nobody has pointed at"
        for k in (1, 2):
            pictured(page, k)
            page.locator(".tile canvas").nth(k).focus()
            until(page, f"layerfit.views[{k}].passes > 0")
        assert page.locator(".tile.live").count() == 3
        middle = "(v) => Array.from(v.context.getImageData(v.canvas.width >> 1, v.canvas.height >> 1, 1, 1).data)"
        drawn = evaluated(page, f"() => layerfit.views.slice(0, 3).map({middle})")
        assert all(pixel[3] == 255 and max(pixel[:3]) > 8 for pixel in drawn)
        assert len({tuple(pixel) for pixel in drawn}) == 3
        page.get_by_label("find materials").fill("copper")
        shown = page.locator(".tile:visible h3").all_inner_texts()
        assert shown == [preset.name for preset in found if "copper" in f"{preset.name} {preset.description}"]


def test_a_preset_is_served_to_this_machine_alone(browser):
    """And tuned there; what is not the page is not found."""
    places = Queue()
    text = view.page(read_preset("bare_concrete"), "bare_concrete")
    Thread(target=view.serve, args=(text, places.put, False), daemon=True).start()
    address = places.get(timeout=10.0)
    assert address.startswith("http://127.0.0.1:")
    with pytest.raises(HTTPError, match="404"):
        urlopen(f"{address}etc/passwd")
    with opened(browser, address) as page:
        page.evaluate("layerfit.views[0].limit = 1")
        assert page.locator("fieldset legend").all_inner_texts() == ["concrete"]
        assert page.locator(".sigma").count() == 0


def test_a_view_can_be_a_file(tmp_path):
    ran = layerfit("view", "bare_concrete", "-o", tmp_path / "concrete.html")
    assert ran.code == 0
    assert (tmp_path / "concrete.html").read_text().startswith("<!doctype html>")


def test_a_phone_shows_a_long_name_and_the_picture_beside_the_sliders(browser, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(view.page(read_preset("metallic_blue_car_paint"), "metallic_blue_car_paint"))
    with opened(browser, path.as_uri()) as page:
        page.evaluate("layerfit.views[0].limit = 0")
        page.set_viewport_size({"width": 360, "height": 740})
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        assert page.locator("h1").inner_text() == "metallic_blue_car_paint"
        assert "blue_<wbr>car" in page.locator("h1").inner_html(), "it is broken between words"
        page.locator("fieldset input").last.scroll_into_view_if_needed()
        stage = page.locator(".stage").bounding_box()
        assert stage["y"] == 0.0, "the picture is in sight of the sliders"
        assert stage["height"] < 0.5 * 740


def test_paper_has_all_of_the_words_and_the_picture(report):
    report.emulate_media(media="print", color_scheme="dark")
    try:
        assert report.locator(".stage canvas").is_visible()
        assert not report.locator(".track").first.is_visible()
        assert evaluated(report, "() => [...document.querySelectorAll('pre')].every((e) => e.scrollWidth <= e.clientWidth)")
        assert evaluated(report, "() => getComputedStyle(document.querySelector('.stage'), null).printColorAdjust") == "exact"
        assert evaluated(report, "() => getComputedStyle(document.documentElement).backgroundColor") == "rgb(250, 250, 250)"
    finally:
        report.emulate_media(media="screen", color_scheme="light")
