"""What is known of a reference render, and what is asked of the fit: plain records, as `capture.scene_file` reads them."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..stack import Stack

Vector = tuple[float, float, float]


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
class FlatLight:
    """A flat patch of constant radiance that shines to one side: that of `half_u` x `half_v`, the vectors from its centre to the middles of
    two neighbouring sides."""

    center: Vector
    half_u: Vector
    half_v: Vector
    radiance_rgb: Vector
    name: str = ""


class Rectangle(FlatLight):
    """All of the patch; a parallelogram, where its sides are not square to each other."""


class Disk(FlatLight):
    """The ellipse that touches the patch's four sides in their middles."""


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


Light = Directional | Point | Constant | SphereLight | Rectangle | Disk | EnvironmentMap

BRIGHTNESS = {
    Directional: "irradiance_rgb",
    Point: "intensity_rgb",
    Constant: "radiance_rgb",
    SphereLight: "radiance_rgb",
    Rectangle: "radiance_rgb",
    Disk: "radiance_rgb",
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
class MapRequest:
    """What the scene file asks of a map."""

    free: tuple[str, ...] = ()
    """Parameters that every texel has for itself."""
    smooth: float | Mapping[str, float] | None = None
    """By how much neighbours differ, one standard deviation in the coordinates of the fit; None where they know nothing of one another."""
    size: int | None = None
    """Texels on a side, over texture coordinates; None for a map of pixels."""
    starts: int = 4


@dataclasses.dataclass(frozen=True)
class Scene:
    """A scene file, read and checked."""

    path: Path
    references: tuple[Reference | MeasuredReference, ...]
    start: Stack
    fit: FitRequest
    map: MapRequest = MapRequest()
