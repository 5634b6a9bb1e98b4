"""Weathered metal after Dorsey and Hanrahan 1996: a stack of pigments over it, at every place as its history made it.

A history is a sequence of the operators `coat`, `erode` and `polish`, pure functions from a stack to a stack. Light is reflected at the
boundary of what lies open; below it the pigments are Kubelka-Munk layers, the metal being their diffuse substrate. Where nothing lies on
it the metal is seen itself.
"""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, member, safe_divide, struct, where
from .._place import Place
from .._types import Colour, Direction, Scalar
from ..errors import InputError
from ..layers import Coat
from ..layers.weathering import STEPS, Deposit, Erosion, Overgrowth, Polish
from ..optics.directions import above, both_above
from ..optics.fresnel import transmittance_dielectric
from ..optics.scattering import kubelka_munk, kubelka_munk_over
from ..surfaces import Conductor, Dielectric, Lambert
from . import corrected
from .growth import MEAN_SKY, Growth, aged_at, cover_at, field_at, growth_of, mean_cover

# A layer thinner than about a wavelength has no boundary of its own; this makes what lies open a smooth function of the thicknesses.
SKIN_UM = 0.5
# Mean over the hemisphere of what Schlick's (1 - c)^5 adds to F0: 2 int (1 - c)^5 c dc.
SCHLICK_MEAN = 1.0 / 21.0


@struct
class Pigment:
    """What comes on."""

    thickness: Scalar = member("thickness that comes on [um]")
    K: Colour = member("absorption of diffuse light [1/um]")
    S: Colour = member("scattering of diffuse light [1/um]")
    alpha: Scalar = member("width of the facet slopes of its boundary")
    eta: Scalar = member("index of refraction, against air")
    escape: Scalar = member("part of diffuse light from below that passes its boundary")


@struct
class Prepared:
    """The steps of a history, latest first, and the metal."""

    steps: tuple[Any, ...]
    growths: tuple[Growth | None, ...]
    base: Any
    albedo: Colour
    """Part of diffuse light that the metal reflects."""
    covered: tuple[Scalar | None, ...]
    """Part of a place that a growing step covers; absent for the mean over the surface."""

    def at(self, place: Place) -> "Prepared":
        """The history of one place."""
        covered = tuple(growth and covered_at(place, growth) for growth in self.growths)
        return dataclasses.replace(self, covered=covered)


def covered_at(place: Place, growth: Growth) -> Scalar:
    """Part of a place that what grows there covers."""
    return cover_at(field_at(place.uv, growth), aged_at(growth, place.sky)).covered


@dataclasses.dataclass(frozen=True)
class Lying:
    """One pigment of a stack, as thick and as wide at a place as its history left it."""

    pigment: Pigment
    thickness: Scalar
    alpha: Scalar


Lies = tuple[Lying, ...]
"""A stack of pigments, innermost first."""


def coat(stack: Lies, pigment: Pigment, amount: Scalar) -> Lies:
    """Lay `amount` [um] on: more of the topmost pigment, or a new one."""
    if stack and stack[-1].pigment is pigment:
        return (*stack[:-1], dataclasses.replace(stack[-1], thickness=stack[-1].thickness + amount))
    return (*stack, Lying(pigment, amount, pigment.alpha))


def erode(stack: Lies, amount: Scalar) -> Lies:
    """Take `amount` [um] off, from the top down."""
    left: list[Lying] = []
    for lying in reversed(stack):
        left.append(dataclasses.replace(lying, thickness=jnp.maximum(lying.thickness - amount, 0.0)))
        amount = jnp.maximum(amount - lying.thickness, 0.0)
    return tuple(reversed(left))


def polish(stack: Lies, height: Scalar, strength: Scalar) -> Lies:
    """Level what lies open to `height` [um], and take a part of its width."""
    levelled = []
    for lying, share in zip(stack, lies_open(stack)[0], strict=True):
        thickness = lying.thickness - share * jnp.maximum(lying.thickness - height, 0.0)
        levelled.append(dataclasses.replace(lying, thickness=thickness, alpha=lying.alpha * (1.0 - strength * share)))
    return tuple(levelled)


def lies_open(stack: Lies) -> tuple[list[Scalar], Scalar]:
    """Part of a place where each pigment is what light meets first, and where it meets bare metal."""
    shares: list[Scalar] = []
    bare: Any = 1.0
    for lying in reversed(stack):
        through = see_through(lying.thickness)
        share = bare * (1.0 - through)
        bare = bare * through
        shares.append(share)
    return shares[::-1], bare


@chunk
def see_through(thickness: Scalar) -> Scalar:
    """Part of a place where a layer of this thickness [um] is too thin to have a boundary of its own."""
    return jnp.exp(-thickness / SKIN_UM)


def grows(layers: tuple[Any, ...]) -> bool:
    """Whether there is a step of a history among the layers."""
    return any(isinstance(layer, STEPS) for layer in layers)


