"""What can be left out of a material, a part at a time: each gives a material that does without it."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from .._fields import params
from ..errors import InputError
from ..preset import FORM_KEYS, preset_of, stack_of
from ..stack import Stack
from .variants import EXACT, materials

GROUPS: Mapping[str, tuple[str, ...]] = {
    "absorption": ("tau", "absorption_per_mm", "thickness_um"),
    "scattering": ("tau_s", "g"),
    "film": ("film_nm", "film_eta"),
}
"""Optional fields of a layer that come and go together, by what they are."""


@dataclasses.dataclass(frozen=True)
class Removal:
    """A material without one part of it."""

    what: str
    stack: Stack
    held: tuple[str, ...] = ()
    """Parameters that a fit may not free, or the part would be there again: colours that are grey now."""


def removals(stack: Stack) -> list[Removal]:
    """Every part that can go by itself: coats, media, films, lobes, grain, colours, and what the form computes."""
    found = [Removal(f"{layer.name}: coat", stack.without(layer.name)) for layer in stack.layers]
    for k, layer in enumerate((*stack.layers, stack.base)):
        found += [Removal(f"{layer.name}: {what}", _with(stack, k, made), held) for what, made, held in _simpler(layer)]
    found += [Removal(f"form: {name} instead", way) for name, way in materials(stack).items() if name != EXACT]
    return [removal for removal in found if _is_material(removal.stack)]


def _with(stack: Stack, place: int, layer: Any) -> Stack:
    layers = [*stack.layers, stack.base]
    layers[place] = layer
    return stack.with_parts(layers)


def _simpler(layer: Any) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    specs = dict(params(layer))
    there = [name for name in specs if getattr(layer, name) is not None]
    lobes = {f"lobe {n}": tuple(name for name in there if name.endswith(f"_{n}")) for n in (2, 3)}
    for what, names in {**GROUPS, **lobes}.items():
        gone = [name for name in names if name in there and specs[name].optional]
        if gone:
            yield what, dataclasses.replace(layer, **dict.fromkeys(gone)), ()
    if "alpha_x" in there:
        alpha = np.sqrt(layer.alpha_x * layer.alpha_y)
        yield "anisotropy", dataclasses.replace(layer, alpha=alpha, alpha_x=None, alpha_y=None), ()
    for name in there:
        if specs[name].colour and np.shape(getattr(layer, name)) == (3,):
            grey = dataclasses.replace(layer, **{name: np.mean(getattr(layer, name))})
            yield f"colour of {name}", grey, (f"{layer.name}.{name}",)


def _is_material(stack: Stack) -> bool:
    """Whether a preset could say it: fields that need one another are all there, and its form is for it."""
    try:
        document = preset_of(stack, "m")
        stack_of({key: document[key] for key in ("layers", "base", *FORM_KEYS) if key in document}, "m")
    except InputError:
        return False
    return True
