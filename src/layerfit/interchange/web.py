"""three.js and Babylon.js: a module of code that makes the material."""

import json
from typing import Any

from ..shader.export import print_material
from . import gltf, words
from .convert import Conversion
from .engine import Engine

THREE = """\
// {name}, as three.js comes nearest to it (MeshPhysicalMaterial), and as it is (RawShaderMaterial). Written by layerfit.
import * as THREE from 'three';

export const material = new THREE.MeshPhysicalMaterial({physical});

// The material itself: one distant light, no image-based light. Set u_eye and u_light, both in the world's space, as your scene has them.
export const shader = new THREE.RawShaderMaterial({{
  glslVersion: THREE.GLSL3,
  uniforms: {{
    u_eye: {{ value: new THREE.Vector3(0, 0, 5) }},
    u_up: {{ value: new THREE.Vector3(0, 1, 0) }},
    u_light: {{ value: [new THREE.Vector4(0.4, 0.5, 0.768, 0)] }},
    u_light_rgb: {{ value: [new THREE.Vector3(Math.PI, Math.PI, Math.PI)] }},
  }},
  vertexShader: `
in vec3 position;
in vec3 normal;
in vec2 uv;
uniform mat4 modelMatrix, viewMatrix, projectionMatrix;
out vec3 v_position, v_normal, v_tangent;
out vec2 v_uv;
void main() {{
  vec4 world = modelMatrix * vec4(position, 1.0);
  v_position = world.xyz;
  v_normal = normalize(mat3(modelMatrix) * normal);  // no uneven scale
  v_tangent = cross(vec3(0.0, 1.0, 0.0), v_normal);
  v_uv = uv;
  gl_Position = projectionMatrix * viewMatrix * world;
}}`,
  fragmentShader: {fragment},
}});
"""

BABYLON = """\
// {name}, as Babylon.js comes nearest to it (PBRMaterial). Written by layerfit.
import {{ Color3, PBRMaterial, Vector2 }} from '@babylonjs/core';

export function make(scene) {{
  const material = new PBRMaterial({quoted}, scene);
{lines}  return material;
}}
"""


def write_three(found: Conversion) -> str:
    """An ES module with a MeshPhysicalMaterial, and the material's own shader."""
    fragment = print_material(found.stack, found.name).text("essl300").partition("\n")[2]  # three.js writes the version itself
    physical = "{\n" + "".join(f"  {key}: {value},\n" for key, value in three_settings(found.engine).items()) + "}"
    return THREE.format(name=found.name, physical=physical, fragment=json.dumps(fragment))


def three_settings(engine: Engine) -> dict[str, str]:
    """Settings of a MeshPhysicalMaterial, as code; its material is that of glTF."""
    made = gltf.material(engine, "")
    basic, extensions = made["pbrMetallicRoughness"], made.get("extensions", {})
    coat, grain, film = (extensions.get(name, {}) for name in (gltf.CLEARCOAT, gltf.ANISOTROPY, gltf.IRIDESCENCE))
    settings: dict[str, Any] = {
        "color": "new THREE.Color().setRGB({:g}, {:g}, {:g})".format(*basic["baseColorFactor"]),
        "metalness": basic["metallicFactor"],
        "roughness": basic["roughnessFactor"],
        "specularIntensity": extensions.get(gltf.SPECULAR, {}).get("specularFactor"),
        "ior": extensions.get(gltf.IOR, {}).get("ior"),
        "anisotropy": grain.get("anisotropyStrength"),
        "anisotropyRotation": grain.get("anisotropyRotation"),
        "iridescence": film.get("iridescenceFactor"),
        "iridescenceIOR": film.get("iridescenceIor"),
        "iridescenceThicknessRange": "[0, {iridescenceThicknessMaximum:g}]".format(**film) if film else None,
        "clearcoat": coat.get("clearcoatFactor"),
        "clearcoatRoughness": coat.get("clearcoatRoughnessFactor"),
    }
    return {key: value if isinstance(value, str) else f"{value:g}" for key, value in settings.items() if value is not None}


def write_babylon(found: Conversion) -> str:
    """An ES module with a function that makes a PBRMaterial."""
    lines = "".join(f"  material.{key} = {value};\n" for key, value in babylon_settings(found.engine).items())
    return BABYLON.format(name=found.name, quoted=json.dumps(found.name), lines=lines)


def babylon_settings(engine: Engine) -> dict[str, str]:
    """Settings of a PBRMaterial, as code."""
    pair = words.widths(engine)
    alpha = engine.alpha if pair is None else pair[1]
    settings = {
        "albedoColor": _color3(words.color(engine.base_color)),
        "metallic": f"{words.metallic(engine):g}",
        "roughness": "1" if alpha is None else f"{words.roughness(alpha):g}",
    }
    if engine.base == "glossy":
        settings["indexOfRefraction"] = f"{words.digits(engine.ior):g}"
    elif engine.base != "metal":
        settings["metallicF0Factor"] = "0"  # else a dielectric has a lobe of its own
    if engine.base == "mixed":
        settings["brdf.useLegacySpecularEnergyConservation"] = (
            "false"  # else that factor takes a metal's reflectance at grazing angles, too
        )
    return settings | _babylon_grain(engine, pair) | _babylon_film(engine) | _babylon_coat(engine)


def _babylon_grain(engine: Engine, pair: tuple[float, float] | None) -> dict[str, str]:
    """As in glTF, from Babylon.js 6.4 on."""
    if pair is None:
        return {}
    direction = "new Vector2(0, 1)" if words.across(engine) else "new Vector2(1, 0)"
    grain = {"isEnabled": "true", "intensity": f"{words.strength(pair):g}", "direction": direction}
    return {f"anisotropy.{key}": value for key, value in grain.items()}


def _babylon_film(engine: Engine) -> dict[str, str]:
    if engine.film_nm is None:
        return {}
    film = {"isEnabled": "true", "intensity": "1"}
    film |= {"indexOfRefraction": f"{words.digits(engine.film_eta):g}", "maximumThickness": f"{words.digits(engine.film_nm):g}"}
    return {f"iridescence.{key}": value for key, value in film.items()}


def _babylon_coat(engine: Engine) -> dict[str, str]:
    if engine.coat_alpha is None:
        return {}
    coat = {
        "isEnabled": "true",
        "intensity": "1",
        "roughness": f"{words.roughness(engine.coat_alpha):g}",
        "indexOfRefraction": f"{words.digits(engine.coat_ior):g}",
        "remapF0OnInterfaceChange": "false",  # the base's reflectance is that below the coat already
    }
    if (tint := words.tint(engine, 1.0)) is not None:
        coat |= {"isTintEnabled": "true", "tintColor": _color3(tint), "tintColorAtDistance": "1", "tintThickness": "1"}
    return {f"clearCoat.{key}": value for key, value in coat.items()}


def _color3(color: list[float]) -> str:
    return "new Color3({:g}, {:g}, {:g})".format(*color)
