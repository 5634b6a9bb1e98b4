"""Blender: a Python script that makes the material with `bpy`, and the inputs of a Principled BSDF as they are read back."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from . import words
from .convert import Conversion
from .engine import Engine

SCHEMA = "layerfit/principled"

SCRIPT = '''\
"""{name}: a material for Blender {versions}, written by layerfit. Run it in Blender's text editor, or

    blender scene.blend --background --python {name}.py

It makes the material and gives it to the active object, where there is one.
"""

import bpy

INPUTS = {inputs}

material = bpy.data.materials.get({quoted}) or bpy.data.materials.new({quoted})
material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
nodes.clear()
shader = nodes.new("ShaderNodeBsdfPrincipled")
output = nodes.new("ShaderNodeOutputMaterial")
output.location.x = 400
shader.distribution = "GGX"  # what the values are found for; MULTI_GGX is brighter where it is rough
for name, value in INPUTS.items():
    shader.inputs[name].default_value = (*value, 1.0) if isinstance(value, list) else value
links.new(shader.outputs["BSDF"], output.inputs["Surface"])
active = bpy.context.view_layer.objects.active
if active is not None and hasattr(active.data, "materials"):
    active.data.materials.clear()
    active.data.materials.append(material)
'''


def write(found: Conversion) -> str:
    """A script that makes the material."""
    inputs = json.dumps(principled(found.engine), indent=4)
    versions = "4 and 5" if found.engine.film_nm is None else "5, whose metals have films"
    return SCRIPT.format(name=found.name, versions=versions, quoted=json.dumps(found.name), inputs=inputs)


def principled(engine: Engine) -> dict[str, Any]:
    """Inputs of a Principled BSDF by the names that Blender shows: numbers, and colours as lists."""
    found: dict[str, Any] = {
        "Base Color": words.color(engine.base_color),
        "Metallic": words.metallic(engine),
        "IOR": words.digits(engine.ior) if engine.base == "glossy" else 1.5,
        "Specular IOR Level": 0.5 if engine.base == "glossy" else 0.0,  # 0: a dielectric without a lobe
    } | _lobe(engine)
    if engine.edge_tint is not None:
        found["Specular Tint"] = words.color(engine.edge_tint)
    if engine.coat_alpha is not None:
        found |= {
            "Coat Weight": 1.0,
            "Coat Roughness": words.roughness(engine.coat_alpha),
            "Coat IOR": words.digits(engine.coat_ior),
        }
        if engine.coat_tau is not None:
            found["Coat Tint"] = words.tint(engine, 2.0)
    if engine.film_nm is not None:
        found |= {"Thin Film Thickness": words.digits(engine.film_nm), "Thin Film IOR": words.digits(engine.film_eta)}
    return found


def _lobe(engine: Engine) -> dict[str, float]:
    """Cycles has alpha / aspect along the tangent and alpha aspect across it, aspect^2 = 1 - .9 anisotropic."""
    pair = words.widths(engine)
    if pair is None:
        return {"Roughness": 1.0 if engine.alpha is None else words.roughness(engine.alpha)}
    anisotropic = min((1.0 - pair[1] / pair[0]) / 0.9, 1.0)
    grain = {"Roughness": words.roughness(math.sqrt(pair[0] * pair[1])), "Anisotropic": words.digits(anisotropic)}
    return grain | ({"Anisotropic Rotation": 0.25} if words.across(engine) else {})


DEFAULTS: dict[str, Any] = {
    "Base Color": [0.8, 0.8, 0.8],
    "Metallic": 0.0,
    "Roughness": 0.5,
    "IOR": 1.5,
    "Specular IOR Level": 0.5,
    "Specular Tint": [1.0, 1.0, 1.0],
    "Anisotropic": 0.0,
    "Anisotropic Rotation": 0.0,
    "Coat Weight": 0.0,
    "Coat Roughness": 0.03,
    "Coat IOR": 1.5,
    "Coat Tint": [1.0, 1.0, 1.0],
    "Thin Film Thickness": 0.0,
    "Thin Film IOR": 1.33,
}
"""Of the inputs that are read (Blender 4 and 5)."""


def read(path: Path, document: Any) -> Engine:
    """The inputs that the script of `layerfit blender-kit` leaves beside a render: {"schema": "layerfit/principled", "inputs": {...}}."""
    given = document.get("inputs") if isinstance(document, dict) and document.get("schema") == SCHEMA else None
    if not isinstance(given, dict):
        raise InputError(
            f'{path}: not a material of Blender: "schema" should be {SCHEMA!r}. `layerfit blender-kit` writes such files'
        )
    return engine_of(
        DEFAULTS
        | {
            key: words.checked(_three(value), DEFAULTS[key], f"{path}: {key}")
            for key, value in given.items()
            if key in DEFAULTS
        }
    )


def _three(value: Any) -> Any:
    """A colour without its alpha."""
    return value[:3] if isinstance(value, list) and len(value) == 4 else value


def engine_of(values: dict[str, Any]) -> Engine:
    """The coat over a base of a Principled BSDF's inputs."""
    coated = values["Coat Weight"] > 0.0
    kind = words.base_of(values["Metallic"], values["Specular IOR Level"] > 0.0 and not coated)
    found: dict[str, Any] = {"base": kind, "base_color": np.asarray(values["Base Color"], float)}
    alpha = words.width(values["Roughness"])
    if kind == "mixed":
        found["metallic"] = values["Metallic"]
    if kind in ("metal", "mixed"):
        found["edge_tint"] = np.asarray(values["Specular Tint"], float)
    if kind == "metal" and values["Thin Film Thickness"] > 0.0:
        found |= words.film(values["Thin Film Thickness"], values["Thin Film IOR"])
    if kind == "glossy":
        found["ior"] = float(np.clip(values["IOR"], 1.0, 3.0))
    if values["Anisotropic"] > 0.0:
        aspect = math.sqrt(1.0 - 0.9 * min(values["Anisotropic"], 1.0))
        turned = abs(math.sin(2.0 * math.pi * values["Anisotropic Rotation"])) > 0.5
        pair = (words.clipped(alpha / aspect), words.clipped(alpha * aspect))
        found |= dict(zip(("alpha_x", "alpha_y"), pair[::-1] if turned else pair, strict=True))
    elif kind != "diffuse":
        found["alpha"] = alpha
    if coated:
        found |= {"coat_alpha": words.width(values["Coat Roughness"]), "coat_ior": values["Coat IOR"]}
        if min(values["Coat Tint"]) < 1.0:
            found["coat_tau"] = words.depth(values["Coat Tint"], 2.0)
    return Engine(dialect="blender", **found)
