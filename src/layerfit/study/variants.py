"""The ways in which one material can be evaluated and printed: what error against run time is measured over."""

import dataclasses
from typing import Any

from .._fields import given
from ..forms.corrected import Corrected
from ..preset import MODELS, model_name
from ..shader.export import print_material
from ..stack import FORMS, IN_TIME, Stack

EXACT = "exact"
"""The material as its preset says: its own form, exact reflectances."""


def variants(stack: Stack) -> dict[str, Stack]:
    """Every way by its name, the material itself first. What prints the same shader is listed once."""
    ways = {EXACT: stack, **_forms(stack), **_fewer_orders(stack)}
    ways |= {kind: approximate for kind in ("schlick", "lazanyi") if (approximate := with_fresnel(stack, kind)) is not None}
    seen: dict[str, str] = {}
    for name, way in ways.items():
        seen.setdefault(print_material(way, "m").functions, name)
    return {name: ways[name] for name in seen.values()}


def _forms(stack: Stack) -> dict[str, Stack]:
    """The other forms that are for this structure."""
    if not stack.layers or any(kind.grows(stack.layers) for kind in IN_TIME):
        return {}
    own = model_name(stack)
    fits = {name: form for name, form in MODELS.items() if FORMS[form].refuses(stack.layers, stack.base) is None}
    return {name: dataclasses.replace(stack, form=form()) for name, form in fits.items() if name != own}


def _fewer_orders(stack: Stack) -> dict[str, Stack]:
    """The corrected form with less of the light that goes to and fro below the coat."""
    if not stack.layers or Corrected not in FORMS or FORMS[Corrected].refuses(stack.layers, stack.base):
        return {}
    form = stack.form if isinstance(stack.form, Corrected) else Corrected()
    some = {f"corrected, {n} order{'' if n == 1 else 's'}": n for n in range(form.orders)}
    return {name: dataclasses.replace(stack, form=dataclasses.replace(form, orders=n)) for name, n in some.items()}


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
