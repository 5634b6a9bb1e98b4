"""Small files of every kind that layerfit reads, and what reads them: what `fuzz.py` mutates."""

import dataclasses
import io
import json
import re
import struct
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from PIL import Image

from layerfit._data import references
from layerfit.batch.table import Journal
from layerfit.batch.tasks import tasks_of
from layerfit.capture.exr import read_exr, write_exr
from layerfit.capture.load import load
from layerfit.capture.measured.read import read_brdf
from layerfit.capture.png import read_png
from layerfit.capture.scene_file import read_scene
from layerfit.errors import InputError
from layerfit.interchange.formats import read_start
from layerfit.maps.descent import Found
from layerfit.maps.kept import read_tile, write_tile
from layerfit.maps.texels import observe
from layerfit.preset import preset_of, read_preset
from layerfit.shipped import shipped_presets
from layerfit.study.kept import Kept
from layerfit.study.sweep import read_plan
from layerfit.tabulate import read_directions

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from commands import SCENE
from measured_files import polar, write_cornell, write_merl, write_rgl, write_table


def _preset(path: Path) -> None:
    stack = read_preset(path)
    json.dumps(preset_of(stack, "fuzz"), allow_nan=False)
    names = [layer.name for layer in (*stack.layers, stack.base)]
    if not all(re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) for name in names):
        raise AssertionError(f"names that are no words of a shader: {names}")


def _views(path: Path) -> None:
    """A reference as a fit and as a map see it: pixels, normals, positions and texture coordinates that may be anything."""
    scene = path.with_name("views.toml")
    scene.write_text(VIEWED.replace("views.exr", path.name))
    read = read_scene(scene)
    try:
        load(read)
        observe(read, read.start, 8)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _manifest(path: Path) -> None:
    tasks_of([path], path.parent, False, {})


def _journal(path: Path) -> None:
    list(Journal(path).rows(ROWS))


def _parts(path: Path) -> None:
    Kept(path, QUESTION).part("y", lambda: PART)


ROWS, QUESTION, PART = ["one", "two"], ["a", 1], {"value": [1.0, 2.0]}
VIEWED = (
    SCENE.replace("reference.exr", "views.exr").replace('[geometry]\nkind = "sphere"\n', "")
    + """
[map]
free = ["coat.alpha"]
"""
)

DOCUMENTS = {
    "study": (
        """\
[study]
design = "grid"
repeats = 2
seed = 1
free = ["base.alpha"]
material = { model = "corrected", layers = [{ type = "coat", alpha = 0.1 }], base = { type = "conductor", alpha = 0.2 } }
[vary]
"coat.alpha" = [0.05, 0.1, 0.2]
"base.alpha" = { from = 0.1, to = 0.4, steps = 3, scale = "log" }
"reference.noise" = [0.0, 0.01]
[reference]
side = 16
[fit]
starts = 1
loss = "huber"
""",
        """\
study = { design = "sobol", points = 8, measure = "walk", paths = 100, material = "lacquered_copper" }
vary = { "coat.tau" = { from = 0.0, to = 1.0 }, "coat.alpha" = { from = 0.1, to = 0.3 } }
""",
    ),
    "manifest": ("scene,name\na.toml,one\nfolder/b.toml,two\n",),
    "gltf": (
        json.dumps(
            {
                "asset": {"version": "2.0"},
                "materials": [
                    {
                        "name": "lacquer",
                        "pbrMetallicRoughness": {
                            "baseColorFactor": [0.9, 0.5, 0.3, 1.0],
                            "metallicFactor": 1.0,
                            "roughnessFactor": 0.4,
                        },
                        "extensions": {
                            "KHR_materials_clearcoat": {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.1},
                            "KHR_materials_ior": {"ior": 1.6},
                            "KHR_materials_specular": {"specularFactor": 1.0},
                            "KHR_materials_anisotropy": {"anisotropyStrength": 0.4, "anisotropyRotation": 1.57},
                            "KHR_materials_iridescence": {"iridescenceFactor": 1.0, "iridescenceThicknessMaximum": 300.0},
                        },
                    }
                ],
            },
            indent=1,
        ),
    ),
    "mtlx": (
        """\
<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709">
  <bitangent name="across" type="vector3" />
  <open_pbr_surface name="paint_surface" type="surfaceshader">
    <input name="base_color" type="color3" value="0.8, 0.4, 0.1" />
    <input name="base_metalness" type="float" value="1" />
    <input name="specular_roughness" type="float" value="0.3" />
    <input name="specular_roughness_anisotropy" type="float" value="0.5" />
    <input name="coat_weight" type="float" value="1" />
    <input name="coat_ior" type="float" value="1.5" />
    <input name="coat_roughness" type="float" value="0.1" />
    <input name="coat_color" type="color3" value="0.9, 0.8, 0.5" />
    <input name="geometry_tangent" type="vector3" nodename="across" />
  </open_pbr_surface>
  <surfacematerial name="paint" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="paint_surface" />
  </surfacematerial>
</materialx>
""",
    ),
    "blender": (
        json.dumps(
            {
                "schema": "layerfit/principled",
                "inputs": {
                    "Base Color": [0.8, 0.4, 0.1, 1.0],
                    "Metallic": 0.0,
                    "Roughness": 0.4,
                    "IOR": 1.45,
                    "Anisotropic": 0.5,
                    "Coat Weight": 1.0,
                    "Coat Roughness": 0.1,
                    "Coat IOR": 1.5,
                    "Coat Tint": [0.9, 0.8, 0.5, 1.0],
                },
            },
            indent=1,
        ),
    ),
}
"""Documents of each kind, by hand."""

