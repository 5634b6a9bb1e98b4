"""Scene files: what is known of a reference render, and what is asked of the fit.

`read_scene` returns the records of `capture.scene`; nothing is opened but the scene file itself and the preset that it names.
"""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import check_keys, nearest, read_document
from ..errors import InputError
from ..preset import FORM_KEYS, form_of, read_preset, stack_of
from ..shipped import check_not_preset
from ..stack import Stack
from .scene import (
    AMBIENT,
    LOSSES,
    METRICS,
    WHOLE,
    Camera,
    Constant,
    Directional,
    Disk,
    EnvironmentMap,
    FitRequest,
    Light,
    MapRequest,
    MeasuredReference,
    Point,
    Rectangle,
    Reference,
    Scene,
    Sphere,
    SphereLight,
)
from .values import direction, layout, need, number, one_of, positive, rgb, text, vector

MOST_STARTS = 1000
"""Of a fit: each takes seconds."""
MOST_TEXELS = 4096
"""On a side of a map: memory holds what was seen of all of them."""


def read_scene(path: str | Path, start: Stack | None = None) -> Scene:
    """Read a scene file (TOML or JSON); `start` stands in for its [material] where it has none. Raises `InputError` naming the key at fault."""
    path = Path(path)
    check_not_preset(path)
    document = read_document(path)
    where = str(path)
    if "schema" in document:
        raise InputError(
            f"{where}: is a {document['schema']}, not a scene file, which says reference, camera, lights and what to fit. "
            f'A scene starts from a preset by preset = "{path.name}" in its [material].'
        )
    check_keys(document, ("reference", "geometry", "camera", "light", "material", "fit", "map"), where)
    entries = document.get("reference")
    if entries is None:
        raise InputError(f'{where}: there is no [reference]; give one, with exr = "NAME.exr" or brdf = "NAME.bsdf"')
    entries = entries if isinstance(entries, list) else [entries]
    return Scene(
        path,
        tuple(r for k, entry in enumerate(entries) for r in _references(entry, document, path, f"{where}: reference[{k}]")),
        start if start is not None and "material" not in document else _start(document.get("material"), path),
        _fit(document.get("fit", {}), f"{where}: fit"),
        _map(document.get("map", {}), f"{where}: map"),
    )


_CHANNEL_KEYS = ("beauty", "alpha", "normal", "position", "tangent", "uv", "depth", "noise")


def _references(entry: Any, document: Mapping[str, Any], path: Path, where: str) -> list[Reference] | list[MeasuredReference]:
    if isinstance(entry, Mapping) and "brdf" in entry:
        return _measured(entry, path, where)
    check_keys(entry, ("exr", "brdf", *_CHANNEL_KEYS, "mask", "camera", "light", "geometry", "thickness_scale"), where)
    if "exr" not in entry:
        raise InputError(f"{where}: there is no exr; name the reference render, or a measured brdf")
    names = entry["exr"] if isinstance(entry["exr"], list) else [entry["exr"]]
    camera = entry.get("camera", document.get("camera"))
    lights = entry.get("light", document.get("light"))
    geometry = entry.get("geometry", document.get("geometry"))
    if camera is None:
        raise InputError(f"{path}: there is no [camera]; give its position, look_at, up and vfov_deg")
    if not lights:
        raise InputError(f'{path}: there is no [[light]]; give at least one, for example type = "directional"')
    channels = {key: text(entry[key], f"{where}.{key}") for key in _CHANNEL_KEYS if key in entry}
    scale = _thickness_scale(entry, where)
    lights = lights if isinstance(lights, list) else [lights]
    return [
        Reference(
            exr=path.parent / text(name, f"{where}.exr"),
            camera=_camera(camera, f"{path}: camera"),
            lights=tuple(_light(light, path, f"{path}: light[{k}]") for k, light in enumerate(lights)),
            geometry=None if geometry is None else _geometry(geometry, f"{path}: geometry"),
            channels=channels,
            mask=path.parent / text(entry["mask"], f"{where}.mask") if "mask" in entry else None,
            thickness_scale=scale,
        )
        for name in names
    ]


