"""A layered material: coats over a base, and the form in which the light between them is computed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ._chunk import static, struct, where
from ._compiled import Compiled
from ._fields import Param, params
from ._html import table
from ._place import Place, needs, reads
from ._types import Colour, Direction
from .forms import corrected, faithful, patina, precise, weathering
from .optics.directions import above, both_above

Form = faithful.Faithful | corrected.Corrected | precise.Precise
FORMS = {faithful.Faithful: faithful, corrected.Corrected: corrected, precise.Precise: precise}
IN_TIME = (patina, weathering)
"""What a metal comes to in time: it is evaluated in a way of its own, whatever the form."""
PREPARED = faithful.Prepared | corrected.Prepared | precise.Prepared


@struct
class Stack:
    """Layers over a base, outermost first. What a material does without is absent: no coat, no absorption."""

    layers: tuple[Any, ...]
    base: Any
    form: Form = static(corrected.Corrected())

    def astype(self, dtype: Any) -> "Stack":
        """The same material with every number in one precision."""
        return jax.tree.map(lambda x: jnp.asarray(x, dtype), self)

    def _repr_html_(self) -> str:
        """For notebooks: every number of its layers, the outermost first."""
        rows = [
            [f"{layer.name}.{field}", _shown(value), "" if spec.unit == "1" else spec.unit, _range(spec), spec.doc]
            for layer in (*self.layers, self.base)
            for field, spec in params(layer)
            if (value := getattr(layer, field)) is not None
        ]
        kinds = " over ".join(type(layer).__name__ for layer in (*self.layers, self.base))
        return f"<p>{kinds}, {type(self.form).__name__.lower()} form</p>{table(_SHOWN, rows)}"

    def prepare(self) -> Any:
        """What is computed once per material: the constants of its shader. Raises ValueError for a material that is not of its form."""
        if not self.layers:
            return self.base.below(1.0)
        for kind in IN_TIME:
            if kind.grows(self.layers):
                return kind.prepare(self.layers, self.base, self.form)
        form = FORMS[type(self.form)]
        if reason := form.refuses(self.layers, self.base):
            raise ValueError(f"the {type(self.form).__name__.lower()} form is not for this material: {reason}")
        return form.prepare(self.layers, self.base, self.form)

    @property
    def reads(self) -> tuple[str, ...]:
        """What this material reads of a `Place` of the surface: nothing where it is the same everywhere."""
        return reads(*self.layers, self.base)

    @property
    def needs(self) -> tuple[str, ...]:
        """What of it this material cannot do without: what a fit gives it. Flakes are fitted by their mean."""
        return needs(*self.layers, self.base)

    def with_parts(self, parts: Sequence[Any]) -> "Stack":
        """The same form of other layers, the base last."""
        *layers, base = parts
        return replace(self, layers=tuple(layers), base=base)

    def without(self, name: str) -> "Stack":
        """The same material with one layer taken off."""
        left = tuple(layer for layer in self.layers if layer.name != name)
        if len(left) == len(self.layers):
            raise KeyError(f"no layer called {name!r} to take off; there are {[layer.name for layer in self.layers]}")
        # A bare base is the same in every form; the corrected one is for all materials, in a preset too.
        return replace(self, layers=left, form=self.form if left else corrected.Corrected())


_SHOWN = ("parameter", "value", "unit", "range", "meaning")


def _shown(value: Any) -> str:
    return ", ".join(f"{v:.4g}" for v in np.ravel(np.asarray(value, float)))


def _range(spec: Param) -> str:
    return f"{spec.lower:g} to {spec.upper:g}"


prepared = Compiled(Stack.prepare, optimise=0)
"""What is computed once per material, compiled."""


def at(prepared: Any, place: Place | None) -> Any:
    """A prepared material as it is at one place of the surface; without a place, as it is everywhere or in the mean."""
    if place is None:
        return prepared
    if isinstance(prepared, (patina.Prepared, weathering.Prepared)):
        return prepared.at(place)
    if isinstance(prepared, PREPARED):
        return replace(prepared, base=at(prepared.base, place))
    return prepared.at(place) if reads(prepared) else prepared


def evaluate(form: Form, prepared: Any, wi: Direction, wo: Direction) -> Colour:
    """BRDF [1/sr] of a prepared material for unit directions in the surface frame; 0 below the surface."""
    for kind in IN_TIME:
        if isinstance(prepared, kind.Prepared):
            return kind.evaluate(prepared, wi, wo, form)
    if isinstance(prepared, PREPARED):
        return FORMS[type(form)].evaluate(prepared, wi, wo, form)
    lit = both_above(wi, wo)
    return where(lit, prepared.evaluate(above(lit, wi), above(lit, wo)), 0.0)
