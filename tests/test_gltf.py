"""An exported glTF file as the viewers of others show it: loaded by three.js and by Babylon.js in a browser, beside the preset itself.

NODE_PATH names the folder that has the packages `three`, `@babylonjs/core` and `@babylonjs/loaders`.
"""

import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import chromium, evaluated
from layerfit.interchange import gltf
from layerfit.interchange.convert import Conversion, convert, mean_error
from layerfit.interchange.stage import CAMERA, LIGHTS, SIDE
from layerfit.preset import read_preset
from test_babylon import DIM, GAMMA, PARTS as BABYLON

NEEDED = ("three", "@babylonjs/core", "@babylonjs/loaders")
FOLDERS = [Path(part) for part in os.environ.get("NODE_PATH", "").split(os.pathsep)]
MODULES = next((folder for folder in FOLDERS if all((folder / name).is_dir() for name in NEEDED)), None)
pytestmark = pytest.mark.skipif(
    MODULES is None, reason=f"npm install {' '.join(NEEDED)}, and name its node_modules in NODE_PATH"
)

FINER = 5
"""Pixels across one of the picture: both programs widen lobes where normals differ from pixel to pixel."""
LOSS = {
    ("lacquered_copper", "three"): 2.54,
    ("lacquered_copper", "babylon"): 2.63,
    ("clear_coated_red_paint", "three"): 1.92,
    ("clear_coated_red_paint", "babylon"): 1.91,
    ("anodised_titanium", "three"): 1.64,
    ("anodised_titanium", "babylon"): 1.49,
    ("brushed_steel", "three"): 0.22,
    ("brushed_steel", "babylon"): 0.10,
}
"""Delta E 2000 of what is drawn of the file, against the preset: docs/interchange.md."""
AGAIN = 0.1
"""What of it may differ from driver to driver."""

PAGE = """<!doctype html><script type="importmap">{"imports": {
"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/",
"@babylonjs/core": "/all.js", "@babylonjs/core/": "/@babylonjs/core/", "@babylonjs/loaders/": "/@babylonjs/loaders/"}}</script>
<canvas width="12" height="12"></canvas>"""
MORE = {"AppendSceneAsync": "Loading/sceneLoader.js", "SceneLoaderFlags": "Loading/sceneLoaderFlags.js"}
ALL = "".join(f'export {{ {name} }} from "@babylonjs/core/{place}";' for name, place in (BABYLON | MORE).items())
ALL += 'import "@babylonjs/loaders/glTF/2.0/index.js";'

DRAW_THREE = """async ([text, lights, side, { distance, degrees }]) => {
    const THREE = await import("three");
    const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
    const renderer = (globalThis.renderer ??= new THREE.WebGLRenderer());
    const { scene } = await new GLTFLoader().parseAsync(text, "");
    const light = new THREE.DirectionalLight(0xffffff, Math.PI);
    scene.add(light);
    const camera = new THREE.PerspectiveCamera(degrees, 1, 0.1, 10);
    camera.position.set(0, 0, distance);
    const target = new THREE.WebGLRenderTarget(side, side, { type: THREE.FloatType });
    return lights.map((place) => {
        light.position.set(...place);
        renderer.setRenderTarget(target);
        renderer.render(scene, camera);
        const pixels = new Float32Array(4 * side * side);
        renderer.readRenderTargetPixels(target, 0, 0, side, side, pixels);
        return Array.from(pixels);
    });
}"""

DRAW_BABYLON = """async ([text, lights, side, { distance, degrees, dim }]) => {
    const B = await import("@babylonjs/core");
    const engine = (globalThis.engine ??= new B.Engine(document.querySelector("canvas"), false));
    const scene = new B.Scene(engine);
    scene.clearColor = new B.Color4(0, 0, 0, 0);
    scene.useRightHandedSystem = true;
    B.SceneLoaderFlags.ShowLoadingScreen = false;
    await B.AppendSceneAsync(`data:${text}`, scene, { pluginExtension: ".gltf" });
    scene.imageProcessingConfiguration.isEnabled = false;
    const camera = new B.TargetCamera("camera", new B.Vector3(0, 0, distance), scene);
    camera.setTarget(B.Vector3.Zero());
    Object.assign(camera, { fov: (degrees * Math.PI) / 180, minZ: 0.1, maxZ: 10 });
    const light = new B.DirectionalLight("light", new B.Vector3(0, 0, -1), scene);
    light.intensity = dim * Math.PI;
    const target = new B.RenderTargetTexture("target", side, scene, { type: 1, generateMipMaps: false });
    target.renderList = scene.meshes;
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
    """A page that finds the modules of both where pages find them."""
    with chromium() as browser:
        one = browser.new_page()
        said = []
        one.on("pageerror", lambda error: said.append(str(error)))
        one.route("**/*", _serve)
        one.goto("http://gltf.test/")
        yield one
        one.close()
        assert not said, said


def _serve(route: Any) -> None:
    name = route.request.url.partition("//")[2].partition("/")[2]
    if name in ("", "all.js"):
        kind = "text/javascript" if name else "text/html"
        route.fulfill(body=ALL if name else PAGE, content_type=kind)
    elif (path := Path(str(MODULES)) / name).is_file():
        route.fulfill(path=str(path), content_type="text/javascript")
    else:
        route.fulfill(status=404, body="")


@cache
def exported(name: str) -> Conversion:
    """A preset in the words of glTF."""
    return convert(read_preset(name), name, "gltf")


@pytest.mark.parametrize(("name", "program"), LOSS)
def test_what_is_lost_of_a_file_is_what_is_said(page, name, program):
    """The whole file: its sphere, tangents and material, by somebody else's loader."""
    found = exported(name)
    lights = [list(light.to_light) for light in LIGHTS]
    seen = {"distance": CAMERA.position[2], "degrees": CAMERA.vfov_deg, "dim": DIM}
    script = DRAW_THREE if program == "three" else DRAW_BABYLON
    pixels = evaluated(page, script, [gltf.write(found), lights, FINER * SIDE, seen])
    linear = np.reshape(pixels, (len(lights), FINER * SIDE, FINER * SIDE, 4))[:, ::-1, :, :3]
    linear = linear if program == "three" else linear**GAMMA / DIM
    image = linear.reshape(len(lights), SIDE, FINER, SIDE, FINER, 3).mean((2, 4))
    values = [one.reshape(-1, 3)[view.index] for one, view in zip(image, found.views, strict=True)]
    error = mean_error(found.views, values)
    assert error["delta_e"] == pytest.approx(LOSS[name, program], abs=AGAIN)
