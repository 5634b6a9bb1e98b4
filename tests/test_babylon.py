"""Exported materials in Babylon.js itself, drawn by a browser: its formula is the one that values are fitted to.

NODE_PATH names the folder that has the package `@babylonjs/core`.
"""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from browser import chromium, evaluated
from layerfit.interchange import web
from layerfit.interchange.engine import Engine
from test_interchange import conversion
from test_three import COLOUR, FLOOR, HALF_ANGLE, LIGHTS, SIDE, wanted

FOLDERS = [Path(part) for part in os.environ.get("NODE_PATH", "").split(os.pathsep)]
MODULES = next((folder for folder in FOLDERS if (folder / "@babylonjs" / "core").is_dir()), None)
pytestmark = pytest.mark.skipif(
    MODULES is None, reason="no Babylon.js: npm install @babylonjs/core, and name its node_modules in NODE_PATH"
)

SAME = 1e-2
"""Relative, of what has no table in it: floats, settings with six digits, and a floor under cosines."""
TABLE = 3e-2
"""Of lobes that are scaled for light between facets, as Babylon.js has it in a table."""
DIM = 0.02
"""Of the light: what it draws to a float target is encoded for a screen, and cut off at 1."""
GAMMA = 2.2

PAGE = """<!doctype html><script type="importmap">{"imports": {"@babylonjs/core": "/all.js", "@babylonjs/core/": "/@babylonjs/core/"}}</script>
<canvas width="12" height="12"></canvas>"""
PARTS = {
    "PBRMaterial": "Materials/PBR/pbrMaterial.js",
    "Color3": "Maths/math.color.js",
    "Color4": "Maths/math.color.js",
    "Vector2": "Maths/math.vector.js",
    "Vector3": "Maths/math.vector.js",
    "Engine": "Engines/engine.js",
    "Scene": "scene.js",
    "DirectionalLight": "Lights/directionalLight.js",
    "TargetCamera": "Cameras/targetCamera.js",
    "RenderTargetTexture": "Materials/Textures/renderTargetTexture.js",
    "CreatePlane": "Meshes/Builders/planeBuilder.js",
}
ALL = "".join(f'export {{ {name} }} from "@babylonjs/core/{place}";' for name, place in PARTS.items())
"""What is used of the package: its own index is of thousands of files."""

DRAW = """async ([source, lights, side, degrees, dim]) => {
    const B = await import("@babylonjs/core");
    const { make } = await import(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
    const engine = (globalThis.engine ??= new B.Engine(document.querySelector("canvas"), false));
    const scene = new B.Scene(engine);
    scene.clearColor = new B.Color4(0, 0, 0, 0);
    scene.useRightHandedSystem = true;
    const plane = B.CreatePlane("plane", { size: 40 }, scene);
    plane.setVerticesData("normal", [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1]);
    plane.material = make(scene);
    plane.material.backFaceCulling = false;
    plane.material.imageProcessingConfiguration.isEnabled = false;
    const camera = new B.TargetCamera("camera", new B.Vector3(0, 0, 1), scene);
    camera.setTarget(B.Vector3.Zero());
    Object.assign(camera, { fov: (2 * degrees * Math.PI) / 180, minZ: 0.1, maxZ: 10 });
    const light = new B.DirectionalLight("light", new B.Vector3(0, 0, -1), scene);
    light.intensity = dim * Math.PI;
    const target = new B.RenderTargetTexture("target", side, scene, { type: 1, generateMipMaps: false });
    target.renderList = [plane];
    target.activeCamera = camera;
    const out = [];
    for (const place of lights) {
        light.direction = new B.Vector3(...place).normalize().scale(-1);
        while (!target.isReadyForRendering()) await new Promise((done) => setTimeout(done, 20));
        scene.render();
        target.render();
        out.push(Array.from(await target.readPixels()));
    }
    scene.dispose();
    return out;
}"""


@pytest.fixture(scope="module")
def page():
    """A page that finds Babylon.js where pages find their modules."""
    with chromium() as browser:
        one = browser.new_page()
        one.route("**/*", _serve)
        one.goto("http://babylon.test/")
        yield one
        one.close()


def _serve(route: Any) -> None:
    name = route.request.url.partition("//")[2].partition("/")[2]
    if name == "":
        route.fulfill(body=PAGE, content_type="text/html")
    elif name == "all.js":
        route.fulfill(body=ALL, content_type="text/javascript")
    elif (path := Path(str(MODULES)) / name).is_file():
        route.fulfill(path=str(path), content_type="text/javascript")
    else:
        route.fulfill(status=404, body="")


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
    pixels = evaluated(page, DRAW, [web.write_babylon(conversion(made)), LIGHTS, SIDE, HALF_ANGLE, DIM])
    drawn = np.reshape(pixels, (len(LIGHTS), -1, 4))[..., :3] ** GAMMA / DIM
    assert np.max(np.abs(drawn - want) / np.maximum(want, FLOOR)) < tolerance
