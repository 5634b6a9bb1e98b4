"""The tiers of short formulas for what a facet reflects."""

import dataclasses
from typing import Any

from .._fields import given
from ..stack import FORMS, Stack


def with_fresnel(stack: Stack, kind: str) -> Stack | None:
    """The material with all reflectances approximate that its form lets be; None where there are none."""

    def changed(layer: Any) -> Any:
        chosen = "fresnel" in given(type(layer)) and layer.fresnel == "exact"
        return dataclasses.replace(layer, fresnel=kind) if chosen else layer

    # The tables of the precise form were made with the exact reflectance of a coat: there its base alone is approximate.
    layers, base = tuple(changed(layer) for layer in stack.layers), changed(stack.base)
    for made in (dataclasses.replace(stack, layers=layers, base=base), dataclasses.replace(stack, base=base)):
        same = made.base is stack.base and all(a is b for a, b in zip(made.layers, stack.layers, strict=True))
        if not same and (not stack.layers or FORMS[type(stack.form)].refuses(made.layers, made.base) is None):
            return made
    return None
