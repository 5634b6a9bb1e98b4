"""What a browser draws of a shader is what OpenGL draws of it, to the number; the page of all presets is drawn whole."""

from pathlib import Path

import numpy as np
import pytest

from browser import chromium, evaluated, opened, pictured, small, until
from layerfit import view
from layerfit.fit.metrics import display
from layerfit.preset import read_preset
from layerfit.report import gallery
from layerfit.report.gallery import for_web
from layerfit.shader.gl import shade_points
from layerfit.shipped import shipped_presets
from test_gallery import STRUCTURES

SAME = 5e-5
"""Pixels of two drivers, relative to the brightest: rounding of what they interpolate between vertices, seen through a lobe."""
SHOWN = 1e-3
"""The same as a screen shows them, before it rounds to 8 bits."""

SIDE = 32
SEEN = {"yaw": 0.3, "pitch": 0.2, "distance": 5}
LIGHTS = [[[-0.4, 0.6, 0.7, 0.0], [3.0, 2.0, 1.0]], [[2.0, -1.0, 3.0, 1.0], [5.0, 9.0, 14.0]]]
LIGHTS += [[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]] * 2

GOLDEN = Path(__file__).parent / "golden"
"""Printed shaders of every model, those that no preset has too."""


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


CAMERA = f"""() => {{
    const c = camera({SEEN["yaw"]}, {SEEN["pitch"]}, {SEEN["distance"]}, {SIDE}, {SIDE});
    return {{ eye: c.eye, matrix: Array.from(c.matrix) }};
}}"""


def points_of(seen):
    """A point of the unit sphere for each pixel that looks at it: position, normal, tangent, uv; a row each, and the pixels."""
    matrix = np.reshape(seen["matrix"], (4, 4)).T
    at = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    ends = [np.stack([*np.meshgrid(at, at), np.full((SIDE, SIDE), z), np.ones((SIDE, SIDE))], -1) for z in (-1.0, 1.0)]
    near, far = (p[..., :3] / p[..., 3:] for p in (end @ np.linalg.inv(matrix).T for end in ends))
    eye, way = np.asarray(seen["eye"]), (far - near) / np.linalg.norm(far - near, axis=-1, keepdims=True)
    b = way @ eye
    root = b * b - (eye @ eye - 1.0)
    hit = root > 1e-3
    position = (eye + (-b - np.sqrt(np.maximum(root, 0.0)))[..., None] * way)[hit]
    tangent = np.cross([0.0, 1.0, 0.0], position)
    uv = np.stack([np.arctan2(position[:, 0], position[:, 2]), np.arccos(position[:, 1])], -1)
    return np.concatenate([position, position * 1.7, tangent, uv], -1).astype("f4"), hit


SNAPSHOT = """([fragment, points, side, lights, orbit]) => {
    const { renderer } = layerfit.views[0];
    const count = points.length / 11;
    const mesh = renderer.upload({ vertices: new Float32Array(points), triangles: Uint32Array.from({ length: count }, (_, k) => k) });
    renderer.meshes.points = { ...mesh, mode: renderer.gl.POINTS };
    const view = new View(renderer, document.createElement("canvas"), fragment, []);
    const { pixels } = Object.assign(view, { shape: "points", orbit }).snapshot(side, side, lights);
    view.dispose();
    return Array.from(pixels);
}"""
"""What the renderer draws of a shader, on points instead of triangles: drivers lay the vertices of these on grids of their own."""


def check_pixels(page, fragment):
    """Draw a shader, GLSL ES with constants as `layerfit export` gives it, here and there."""
    seen = evaluated(page, CAMERA)
    points, hit = points_of(seen)
    image = np.reshape(evaluated(page, SNAPSHOT, [fragment, points.ravel().tolist(), SIDE, LIGHTS, SEEN]), (SIDE, SIDE, 4))
    np.testing.assert_array_equal(image[..., 3] == 1.0, hit)
    image = image[hit][:, :3]
    inputs = {"v_position": points[:, :3], "v_normal": points[:, 3:6], "v_tangent": points[:, 6:9], "v_uv": points[:, 9:]}
    host = {"u_eye": tuple(seen["eye"]), "u_up": (0.0, 1.0, 0.0)}
    host |= {"u_light": [tuple(place) for place, _ in LIGHTS], "u_light_rgb": [tuple(rgb) for _, rgb in LIGHTS]}
    used = {key: value for key, value in inputs.items() if f" {key};" in fragment}
    wanted = shade_points(fragment.replace("\n", "\n#define LF_LIGHTS 4\n", 1), used, host)
    assert np.mean(wanted.max(-1) > 0.0) > 0.5
    assert np.abs(image - wanted).max() <= SAME * wanted.max()
    assert np.abs(display(image, 1.0) - display(wanted, 1.0)).max() <= SHOWN


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory):
    """Any page with a renderer."""
    path = tmp_path_factory.mktemp("pixels") / "view.html"
    path.write_text(view.page(read_preset("bare_concrete"), "bare_concrete"))
    with opened(browser, path.as_uri()) as one:
        one.evaluate("layerfit.views[0].limit = 0")
        yield one


PATHS = {
    path.stem: path for path in (*(path.with_suffix(".frag") for path in STRUCTURES.values()), *sorted(GOLDEN.glob("*.frag")))
}
"""One of each structure that ships, and of the models that no preset has."""
FEW = ("lacquered_copper", "brushed_steel", "phong")


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in FEW else pytest.mark.slow) for name in PATHS])
def test_pixels_are_those_of_the_shader(gl, page, name):
    check_pixels(page, for_web(PATHS[name].read_text()))


LIT = """(k) => {
    const { canvas, context } = layerfit.views[k];
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    return data.some((x, i) => i % 4 < 3 && x > 60 && data[i | 3] === 255);
}"""
"""Whether something in a canvas is covered and bright: of black, a highlight."""


@pytest.mark.slow
def test_the_page_of_all_presets_is_drawn_whole(browser, tmp_path):
    """Each where it is pointed at, without a GPU, and without a word on the console; no driver is lost."""
    path = tmp_path / "all.html"
    path.write_text(gallery.page(shipped_presets()))
    with opened(browser, path.as_uri()) as all_of_them:
        all_of_them.evaluate("layerfit.views.forEach((view) => { view.limit = 1; })")
        all_of_them.evaluate(small("32px"))
        count = all_of_them.evaluate("layerfit.views.length")
        assert count == len(shipped_presets())
        for k in range(count):
            if k:  # the first is live as the page opens
                pictured(all_of_them, k)
            all_of_them.locator(".tile canvas").nth(k).focus()
            until(all_of_them, f"layerfit.views[{k}].passes > 0")
            until(all_of_them, f"({LIT})({k})")
        assert all_of_them.locator(".tile.live").count() == count
        assert all_of_them.evaluate("layerfit.views[0].age") == 1
