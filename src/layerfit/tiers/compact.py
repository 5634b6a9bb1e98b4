"""The compact tier: per-material polynomials for all that lies under the coat, fitted to the material's own exact form.

Light under a coat depends on the two directions mostly one at a time. What a direction meets, the energy that passes, its bend, its
path, is a function of its cosine, and a polynomial of low degree follows it. So does the reflectance of a metal in the half
cosine, and a width in a sum of widths. Degrees are lowered one by one while the error of the whole BRDF stays below what is asked.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._compiled import Compiled
from .._directions import FLOOR as OF_WHITE, random_pairs, random_places
from .._place import narrowed
from ..forms.corrected import Corrected
from ..forms.faithful import Faithful
from ..forms.precise import Precise
from ..layers import Coat
from ..render import brdf
from ..stack import Stack, at, evaluate, prepared as prepare
from ..surfaces.diffuse import Lambert
from ..surfaces.flakes import Flakes
from ..surfaces.microfacet import Conductor
from . import bare, corrected_stack, diffuse, faithful, precise_metal, tables as precomputed
from .polynomial import MOST
from .surface import Compact, Recipe, noted, plain

PAIRS = 16384
"""Pairs of directions that the error is measured over, random and extreme."""

FLOOR = OF_WHITE / np.pi
"""Values [1/sr] below it are compared absolutely."""

MARGIN = (0.9, 0.7, 0.5)
"""Part of the error asked for to which the degrees are lowered: less, where other pairs then show more."""


def refuses(stack: Stack) -> str | None:
    """Why a material has no compact tier, or None."""
    coats, base, form = stack.layers, stack.base, stack.form
    if not coats:
        return None if _plain_metal(base) else f"it has no coat, and {base.name} is not an isotropic GGX metal"
    if stack.reads and not isinstance(base, Flakes):
        return f"it varies over the surface by {', '.join(stack.reads)}"
    if isinstance(form, Faithful) and form != Faithful():
        return "it is made for the faithful form as published"
    if other := next((layer.name for layer in coats if not isinstance(layer, Coat)), None):
        return f"{other} is not a coat"
    if odd := next((coat.name for coat in coats if not plain(coat)), None):
        return f"{odd} is not isotropic GGX with the exact reflectance and Smith's masking"
    if hazy := next((coat.name for coat in coats if coat.tau_s is not None), None):
        return f"{hazy} scatters light"
    if len(coats) == 1 and not base.lobes:
        lambertian = isinstance(base.diffuse, Lambert) or not isinstance(form, Faithful)
        return None if lambertian else f"{base.name} is not the same from all sides"
    if isinstance(form, Corrected):
        return "parts of the corrected form are left out, or added" if form != Corrected() else corrected_stack.refuses(stack)
    if len(coats) > 1:
        return f"of two coats it is made for the corrected form, not the {type(form).__name__.lower()} one"
    if not _plain_metal(base):
        return f"{base.name} is neither diffuse nor an isotropic GGX metal"
    return None


def _plain_metal(base: Any) -> bool:
    """Whether it is an isotropic GGX metal."""
    usual = isinstance(base, Conductor) and (base.distribution, base.masking) == ("ggx", "smith")
    return usual and not isinstance(base.width, tuple)


def compact(stack: Stack, max_error: float) -> tuple[Stack, float] | str:
    """A compact material and its largest relative error against `stack`; or why there is none that is near enough."""
    if reason := refuses(stack):
        return reason
    with jax.enable_x64(True):
        return _compact(stack.astype(np.float64), max_error)


def tables(stack: Stack, max_error: float | None = None, entries: int | None = None) -> tuple[Stack, float] | str:
    """A material whose reflectances and densities are read from tables, and its largest relative error against `stack`; or why there is none.

    It is of the faithful form. Without `entries` the tables have as few, a power of 2, as a `max_error` takes, or 256.
    """
    if not stack.layers:
        return "it has no coat"
    paper = replace(stack, form=Faithful())
    if reason := refuses(paper):
        return reason
    if not paper.base.lobes:
        return f"{paper.base.name} is diffuse, and over it there is nothing to look up but the coat's top"
    with jax.enable_x64(True):
        prepared, judge = prepare(paper.astype(np.float64)), _Judge(stack.astype(np.float64), 2)
        for count in _doubled() if max_error is not None and entries is None else [entries or precomputed.ENTRIES]:
            base = precomputed.made(prepared, stack.base.name, count)
            error = judge.error(base)
            if max_error is None or error <= max_error:
                size = f"{count} entries, {base.table_bytes / 1000:.1f} kB"
                note = f"Tables of {size}, of the faithful form: within {error:.1e} of the exact one, relative, over random and extreme directions."
                return replace(stack, layers=(), base=noted(base, note)).astype(np.float32), error
    return f"its error stays at {error:.1e}, and {max_error:.1e} is asked for"


def _doubled() -> list[int]:
    """Numbers of entries that are tried."""
    return [2**k for k in range(precomputed.FEWEST.bit_length() - 1, precomputed.MOST.bit_length())]


def largest_error(other: Stack, stack: Stack) -> float:
    """Largest relative error of a material against `stack`."""
    with jax.enable_x64(True):
        judge = _Judge(stack.astype(np.float64), 2)
        return judge.compared(np.asarray(brdf(other.astype(np.float64), judge.wi, judge.wo, judge.place)))


def _compact(stack: Stack, max_error: float) -> tuple[Stack, float] | str:
    with np.errstate(divide="ignore", invalid="ignore"):  # over what may be 0: told below
        recipe = _recipe(stack)
    if lost := [name for name, curve in recipe.curves.items() if not curve.possible]:
        return f"what polynomials would follow ({', '.join(lost)}) has no values to fit, as of a base that is not seen"
    fitted, others = (_Judge(stack, seed) for seed in (1, 2))
    full = {name: curve.most for name, curve in recipe.curves.items()}
    padded = _padded(recipe)
    best = fitted.error(padded(full))
    if best > max_error:
        return f"its error stays at {best:.1e}, and {max_error:.1e} is asked for"
    for margin in MARGIN:
        degrees = _lowered(recipe, full, lambda degrees: fitted.error(padded(degrees)), margin * max_error)
        error = others.error(padded(degrees))
        if error <= max_error:
            made = recipe.build({name: curve.fit(degrees[name]) for name, curve in recipe.curves.items()})
            error = max(error, fitted.error(padded(degrees)))
            of = f"the {type(stack.form).__name__.lower()} form" if stack.layers else "a bare metal"
            note = f"Compact tier of {of}: within {error:.1e} of it, relative, over random and extreme directions."
            return dataclasses.replace(stack, layers=(), base=noted(made, note)).astype(np.float32), error
    return f"its error stays at {error:.1e}, and {max_error:.1e} is asked for"


def _recipe(stack: Stack) -> Recipe:
    prepared: Any = prepare(stack)
    name = stack.base.name
    if not stack.layers:
        return bare.recipe(prepared, name)
    if isinstance(stack.form, Faithful):
        return faithful.recipe(prepared, name)
    if len(stack.layers) == 1 and not stack.base.lobes:
        return diffuse.recipe(prepared, name, lambda prepared, wi, wo: evaluate(stack.form, prepared, wi, wo))
    return (precise_metal if isinstance(stack.form, Precise) else corrected_stack).recipe(prepared, name)


def _padded(recipe: Recipe) -> Callable[[dict[str, int]], Compact]:
    """The material with polynomials of given degrees, all of the same shape: what judges it is compiled once. Each is fitted once."""
    fit = cache(lambda name, degree: recipe.curves[name].fit(degree, MOST + 1))
    return lambda degrees: recipe.build({name: fit(name, degree) for name, degree in degrees.items()})


def _lowered(
    recipe: Recipe, full: dict[str, int], error: Callable[[dict[str, int]], float], max_error: float
) -> dict[str, int]:
    """Degrees as low as the error allows: one less of each in turn, of the widest vectors first, which cost most."""
    degrees = dict(full)
    size = lambda name: np.size(recipe.curves[name].y[0])  # noqa: E731
    left = sorted(recipe.curves, key=size, reverse=True)
    while left := [name for name in left if degrees[name] > 1]:
        for name in list(left):
            if error(degrees | {name: degrees[name] - 1}) <= max_error:
                degrees[name] -= 1
            else:
                left.remove(name)
    return degrees


class _Judge:
    """Error of a compact material over pairs of directions."""

    def __init__(self, stack: Stack, seed: int) -> None:
        self.wi, self.wo = (jnp.asarray(w, float) for w in random_pairs(PAIRS, seed))
        there = narrowed(random_places(PAIRS, seed), stack.reads)
        self.place = jax.tree.map(lambda a: jnp.asarray(a, float), there)
        self.exact = np.asarray(brdf(stack, self.wi, self.wo, self.place))
        self.scale = np.maximum(np.abs(self.exact), FLOOR)

    def error(self, made: Compact) -> float:
        return self.compared(np.asarray(_judged(made, self.wi, self.wo, self.place)))

    def compared(self, values: np.ndarray) -> float:
        error = np.abs(values - self.exact) / self.scale
        return float(np.max(np.where(np.isfinite(error), error, np.inf)))


def _values(made: Compact, wi: Any, wo: Any, place: Any) -> Any:
    return jax.vmap(lambda i, o, there: jnp.broadcast_to(at(made, there).evaluate(i, o), (3,)))(wi, wo, place)


_judged = Compiled(_values, optimise=0)
