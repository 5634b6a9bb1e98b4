"""Scene files: what is known of a reference render, and what is asked of the fit.

`read_scene` returns plain records; nothing is opened but the scene file itself and the preset that it names.
"""

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import check_keys, is_number, nearest, read_document
from ..errors import InputError
from ..preset import FORM_KEYS, form_of, read_preset, stack_of
from ..stack import Stack

Vector = tuple[float, float, float]

MOST_STARTS = 1000
"""Of a fit: each takes seconds."""
LARGEST = 1e15
"""Number in a scene: beyond it, squares of lengths and light leave float32."""


@dataclasses.dataclass(frozen=True)
class Camera:
    """A pinhole camera."""

    position: Vector
    look_at: Vector
    up: Vector
    vfov_deg: float


@dataclasses.dataclass(frozen=True)
class Sphere:
    """Analytic geometry of the reference."""

    center: Vector = (0.0, 0.0, 0.0)
    radius: float = 1.0


@dataclasses.dataclass(frozen=True)
class Directional:
    """Light from one direction: pixel = f cos irradiance."""

    to_light: Vector
    irradiance_rgb: Vector
    name: str = ""


@dataclasses.dataclass(frozen=True)
class Point:
    """A point light: pixel = f cos intensity / distance^2."""

    position: Vector
    intensity_rgb: Vector
    name: str = ""


@dataclasses.dataclass(frozen=True)
class Constant:
    """The same radiance from everywhere."""

    radiance_rgb: Vector
    name: str = ""


@dataclasses.dataclass(frozen=True)
class SphereLight:
    """A sphere of constant radiance."""

    center: Vector
    radius: float
    radiance_rgb: Vector
    name: str = ""


@dataclasses.dataclass(frozen=True)
class EnvironmentMap:
    """A lat-long image at infinity, Y up: u = atan2(d.x, -d.z) / 2 pi mod 1, v = acos(d.y) / pi, row 0 up.

    `up = "z"` is for renderers with Z up: the map's Y axis is then the scene's Z, and its -Z the scene's Y.
    `rows` says where row 0 lies: its "centre" half a row below the pole, or "on poles" (Mitsuba 3).
    """

    file: Path
    scale: Vector = (1.0, 1.0, 1.0)
    up: str = "y"
    rows: str = "centre"
    name: str = ""


Light = Directional | Point | Constant | SphereLight | EnvironmentMap

BRIGHTNESS = {
    Directional: "irradiance_rgb",
    Point: "intensity_rgb",
    Constant: "radiance_rgb",
    SphereLight: "radiance_rgb",
    EnvironmentMap: "scale",
}
"""What says how bright a light is."""


AMBIENT = "ambient"
"""The name of light from everywhere that a scene does not tell of, and a fit may find."""

WHOLE = "scale"
"""What all lights are multiplied by, but the ambient one."""

Lit = Mapping[str, Any]
"""How bright lights are, over what a scene says of them, by their name or `WHOLE`; of the ambient one the radiance. Each a number a channel."""


def factor(name: str, lit: Lit) -> Any:
    """What a light of this name is multiplied by, (3,)."""
    if name == AMBIENT:
        return lit.get(AMBIENT, np.zeros(3, np.float32))
    return lit.get(name, np.ones(3, np.float32)) * lit.get(WHOLE, np.float32(1.0))


def brighter(lights: tuple[Light, ...], lit: Lit) -> tuple[Light, ...]:
    """The same lights as bright as they are, with the ambient one that there may be."""
    known = (*lights, Constant((1.0, 1.0, 1.0), AMBIENT)) if AMBIENT in lit else lights
    return tuple(
        dataclasses.replace(light, **{name: tuple(np.multiply(getattr(light, name), factor(light.name, lit)).tolist())})
        for light in known
        for name in [BRIGHTNESS[type(light)]]
    )


@dataclasses.dataclass(frozen=True)
class Reference:
    """One image, with the camera and the lights that it was rendered with."""

    exr: Path
    camera: Camera
    lights: tuple[Light, ...]
    geometry: Sphere | None
    channels: Mapping[str, str]
    mask: Path | None
    thickness_scale: Mapping[str, float]
    """Thickness of a coat in this image over that of the material, by layer name."""

    @property
    def path(self) -> Path:
        """The file."""
        return self.exr


@dataclasses.dataclass(frozen=True)
class MeasuredReference:
    """A measured BRDF: it needs no camera and no lights."""

    brdf: Path
    illuminant: str
    """Light in which spectra become colours."""
    min_half_deg: float
    """Samples whose half vector is nearer to the normal are not used: the spike of a mirror, which an instrument blurs."""
    thickness_scale: Mapping[str, float]

    @property
    def path(self) -> Path:
        """The file."""
        return self.brdf


