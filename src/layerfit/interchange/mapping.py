"""The one place where our layers become a coat over a base, and a coat over a base our layers."""

import math
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..forms.corrected import Corrected
from ..layers import Coat
from ..optics.fresnel import EDGE, fresnel_conductor, fresnel_schlick
from ..preset import form_of
from ..stack import Stack
from ..surfaces import Conductor, Dielectric, Lambert
from . import words
from .dialects import COAT_INDEX, DIALECTS
from .engine import Engine

BRIGHT = 0.2
"""Reflectance at normal incidence from which on a lobe beside a diffuse part is a metal's."""


def copied(stack: Stack, dialect: str) -> Engine:
    """A material value by value in the words of a program: where the search for the best values begins."""
    rules = DIALECTS[dialect]
    coats = [layer for layer in stack.layers if isinstance(layer, Coat)]
    engine = _base(stack, coats, dialect)
    if coats and engine.base == "diffuse" and not rules.coat_index:  # a dielectric base has an index where a coat has none
        engine = replace(engine, base="glossy", alpha=_width(coats[0]), ior=_number(coats[0].eta))
    elif coats:
        engine = replace(engine, coat_alpha=_width(coats[0]), coat_ior=_number(coats[0].eta) if rules.coat_index else None)
    if coats:
        engine = _absorbing(
            engine, sum((_colour(coat.extinction) for coat in coats if coat.extinction is not None), np.zeros(3))
        )
    elif (
        engine.base in ("metal", "mixed") and len(stack.base.lobes) > 1
    ):  # the narrowest of a paint's lobes stands for its clear coat
        coat_ior = COAT_INDEX if rules.coat_index else None
        engine = replace(
            engine, base="mixed", metallic=0.5, coat_alpha=min(_width(lobe) for lobe in stack.base.lobes), coat_ior=coat_ior
        )
    return engine


def filmed(stack: Stack, engine: Engine) -> Engine | None:
    """A copy with the film of its metal, where there is one and the program has a word for it: the metal's own reflectance below it."""
    base = stack.base
    if engine.rules.film is None or engine.base != "metal" or not isinstance(base, Conductor) or base.film_nm is None:
        return None
    if engine.coat_alpha is not None and not engine.rules.film_coated:
        return None
    bare = copied(replace(stack, base=replace(base, film_nm=None, film_eta=None)), engine.dialect)
    return replace(bare, film_nm=_number(base.film_nm), film_eta=_number(base.film_eta))


def _absorbing(engine: Engine, tau: np.ndarray) -> Engine:
    """With the depth of its coat, or what that takes of the base's colour where the coat cannot absorb."""
    if not tau.any():
        return engine
    if engine.rules.path is None:
        return replace(engine, base_color=engine.base_color * np.exp(-2.0 * tau))
    return replace(engine, coat_tau=np.minimum(tau, 10.0))


def _base(stack: Stack, coats: list[Any], dialect: str) -> Engine:
    """What lies below the coats."""
    outside = _number(coats[-1].eta) if coats else 1.0
    if len(coats) < len(stack.layers):  # what time made of a metal is a mixture
        return Engine(dialect=dialect, base="mixed", base_color=np.full(3, 0.3), metallic=0.5, alpha=0.4)
    below = stack.base.below(jnp.asarray(outside))
    lobes, diffuse = below.lobes, below.diffuse
    albedo = np.zeros(3) if diffuse is None else _colour(diffuse.albedo)
    if not lobes:
        return Engine(dialect=dialect, base="diffuse", base_color=albedo)
    widest = max(lobes, key=_width)
    f0 = np.clip(_colour(widest.reflectance(jnp.ones(()))), 0.0, 1.0)
    engine = Engine(dialect=dialect, base_color=f0, **_widths(stack.base, widest))
    if isinstance(stack.base, Conductor):
        return replace(engine, edge_tint=_edge_tint(below, f0)) if engine.rules.edge_tint else engine
    if len(lobes) == 1 and not coats and (isinstance(stack.base, Dielectric) or (diffuse is not None and f0.max() < BRIGHT)):
        root = math.sqrt(min(float(f0.mean()), BRIGHT))
        return replace(engine, base="glossy", base_color=albedo, ior=(1.0 + root) / (1.0 - root))
    color = np.clip(f0 + albedo, 0.0, 1.0)
    return replace(engine, base="mixed", base_color=color, metallic=float(f0.mean() / max(color.mean(), 1e-6)))


