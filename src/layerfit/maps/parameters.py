"""What a map holds: parameters of the material that every texel has for itself, and the slopes of its normal."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from .._fields import Param
from ..documents import nearest
from ..errors import InputError
from ..fit.nuisances import THICKNESS, depths, of_references
from ..fit.parameters import Free, Parametrisation, known_parameters
from ..stack import Stack

TILT = "tilt"
"""The name by which both slopes of the normal are asked for."""

SLOPES = {
    f"{TILT}.x": Param(0.0, -0.6, 0.6, "linear", "slope of the normal along the tangent", fitted=False),
    f"{TILT}.y": Param(0.0, -0.6, 0.6, "linear", "slope of the normal along the bitangent", fitted=False),
}
"""The normal is along (x, y, 1) in the frame of the reference: x and y are the tangents of its two angles. Up to 31 degrees: beyond, a
surface is another one than its reference says, and light below its horizon is not in the samples."""


def mapped(start: Stack, names: Sequence[str], where: str) -> tuple[Stack, Parametrisation]:
    """The material with mapped colours widened to three channels, and the fields of one texel in the order of the layers.

    `names` are parameters such as "coat.thickness_um", LAYER.thickness_scale (one number over all depths of a layer), and "tilt". Raises
    `InputError` for one that the material does not have, and for two that images cannot tell apart.
    """
    known = known_parameters(start)
    known |= {name: found for name, found in of_references(start, ()).items() if found[0] is not None}
    known |= {name: (None, name, spec) for name, spec in SLOPES.items()}
    names = [part for name in names for part in (SLOPES if name == TILT else [name])]
    if unknown := [name for name in names if name not in known]:
        words = [*(name for name in known if name not in SLOPES), TILT]
        raise InputError(
            f"{where}: unknown parameter {unknown[0]!r}{nearest(unknown[0], words)}. A map of this material can hold {', '.join(words)}"
        )
    if not names:
        raise InputError(f"{where}: nothing is left to map; name a parameter, such as {next(iter(known))!r} or {TILT!r}")
    _check_apart(start, names, where)
    chosen, slot = [], 0
    layers = [*start.layers, start.base]
    for name in (name for name in known if name in names):
        k, field, spec = known[name]
        if k is not None and spec.colour:
            value = np.broadcast_to(np.asarray(getattr(layers[k], field), float), 3)
            layers[k] = dataclasses.replace(layers[k], **{field: value})
        width = 3 if spec.colour else 1
        of_material = k is not None and field != THICKNESS
        told = () if of_material else float(spec.default or 0.0)
        chosen.append(Free(name, k, field, spec, tuple(range(slot, slot + width)), told=told))
        slot += width
    return start.with_parts(layers), Parametrisation(tuple(chosen))


def _check_apart(start: Stack, names: Sequence[str], where: str) -> None:
    for layer in (*start.layers, start.base):
        scale = f"{layer.name}.{THICKNESS}"
        pairs = [(scale, f"{layer.name}.{field}", "it multiplies the other") for field in depths(layer)]
        pairs += [(f"{layer.name}.{a}", f"{layer.name}.{b}", why) for a, b, _, why in getattr(layer, "gauges", ())]
        for one, other, why in pairs:
            if one in names and other in names:
                raise InputError(f"{where}: {one} and {other} cannot both be mapped: {why}. Leave one of them out")
