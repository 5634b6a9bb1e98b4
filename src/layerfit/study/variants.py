"""The ways in which one material can be evaluated and printed: what error against run time is measured over."""

import dataclasses

from ..forms.corrected import Corrected
from ..forms.precise import Precise
from ..preset import MODELS, model_name
from ..shader.export import print_material
from ..stack import FORMS, IN_TIME, Stack
from ..tiers.compact import compact, tables
from ..tiers.fresnel import with_fresnel

EXACT = "exact"
"""The material as its preset says: its own form, exact reflectances."""

TABLE_ENTRIES = (16, 64, 256, 1024)
"""Resolutions of the tables."""

COMPACT_ERRORS = (1e-2, 1e-3, 1e-4)
"""That the compact tier is held to."""


def variants(stack: Stack) -> dict[str, Stack]:
    """Every way by its name, the material itself first. What prints the same shader is listed once."""
    forms = _forms(stack)
    cheaper = {**_compact(stack), **_compact_forms(forms), **_tables(stack)}
    return _distinct({EXACT: stack, **forms, **_fewer_orders(stack), **_reflectances(stack), **cheaper})


def materials(stack: Stack) -> dict[str, Stack]:
    """Those of them that are materials as a preset holds them: other forms, fewer orders, other reflectances."""
    return _distinct({EXACT: stack, **_forms(stack), **_fewer_orders(stack), **_reflectances(stack)})


def _distinct(ways: dict[str, Stack]) -> dict[str, Stack]:
    """The first of those that print the same shader."""
    seen: dict[str, str] = {}
    for name, way in ways.items():
        seen.setdefault(print_material(way, "m").functions, name)
    return {name: ways[name] for name in seen.values()}


def _reflectances(stack: Stack) -> dict[str, Stack]:
    """With reflectances that are not exact."""
    kinds = ("schlick", "lazanyi")
    return {kind: approximate for kind in kinds if (approximate := with_fresnel(stack, kind)) is not None}


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


def _compact_forms(forms: dict[str, Stack]) -> dict[str, Stack]:
    """The same of the other forms, near enough that only the form tells; not of the precise one, which is taken for its accuracy."""
    made = {name: compact(way, COMPACT_ERRORS[-1]) for name, way in forms.items() if not isinstance(way.form, Precise)}
    return {f"{name}, compact": found[0] for name, found in made.items() if not isinstance(found, str)}


def _tables(stack: Stack) -> dict[str, Stack]:
    """The paper's precomputed form, at several resolutions."""
    made = {f"tables, {entries}": tables(stack, entries=entries) for entries in TABLE_ENTRIES}
    return {name: found[0] for name, found in made.items() if not isinstance(found, str)}


def _compact(stack: Stack) -> dict[str, Stack]:
    """Polynomials for what lies under the coat, of several errors."""
    made = {f"compact, {error:g}": compact(stack, error) for error in COMPACT_ERRORS}
    return {name: found[0] for name, found in made.items() if not isinstance(found, str)}
