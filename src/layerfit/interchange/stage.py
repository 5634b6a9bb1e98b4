"""Where a material and what another program makes of it are compared: the references of a scene, or a sphere under two lights."""

import dataclasses
from pathlib import Path

import numpy as np

from .._place import narrowed
from ..capture.geometry import normalise, sphere_surface, sphere_tangent, sphere_uv
from ..capture.load import AnyView, load
from ..capture.samples import Samples, View
from ..capture.scene import Camera, Directional, Light, Reference, Sphere
from ..capture.scene_file import read_scene
from ..forms.corrected import Corrected
from ..render import predict
from ..stack import Stack
from ..surfaces import Lambert

CAMERA = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 25.0)
SUN = (np.pi, np.pi, np.pi)
LIGHTS = (Directional((0.4, 0.5, 0.768), SUN), Directional((-0.902, 0.35, 0.25), SUN))
"""One from the front, and one from the side for what is lit at grazing angles."""

SIDE = 96
"""Pixels of the sphere along its picture."""

QUADRATURE = 256
"""Directions a pixel for light that is not a point: both materials see the same."""


def default_views() -> list[AnyView]:
    """The sphere, once under each light; its pixels say nothing yet."""
    return [_sphere(light) for light in LIGHTS]


def scene_views(scene: Path) -> list[AnyView]:
    """The references of a scene; what it says of its material is not looked at."""
    return load(read_scene(scene, Stack((), Lambert(), Corrected())))


def _sphere(light: Light) -> View:
    surface = sphere_surface(Sphere(), CAMERA, SIDE, SIDE)
    toward = normalise(np.asarray(light.to_light)) if isinstance(light, Directional) else np.zeros(3)
    view = normalise(np.asarray(CAMERA.position) - surface.position)
    seen = surface.covered & (surface.normal @ toward > 0.05) & (np.sum(surface.normal * view, -1) > 0.05)
    normal, position = surface.normal[seen], surface.position[seen]
    black = np.zeros((len(normal), 3), np.float32)
    reference = Reference(Path("a sphere"), CAMERA, (light,), Sphere(), {}, None, {})
    tangent, uv = sphere_tangent(normal, CAMERA.up), sphere_uv(normal, CAMERA.up)
    index, shape = np.flatnonzero(seen), (SIDE, SIDE)
    return View(
        reference,
        black,
        None,
        position,
        normal,
        tangent,
        uv,
        view[seen],
        index,
        shape,
        {},
        np.zeros((SIDE, SIDE, 3), np.float32),
    )


def showing(views: list[AnyView], stack: Stack) -> list[AnyView]:
    """The same with a material in place of what was rendered or measured."""
    return [_showing(view, stack) for view in views]


def _showing(view: AnyView, stack: Stack) -> AnyView:
    view.check(stack)
    values = draw(view, stack)
    if isinstance(view, View):
        return dataclasses.replace(view, target=values, noise=None, picture=view.image(values))
    f = view.brdf.f.copy()
    f[view.index] = values / view.brdf.wi[view.index, 2:]
    return dataclasses.replace(view, brdf=dataclasses.replace(view.brdf, f=f))


def draw(view: AnyView, stack: Stack) -> np.ndarray:
    """Radiance (pixels, 3) of a material where a reference was seen."""
    seen = samples(view)
    return predict(stack, seen.wi, seen.wo, seen.weight, narrowed(seen.place, stack.needs))


def samples(view: AnyView) -> Samples:
    """What is compared of a reference."""
    return view.samples(quadrature=1 if view.exact else QUADRATURE)
