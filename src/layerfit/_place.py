"""Where on a surface something is shaded: what a material that varies over the surface reads beside the two directions.

Such a layer says in `reads` which of it, and gives by `at(place)` what it is there: a layer of the plain kind. All else of the
model knows nothing of places, and neither has the shader of a material that is the same everywhere.
"""

import dataclasses
from typing import Any

from ._chunk import struct
from .errors import InputError


@struct
class Place:
    """A point of a surface; what the material does not read may be absent. A batch has an axis more."""

    uv: Any = None
    """Texture coordinates, (2,) or (n, 2)."""
    distance: Any = None
    """To the viewer, () or (n,), in the unit of the material's own distances."""
    sky: Any = None
    """Part of the sky that is seen from there, () or (n,), 0 to 1: (1 + n . up) / 2 in the open, times ambient occlusion."""


INPUTS = tuple(field.name for field in dataclasses.fields(Place))
TANGENT = "tangent"
"""Read by what lies along the surface: in a shader, the frame then needs a tangent, as an anisotropic surface does."""


def reads(*layers: Any) -> tuple[str, ...]:
    """What these layers read of a place, in the order of `Place`."""
    read = {name for layer in layers for name in getattr(layer, "reads", ())}
    return tuple(name for name in INPUTS if name in read)


def needs(*layers: Any) -> tuple[str, ...]:
    """What of it they cannot do without: those that say `averages` are seen as they are in the mean where there is no place."""
    return reads(*(layer for layer in layers if not getattr(layer, "averages", False)))


def narrowed(place: Place | None, names: tuple[str, ...]) -> Place | None:
    """A place with these of its parts alone; None where there are none. Raises `InputError` for one that is not known."""
    if not names or place is None:
        return None
    if missing := [name for name in names if getattr(place, name) is None]:
        told = f"the material reads {', '.join(names)} of a place of the surface"
        raise InputError(f"{told}, and of this one there is no {', '.join(missing)}: give Place all of them")
    return Place(**{name: getattr(place, name) for name in names})


ORIENTED = ("alpha_x", "cy", "cy_2", "cy_3")
"""Fields that are measured along the tangent or across it: where one is given, a surface has a grain."""


def grain(layer: Any) -> str | None:
    """The field of a layer that gives it a grain, or None where it is isotropic."""
    return next((name for name in ORIENTED if getattr(layer, name, None) is not None), None)


def needs_tangent(layer: Any) -> bool:
    """Whether a layer is laid along a tangent."""
    return grain(layer) is not None or TANGENT in getattr(layer, "reads", ())
