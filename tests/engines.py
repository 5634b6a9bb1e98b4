"""Programs of others that draw materials in a page: three.js and Babylon.js, each lit by one light at a time and read as floats.

NODE_PATH names the folder that has their packages.
"""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import chromium, evaluated

THREE = ("three",)
BABYLON = ("@babylonjs/core",)
GLTF = (*THREE, *BABYLON, "@babylonjs/loaders")

DIM = 0.02
"""Of the light for Babylon.js: what it draws to a float target is encoded for a screen, and cut off at 1."""
GAMMA = 2.2

PAGE = """<!doctype html><script type="importmap">{"imports": {
"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/",
"@babylonjs/core": "/babylon.js", "@babylonjs/core/": "/@babylonjs/core/", "@babylonjs/loaders/": "/@babylonjs/loaders/"}}</script>
<canvas width="12" height="12"></canvas>"""

USED = {
    "AppendSceneAsync": "Loading/sceneLoader.js",
    "Color3": "Maths/math.color.js",
    "Color4": "Maths/math.color.js",
    "CreatePlane": "Meshes/Builders/planeBuilder.js",
    "DirectionalLight": "Lights/directionalLight.js",
    "Engine": "Engines/engine.js",
    "PBRMaterial": "Materials/PBR/pbrMaterial.js",
    "RenderTargetTexture": "Materials/Textures/renderTargetTexture.js",
    "Scene": "scene.js",
    "SceneLoaderFlags": "Loading/sceneLoaderFlags.js",
    "TargetCamera": "Cameras/targetCamera.js",
    "Vector2": "Maths/math.vector.js",
    "Vector3": "Maths/math.vector.js",
}
"""What is used of Babylon.js: its own index is of thousands of files."""

LIT = {
    "three": """import * as THREE from "three";
export const renderer = new THREE.WebGLRenderer();
export function lit(scene, lights, side, distance, degrees, before = () => {}) {
    const light = new THREE.DirectionalLight(0xffffff, Math.PI);
    scene.add(light);
    const camera = new THREE.PerspectiveCamera(degrees, 1, 0.1, 10);
    camera.position.set(0, 0, distance);
    const target = new THREE.WebGLRenderTarget(side, side, { type: THREE.FloatType });
    return lights.map((place) => {
        light.position.set(...place);
        before(place);
        renderer.setRenderTarget(target);
        renderer.render(scene, camera);
        const pixels = new Float32Array(4 * side * side);
        renderer.readRenderTargetPixels(target, 0, 0, side, side, pixels);
        return Array.from(pixels);
    });
}""",
    "babylon": """import * as B from "@babylonjs/core";
const engine = new B.Engine(document.querySelector("canvas"), false);
export function empty() {
    const scene = new B.Scene(engine);
    scene.clearColor = new B.Color4(0, 0, 0, 0);
    scene.useRightHandedSystem = true;
    return scene;
}
export async function lit(scene, lights, side, distance, degrees, dim) {
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
}""",
}
"""Modules of the page: `lit(scene, lights, side, distance, degrees, ...)` gives the pixels under every light, of irradiance pi times `dim`."""


def _folder(packages: tuple[str, ...]) -> Path | None:
    folders = [Path(part) for part in os.environ.get("NODE_PATH", "").split(os.pathsep) if part]
    return next((folder for folder in folders if all((folder / name).is_dir() for name in packages)), None)


def needs(packages: tuple[str, ...]) -> pytest.MarkDecorator:
    """The mark of a module that draws with them. What is installed for the tests is of Python alone: without them it is skipped."""
    why = f"npm install {' '.join(packages)}, and name its node_modules in NODE_PATH"
    return pytest.mark.skipif(_folder(packages) is None, reason=why)


@contextmanager
def packaged(packages: tuple[str, ...], texts: Mapping[str, str], **functions: Callable[..., Any]) -> Iterator[Any]:
    """A page that finds the packages by their names, and these functions; of texts, the one without a name is the page.

    No script of it may fail.
    """

    def serve(route: Any) -> None:
        name = route.request.url.partition("//")[2].partition("/")[2]
        if name in texts:
            route.fulfill(body=texts[name], content_type="text/javascript" if name else "text/html")
        elif (path := Path(str(_folder(packages))) / name).is_file():
            route.fulfill(path=str(path), content_type="text/javascript")
        else:
            route.fulfill(status=404, body="")

    with chromium() as browser:
        page = browser.new_page()
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.route("**/*", serve)
        for name, function in functions.items():
            page.expose_function(name, function)
        page.goto("http://engine.test/")
        yield page
        page.close()
        assert not said, said


@contextmanager
def engine_page(packages: tuple[str, ...]) -> Iterator[Any]:
    """A page that finds the packages where pages find their modules."""
    babylon = "".join(f'export {{ {name} }} from "@babylonjs/core/{place}";' for name, place in USED.items())
    if "@babylonjs/loaders" in packages:
        babylon += 'import "@babylonjs/loaders/glTF/2.0/index.js";'
    with packaged(packages, {"": PAGE, "babylon.js": babylon} | {f"lit_{name}.js": text for name, text in LIT.items()}) as page:
        yield page


def radiance(page: Any, script: str, value: Any, lights: int) -> np.ndarray:
    """Radiance (lights, pixels, 3) that a script draws, rows from below."""
    return np.reshape(evaluated(page, script, value), (lights, -1, 4))[..., :3]


def unscreened(values: np.ndarray) -> np.ndarray:
    """What Babylon.js drew, without its dim light and its encoding."""
    return values**GAMMA / DIM
