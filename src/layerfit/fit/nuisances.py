"""What a fit may find of the scene beside the material: how bright its lights are, and how thick layers are in each reference."""

from collections.abc import Sequence
from typing import Any

from .._fields import Param
from ..capture.load import AnyView
from ..capture.samples import View
from ..capture.scene import AMBIENT, WHOLE, Reference
from ..errors import InputError
from ..stack import Stack

LIGHTS = "light"
"""What parameters of the lights are named after: `light.scale`, `light.ambient`, `light.NAME`; with `.grey`, one number for all channels."""

GREY = "grey"

THICKNESS = "thickness_scale"
"""Thickness of a layer in a reference over that of the material: `coat.thickness_scale`."""

DEPTHS = ("thickness_um", "tau", "tau_s", "kx", "sx")
"""Fields that grow with the thickness of their layer."""


def of_a_scene(name: str) -> bool:
    """Whether a parameter is of a scene by its name: where no layer is called `light`."""
    return name.startswith(f"{LIGHTS}.") or name.endswith(f".{THICKNESS}")


def depths(layer: Any) -> list[str]:
    """Fields of a layer that grow with its thickness; of several layers of pigment, those of the outermost."""
    return [name for name in DEPTHS if getattr(layer, name, None) is not None]


_THICKNESS = Param(1.0, 0.01, 100.0, "log", "thickness in a reference over that of the material", fitted=False)


def _brightness(what: str, colour: bool) -> Param:
    if what == AMBIENT:
        # From 0, and up to what the lights of any scene are: linear where pictures are darkest.
        return Param(
            0.0, 0.0, 1e6, "softlog", "radiance from everywhere", unit="radiance", colour=colour, fitted=False, soft=0.01
        )
    whose = "all lights" if what == WHOLE else "the lights of this name"
    return Param(1.0, 0.01, 100.0, "log", f"{whose} over what the scene says of them", colour=colour, fitted=False)


def of_the_scene(stack: Stack, views: Sequence[AnyView]) -> dict[str, tuple[int | None, str, Param]]:
    """Every number beside those of the material, by its name: place of its layer (None for lights), field and range."""
    return of_references(stack, [view.reference for view in views if isinstance(view, View)])


def of_references(stack: Stack, references: Sequence[Reference]) -> dict[str, tuple[int | None, str, Param]]:
    """`of_the_scene`, of references that are not loaded."""
    named = {light.name for reference in references for light in reference.lights} - {""}
    known: dict[str, tuple[int | None, str, Param]] = {}
    for what in (WHOLE, AMBIENT, *sorted(named)):
        known[f"{LIGHTS}.{what}"] = (None, what, _brightness(what, colour=True))
        known[f"{LIGHTS}.{what}.{GREY}"] = (None, what, _brightness(what, colour=False))
    for k, layer in enumerate((*stack.layers, stack.base)):
        if depths(layer):
            known[f"{layer.name}.{THICKNESS}"] = (k, THICKNESS, _THICKNESS)
    return known


def told(layer: int | None, field: str, spec: Param, stack: Stack, views: Sequence[AnyView], reference: int) -> float:
    """What a scene says of such a number."""
    if field == THICKNESS and layer is not None and views:
        name = (*stack.layers, stack.base)[layer].name
        return views[reference].reference.thickness_scale.get(name, 1.0)
    assert spec.default is not None
    return spec.default


def check(names: Sequence[str], views: Sequence[AnyView], where: str) -> None:
    """Raise `InputError` for what these references cannot tell at all."""
    lights = [name for name in names if name.startswith(f"{LIGHTS}.")]
    for view in views:
        if lights and not isinstance(view, View):
            raise InputError(f"{where}.free: {view.reference.path} is a measured BRDF and has no lights; leave {lights[0]} out")
    for name in lights:
        if f"{name}.{GREY}" in lights:
            raise InputError(
                f"{where}.free: {name} and {name}.{GREY} are the same light, by channel and as one number; leave one out"
            )
    scales = [name for name in names if name.endswith(f".{THICKNESS}")]
    if scales and len(views) == 1:
        raise InputError(f"{where}.free: {scales[0]} is of several references, over the first; there is one. Leave it out")