METRICS = ("law", "uniform", "relative", "log", "cube_root")
"""In what differences are taken; `fit.difference` and `fit.weights` say how."""

LOSSES = ("square", "huber", "cauchy")


@dataclasses.dataclass(frozen=True)
class FitRequest:
    """What the scene file asks of the fit."""

    free: tuple[str, ...] | None = None
    also: tuple[str, ...] = ()
    """Parameters that are fitted beside those."""
    each: tuple[str, ...] = ()
    """Parameters that are fitted for each reference apart."""
    fixed: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    loss: str = "square"
    min_cosine: float = 0.1
    metric: str = "law"
    starts: int = 8
    seed: int = 0


@dataclasses.dataclass(frozen=True)
class Scene:
    """A scene file, read and checked."""

    path: Path
    references: tuple[Reference | MeasuredReference, ...]
    start: Stack
    fit: FitRequest


def read_scene(path: str | Path, start: Stack | None = None) -> Scene:
    """Read a scene file (TOML or JSON); `start` stands in for its [material] where it has none. Raises `InputError` naming the key at fault."""
    path = Path(path)
    document = read_document(path)
    where = str(path)
    check_keys(document, ("reference", "geometry", "camera", "light", "material", "fit"), where)
    entries = document.get("reference")
    if entries is None:
        raise InputError(f'{where}: there is no [reference]; give one, with exr = "NAME.exr" or brdf = "NAME.bsdf"')
    entries = entries if isinstance(entries, list) else [entries]
    return Scene(
        path,
        tuple(r for k, entry in enumerate(entries) for r in _references(entry, document, path, f"{where}: reference[{k}]")),
        start if start is not None and "material" not in document else _start(document.get("material"), path),
        _fit(document.get("fit", {}), f"{where}: fit"),
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
    channels = {key: _text(entry[key], f"{where}.{key}") for key in _CHANNEL_KEYS if key in entry}
    scale = _thickness_scale(entry, where)
    lights = lights if isinstance(lights, list) else [lights]
    return [
        Reference(
            exr=path.parent / _text(name, f"{where}.exr"),
            camera=_camera(camera, f"{path}: camera"),
            lights=tuple(_light(light, path, f"{path}: light[{k}]") for k, light in enumerate(lights)),
            geometry=None if geometry is None else _geometry(geometry, f"{path}: geometry"),
            channels=channels,
            mask=path.parent / _text(entry["mask"], f"{where}.mask") if "mask" in entry else None,
            thickness_scale=scale,
        )
        for name in names
    ]


def _measured(entry: Mapping[str, Any], path: Path, where: str) -> list[MeasuredReference]:
    check_keys(entry, ("brdf", "illuminant", "min_half_deg", "thickness_scale"), where)
    names = entry["brdf"] if isinstance(entry["brdf"], list) else [entry["brdf"]]
    least = _finite(entry.get("min_half_deg", 0.0), f"{where}.min_half_deg")
    if not 0.0 <= least < 90.0:
        raise InputError(f"{where}.min_half_deg = {least:g}: should be from 0 to below 90 degrees")
    illuminant = _text(entry.get("illuminant", "D65"), f"{where}.illuminant")
    scale = _thickness_scale(entry, where)
    return [MeasuredReference(path.parent / _text(name, f"{where}.brdf"), illuminant, least, scale) for name in names]


def _thickness_scale(entry: Mapping[str, Any], where: str) -> dict[str, float]:
    scale = entry.get("thickness_scale", {})
    if not isinstance(scale, Mapping):
        raise InputError(f"{where}.thickness_scale = {scale!r}: should be a table of layers")
    return {str(k): _positive(v, f"{where}.thickness_scale.{k}") for k, v in scale.items()}


def _start(material: Any, path: Path) -> Stack:
    where = f"{path}: material"
    if material is None:
        raise InputError(f'{path}: there is no [material]; name a start with preset = "FILE.json" or give layers and base')
    if not isinstance(material, Mapping):
        raise InputError(f"{where}: should be a table of keys, not {material!r}")
    if "preset" not in material:
        return stack_of(material, where)
    check_keys(material, ("preset", *FORM_KEYS), where)
    stack = read_preset(path.parent / _text(material["preset"], f"{where}.preset"))
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
            if not isinstance(values[key], list) or not all(isinstance(v, str) for v in values[key]):
                raise InputError(f'{where}.{key}: should be a list of parameters such as "coat.alpha"')
            values[key] = tuple(values[key])
    for key, known in (("loss", LOSSES), ("metric", METRICS)):
        if values.get(key, known[0]) not in known:
            raise InputError(
                f"{where}.{key} = {values[key]!r}: should be one of {', '.join(known)}{nearest(str(values[key]), known)}"
            )
    if "min_cosine" in values and not 0.0 <= _finite(values["min_cosine"], f"{where}.min_cosine") < 1.0:
        raise InputError(f"{where}.min_cosine = {values['min_cosine']!r}: should be from 0 to below 1")
    for key, (least, most) in (("starts", (1, MOST_STARTS)), ("seed", (0, 2**63 - 1))):
        value = values.get(key, least)
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            raise InputError(f"{where}.{key} = {value!r}: should be a whole number from {least} to {most}")
    if not isinstance(values.get("fixed", {}), Mapping):
        raise InputError(f"{where}.fixed = {values['fixed']!r}: should be a table of parameters and their values")
    return FitRequest(**values)


def _camera(table: Any, where: str) -> Camera:
    check_keys(table, ("position", "look_at", "up", "vfov_deg"), where)
    camera = Camera(
        _vector(_need(table, "position", where), f"{where}.position"),
        _vector(_need(table, "look_at", where), f"{where}.look_at"),
        _vector(table.get("up", (0.0, 1.0, 0.0)), f"{where}.up"),
        _finite(_need(table, "vfov_deg", where), f"{where}.vfov_deg"),
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
        _vector(table.get("center", (0.0, 0.0, 0.0)), f"{where}.center"), _positive(table.get("radius", 1.0), f"{where}.radius")
    )


def _light(table: Any, path: Path, where: str) -> Light:
    kind = table.get("type") if isinstance(table, Mapping) else table
    if not isinstance(kind, str) or kind not in _LIGHTS or not isinstance(table, Mapping):
        raise InputError(f"{where}.type = {kind!r}: should be one of {', '.join(_LIGHTS)}{nearest(str(kind), _LIGHTS)}")
    cls, readers = _LIGHTS[kind]
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
    return cls(**values)


def _light_name(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value.isidentifier() or value in (AMBIENT, WHOLE):
        raise InputError(
            f"{where} = {value!r}: should be letters, digits and underscores, and neither {AMBIENT!r} nor {WHOLE!r}, which have a meaning"
        )
    return value


def _need(table: Mapping[str, Any], key: str, where: str) -> Any:
    if key not in table:
        raise InputError(f"{where}: {key} is missing")
    return table[key]


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{where} = {value!r}: should be text")
    return value


def _finite(value: Any, where: str) -> float:
    if not is_number(value) or abs(value) > LARGEST:
        raise InputError(f"{where} = {value!r}: should be a finite number, at most {LARGEST:g}")
    return float(value)


def _positive(value: Any, where: str) -> float:
    if _finite(value, where) <= 0.0:
        raise InputError(f"{where} = {value!r}: should be above 0")
    return float(value)


def _vector(value: Any, where: str) -> Vector:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise InputError(f"{where} = {value!r}: should be a list of three numbers")
    x, y, z = (_finite(v, where) for v in value)
    return (x, y, z)


def _direction(value: Any, where: str) -> Vector:
    vector = np.array(_vector(value, where))
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise InputError(f"{where} = {value!r}: a direction is not zero")
    x, y, z = (vector / length).tolist()
    return (x, y, z)


def _rgb(value: Any, where: str) -> Vector:
    rgb = _vector([value] * 3 if isinstance(value, (int, float)) else value, where)
    if min(rgb) < 0.0:
        raise InputError(f"{where} = {value!r}: light is not negative")
    return rgb


def _layout(value: Any, where: str) -> str:
    if value != "lat-long, Y up":
        raise InputError(
            f'{where} = {value!r}: should be "lat-long, Y up" (u = atan2(d.x, -d.z) / 2 pi mod 1, v = acos(d.y) / pi)'
        )
    return value


def _one_of(*known: str) -> Callable[[Any, str], str]:
    def read(value: Any, where: str) -> str:
        if value not in known:
            raise InputError(f"{where} = {value!r}: should be one of {', '.join(known)}{nearest(str(value), known)}")
        return value

    return read


_LIGHTS: dict[str, tuple[type, dict[str, Callable[[Any, str], Any]]]] = {
    "directional": (Directional, {"to_light": _direction, "irradiance_rgb": _rgb}),
    "point": (Point, {"position": _vector, "intensity_rgb": _rgb}),
    "constant": (Constant, {"radiance_rgb": _rgb}),
    "sphere": (SphereLight, {"center": _vector, "radius": _positive, "radiance_rgb": _rgb}),
    "envmap": (
        EnvironmentMap,
        {"file": _text, "scale": _rgb, "up": _one_of("y", "z"), "rows": _one_of("centre", "on poles"), "layout": _layout},
    ),
}