KINDS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "exr": (".exr", read_exr),
    "scene": (".toml", read_scene),
    "scene_json": (".json", read_scene),
    "preset": (".json", _preset),
    "directions": (".csv", read_directions),
    "table": (".csv", read_brdf),
    "rgl": (".bsdf", read_brdf),
    "merl": (".binary", read_brdf),
    "cornell": (".brdf", read_brdf),
    "views": (".exr", _views),
    "mask": (".png", read_png),
    "study": (".toml", read_plan),
    "manifest": (".csv", _manifest),
    "gltf": (".gltf", read_start),
    "glb": (".glb", read_start),
    "mtlx": (".mtlx", read_start),
    "blender": (".json", read_start),
    "journal": (".jsonl", _journal),
    "parts": (".json", _parts),
    "tile": (".tile", read_tile),
}
ANEW = {"journal", "parts", "tile"}
"""What layerfit keeps for itself: of a file that is spoilt what is whole is taken, and the rest is made again."""
TEXTS = {"scene", "scene_json", "preset", "directions", "table", "cornell", "journal", "parts", *DOCUMENTS}


def corpus(kind: str, folder: Path) -> list[bytes]:
    """Small whole files."""
    path = folder / f"whole{KINDS[kind][0]}"
    flat = lambda wi, wo: np.full((len(wi), 3), 0.2) + 0.1 * wo  # noqa: E731
    if kind == "exr":
        rng = np.random.default_rng(0)
        write_exr(path, {name: rng.uniform(0.0, 1.0, (5, 7)) for name in ("R", "G", "B", "A", "N.X")})
        first = path.read_bytes()
        write_exr(path, {"Y": np.ones((40, 3))}, half=True)
        return [first, path.read_bytes()]
    if kind == "scene":
        return [SCENE.encode(), *(path.read_bytes() for path in sorted(references().glob("*.toml")))]
    if kind == "scene_json":
        return [json.dumps(tomllib.loads(SCENE), indent=1).encode()]
    if kind == "preset":
        return [preset.path.read_bytes() for preset in shipped_presets("")]
    if kind in ("directions", "table"):
        theta = np.linspace(0.0, 1.4, 5)
        write_table(path, flat, polar(theta, theta), polar(theta, 2.0 * theta))
    elif kind == "rgl":
        write_rgl(path, flat, side=4)
    elif kind == "merl":
        write_merl(path, flat, (3, 3, 4))
    elif kind == "views":
        _write_views(path)
    elif kind == "mask":
        return [_png(mode) for mode in ("L", "RGB", "I;16", "1", "P", "LA")]
    elif kind in DOCUMENTS:
        return [text.encode() for text in DOCUMENTS[kind]]
    elif kind == "glb":
        text = DOCUMENTS["gltf"][0].encode()
        return [b"glTF" + struct.pack("<3I4s", 2, 20 + len(text), len(text), b"JSON") + text]
    elif kind == "journal":
        Journal(path).write([(key, {"error": None, "scene": f"{key}.toml", "value": 0.5}) for key in ROWS])
    elif kind == "parts":
        Kept(path, QUESTION).part("y", lambda: PART)
    elif kind == "tile":
        write_tile(path, Found(*(np.ones((4, 3)) for _ in dataclasses.fields(Found))))
    else:
        write_cornell(path, lambda wi, wo, wavelengths: np.full((len(wi), len(wavelengths)), 0.2))
    return [path.read_bytes()]


def _write_views(path: Path) -> None:
    """A flat panel with its normals, positions and texture coordinates; stored plain, so that the numbers themselves are mutated."""
    row, column = np.mgrid[0:8, 0:8]
    u, v = (column + 0.5) / 8, (row + 0.5) / 8
    layers = {"P.X": u, "P.Y": v, "P.Z": 0.0 * u, "N.X": 0.0 * u, "N.Y": 0.0 * u, "N.Z": 1.0 + 0.0 * u}
    layers |= {"T.X": 1.0 + 0.0 * u, "T.Y": 0.0 * u, "T.Z": 0.0 * u}
    layers |= (
        {"uv.U": u, "uv.V": v, "A": 1.0 + 0.0 * u}
        | {f"SE.{c}": 0.01 + 0.0 * u for c in "RGB"}
        | dict.fromkeys("RGB", 0.2 + u * v)
    )
    pixels = {name: a.astype(np.float32) for name, a in layers.items()}
    OpenEXR.File({"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}, pixels).write(str(path))


def _png(mode: str) -> bytes:
    data = io.BytesIO()
    Image.fromarray(np.arange(48, dtype=np.uint8).reshape(6, 8)).convert(mode).save(data, "PNG")
    return data.getvalue()
