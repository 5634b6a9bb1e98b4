"""glTF 2.0: a material with a sphere to look at it on, as one .gltf file; and the materials of .gltf and .glb files."""

import base64
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.geometry import sphere_mesh
from ..errors import InputError
from . import words
from .convert import Conversion
from .engine import Engine

CLEARCOAT, IOR, SPECULAR, ANISOTROPY, IRIDESCENCE = (
    f"KHR_materials_{name}" for name in ("clearcoat", "ior", "specular", "anisotropy", "iridescence")
)
SEGMENTS, RINGS = 48, 24
"""Of the sphere that the material is put on."""


def write(found: Conversion) -> str:
    """A .gltf document: one material, on a sphere of radius 1 that is in the file."""
    made = material(found.engine, found.name)
    document = {"asset": {"version": "2.0", "generator": "layerfit"}} | _sphere(ANISOTROPY in made.get("extensions", {}))
    if used := list(made.get("extensions", {})):
        document["extensionsUsed"] = used
    return json.dumps(document | {"materials": [made]}, indent=1) + "\n"


def material(engine: Engine, name: str) -> dict[str, Any]:
    """The material alone, an entry of "materials"."""
    pair = words.widths(engine)
    alpha = engine.alpha if pair is None else pair[1]
    metallic_roughness = {
        "baseColorFactor": [*words.color(engine.base_color), 1.0],
        "metallicFactor": words.metallic(engine),
        "roughnessFactor": 1.0 if alpha is None else words.roughness(alpha),
    }
    extensions: dict[str, Any] = {}
    if engine.base == "glossy":
        extensions[IOR] = {"ior": words.digits(engine.ior)}
    elif engine.base != "metal":
        extensions[SPECULAR] = {"specularFactor": 0.0}  # else a dielectric has a lobe of its own
    if pair is not None:
        extensions[ANISOTROPY] = {"anisotropyStrength": words.strength(pair)}
        if words.across(engine):
            extensions[ANISOTROPY]["anisotropyRotation"] = words.digits(0.5 * math.pi)
    if engine.coat_alpha is not None:
        extensions[CLEARCOAT] = {"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": words.roughness(engine.coat_alpha)}
    if engine.film_nm is not None:
        film = {
            "Ior": engine.film_eta,
            "ThicknessMinimum": 0.0,
            "ThicknessMaximum": engine.film_nm,
        }  # the maximum holds without a texture
        extensions[IRIDESCENCE] = {"iridescenceFactor": 1.0} | {
            f"iridescence{key}": words.digits(value) for key, value in film.items()
        }
    made: dict[str, Any] = {"name": name, "pbrMetallicRoughness": metallic_roughness}
    return made | ({"extensions": extensions} if extensions else {})


def _sphere(tangents: bool) -> dict[str, Any]:
    """Scene, mesh and buffer of a sphere with normals, which are its positions, and triangles."""
    normal, tangent, _, corners = sphere_mesh(RINGS, SEGMENTS)
    normal, triangles = normal.astype("<f4"), corners.astype("<u2")
    tangent = np.pad(tangent, ((0, 0), (0, 1)), constant_values=1.0).astype("<f4")
    low, high = normal.min(0).tolist(), normal.max(0).tolist()
    accessors: list[dict[str, Any]] = [
        {"componentType": 5126, "count": len(normal), "type": "VEC3", "min": low, "max": high},
        {"componentType": 5123, "count": triangles.size, "type": "SCALAR"},
    ]
    attributes, parts, targets = {"POSITION": 0, "NORMAL": 0}, [normal, triangles], [34962, 34963]
    if tangents:
        attributes["TANGENT"] = 2
        accessors.append({"componentType": 5126, "count": len(normal), "type": "VEC4"})
        parts, targets = [*parts, tangent], [*targets, 34962]
    starts = np.cumsum([0, *(part.nbytes for part in parts)]).tolist()
    data = base64.b64encode(b"".join(part.tobytes() for part in parts)).decode()
    return {
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "sphere"}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 1, "material": 0}]}],
        "accessors": [{"bufferView": k} | accessor for k, accessor in enumerate(accessors)],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": part.nbytes, "target": target}
            for start, part, target in zip(starts, parts, targets, strict=False)
        ],
        "buffers": [{"byteLength": starts[-1], "uri": f"data:application/octet-stream;base64,{data}"}],
    }


