"""Lobes that are powers of a cosine: Phong 1975 and Blinn 1977.

`normalized` scales the lobe so that `ks` is about the part of the light that it sends back, and divides the diffuse part by pi.
`faithful` is the published shading kd NoL + ks cos^s: as a BRDF it is divided by NoL, so that it is not reciprocal and knows no bound
of energy. A coat over it counts no more than all of the light as coming back.
"""

import math
from abc import abstractmethod
from typing import Any, Literal

import jax.numpy as jnp

from .._chunk import chunk, dot, safe_divide, safe_sqrt, static, where
from .._fields import choice, layer, param
from .._types import Colour, Direction, Number, Scalar
from ..optics.directions import along, sine2
from ..optics.microfacet import Width
from .base import Lobe, variance
from .diffuse import Lambert, TwoParts, kd_param

Scaling = Literal["normalized", "faithful"]


@chunk
def cosine_power(one_minus: Scalar, exponent: Scalar) -> Scalar:
    """cos^exponent of an angle by 1 - cos, which keeps the digits of narrow lobes; 0 from a right angle on."""
    inside = one_minus < 0.999999
    return where(inside, jnp.exp(exponent * jnp.log1p(-where(inside, one_minus, 0.0))), 0.0)


@chunk
def mirror_distance(wi: Direction, wo: Direction) -> Scalar:
    """1 - cos of the angle between `wo` and the mirror direction of `wi`: half of a squared distance."""
    lean, z = along(wi) + along(wo), wi[-1] - wo[-1]
    return 0.5 * (dot(lean, lean) + z * z)


@chunk
def normal_distance(h: Direction) -> Scalar:
    """1 - NoH, without the cancellation near the normal."""
    return sine2(h) / (1.0 + h[-1])


class CosineLobe(TwoParts, Lobe):
    """A Lambertian part and a lobe that is a power of a cosine."""

    ks: Number
    exponent: Number
    scaling: Scaling

    @property
    def diffuse(self) -> Any:
        if self.kd is None or self.scaling == "normalized":
            return super().diffuse
        return Lambert(albedo=jnp.pi * self.kd)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (self,)

    def reflectance(self, c: Scalar) -> Colour:
        return self.ks

    def energy(self, reflectance: Colour) -> Colour:
        """Of a faithful lobe the light at normal incidence, as if the normalised one were scaled to the same peak."""
        if self.scaling == "normalized":
            return reflectance
        return jnp.minimum(reflectance / self.peak(self.exponent), 1.0)

    @abstractmethod
    def peak(self, exponent: Scalar) -> Scalar:
        """Value of the normalised lobe of reflectance 1 at its peak [1/sr]."""

    def powered(self, one_minus: Scalar, wi: Direction, exponent: Scalar | None) -> Scalar:
        """The lobe [1/sr] by 1 - cos; `exponent` is that of a widened one, which keeps its light, or None."""
        power = cosine_power(one_minus, self.exponent if exponent is None else exponent)
        if self.scaling == "normalized":
            return self.peak(self.exponent if exponent is None else exponent) * power
        if exponent is not None:
            power = power * (self.peak(exponent) / self.peak(self.exponent))
        return safe_divide(power, wi[-1])


def _ks() -> Any:
    return param(default=0.2, lower=0.0, upper=1.0, scale="linear", doc="strength of the lobe", colour=True)


def _exponent() -> Any:
    return param(default=50.0, lower=1.0, upper=1e4, scale="log", doc="exponent of the cosine; large is narrow")


def _scaling() -> Any:
    return choice(default="normalized", others=("faithful",), doc="by the light that is sent back, or as published")


@layer
class Phong(CosineLobe):
    """A power of the cosine to the mirror direction (Phong 1975), beside a diffuse part."""

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = _ks()
    exponent: Number = _exponent()
    scaling: Scaling = _scaling()

    @property
    def width(self) -> Width:
        """cos^s of twice the angle of the facets is about exp(-2 s tan^2), Beckmann's with alpha^2 = 1 / (2 s)."""
        return safe_sqrt(0.5 / self.exponent)

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        exponent = None if width is None else 0.5 / variance(width)
        return self.powered(mirror_distance(wi, wo), wi, exponent)

    def peak(self, exponent: Scalar) -> Scalar:
        """(s + 2) / (2 pi): Lafortune and Willems 1994."""
        return (exponent + 2.0) * (0.5 / math.pi)


@layer
class Blinn(CosineLobe):
    """A power of the cosine between half vector and normal (Blinn 1977), beside a diffuse part."""

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = _ks()
    exponent: Number = _exponent()
    scaling: Scaling = _scaling()

    @property
    def width(self) -> Width:
        """alpha^2 = 2 / (s + 2): that of Beckmann's density with the same peak (Walter et al. 2007, section 5.2)."""
        return safe_sqrt(2.0 / (self.exponent + 2.0))

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        exponent = None if width is None else jnp.maximum(2.0 / variance(width) - 2.0, 0.0)
        return self.powered(normal_distance(h), wi, exponent)

    def peak(self, exponent: Scalar) -> Scalar:
        """(s + 8) / (8 pi): Akenine-Moller, Haines and Hoffman 2008, a little too bright for narrow lobes."""
        return (exponent + 8.0) * (0.125 / math.pi)
