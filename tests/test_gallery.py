"""What lies beside the presets: printed shaders and pictures, none behind its preset, and the page that shows them."""

import io
import json

import gallery
import numpy as np
import pytest
from PIL import Image

from helpers import compiles
from layerfit._data import shaders
from layerfit.preset import read_preset
from layerfit.shader.export import HEADERS, print_material

PRESETS = sorted((shaders() / "presets").glob("*.json"))
EACH = pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)

PICTURES_BYTES = 700_000
"""All pictures together: they are kept in git for good."""

CARELESS = 0.02
"""Mean difference of a picture drawn with a sixth of the directions: grain."""


def structure(path) -> str:
    """All of a preset but its numbers and names: presets that share it print one shader with uniforms."""
    document = json.loads(path.read_text())
    layers = [{key: np.ndim(layer[key]) for key in layer} | {"type": layer["type"]} for layer in document["layers"]]
    base = {key: np.ndim(document["base"][key]) for key in document["base"]} | {"type": document["base"]["type"]}
    return json.dumps([document["model"], *layers, base])


STRUCTURES = {structure(path): path for path in PRESETS}
"""A preset of each."""


def test_the_page_is_that_of_the_presets():
    assert gallery.page() == gallery.PAGE.read_text(), "run make gallery"


def test_beside_presets_lie_shaders_and_pictures_and_nothing_else():
    folder = shaders() / "presets"
    assert set(folder.iterdir()) == {path.with_suffix(end) for path in PRESETS for end in (".json", ".frag", ".png")}
    assert sum(path.stat().st_size for path in folder.glob("*.png")) < PICTURES_BYTES


@EACH
def test_the_shader_is_what_is_printed(path):
    text = print_material(read_preset(path), path.stem).text(gallery.TARGET)
    assert gallery.same(text, path.with_suffix(".frag").read_text()), "run make gallery"


@EACH
def test_the_picture_is_drawn_by_that_shader(path):
    shader = path.with_suffix(".frag").read_text()
    assert gallery.drawn_by(path.with_suffix(".png")) == gallery.stamp(shader), "run make gallery"


def test_a_picture_is_drawn(gl, monkeypatch):
    """One that is kept, with less care."""
    monkeypatch.setattr(gallery, "SAMPLES", 30)
    monkeypatch.setattr(gallery, "scene", gallery.scene.__wrapped__)
    path = shaders() / "presets" / "lacquered_copper.json"
    drawn = _pixels(io.BytesIO(gallery.picture(print_material(read_preset(path), path.stem), "")))
    kept = _pixels(path.with_suffix(".png"))
    assert drawn.shape == kept.shape == (gallery.SIDE, gallery.SIDE, 3)
    assert np.mean(np.abs(drawn - kept)) < CARELESS
    assert np.ptp(kept) > 0.5, "a picture of something"


def _pixels(source) -> np.ndarray:
    with Image.open(source) as image:
        return np.asarray(image.convert("RGB")) / 255.0


def test_the_shaders_are_valid(tmp_path):
    validate(tmp_path, {path.stem: path.with_suffix(".frag").read_text() for path in PRESETS})


# A film is integrated over the spectrum before it is printed: uniforms are refused, which test_film.py holds.
@pytest.mark.parametrize("path", [path for key, path in STRUCTURES.items() if "film_nm" not in key], ids=lambda path: path.stem)
def test_the_shader_with_uniforms_is_valid(path, tmp_path):
    """One of each structure."""
    validate(tmp_path, {path.stem: print_material(read_preset(path), path.stem, uniforms=True).text(gallery.TARGET)})


def validate(folder, texts):
    """Both languages, in one go."""
    both = lambda text: {target: text.replace(HEADERS[gallery.TARGET], header) for target, header in HEADERS.items()}  # noqa: E731
    compiles(folder, {f"{name}_{target}.frag": one for name, text in texts.items() for target, one in both(text).items()})


@pytest.mark.parametrize(
    ("other", "alike"),
    [
        ("float a = 1.5000001;\nvec3 b = vec3(2.0, 1e-07, 3.0);", True),
        ("float a = 1.501;\nvec3 b = vec3(2.0, 0.0, 3.0);", False),
        ("float a = 1.5;\nvec3 b = vec3(2.0, 0.01, 3.0);", False),
        ("float a = 1.5;\nvec3 c = vec3(2.0, 0.0, 3.0);", False),
        ("float a = 1.5;", False),
    ],
)
def test_shaders_are_alike_but_for_last_digits(other, alike):
    assert gallery.same("float a = 1.5;\nvec3 b = vec3(2.0, 0.0, 3.0);", other) is alike


def test_comments_draw_nothing():
    assert gallery.stamp("float a; // width\n") == gallery.stamp("float a;  // the width\n\n") != gallery.stamp("float b;\n")