def _measured(entry: Mapping[str, Any], path: Path, where: str) -> list[MeasuredReference]:
    check_keys(entry, ("brdf", "illuminant", "min_half_deg", "thickness_scale"), where)
    names = entry["brdf"] if isinstance(entry["brdf"], list) else [entry["brdf"]]
    least = number(entry.get("min_half_deg", 0.0), f"{where}.min_half_deg")
    if not 0.0 <= least < 90.0:
        raise InputError(f"{where}.min_half_deg = {least:g}: should be from 0 to below 90 degrees")
    illuminant = text(entry.get("illuminant", "D65"), f"{where}.illuminant")
    scale = _thickness_scale(entry, where)
    return [MeasuredReference(path.parent / text(name, f"{where}.brdf"), illuminant, least, scale) for name in names]


def _thickness_scale(entry: Mapping[str, Any], where: str) -> dict[str, float]:
    scale = entry.get("thickness_scale", {})
    if not isinstance(scale, Mapping):
        raise InputError(f"{where}.thickness_scale = {scale!r}: should be a table of layers")
    return {str(k): positive(v, f"{where}.thickness_scale.{k}") for k, v in scale.items()}


def _start(material: Any, path: Path) -> Stack:
    where = f"{path}: material"
    if material is None:
        raise InputError(f'{path}: there is no [material]; name a start with preset = "FILE.json" or give layers and base')
    if not isinstance(material, Mapping):
        raise InputError(f"{where}: should be a table of keys, not {material!r}")
    if "preset" not in material:
        return stack_of(material, where)
    check_keys(material, ("preset", *FORM_KEYS), where)
    stack = read_preset(path.parent / text(material["preset"], f"{where}.preset"))
    if not any(key in material for key in FORM_KEYS):
        return stack
    return dataclasses.replace(stack, form=form_of(material, stack.layers, stack.base, where))


def _fit(table: Any, where: str) -> FitRequest:
    check_keys(table, [*(f.name for f in dataclasses.fields(FitRequest)), "weights"], where)
    values = dict(table)
    if "weights" in values:  # what `metric` was called when there were two of them
        if "metric" in values:
            raise InputError(f"{where}: weights is a former name of metric; give metric alone")
        values["metric"] = values.pop("weights")
    for key in ("free", "also", "each"):
        if key in values:
            values[key] = _names(values[key], f"{where}.{key}")
    check_request(values, where)
    if "min_cosine" in values and not 0.0 <= number(values["min_cosine"], f"{where}.min_cosine") < 1.0:
        raise InputError(f"{where}.min_cosine = {values['min_cosine']!r}: should be from 0 to below 1")
    if not isinstance(values.get("fixed", {}), Mapping):
        raise InputError(f"{where}.fixed = {values['fixed']!r}: should be a table of parameters and their values")
    return FitRequest(**values)


def check_request(values: Mapping[str, Any], where: str) -> None:
    """Raise `InputError` for a choice of a fit that is none: of those that may also be given beside a scene."""
    for key, known in (("loss", LOSSES), ("metric", METRICS)):
        if values.get(key, known[0]) not in known:
            raise InputError(
                f"{where}.{key} = {values[key]!r}: should be one of {', '.join(known)}{nearest(str(values[key]), known)}"
            )
    for key, (least, most) in (("starts", (1, MOST_STARTS)), ("seed", (0, 2**63 - 1))):
        _check_whole(values.get(key, least), least, most, f"{where}.{key}")


def _map(table: Any, where: str) -> MapRequest:
    check_keys(table, [f.name for f in dataclasses.fields(MapRequest)], where)
    values = dict(table)
    if "free" in values:
        values["free"] = _names(values["free"], f"{where}.free")
    for key, most in (("size", MOST_TEXELS), ("starts", MOST_STARTS)):
        if key in values:
            _check_whole(values[key], 1, most, f"{where}.{key}")
    smooth = values.get("smooth", {})
    for name, value in (smooth if isinstance(smooth, Mapping) else {"": smooth}).items():
        positive(value, f"{where}.smooth.{name}".rstrip("."))
    return MapRequest(**values)


