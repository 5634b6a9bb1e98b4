"""Generalised cosine lobes: Lafortune, Foo, Torrance and Greenberg 1997."""

import dataclasses
import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from .._chunk import chunk, dot, safe_sqrt, static, where
from .._fields import layer, param
from .._types import Colour, Direction, Number, Scalar, Vec3
from ..optics.directions import numbers
from ..optics.microfacet import Width
from .base import Lobe, variance
from .diffuse import TwoParts, kd_param


@chunk
def lafortune_log_product(wi: Direction, wo: Direction, C: Vec3) -> Scalar:
    """log(Cx wi.x wo.x + Cy wi.y wo.y + Cz wi.z wo.z), which is 0 at the peak of Phong's lobe; -1e4 where there is none."""
    # a b = (a^2 + b^2 - (a - b)^2) / 2, with signs, and unit vectors: the sum less 1 has its own digits near 0.
    wi, wo = numbers(wi), numbers(wo)
    C = _as_many(C, wi)
    magnitude = jnp.abs(C)
    apart = wi - jnp.sign(C) * wo
    above_one = 0.5 * ((magnitude - 1.0) * (wi * wi + wo * wo) - magnitude * (apart * apart))
    product = jnp.sum(above_one)
    inside = product > -0.999999
    return where(inside, jnp.log1p(where(inside, product, 0.0)), -1e4)


@chunk
def lafortune_log_length(w: Direction, C: Vec3) -> Scalar:
    """log of the length of (Cx w.x, Cy w.y, Cz w.z): the most that any direction makes of the product with w."""
    w = numbers(w)
    weighted = _as_many(C, w) * w
    return 0.5 * jnp.log(jnp.maximum(dot(weighted, weighted), 1e-12))


def _as_many(C: Vec3, w: jax.Array) -> jax.Array:
    """The weights of as many numbers as a direction has: without a frame there are three along the surface, all weighted alike."""
    return C if len(w) == len(C) else jnp.concatenate([C[:1], C])


@dataclasses.dataclass(frozen=True)
class LafortuneLobe(Lobe):
    """One lobe of several."""

    ks: Colour
    C: Vec3
    exponent: Scalar

    @property
    def width(self) -> Width:
        """As Phong's."""
        return safe_sqrt(0.5 / self.exponent)

    def reflectance(self, c: Scalar) -> Colour:
        return self.ks

    def energy(self, reflectance: Colour) -> Colour:
        """At normal incidence, where the lobe is |Cz|^n cos^n."""
        peak = jnp.exp(jnp.minimum(self.exponent * jnp.log(jnp.maximum(jnp.abs(self.C[2]), 1e-6)), 20.0))
        return jnp.minimum(reflectance * peak * (2.0 * math.pi / (self.exponent + 2.0)), 1.0)

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        """The power of the product; of a widened lobe, a lower power with the same light and the same scale."""
        log_product = lafortune_log_product(wi, wo, self.C)
        if width is None:
            return _power(log_product, self.exponent)
        exponent = 0.5 / variance(width)
        log_scale = 0.5 * (lafortune_log_length(wi, self.C) + lafortune_log_length(wo, self.C))
        same_light = (exponent + 2.0) / (self.exponent + 2.0)
        return same_light * _power(log_product - log_scale, exponent) * _power(log_scale, self.exponent)


BRIGHTEST = 60.0
"""Logarithm at which a lobe is held. Weights of 2 and a high exponent make more of it than float32 holds; times the largest strength, of
three lobes and many pixels, this and its derivatives by a factor of the exponent stay within."""


def _power(log_base: Scalar, exponent: Scalar) -> Scalar:
    return jnp.exp(jnp.minimum(exponent * log_base, BRIGHTEST))


def _ks(default: float | None) -> Any:
    return param(default=default, lower=0.0, upper=1e3, scale="softlog", doc="strength of the lobe", unit="1/sr", colour=True)


def _c(default: float | None, axis: str, fitted: bool = True) -> Any:
    return param(default=default, lower=-2.0, upper=2.0, scale="linear", doc=f"weight of the product of {axis}", fitted=fitted)


def _exponent(default: float | None) -> Any:
    return param(default=default, lower=0.5, upper=1e4, scale="log", doc="exponent of the lobe; large is narrow")


@layer
class Lafortune(TwoParts):
    """Up to three lobes ks (Cx wi.x wo.x + Cy wi.y wo.y + Cz wi.z wo.z)^n beside a diffuse part (Lafortune et al. 1997).

    Without `cy` a lobe is isotropic, Cy = Cx. Cx = Cy = -1 and Cz = 1 is Phong's; -Cx > Cz stands up off-specular peaks. The scale of
    the three and `ks` are one number: a fit holds `cz`. A second and third lobe are there where all of their fields are.
    """

    together: ClassVar = (("ks_2", "cx_2", "cz_2", "exponent_2"), ("ks_3", "cx_3", "cz_3", "exponent_3"))
    only_with: ClassVar = {"cy_2": ("ks_2",), "cy_3": ("ks_3",)}

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = _ks(0.5)
    cx: Number = _c(-1.0, "the components along the tangent")
    cy: Number = _c(None, "the components across the tangent; absent: as cx")
    cz: Number = _c(1.0, "the cosines", fitted=False)
    exponent: Number = _exponent(20.0)
    ks_2: Number = _ks(None)
    cx_2: Number = _c(None, "the components along the tangent")
    cy_2: Number = _c(None, "the components across the tangent; absent: as cx_2")
    cz_2: Number = _c(None, "the cosines", fitted=False)
    exponent_2: Number = _exponent(None)
    ks_3: Number = _ks(None)
    cx_3: Number = _c(None, "the components along the tangent")
    cy_3: Number = _c(None, "the components across the tangent; absent: as cx_3")
    cz_3: Number = _c(None, "the cosines", fitted=False)
    exponent_3: Number = _exponent(None)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return tuple(self._lobe(suffix) for suffix in ("", "_2", "_3") if getattr(self, f"ks{suffix}") is not None)

    def _lobe(self, suffix: str) -> LafortuneLobe:
        ks, cx, cy, cz, exponent = (getattr(self, f"{name}{suffix}") for name in ("ks", "cx", "cy", "cz", "exponent"))
        return LafortuneLobe(ks, jnp.stack([cx, cx if cy is None else cy, cz]), exponent)