def _edge_tint(metal: Any, f0: np.ndarray) -> np.ndarray:
    """A metal's reflectance at 82 degrees over that of Schlick's formula."""
    at_edge = _colour(metal.reflectance(jnp.asarray(EDGE)))
    return np.clip(at_edge / np.asarray(fresnel_schlick(jnp.asarray(EDGE), jnp.asarray(f0))), 0.0, 1.0)


def _widths(base: Any, lobe: Any) -> dict[str, Any]:
    if getattr(base, "alpha_x", None) is None:
        return {"alpha": _width(lobe)}
    return {"alpha_x": words.clipped(base.alpha_x), "alpha_y": words.clipped(base.alpha_y)}


def _width(lobe: Any) -> float:
    width = lobe.width
    return words.clipped(math.sqrt(float(width[0]) * float(width[1])) if isinstance(width, tuple) else float(width))


def _number(value: Any) -> float:
    return float(np.mean(np.asarray(value)))


def _colour(value: Any) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, float), 3).copy()


def alone(engine: Engine) -> Stack:
    """An engine's material, to be fitted and drawn as any other."""
    return Stack((), engine, Corrected())


def fitted_fields(engine: Engine) -> tuple[str, ...]:
    """What the best values are searched in: not an index that was copied, nor a colour where a coat's depth has the same effect."""
    fields = ["alpha", "alpha_x", "alpha_y", "metallic", "coat_alpha", "coat_tau", "film_nm"]
    if engine.coat_tau is None or engine.base == "mixed" or (engine.base == "diffuse" and engine.rules.path != "flat"):
        fields.append("base_color")
    return tuple(name for name in fields if getattr(engine, name) is not None)


def stack_of(engine: Engine) -> Stack:
    """The layers that come nearest to a coat over a base: where a fit starts from somebody's material.

    A mixed base is taken as a metal from half a metal on. Of a metal, reflectance and edge tint give index and extinction.
    """
    coat_index = 1.0 if engine.coat_alpha is None else engine.coat_ior or COAT_INDEX
    metal = engine.base == "metal" or (engine.base == "mixed" and _number(engine.metallic) >= 0.5)
    widths = {"alpha": engine.alpha, "alpha_x": engine.alpha_x, "alpha_y": engine.alpha_y}
    if metal:
        eta, k = metal_of(_colour(engine.base_color), None if engine.edge_tint is None else _colour(engine.edge_tint))
        film = {"film_nm": engine.film_nm, "film_eta": engine.film_eta}
        base: Any = Conductor(**widths, **film, eta=np.clip(eta * coat_index, 0.02, 10.0), k=np.clip(k * coat_index, 0.0, 15.0))
    elif engine.base == "glossy" and not _colour(engine.base_color).any():
        base = Dielectric(**widths, eta=engine.ior)
    else:
        base = Lambert(albedo=_colour(engine.base_color))
    layers = _coats(engine) if engine.coat_alpha is not None else ()
    if engine.base == "glossy" and isinstance(base, Lambert):  # a dielectric lobe over a diffuse part is a clear coat
        layers = (Coat(**widths, eta=engine.ior),)
    return Stack(layers, base, form_of({}, layers, base, "material"))


def _coats(engine: Engine) -> tuple[Coat, ...]:
    coat = Coat(alpha=engine.coat_alpha, eta=engine.coat_ior or COAT_INDEX)
    return (coat if engine.coat_tau is None else replace(coat, tau=_colour(engine.coat_tau)),)


def metal_of(f0: np.ndarray, edge_tint: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Index and extinction (3,) of a metal, relative to what is outside, by its reflectance at normal incidence and its edge tint.

    All pairs with that reflectance lie on a circle (Gulbrandsen 2014, eq. 5); taken is the point whose reflectance at 82 degrees is nearest.
    """
    r = np.clip(f0, 1e-3, 0.999)
    root = np.sqrt(r)
    least, most = (1.0 - r) / (1.0 + r), (1.0 + root) / (1.0 - root)
    share = np.linspace(0.0, 1.0, 257)[:, None]
    eta = least * (most / least) ** share
    k = np.sqrt(np.maximum((r * (eta + 1.0) ** 2 - (eta - 1.0) ** 2) / (1.0 - r), 0.0))
    schlick = np.asarray(fresnel_schlick(jnp.asarray(EDGE), jnp.asarray(r)))
    wanted = schlick if edge_tint is None else schlick * edge_tint
    found = np.asarray(jax.vmap(lambda n, k: fresnel_conductor(jnp.asarray(EDGE), n, k))(jnp.asarray(eta), jnp.asarray(k)))
    at = np.argmin(np.abs(found - wanted), 0)
    return eta[at, np.arange(3)], k[at, np.arange(3)]
