"""Materials that vary over the surface: what they read of a place reaches render and shader, and nobody else pays for it."""

import subprocess
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from helpers import STACKS, hemisphere, varnish
from layerfit._chunk import static
from layerfit._fields import layer, param
from layerfit._place import Place
from layerfit.forms.faithful import Faithful
from layerfit.forms.precise import Precise
from layerfit.render import brdf, predict
from layerfit.shader.export import HEADERS, print_material
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
        return replace(self, albedo=self.albedo * along / (1.0 + place.distance))


FORMS = {
    "bare": Stack((), Ramp(albedo=[0.5, 0.28, 0.13])),
    "corrected": Stack((varnish(),), Ramp(albedo=[0.5, 0.28, 0.13])),
    "faithful": Stack((varnish(),), Ramp(albedo=0.5), Faithful()),
    "precise": Stack((varnish(),), Ramp(albedo=0.5), Precise()),
}


@pytest.mark.parametrize("name", FORMS)
def test_every_form_takes_a_place(gl, name):
    shader = print_material(FORMS[name], name)
    assert "lf_evaluate(vec3 wi, vec3 wo, vec2 uv, float distance)" in shader.functions
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


@pytest.mark.parametrize("target", HEADERS)
@pytest.mark.parametrize("name", ["bare", "corrected"])
def test_the_whole_shader_validates(name, target, tmp_path):
    text = print_material(FORMS[name], name).text(target)
    path = tmp_path / "material.frag"
    path.write_text(text)
    ran = subprocess.run(["glslangValidator", str(path)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout
    assert "in vec2 v_uv;" in text
    assert "length(u_eye - v_position)" in text
    assert "v_tangent" not in text


def test_others_are_not_asked_for_a_place():
    text = print_material(STACKS["corrected over conductor"], "m").text()
    assert "uv" not in text
    assert "float distance =" not in text
    assert "lf_evaluate(vec3 wi, vec3 wo)" in text