def read(path: Path, content: bytes) -> Engine:
    """The first material of a .gltf or .glb file. Raises `InputError` where there is none, or a texture gives it its values."""
    try:
        document = json.loads(_json_chunk(path, content) if path.suffix.lower() == ".glb" else content)
        made = document["materials"][0]
    except (ValueError, KeyError, IndexError, TypeError, RecursionError):
        raise InputError(f"{path}: there is no glTF material in it; export one from your program as .gltf or .glb") from None
    return engine_of(made, str(path))


def _json_chunk(path: Path, content: bytes) -> bytes:
    """The first chunk of a binary file (glTF 2.0, 4.4): 12 bytes of header, its length, its type."""
    length = int.from_bytes(content[12:16], "little")
    if content[:4] != b"glTF" or content[16:20] != b"JSON" or length > len(content) - 20:
        raise InputError(f"{path}: is not a binary glTF file; is it cut short, or a .gltf?")
    return content[20 : 20 + length]


def engine_of(made: Any, where: str) -> Engine:
    """The coat over a base of an entry of "materials"."""
    basic = _table(made, "pbrMetallicRoughness", where)
    extensions = _table(made, "extensions", where)
    coat, ior, specular, grain, film = (
        _table(extensions, name, where) for name in (CLEARCOAT, IOR, SPECULAR, ANISOTROPY, IRIDESCENCE)
    )
    number = lambda table, key, default: _number(table, key, default, where)  # noqa: E731
    metallic = number(basic, "metallicFactor", 1.0)
    coated = number(coat, "clearcoatFactor", 0.0) > 0.0
    kind = words.base_of(metallic, number(specular, "specularFactor", 1.0) > 0.0 and not coated)
    found: dict[str, Any] = {"base": kind, "base_color": np.array(_color(basic, where))}
    alpha = words.width(number(basic, "roughnessFactor", 1.0))
    if kind == "mixed":
        found["metallic"] = metallic
    if kind == "metal" and number(film, "iridescenceFactor", 0.0) > 0.0:
        found |= words.film(number(film, "iridescenceThicknessMaximum", 400.0), number(film, "iridescenceIor", 1.3))
    if kind == "glossy":
        found["ior"] = float(np.clip(number(ior, "ior", 1.5), 1.0, 3.0))
    if strength := number(grain, "anisotropyStrength", 0.0):
        wide, turned = (
            alpha + (1.0 - alpha) * min(strength, 1.0) ** 2,
            abs(math.sin(number(grain, "anisotropyRotation", 0.0))) > 0.5,
        )
        found |= {"alpha_x": alpha if turned else wide, "alpha_y": wide if turned else alpha}
    elif kind != "diffuse":
        found["alpha"] = alpha
    if coated:
        found["coat_alpha"] = words.width(number(coat, "clearcoatRoughnessFactor", 0.0))
    return Engine(dialect="gltf", **found)


def _table(table: Any, key: str, where: str) -> dict[str, Any]:
    found = table.get(key, {}) if isinstance(table, dict) else None
    if not isinstance(found, dict):
        raise InputError(f"{where}: {key} should be a table of keys")
    if textured := [name for name in found if name.endswith("Texture")]:
        raise InputError(
            f"{where}: {textured[0]} gives the material its values, which is the same everywhere here. Use factors alone"
        )
    return found


def _number(table: dict[str, Any], key: str, default: float, where: str) -> float:
    return float(words.checked(table.get(key, default), default, f"{where}: {key}"))


def _color(table: dict[str, Any], where: str) -> list[float]:
    value = table.get("baseColorFactor", [1.0] * 4)
    if not isinstance(value, list) or len(value) != 4:
        raise InputError(f"{where}: baseColorFactor = {value!r}: should be four numbers")
    return [_number({"baseColorFactor": v}, "baseColorFactor", 1.0, where) for v in value[:3]]
