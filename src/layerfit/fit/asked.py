"""What a fit is asked for: which fields of which material, from where."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from ..capture.load import AnyView
from ..stack import Stack
from .parameters import Parametrisation, parametrise, with_fixed
from .result import Held


@dataclasses.dataclass(frozen=True)
class Asked:
    """A start, what is fitted of it, and what is held as no image can tell it."""

    start: Stack
    free: Parametrisation
    held: list[Held]


def what_is_asked(
    views: Sequence[AnyView],
    start: Stack,
    free: Sequence[str] | None,
    also: Sequence[str],
    each: Sequence[str],
    fixed: Mapping[str, Any],
    where: str,
) -> Asked:
    """Raises `InputError` for what cannot be fitted; the arguments are those of `fit`."""
    start = with_fixed(start, fixed, f"{where}.fixed")
    free, held = _without_gauge(start, free, views)
    start, parametrisation = parametrise(start, free, tuple(fixed), where, views, also, each)
    for view in views:
        view.check(start)
    return Asked(start, parametrisation, held)


def _without_gauge(
    start: Stack, free: Sequence[str] | None, views: Sequence[AnyView]
) -> tuple[Sequence[str] | None, list[Held]]:
    """Hold one of two fields that enter only together, such as the thickness of a coat whose absorption is fitted too.

    What a base does with light is another matter at another thickness: there the images tell.
    """
    held = []
    told = len({view.reference.thickness_scale.get(start.base.name, 1.0) for view in views}) > 1
    for layer in start.layers if told else (*start.layers, start.base):
        for kept, other, sign, why in getattr(layer, "gauges", ()):
            first, second = f"{layer.name}.{kept}", f"{layer.name}.{other}"
            if free is not None and first in free and second in free:
                free = [name for name in free if name != second]
                held.append(Held({first: 1.0, second: sign}, f"{why}; {second} was held at its start"))
    return free, held
