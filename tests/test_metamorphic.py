"""Shaders that must draw the same pixels: values as constants or as uniforms, a part that is absent or at zero, lights in another order or
brighter, the whole scene turned."""

import dataclasses

import numpy as np
import pytest

import layerfit as lf
from helpers import COPPER, STACKS, varnish
from layerfit._directions import random_pairs
from layerfit.shader.gl import shade_points
from layerfit.shader.verify import MAX_REL
from test_export import DISTANT, EYE, IRRADIANCE, _plain, agree, drawn, sphere

SAME = 1e-5
"""Two shaders of the same numbers: the compiler may round products of constants where it leaves those of uniforms to the GPU."""
FLOOR = 1e-3
"""Part of the largest value below which values are compared absolutely."""

STRUCTURES = (
    "conductor, anisotropic",
    "oren_nayar",
    "corrected over conductor",
    "precise over lambert",
    "corrected, three layers",
)


def pairs(lights: int, pixels: int = 600) -> tuple[np.ndarray, ...]:
    """Directions and brightness of several lights in each pixel."""
    wi, wo = random_pairs(pixels * lights, 3)
    weight = np.random.default_rng(3).uniform(0.5, 2.0, (pixels, lights, 3)).astype(np.float32)
    return wi.reshape(pixels, lights, 3), wo[::lights], weight


def same(one, other, rel):
    error = np.abs(one - other) / np.maximum(np.abs(other), FLOOR * other.max())
    assert other.max() > 0.0
    assert error.max() <= rel


@pytest.mark.parametrize("name", STRUCTURES)
def test_constants_are_uniforms(gl, name):
    seen = [lf.shade_samples(lf.print_material(STACKS[name], "m", uniforms), *pairs(1)) for uniforms in (False, True)]
    same(*seen, MAX_REL)


@pytest.mark.parametrize("name", STRUCTURES)
def test_light_is_linear(gl, name):
    """Twice as bright is twice the number, to the bit; in another order, a sum of floats has other last digits."""
    shader = lf.print_material(STACKS[name], "m")
    wi, wo, weight = pairs(4)
    seen = lf.shade_samples(shader, wi, wo, weight)
    np.testing.assert_array_equal(lf.shade_samples(shader, wi, wo, 2.0 * weight), 2.0 * seen)
    order = [2, 0, 3, 1]
    same(lf.shade_samples(shader, wi[:, order], wo, weight[:, order]), seen, SAME)


ZERO = {
    "absorption": ("corrected over conductor", {"tau": None}, {"tau": 0.0}),
    "absorption, precise": ("precise over lambert", {"tau": None}, {"tau": 0.0}),
    "absorption by thickness": (
        "corrected over conductor",
        {"tau": None},
        {"tau": None, "absorption_per_mm": 0.0, "thickness_um": 50.0},
    ),
}


@pytest.mark.parametrize("uniforms", [False, True], ids=["constants", "uniforms"])
@pytest.mark.parametrize("name", ZERO)
def test_a_part_at_zero_is_absent(gl, name, uniforms):
    structure, absent, zero = ZERO[name]
    stack = STACKS[structure]
    seen = []
    for fields in (absent, zero):
        made = dataclasses.replace(stack, layers=(dataclasses.replace(varnish(tau=None), **fields),))
        seen.append(lf.shade_samples(lf.print_material(made, "m", uniforms), *pairs(1)))
    same(*seen, MAX_REL)


ISOTROPIC_GRAIN = {
    "conductor": (lf.Conductor(alpha=0.2, **COPPER), lf.Conductor(alpha=None, alpha_x=0.2, alpha_y=0.2, **COPPER)),
    "facets without spread": (lf.OrenNayar(albedo=[0.5, 0.28, 0.13], sigma=0.0), lf.Lambert(albedo=[0.5, 0.28, 0.13])),
}


@pytest.mark.parametrize("name", ISOTROPIC_GRAIN)
def test_a_general_surface_at_its_limit_is_the_special_one(gl, name):
    seen = [lf.shade_samples(lf.print_material(lf.Stack((), base), "m"), *pairs(1)) for base in ISOTROPIC_GRAIN[name]]
    same(*seen, MAX_REL)


@pytest.mark.parametrize("name", ["corrected over conductor", "corrected, anisotropic", "oren_nayar"])
def test_a_scene_that_is_turned_looks_the_same(gl, name):
    """Positions, normals, tangents, eye and light by one rotation."""
    text = lf.print_material(STACKS[name], "m").text()
    turn, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    plain = drawn(text, [(DISTANT, IRRADIANCE)])
    position, normal, tangent = (a.astype(float) @ turn.T for a in sphere())
    attributes = {"v_position": position, "v_normal": normal, "v_tangent": tangent}
    used = {key: value.astype(np.float32) for key, value in attributes.items() if f" {key};" in text}
    light = np.append(turn @ DISTANT[:3], 0.0)
    host = {"u_eye": tuple(turn @ EYE), "u_light": tuple(light), "u_light_rgb": tuple(IRRADIANCE)}
    agree(shade_points(text, used, {key: _plain(np.asarray(value)) for key, value in host.items()}), plain)
