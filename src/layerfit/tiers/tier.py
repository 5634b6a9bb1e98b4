"""The tiers of a material, by their names: each is a material of its own, made from the exact one, and its error is measured."""

import dataclasses
from dataclasses import replace
from typing import Literal, get_args

import jax

from ..documents import nearest
from ..errors import InputError
from ..forms.faithful import Faithful
from ..stack import Stack
from .compact import compact, largest_error, tables
from .fresnel import with_fresnel

Name = Literal["exact", "compact", "lazanyi", "schlick", "faithful", "tables"]
TIERS: tuple[Name, ...] = get_args(Name)
"""`exact`: the material's own form. `compact`: polynomials for what lies under the coat, fitted to it. `lazanyi` and `schlick`: short
formulas for what a facet reflects. `faithful`: the form of Weidlich and Wilkie 2007. `tables`: that form with reflectances and densities read
from tables, as Elek 2010."""

WALK = "walk"
EVALUATED = (*TIERS, WALK)
"""Those that a material can be evaluated by: with the truth, the random walk, which no shader does."""

MOST_ENTRIES = 4096
"""Of a table: more would only be longer."""

MAX_ERROR = 1e-4
"""Relative error that `compact` is held to where none is asked for."""


@dataclasses.dataclass(frozen=True)
class Tier:
    """One way to print a material."""

    name: Name
    stack: Stack
    """What is evaluated and printed."""
    error: float
    """Largest relative difference of its BRDF from the exact form's, over random and extreme pairs of directions; values below 1e-4 of
    a white diffuse surface are compared absolutely."""

    @property
    def table_bytes(self) -> int:
        """Bytes of the tables that stand in its shader."""
        return getattr(self.stack.base, "table_bytes", 0)


def check_max_error(max_error: float | None) -> None:
    """Raise `InputError` for an error that nothing can be within."""
    if max_error is not None and not max_error > 0.0:
        raise InputError(f"a largest error of {max_error:g}: it should be above 0, such as 0.01")


def make_tier(stack: Stack, name: Name = "compact", max_error: float | None = None, entries: int | None = None) -> Tier:
    """A tier of a material; `compact` has degrees as low as `max_error` allows (1e-4).

    `tables` have so many `entries`, 2 to 4096; left out, as few as `max_error` allows, or 256.

    Raises `InputError` where the material has no such tier, or none within `max_error`.
    """
    if name == WALK:
        raise InputError(
            "no shader does the random walk: layerfit render and eval take --tier walk; layerfit truth and tradeoff hold the others against it"
        )
    if name not in TIERS:
        raise InputError(f"tier {name!r}: should be one of {', '.join(TIERS)}{nearest(name, TIERS)}")
    check_max_error(max_error)
    if name == "compact":
        made = compact(stack, MAX_ERROR if max_error is None else max_error)
        if isinstance(made, str):
            raise InputError(f"there is no compact tier of this material: {made}. Print it exactly (tier exact)")
        return Tier(name, *made)
    if name == "tables":
        if entries is not None and not 2 <= entries <= MOST_ENTRIES:
            raise InputError(f"tables of {entries} entries: should be 2 to {MOST_ENTRIES}")
        found = tables(stack, max_error, entries)
        if isinstance(found, str):
            raise InputError(f"there is no tier tables of this material: {found}")
        return Tier(name, *found)
    other = stack if name == "exact" else _other(stack, name)
    error = 0.0 if name == "exact" else largest_error(other, stack)
    if max_error is not None and error > max_error:
        raise InputError(
            f"the tier {name} of this material is {error:.1e} from its exact form, and {max_error:.1e} is asked for"
        )
    return Tier(name, other, error)


def _other(stack: Stack, name: Name) -> Stack:
    """The material in another form, or with another reflectance."""
    other = replace(stack, form=Faithful()) if name == "faithful" and stack.layers else None
    if name in ("schlick", "lazanyi"):
        other = with_fresnel(stack, name)
    if other is None or (other.form == stack.form and name == "faithful"):
        raise InputError(f"there is no tier {name} of this material: it would not differ from the exact one")
    try:
        jax.eval_shape(Stack.prepare, other)
    except ValueError as error:
        raise InputError(f"there is no tier {name} of this material: {error}") from None
    return other
