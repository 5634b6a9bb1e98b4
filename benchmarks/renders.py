"""Renders with known materials as scenes to fit from a poor start, with the truth kept apart.

Two kinds of folders: scenes with `NAME.truth.json` beside them, as in examples/references; and renders with everything that is known of
them in `NAME.json`, where the scene is made here from the camera, the light and the kind of the material alone.
"""

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from layerfit.capture.exr import write_exr
from layerfit.capture.scene import Scene
from layerfit.capture.scene_file import read_scene

LACQUER = Path(__file__).parents[1] / "examples" / "references" / "lacquered_copper.toml"
"""Six parameters of a coat over copper, from a poor start."""


def lacquer_scene(folder: Path, side: int, model: str) -> Path:
    """The scene `LACQUER` in a folder, of an analytic sphere on `side` x `side` pixels; its reference is blank until one is rendered."""
    image = folder / "reference.exr"
    write_exr(image, dict.fromkeys("RGB", np.ones((side, side))))
    text = LACQUER.read_text(encoding="utf-8").replace("lacquered_copper.exr", image.name)
    text = text.replace("[material]\n", f'[geometry]\nkind = "sphere"\n\n[material]\nmodel = "{model}"\n')
    scene = folder / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    return scene


@dataclasses.dataclass(frozen=True)
class Render:
    """A scene with a poor start, and the true values of its free parameters as far as they are known."""

    name: str
    scene: Scene
    truth: dict[str, Any]


def renders(folder: Path, scratch: Path, model: str | None = None) -> Iterator[Render]:
    """Every render in a folder; scenes that have to be made are written to `scratch`. `model` replaces the default one."""
    for path in sorted(folder.glob("*.truth.json")):
        truth = json.loads(path.read_text()).get("material", {})  # of Blender's material, no slab is known
        yield Render(
            path.name.removesuffix(".truth.json"),
            read_scene(path.with_name(path.name.replace(".truth.json", ".toml"))),
            _named(truth),
        )
    for path in sorted(folder.glob("*.json")):
        if not path.name.endswith(".truth.json"):
            yield render(path, scratch, model)


def render(path: Path, scratch: Path, model: str | None = None) -> Render:
    """One render that is described by `NAME.json`."""
    known = json.loads(path.read_text())
    material, truth = _start(known["material"])
    if model is not None:
        material["model"] = model
    scene = {
        "reference": {"exr": str(path.with_name(known.get("file", path.stem + ".exr")))},
        "camera": {key: known["camera"][key] for key in ("position", "look_at", "up", "vfov_deg")},
        "light": [_light(light, path) for light in _list(known["light"])],
        "material": material,
    }
    made = scratch / f"{path.stem}.json"
    made.write_text(json.dumps(scene))
    return Render(path.stem, read_scene(made), truth)


def errors(render: Render, found: dict[str, Any]) -> dict[str, float]:
    """Relative error of every scalar that is known; channels apart, with a floor of .3 below an optical depth."""
    rows = {}
    for name, wanted in render.truth.items():
        if name in found:
            wanted, value = np.atleast_1d(wanted), np.atleast_1d(found[name])
            scale = np.maximum(wanted, 0.3) if name.endswith(".tau") else np.abs(wanted)
            for c, error in enumerate(np.abs(value - wanted) / scale):
                rows[name if len(wanted) == 1 else f"{name}[{c}]"] = float(error)
    return rows


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


_LIGHT_KEYS = {
    "directional": ("to_light", "irradiance_rgb"),
    "point": ("position", "intensity_rgb"),
    "constant": ("radiance_rgb",),
    "envmap": ("scale",),
}


def _light(light: dict[str, Any], path: Path) -> dict[str, Any]:
    table = {"type": light["type"]} | {key: light[key] for key in _LIGHT_KEYS[light["type"]]}
    if light["type"] == "envmap":
        table |= {"file": str(path.with_name(light["file"])), "rows": "on poles"}
    return table


_COAT = {"type": "coat", "name": "coat", "alpha": 0.3, "eta": 1.4, "tau": [0.3, 0.3, 0.3], "masking": "smith_separable"}
_LAMBERT = {"type": "lambert", "name": "base", "albedo": [0.5, 0.5, 0.5]}


def _conductor(eta: Any, k: Any, masking: str = "smith_separable") -> dict[str, Any]:
    return {"type": "conductor", "name": "base", "alpha": 0.4, "eta": eta, "k": k, "masking": masking}


def _start(material: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Where a fit starts, knowing the kinds of the layers and the metal's indices; and the truth."""
    bsdf = material.get("bsdf", {})
    kind = bsdf.get("type") or material.get("base", {}).get("type")
    if "coat" in material:
        coat, base = material["coat"], material["base"]
        truth = {"coat.alpha": coat["alpha"], "coat.eta": coat["ior"], "coat.tau": material["medium"]["optical_depth_rgb"]}
        if kind == "diffuse":
            return {"layers": [_COAT], "base": _LAMBERT}, truth | {"base.albedo": base["albedo_rgb"]}
        metal = _conductor(base["eta_abs_rgb"], base["k_abs_rgb"])
        return {"layers": [_COAT], "base": metal}, truth | {"base.alpha": base["alpha"]}
    if kind == "roughconductor":
        return {"base": _conductor(bsdf["eta"]["value"], bsdf["k"]["value"])}, {"base.alpha": bsdf["alpha"]}
    if kind == "roughplastic":
        truth = {"coat.alpha": bsdf["alpha"], "coat.eta": bsdf["int_ior"], "base.albedo": bsdf["diffuse_reflectance"]["value"]}
        clear = {key: value for key, value in _COAT.items() if key != "tau"}
        return {"layers": [clear], "base": _LAMBERT}, truth
    if kind == "diffuse":
        return {"base": _LAMBERT}, {"base.albedo": bsdf["reflectance"]["value"]}
    # Blender's Principled BSDF: its coat tints by another law and its masking is the joint one, so no truth of a slab is known.
    coat = _COAT | {"masking": "smith"}
    if material.get("inputs", {}).get("Metallic"):
        return {"layers": [coat], "base": _conductor([0.2, 0.92, 1.1], [3.9, 2.45, 2.14], "smith")}, {}
    if material.get("inputs", {}).get("Coat Weight") or kind == "principled":
        return {"layers": [coat], "base": _LAMBERT}, {}
    return {"base": _LAMBERT}, {"base.albedo": material["inputs"]["Base Color"]} if "inputs" in material else {}


def _named(material: dict[str, Any]) -> dict[str, Any]:
    """Truth of a scene of our own as parameter names."""
    return {
        f"{layer}.{key}": value
        for layer, values in material.items()
        for key, value in values.items()
        if isinstance(value, (int, float, list)) and not (layer == "base" and key in ("eta", "k"))
    }
