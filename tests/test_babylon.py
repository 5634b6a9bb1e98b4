"""Exported materials in Babylon.js itself, drawn by a browser: its formula is the one that values are fitted to.

NODE_PATH names the folder that has the package `@babylonjs/core`.
"""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from engines import BABYLON, DIM, engine_page, needs, radiance, unscreened
from layerfit.interchange import web
from layerfit.interchange.engine import Engine
from test_interchange import conversion
from test_three import COLOUR, FLOOR, HALF_ANGLE, LIGHTS, SIDE, wanted

pytestmark = needs(BABYLON)

SAME = 1e-2
"""Relative, of what has no table in it: floats, settings with six digits, and a floor under cosines."""
TABLE = 3e-2
"""Of lobes that are scaled for light between facets, as Babylon.js has it in a table."""

DRAW = """async ([source, lights, side, degrees, dim]) => {
    const { CreatePlane } = await import("@babylonjs/core");
    const { empty, lit } = await import("/lit_babylon.js");
    const { make } = await import(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
    const scene = empty();
    const plane = CreatePlane("plane", { size: 40 }, scene);
    plane.setVerticesData("normal", [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1]);
    plane.material = make(scene);
    plane.material.backFaceCulling = false;
    return lit(scene, lights, side, 1, 2 * degrees, dim);
}"""


@pytest.fixture(scope="module")
def page():
    with engine_page(BABYLON) as one:
        yield one


COATED = {"coat_alpha": 0.1, "coat_ior": 1.6}
CASES: dict[str, tuple[float, dict[str, Any]]] = {
    "diffuse": (SAME, {"base": "diffuse"}),
    "glossy": (SAME, {"base": "glossy", "alpha": 0.2, "ior": 1.7}),
    "mixed": (SAME, {"base": "mixed", "metallic": 0.4, "alpha": 0.2}),
    "mixed, coated": (SAME, {"base": "mixed", "metallic": 0.4, "alpha": 0.2, **COATED}),
    "metal": (TABLE, {"base": "metal", "alpha": 0.2}),
    "metal with a film": (TABLE, {"base": "metal", "alpha": 0.2, "film_nm": 380.0, "film_eta": 1.6}),
    "metal with a grain": (TABLE, {"base": "metal", "alpha_x": 0.3, "alpha_y": 0.1}),
    "diffuse, coated": (SAME, {"base": "diffuse", **COATED}),
    "metal, under an absorbing coat": (TABLE, {"base": "metal", "alpha": 0.2, **COATED, "coat_tau": np.array([0.1, 0.3, 0.6])}),
}


@pytest.mark.parametrize("case", CASES)
def test_babylon_draws_the_formula_that_is_fitted(page, case):
    tolerance, fields = CASES[case]
    made = Engine(dialect="babylon", base_color=COLOUR, **fields)
    traced = replace(
        made, **{key: jnp.asarray(value) for key, value in vars(made).items() if isinstance(value, float | np.ndarray)}
    )
    want = wanted(traced.below(jnp.ones(())).evaluate)
    source = web.write_babylon(conversion(made))
    drawn = unscreened(radiance(page, DRAW, [source, LIGHTS, SIDE, HALF_ANGLE, DIM], len(LIGHTS)))
    assert np.max(np.abs(drawn - want) / np.maximum(want, FLOOR)) < tolerance
