"""Exported materials in three.js itself, drawn by a browser: its formula is the one that values are fitted to, and the shader is ours.

NODE_PATH names the folder that has the package `three`.
"""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from engines import THREE, engine_page, needs, radiance
from layerfit.interchange import web
from layerfit.interchange.engine import Engine
from layerfit.preset import read_preset
from layerfit.stack import evaluate, prepared
from test_interchange import conversion

pytestmark = needs(THREE)

SAME = 2e-3
"""Relative, of what has no table in it: three.js computes in float32, of settings written with six digits, at places between three vertices."""
TABLE = 1.5e-2
"""Of lobes that are scaled for light between facets: its table of them has bytes, and ours is MaterialX's polynomial."""
FLOOR = 1e-2
"""Radiance over that of a white diffuse surface, below which a difference is compared absolutely."""

SIDE = 12
HALF_ANGLE = 55.0
LIGHTS = [[0.0, 0.0, 1.0], [0.6, 0.2, 0.8], [-0.5, 0.7, 0.5], [0.9, -0.3, 0.25]]

DRAW = """async ([name, source, lights, side, degrees]) => {
    const THREE = await import("three");
    const { lit } = await import("/lit_three.js");
    const made = (await import(URL.createObjectURL(new Blob([source], { type: "text/javascript" }))))[name];
    const plane = new THREE.PlaneGeometry(40, 40);
    plane.setAttribute("tangent", new THREE.Float32BufferAttribute([1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1], 4));
    return lit(new THREE.Scene().add(new THREE.Mesh(plane, made)), lights, side, 1, 2 * degrees, (place) => {
        if (name !== "shader") return;
        made.uniforms.u_eye.value.set(0, 0, 1);
        made.uniforms.u_light.value = [new THREE.Vector4(...place, 0)];
    });
}"""
"""A plane seen from near by, so that a view differs from pixel to pixel, and a normal does not: three.js widens a lobe where it does."""


@pytest.fixture(scope="module")
def page():
    with engine_page(THREE) as one:
        yield one


def drawn(page, name, source):
    """Radiance (lights, pixels, 3) of what a module exports by that name."""
    return radiance(page, DRAW, [name, source, LIGHTS, SIDE, HALF_ANGLE], len(LIGHTS))


def wanted(brdf):
    """The same by a formula, under lights of irradiance pi."""
    at = ((np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0) * np.tan(np.radians(HALF_ANGLE))
    x, y = np.meshgrid(at, at)
    wo = np.stack([-x, -y, np.ones_like(x)], -1).reshape(-1, 3)
    wo = jnp.asarray(wo / np.linalg.norm(wo, axis=-1, keepdims=True))
    wi = jnp.asarray(LIGHTS) / jnp.linalg.norm(jnp.asarray(LIGHTS), axis=-1, keepdims=True)
    of_view = jax.vmap(lambda i, o: jnp.broadcast_to(brdf(i, o), (3,)) * i[2] * jnp.pi, (None, 0))
    return np.asarray(jax.jit(jax.vmap(of_view, (0, None)))(wi, wo))


COLOUR = np.array([0.8, 0.3, 0.1])
PARTS: dict[str, tuple[float, dict[str, Any]]] = {
    "metal": (TABLE, {"base": "metal", "alpha": 0.2}),
    "metal with a grain": (TABLE, {"base": "metal", "alpha_x": 0.3, "alpha_y": 0.1}),
    "diffuse": (SAME, {"base": "diffuse"}),
    "glossy": (SAME, {"base": "glossy", "alpha": 0.2, "ior": 1.7}),
    "metal with a film": (TABLE, {"base": "metal", "alpha": 0.2, "film_nm": 380.0, "film_eta": 1.6}),
    "mixed": (TABLE, {"base": "mixed", "metallic": 0.4, "alpha": 0.2}),
    "metal, coated": (TABLE, {"base": "metal", "alpha": 0.2, "coat_alpha": 0.1}),
    "diffuse, coated": (SAME, {"base": "diffuse", "coat_alpha": 0.1}),
}


@pytest.mark.parametrize("part", PARTS)
def test_three_draws_the_formula_that_is_fitted(page, part):
    tolerance, fields = PARTS[part]
    made = Engine(dialect="three", base_color=COLOUR, **fields)
    traced = replace(
        made, **{key: jnp.asarray(value) for key, value in vars(made).items() if isinstance(value, float | np.ndarray)}
    )
    want = wanted(traced.below(jnp.ones(())).evaluate)
    source = web.write_three(conversion(made, read_preset("bare_concrete")))
    assert np.max(np.abs(drawn(page, "material", source) - want) / np.maximum(want, FLOOR)) < tolerance


def test_three_draws_the_shader_itself(page):
    """The second export of the module, under the same light."""
    stack = read_preset("lacquered_copper")
    source = web.write_three(conversion(Engine(dialect="three", base_color=COLOUR, alpha=0.2), stack))
    ready = prepared(stack.astype(float))
    want = wanted(lambda wi, wo: evaluate(stack.form, ready, wi, wo))
    assert np.max(np.abs(drawn(page, "shader", source) - want) / np.maximum(want, FLOOR)) < SAME
