"""Materials that vary over the surface: what they read of a place reaches render and shader, and nobody else pays for it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from commands import write_reference
from helpers import STACKS, compiles, every_text, hemisphere, varnish
from layerfit._chunk import static
from layerfit._fields import layer, param
from layerfit._place import Place
from layerfit.capture.geometry import sphere_tangent, sphere_uv
from layerfit.capture.load import load
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError
from layerfit.fit.fit import fit
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.preset import read_preset
from layerfit.render import brdf, predict
from layerfit.shader.export import print_material
from layerfit.shader.verify import check_pairs
from layerfit.stack import Stack
from layerfit.surfaces import Lambert


@layer
class Ramp(Lambert):
    """A diffuse surface that gets darker along u and with the distance."""

    name: str = static(default="base", doc="name of the layer")
    albedo: object = param(
        default=0.5, lower=0.0, upper=1.0, scale="linear", doc="part of the light that is sent back", colour=True
    )

    reads = ("uv", "distance")

    def at(self, place):
        """Its albedo there."""
        along = place.uv[0] - jnp.floor(place.uv[0])
        return dataclasses.replace(self, albedo=self.albedo * along / (1.0 + place.distance))


FORMS = {
    "bare": Stack((), Ramp(albedo=[0.5, 0.28, 0.13])),
    "corrected": Stack((varnish(),), Ramp(albedo=[0.5, 0.28, 0.13])),
    "faithful": Stack((varnish(),), Ramp(albedo=0.5), Faithful()),
    "precise": Stack((varnish(),), Ramp(albedo=0.5), Precise()),
}


@pytest.mark.parametrize("name", FORMS)
def test_every_form_takes_a_place(gl, name):
    shader = print_material(FORMS[name], name)
    assert "lf_evaluate(FreeDirection wi, FreeDirection wo, vec2 uv, float distance)" in shader.functions
    assert check_pairs(shader, 6000).passed


def test_a_place_changes_what_is_there_alone():
    wi, wo = hemisphere(8, 1), hemisphere(8, 2)
    place = Place(np.linspace(0.1, 0.8, 8)[:, None] * [1.0, 0.0], np.ones(8))
    stack = FORMS["bare"].astype(np.float64)
    np.testing.assert_allclose(brdf(stack, wi, wo, place), brdf(stack, wi, wo) * place.uv[:, :1] / 2.0)
    plain = STACKS["corrected over lambert"].astype(np.float64)
    assert plain.reads == ()
    np.testing.assert_array_equal(brdf(plain, wi, wo, place), brdf(plain, wi, wo))


def test_prediction_and_the_plain_function_agree():
    wi, wo = hemisphere(40, 1), hemisphere(40, 2)
    rng = np.random.default_rng(3)
    place = Place(rng.uniform(-1.0, 1.0, (40, 2)), rng.uniform(0.0, 2.0, 40))
    pixels = predict(FORMS["corrected"], wi[:, None], wo, np.ones_like(wi)[:, None], place)
    np.testing.assert_allclose(pixels, brdf(FORMS["corrected"], wi, wo, place), rtol=2e-5)


@pytest.mark.parametrize("name", ["bare", "corrected"])
def test_the_whole_shader_validates(name, tmp_path):
    texts = every_text(FORMS[name])
    compiles(tmp_path, texts)
    for text in texts.values():
        assert "in vec2 v_uv;" in text
        assert "length(u_eye - v_position)" in text
        assert "v_tangent" not in text


def test_others_are_not_asked_for_a_place():
    text = print_material(STACKS["corrected over conductor"], "m").text()
    assert "uv" not in text
    assert "float distance =" not in text
    assert "lf_evaluate(FreeDirection wi, FreeDirection wo)" in text


def test_a_sphere_has_texture_coordinates():
    """u runs along the tangent, once around the axis; v from pole to pole."""
    normal = np.vstack([hemisphere(50, 1), -hemisphere(50, 2)])
    up = (0.2, 1.0, -0.3)
    uv = sphere_uv(normal, up)
    assert np.all((uv >= 0.0) & (uv <= 1.0))
    axis = np.array(up) / np.linalg.norm(up)
    np.testing.assert_allclose(np.cos(np.pi * uv[:, 1]), normal @ axis, atol=1e-12)
    step = 1e-6
    along = normal + step * sphere_tangent(normal, up)
    moved = sphere_uv(along / np.linalg.norm(along, axis=-1, keepdims=True), up) - uv
    inside = (uv[:, 0] > 0.01) & (uv[:, 0] < 0.99)
    around = step / (2.0 * np.pi * np.linalg.norm(np.cross(axis, normal), axis=-1))
    np.testing.assert_allclose(moved[inside, 0], around[inside], rtol=1e-4)
    np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-9)


PATTERN = {
    "schema": "layerfit/preset",
    "version": 1,
    "name": "truth",
    "model": "corrected",
    "base": {
        "type": "flakes",
        "name": "paint",
        "alpha": 0.15,
        "eta": 1.4,
        "k": 7.0,
        "sigma": 0.2,
        "per_uv": 30.0,
        "half_distance": 8.0,
    },
}
"""Flakes large enough to be seen one by one."""


@pytest.fixture(scope="module")
def painted(tmp_path_factory):
    """A scene whose reference layerfit rendered with flakes."""
    return write_reference(tmp_path_factory.mktemp("painted"), PATTERN)


def test_a_render_shows_flakes_and_a_fit_compares_their_mean(painted):
    scene = read_scene(painted)
    (view,) = load(scene)
    stack = read_preset(painted.parent / "truth.json")
    samples = view.samples()
    assert samples.place.uv.shape == (len(view.index), 2)
    np.testing.assert_allclose(predict(stack, *samples.arrays), samples.target, rtol=1e-4, atol=1e-6)
    mean = predict(stack, *samples.arrays[:3])
    assert np.sqrt(np.mean((mean - samples.target) ** 2)) > 0.1 * np.mean(mean), "the flakes are not to be seen"
    result = fit([view], stack, free=["paint.alpha"], starts=1)
    assert result.converged
    assert result.stack.base.alpha == pytest.approx(0.15, rel=0.15)


def test_a_picture_without_texture_coordinates_is_refused(painted):
    (view,) = load(read_scene(painted))
    with pytest.raises(InputError, match="no texture coordinates"):
        dataclasses.replace(view, uv=None).check(read_preset(painted.parent / "truth.json"))


def test_pixels_that_need_their_place_are_fitted_there(painted):
    """A pattern that has no mean: each pixel is compared where it is."""
    (view,) = load(read_scene(painted))
    truth = Stack((), Ramp(albedo=[0.5, 0.28, 0.13]))
    target = predict(truth, *view.samples().arrays)
    result = fit(
        [dataclasses.replace(view, target=target.astype(float))],
        Stack((), Ramp(albedo=[0.9] * 3)),
        free=["base.albedo"],
        starts=1,
    )
    np.testing.assert_allclose(result.stack.base.albedo, [0.5, 0.28, 0.13], rtol=1e-3)


def test_a_picture_knows_how_much_of_the_sky_is_seen(painted):
    """All of it where a sphere faces up, none where it faces down."""
    (view,) = load(read_scene(painted))
    up = np.array(view.reference.camera.up) / np.linalg.norm(view.reference.camera.up)
    sky = view.samples().place.sky
    np.testing.assert_allclose(sky, 0.5 + 0.5 * view.normal @ up, rtol=1e-6)
    assert sky.max() - sky.min() > 0.3
