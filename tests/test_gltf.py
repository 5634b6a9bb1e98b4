"""An exported glTF file as the viewers of others show it: loaded by three.js and by Babylon.js in a browser, beside the preset itself.

NODE_PATH names the folder that has the packages `three`, `@babylonjs/core` and `@babylonjs/loaders`.
"""

from functools import cache

import pytest

from engines import DIM, GLTF, engine_page, needs, radiance, unscreened
from layerfit.interchange import gltf
from layerfit.interchange.convert import Conversion, convert, mean_error
from layerfit.interchange.stage import CAMERA, LIGHTS, SIDE
from layerfit.preset import read_preset

pytestmark = needs(GLTF)

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

DRAW = {
    "three": """async ([text, lights, side, distance, degrees]) => {
    const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js");
    const { lit } = await import("/lit_three.js");
    const { scene } = await new GLTFLoader().parseAsync(text, "");
    return lit(scene, lights, side, distance, degrees);
}""",
    "babylon": """async ([text, lights, side, distance, degrees, dim]) => {
    const { AppendSceneAsync, SceneLoaderFlags } = await import("@babylonjs/core");
    const { empty, lit } = await import("/lit_babylon.js");
    const scene = empty();
    SceneLoaderFlags.ShowLoadingScreen = false;
    await AppendSceneAsync(`data:${text}`, scene, { pluginExtension: ".gltf" });
    return lit(scene, lights, side, distance, degrees, dim);
}""",
}


@pytest.fixture(scope="module")
def page():
    with engine_page(GLTF) as one:
        yield one


@cache
def exported(name: str) -> Conversion:
    """A preset in the words of glTF."""
    return convert(read_preset(name), name, "gltf")


@pytest.mark.parametrize(("name", "program"), LOSS)
def test_what_is_lost_of_a_file_is_what_is_said(page, name, program):
    """The whole file: its sphere, tangents and material, by somebody else's loader."""
    found = exported(name)
    lights = [list(light.to_light) for light in LIGHTS]
    seen = [gltf.write(found), lights, FINER * SIDE, CAMERA.position[2], CAMERA.vfov_deg, DIM]
    linear = radiance(page, DRAW[program], seen, len(lights))
    linear = linear if program == "three" else unscreened(linear)
    linear = linear.reshape(len(lights), FINER * SIDE, FINER * SIDE, 3)[:, ::-1]
    image = linear.reshape(len(lights), SIDE, FINER, SIDE, FINER, 3).mean((2, 4))
    values = [one.reshape(-1, 3)[view.index] for one, view in zip(image, found.views, strict=True)]
    error = mean_error(found.views, values)
    assert error["delta_e"] == pytest.approx(LOSS[name, program], abs=AGAIN)