def refuses(layers: tuple[Any, ...], base: Any) -> str | None:
    """Why a history cannot be what it is, or None."""
    if not grows(layers):
        return None
    other = [layer.name for layer in layers if not isinstance(layer, STEPS)]
    kinds = ", ".join(step.__name__.lower() for step in STEPS)
    if other:
        return f"{other[0]} lies among steps of weathering ({kinds}), which go with none but their like"
    if not any(isinstance(layer, (Deposit, Overgrowth)) for layer in layers):
        return "there is no deposit or overgrowth to wear or to polish"
    return None if isinstance(base, Conductor) else f"weathering is of a conductor; here the base is {type(base).__name__}"


def prepare(layers: tuple[Any, ...], base: Any, form: Any) -> Prepared:
    """The constants of the pigments, how far each has grown, and the metal below them. Raises `InputError` for what is no history."""
    if reason := refuses(layers, base):
        raise InputError(reason)
    steps = tuple(layer if isinstance(layer, (Erosion, Polish)) else _pigment(layer) for layer in layers)
    growths = tuple(growth_of(layer) if isinstance(layer, Overgrowth) else None for layer in layers)
    innermost = [step for step in steps if isinstance(step, Pigment)][-1]
    f0 = base.below(innermost.eta).f0
    return Prepared(steps, growths, base.below(1.0), f0 + (1.0 - f0) * SCHLICK_MEAN, tuple(None for _ in layers))


def _pigment(layer: Deposit | Overgrowth) -> Pigment:
    # What a white body gains by the light that the boundary sends back to it is one over what escapes at each try.
    boundary = Coat(alpha=layer.alpha, eta=layer.eta)
    white = Lambert(albedo=jnp.ones_like(layer.eta))
    gain: Any = corrected.prepare((boundary,), white, corrected.Corrected(rough_interface=False)).returned
    return Pigment(layer.thickness_um, layer.K_per_mm * 1e-3, layer.S_per_mm * 1e-3, layer.alpha, layer.eta, 1.0 / gain)


def history(prepared: Prepared) -> Lies:
    """The stack of one place: all steps, from the first to the latest."""
    stack: Lies = ()
    steps = zip(prepared.steps, prepared.growths, prepared.covered, strict=True)
    for step, growth, covered in reversed(list(steps)):
        if isinstance(step, Erosion):
            stack = erode(stack, step.amount_um)
        elif isinstance(step, Polish):
            stack = polish(stack, step.height_um, step.strength)
        elif growth is None:
            stack = coat(stack, step, step.thickness)
        else:
            part = mean_cover(aged_at(growth, MEAN_SKY))[0].covered if covered is None else covered
            stack = coat(stack, step, part * step.thickness)
    return stack


def evaluate(prepared: Prepared, wi: Direction, wo: Direction, form: Any) -> Colour:
    """BRDF [1/sr] of unit directions above the surface; 0 where either is below it. No form changes it."""
    lit = both_above(wi, wo)
    wi, wo = above(lit, wi), above(lit, wo)
    stack = history(prepared)
    top, covered, bare = _open_boundary(stack)
    albedo = prepared.albedo
    for lying in stack:
        layer = kubelka_munk(lying.pigment.K * lying.thickness, lying.pigment.S * lying.thickness)
        albedo = kubelka_munk_over(layer, albedo)
    boundary = Dielectric(alpha=top.alpha, eta=top.eta).evaluate(wi, wo)
    body = below_boundary(wi, wo, top.eta, top.escape, albedo)
    metal = prepared.base.evaluate(wi, wo)
    f = covered * (boundary + body) + bare * metal
    return where(lit, f, 0.0)


@dataclasses.dataclass(frozen=True)
class _Boundary:
    alpha: Scalar
    eta: Scalar
    escape: Scalar


def _open_boundary(stack: Lies) -> tuple[_Boundary, Scalar, Scalar]:
    """The boundary of what lies open, a mean by shares, and the parts of the place that it covers and leaves bare."""
    shares, bare = lies_open(stack)
    covered = sum(shares[1:], shares[0])
    # Where nothing lies there is no mean; the innermost pigment then stands for it, with a weight of 0.
    weights = [safe_divide(share, covered) for share in shares[1:]]
    weights = [1.0 - sum(weights, jnp.zeros_like(covered)), *weights]

    def mean(values: list[Scalar]) -> Scalar:
        return sum((w * v for w, v in zip(weights[1:], values[1:], strict=True)), weights[0] * values[0])

    alpha = mean([lying.alpha for lying in stack])
    eta = mean([lying.pigment.eta for lying in stack])
    escape = mean([lying.pigment.escape for lying in stack])
    return _Boundary(alpha, eta, escape), covered, bare


@chunk
def below_boundary(wi: Direction, wo: Direction, eta: Scalar, escape: Scalar, albedo: Colour) -> Colour:
    """BRDF [1/sr] of a diffuse body of this albedo below a smooth boundary (Saunderson 1942, per direction)."""
    T = transmittance_dielectric(wi[-1], eta) * transmittance_dielectric(wo[-1], eta)
    kept = jnp.maximum(1.0 - albedo + albedo * escape, 1e-6)
    return T / (eta * eta) * (albedo / math.pi) / kept
