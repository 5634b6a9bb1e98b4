"""OpenPBR as a MaterialX document: written as text, read and checked as text; the MaterialX package, where it is there, checks it too."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from . import words
from .convert import Conversion
from .engine import Engine

VERSION = "1.39"
NODE = "open_pbr_surface"


def write(found: Conversion) -> str:
    """An .mtlx document with one surface and one material."""
    root = ET.Element("materialx", version=VERSION, colorspace="lin_rec709")
    engine = found.engine
    if words.across(engine):
        turned = ET.SubElement(root, "bitangent", name="across", type="vector3")
        ET.SubElement(turned, "input", name="space", type="string", value="world")
    node = ET.SubElement(root, NODE, name=f"{found.name}_surface", type="surfaceshader")
    for name, value in inputs(engine).items():
        kind = "color3" if isinstance(value, list) else "float"
        ET.SubElement(node, "input", name=name, type=kind, value=_text(value))
    if words.across(engine):
        ET.SubElement(node, "input", name="geometry_tangent", type="vector3", nodename="across")
    material = ET.SubElement(root, "surfacematerial", name=found.name, type="material")
    ET.SubElement(material, "input", name="surfaceshader", type="surfaceshader", nodename=f"{found.name}_surface")
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _text(value: Any) -> str:
    return ", ".join(f"{v:.6g}" for v in value) if isinstance(value, list) else f"{value:.6g}"


def inputs(engine: Engine) -> dict[str, Any]:
    """Inputs of the surface: numbers, and colours as lists."""
    under = 1.0 if engine.coat_alpha is None or engine.coat_ior is None else words.digits(engine.coat_ior)
    found = {"base_color": words.color(engine.base_color), "base_metalness": words.metallic(engine)} | _specular(engine)
    # The index of the coat below the coat, or 1 in air: a dielectric without a lobe.
    found["specular_ior"] = words.digits(engine.ior) if engine.base == "glossy" else under
    if engine.coat_alpha is not None:
        found |= {"coat_weight": 1.0, "coat_ior": under, "coat_roughness": words.roughness(engine.coat_alpha)}
        found["coat_darkening"] = float(engine.base == "diffuse")
        if engine.coat_tau is not None:
            found["coat_color"] = words.tint(engine, 2.0)
    return found


def _specular(engine: Engine) -> dict[str, Any]:
    if engine.base == "diffuse":
        return {"specular_roughness": 1.0}
    tinted = {} if engine.edge_tint is None else {"specular_color": words.color(engine.edge_tint)}
    pair = words.widths(engine)
    if pair is None:
        return tinted | {"specular_roughness": words.roughness(engine.alpha)}
    mean = math.sqrt(0.5 * (pair[0] ** 2 + pair[1] ** 2))  # OpenPBR 1.1, "Microfacet model"
    return tinted | {
        "specular_roughness": words.roughness(mean),
        "specular_roughness_anisotropy": words.digits(1.0 - pair[1] / pair[0]),
    }


DEFAULTS: dict[str, Any] = {
    "base_weight": 1.0,
    "base_color": [0.8, 0.8, 0.8],
    "base_metalness": 0.0,
    "specular_weight": 1.0,
    "specular_color": [1.0, 1.0, 1.0],
    "specular_roughness": 0.3,
    "specular_ior": 1.5,
    "specular_roughness_anisotropy": 0.0,
    "coat_weight": 0.0,
    "coat_color": [1.0, 1.0, 1.0],
    "coat_roughness": 0.0,
    "coat_ior": 1.6,
    "thin_film_weight": 0.0,
    "thin_film_thickness": 0.5,
    "thin_film_ior": 1.4,
}
"""Of the inputs that are read (OpenPBR 1.1)."""


def read(path: Path, text: str) -> Engine:
    """The first OpenPBR surface of a document. Raises `InputError` where there is none, or where a graph gives an input its value."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{path}: declares entities, which no MaterialX document does; it is not read")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"{path}: not valid XML: {error}") from None
    node = root.find(f".//{NODE}")
    if node is None:
        raise InputError(
            f"{path}: there is no {NODE} in it. MaterialX translates others, such as standard_surface, to OpenPBR; read what it gives"
        )
    values = {str(item.get("name")): _value(item, path) for item in node.findall("input") if item.get("name") in DEFAULTS}
    engine = engine_of(DEFAULTS | values)
    return replace(engine, alpha_x=engine.alpha_y, alpha_y=engine.alpha_x) if _turned(root, node) else engine


def _turned(root: ET.Element, node: ET.Element) -> bool:
    """Whether the tangent is the bitangent: how a greater width across it is written."""
    linked = node.find("input[@name='geometry_tangent']")
    return linked is not None and any(turned.get("name") == linked.get("nodename") for turned in root.findall("bitangent"))


def _value(item: ET.Element, path: Path) -> Any:
    text = item.get("value")
    where = f"{path}: {item.get('name')}"
    if text is None:
        raise InputError(
            f"{where}: comes from a graph or a texture, and a material here is the same everywhere. Give it a value"
        )
    try:
        numbers = [float(v) for v in text.split(",")]
    except ValueError:
        numbers = []
    return words.checked(numbers[0] if len(numbers) == 1 else numbers or text, DEFAULTS[str(item.get("name"))], where)


def engine_of(values: dict[str, Any]) -> Engine:
    """The coat over a base of OpenPBR's inputs."""
    coated = values["coat_weight"] > 0.0
    kind = words.base_of(values["base_metalness"], _has_lobe(values, coated))
    own = words.width(values["specular_roughness"])
    found: dict[str, Any] = {"base": kind, "base_color": np.multiply(values["base_color"], values["base_weight"])}
    if kind == "mixed":
        found["metallic"] = values["base_metalness"]
    if kind in ("metal", "mixed"):
        found["edge_tint"] = np.asarray(values["specular_color"], float)
    if kind == "metal" and values["thin_film_weight"] > 0.0:
        found |= words.film(1000.0 * values["thin_film_thickness"], values["thin_film_ior"])  # from micrometres
    if kind == "glossy" and not coated:
        found["ior"] = values["specular_ior"]
    if ratio := min(max(values["specular_roughness_anisotropy"], 0.0), 0.999):
        along = own * math.sqrt(2.0 / (1.0 + (1.0 - ratio) ** 2))
        found |= {"alpha_x": words.clipped(along), "alpha_y": words.clipped(along * (1.0 - ratio))}
    elif kind != "diffuse":
        found["alpha"] = own
    if coated:
        found |= {"coat_alpha": words.width(values["coat_roughness"]), "coat_ior": values["coat_ior"]}
        if min(values["coat_color"]) < 1.0:
            found["coat_tau"] = words.depth(values["coat_color"], 2.0)
        if kind == "glossy":  # two dielectric lobes over a diffuse part: the coat's is the one that is seen
            found |= {"base": "diffuse", "alpha": None, "alpha_x": None, "alpha_y": None}
    return Engine(dialect="openpbr", **found)


def _has_lobe(values: dict[str, Any], coated: bool) -> bool:
    outside = values["coat_ior"] if coated else 1.0
    return values["specular_weight"] > 0.0 and values["specular_ior"] != outside
