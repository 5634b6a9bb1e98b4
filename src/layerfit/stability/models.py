"""Every structure that a material can have, made of what the layers say about themselves: nothing is listed twice."""

import dataclasses
from collections.abc import Iterator
from typing import Any

from .._fields import Param, params
from ..forms import patina
from ..forms.corrected import Corrected
from ..forms.precise import Precise
from ..layers import LAYERS, Coat, Deposit, Erosion, Overgrowth, Patina, Polish
from ..preset import MODELS
from ..stack import FORMS, Stack
from ..surfaces import BASES, Conductor, Lambert
from ..tiers.fresnel import with_fresnel

WIDTHS, THICKNESS, FILM = ("alpha_x", "alpha_y"), ("absorption_per_mm", "thickness_um"), ("film_nm", "film_eta")
APART = (*WIDTHS, *THICKNESS, *FILM)
"""Optional fields that stand in place of others: each pair is a structure of its own."""

COAT: dict[str, Any] = {"tau": 0.3}
"""A coat absorbs, unless it is left out on purpose."""

BELOW = ("whole", "anisotropic", "filmed", "distribution beckmann")
"""Kinds of a base that the forms treat each in a way of its own."""

SHOWN_BY_FORMULA = ("conductor", "dielectric", "lambert", "torrance_sparrow")
"""Bases below a coat of short formulas for what facets reflect: each kind of reflectance, and none."""


def structures() -> dict[str, Stack]:
    """Materials by a name that says what they are: every base alone and below a coat in every form, every choice of a layer and of a form,
    two coats, the tiers of short formulas, and what changes in time."""
    found: dict[str, Stack] = {}
    bases = dict(_variants(BASES))
    for name, layer in bases.items():
        found[name] = Stack((), layer, Corrected())
    for name, layer in bases.items():
        if name in BASES or name.endswith(BELOW):
            found |= _coated(f"coat over {name}", (Coat(**COAT),), layer)
    for name, layer in _variants({"coat": LAYERS["coat"]}, **COAT):
        if name != "coat":
            found |= _coated(f"{name} over conductor", (layer,), Conductor())
    turned = Coat(alpha=None, alpha_x=0.3, alpha_y=0.1, **COAT)
    found |= _coated("coat, anisotropic over conductor, anisotropic", (turned,), bases["conductor, anisotropic"])
    found |= _coated("milky coat over lambert", (Coat(tau_s=0.5, g=0.5),), Lambert())
    two = (Coat(**COAT), Coat(name="inner", alpha=0.2, eta=1.7, **COAT))
    for base in (Conductor(), Lambert()):
        found |= _coated(f"two coats over {_word(base)}", two, base)
    for name in ("coat over conductor", "coat over lambert"):
        found[f"precise multi, {name}"] = dataclasses.replace(found[f"precise, {name}"], form=Precise("multi"))
    for name in ("corrected, coat over conductor", "faithful, coat over conductor", "corrected, milky coat over lambert"):
        found |= {f"{name}, {words}": dataclasses.replace(found[name], form=form) for words, form in _options(found[name])}
    for name in [f"{form}, coat over {base}" for form in MODELS for base in SHOWN_BY_FORMULA]:
        found |= dict(_short_formulas(name, found[name])) if name in found else {}
    return found | dict(_in_time())


def _options(stack: Stack) -> Iterator[tuple[str, Any]]:
    """The form of a material with each of its options as it is not by default; of a milky coat, the one that is of scattering."""
    for field in dataclasses.fields(stack.form):
        now = getattr(stack.form, field.name)
        others = [0] if field.name == "orders" else [not now] if isinstance(now, bool) else ["h" if now == "n" else "n"]
        if (field.name == "multiple") == (stack.layers[0].tau_s is not None):
            for other in others:
                yield f"{field.name} {other}", dataclasses.replace(stack.form, **{field.name: other})


def _short_formulas(name: str, stack: Stack) -> Iterator[tuple[str, Stack]]:
    """The tiers of a material that are of its own form (`compact` is tried material by material)."""
    for kind in ("schlick", "lazanyi"):
        if tier := with_fresnel(stack, kind):
            yield f"{name}, tier {kind}", tier


def _word(base: Any) -> str:
    return next(name for name, cls in BASES.items() if type(base) is cls)


def _variants(kinds: dict[str, Any], **given: Any) -> Iterator[tuple[str, Any]]:
    """A layer with its defaults, with all that it may have, with each pair that stands in place of another, and with each choice."""
    for name, cls in kinds.items():
        plain = cls(**given)
        yield name, plain
        optional = {key: middle(spec) for key, spec in params(cls) if getattr(plain, key) is None}
        whole = {key: value for key, value in optional.items() if key not in APART}
        if whole:
            yield f"{name}, whole", cls(**given | whole)
        if WIDTHS[0] in optional:
            yield f"{name}, anisotropic", cls(**given | {"alpha": None} | {key: optional[key] for key in WIDTHS})
        if THICKNESS[0] in optional:
            yield f"{name}, by its thickness", cls(**given | {"tau": None} | {key: optional[key] for key in THICKNESS})
        if FILM[0] in optional:
            yield f"{name}, filmed", cls(**given | {key: optional[key] for key in FILM})
        for field in dataclasses.fields(cls):
            for other in field.metadata.get("choices", ())[1:]:
                yield f"{name}, {field.name} {other}", dataclasses.replace(plain, **{field.name: other})


def _coated(name: str, coats: tuple[Any, ...], base: Any) -> dict[str, Stack]:
    """In every form that does not refuse."""
    forms = {key: form for key, form in MODELS.items() if FORMS[form].refuses(coats, base) is None}
    return {f"{key}, {name}": Stack(coats, base, form()) for key, form in forms.items()}


def _in_time() -> Iterator[tuple[str, Stack]]:
    """Metal that changes in time, as it is in the mean."""
    for name, layer in _variants({"patina": Patina}, softness=0.03):
        for key, form in MODELS.items():
            if patina.form_refuses((layer,), form) is None:
                yield f"{key}, {name}", Stack((layer,), Conductor(), form())
    for name, layer in _variants({"overgrowth": Overgrowth}, softness=0.03):
        yield f"weathered, {name}", Stack((layer,), Conductor(), Corrected())
    for steps in ((Deposit(),), (Polish(), Erosion(), Deposit())):
        yield f"weathered, {' '.join(layer.name for layer in steps)}", Stack(steps, Conductor(), Corrected())


def middle(spec: Param) -> float:
    """A value within the range, in the middle of its scale; near the lower end where that is 0 and the range is wide."""
    if spec.default is not None:
        return spec.default
    if spec.scale == "log":
        return (spec.lower * spec.upper) ** 0.5
    return spec.lower + spec.soft if spec.scale == "softlog" else 0.5 * (spec.lower + spec.upper)