def _names(value: Any, where: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise InputError(f'{where}: should be a list of parameters such as "coat.alpha"')
    return tuple(value)


def _check_whole(value: Any, least: int, most: int, where: str) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise InputError(f"{where} = {value!r}: should be a whole number from {least} to {most}")


def _camera(table: Any, where: str) -> Camera:
    check_keys(table, ("position", "look_at", "up", "vfov_deg"), where)
    camera = Camera(
        vector(need(table, "position", where), f"{where}.position"),
        vector(need(table, "look_at", where), f"{where}.look_at"),
        vector(table.get("up", (0.0, 1.0, 0.0)), f"{where}.up"),
        number(need(table, "vfov_deg", where), f"{where}.vfov_deg"),
    )
    if not 0.0 < camera.vfov_deg < 180.0:
        raise InputError(f"{where}.vfov_deg = {camera.vfov_deg:g}: a vertical field of view lies between 0 and 180 degrees")
    view = np.subtract(camera.look_at, camera.position)
    if np.linalg.norm(np.cross(view, camera.up)) < 1e-9 * max(np.linalg.norm(view), 1e-30):
        raise InputError(
            f"{where}: position, look_at and up do not span a view: look_at equals position, or up is along the view"
        )
    return camera


def _geometry(table: Any, where: str) -> Sphere:
    check_keys(table, ("kind", "center", "radius"), where)
    if table.get("kind") != "sphere":
        raise InputError(
            f'{where}.kind = {table.get("kind")!r}: should be "sphere"; leave [geometry] out to use the EXR\'s channels'
        )
    return Sphere(
        vector(table.get("center", (0.0, 0.0, 0.0)), f"{where}.center"), positive(table.get("radius", 1.0), f"{where}.radius")
    )


def _light(table: Any, path: Path, where: str) -> Light:
    kind = table.get("type") if isinstance(table, Mapping) else table
    if not isinstance(kind, str) or kind not in LIGHTS or not isinstance(table, Mapping):
        raise InputError(f"{where}.type = {kind!r}: should be one of {', '.join(LIGHTS)}{nearest(str(kind), LIGHTS)}")
    cls, readers = LIGHTS[kind]
    check_keys(table, ("type", "name", *readers), where)
    needed = {f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING}
    values: dict[str, Any] = {"name": _light_name(table["name"], f"{where}.name")} if "name" in table else {}
    for key, reader in readers.items():
        if key in table:
            values[key] = reader(table[key], f"{where}.{key}")
        elif key in needed:
            raise InputError(f"{where}: a light of type {table['type']!r} needs {key}")
    values.pop("layout", None)
    if "file" in values:
        values["file"] = path.parent / values["file"]
    if readers is _FLAT and not np.any(np.cross(values["half_u"], values["half_v"])):
        raise InputError(f"{where}: half_u and half_v lie along one line, or one of them is 0; the light has no area")
    return cls(**values)


def _light_name(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value.isidentifier() or value in (AMBIENT, WHOLE):
        raise InputError(
            f"{where} = {value!r}: should be letters, digits and underscores, and neither {AMBIENT!r} nor {WHOLE!r}, which have a meaning"
        )
    return value


_FLAT = {"center": vector, "half_u": vector, "half_v": vector, "radiance_rgb": rgb}

LIGHTS: dict[str, tuple[type, dict[str, Callable[[Any, str], Any]]]] = {
    "directional": (Directional, {"to_light": direction, "irradiance_rgb": rgb}),
    "point": (Point, {"position": vector, "intensity_rgb": rgb}),
    "constant": (Constant, {"radiance_rgb": rgb}),
    "sphere": (SphereLight, {"center": vector, "radius": positive, "radiance_rgb": rgb}),
    "rectangle": (Rectangle, _FLAT),
    "disk": (Disk, _FLAT),
    "envmap": (
        EnvironmentMap,
        {"file": text, "scale": rgb, "up": one_of("y", "z"), "rows": one_of("centre", "on poles"), "layout": layout},
    ),
}
"""By the type that a scene names: the record of a light, and what reads each of its keys."""
