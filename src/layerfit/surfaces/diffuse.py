"""Diffuse boundaries: light that has lost its direction below the surface."""

from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, dot, safe_divide, safe_sqrt, static, where
from .._fields import choice, layer, param
from .._types import Colour, Direction, Number, Scalar
from ..optics.directions import along, sine2
from .base import Surface


class Diffuse(Surface):
    """A boundary without lobes: it is its own diffuse part."""

    albedo: Number

    @property
    def diffuse(self) -> Any:
        return self


def _albedo() -> Any:
    return param(default=0.5, lower=0.0, upper=1.0, scale="linear", doc="part of the light that is sent back", colour=True)


@layer
class Lambert(Diffuse):
    """An ideally diffuse boundary: the same radiance in every direction (Lambert 1760)."""

    name: str = static(default="base", doc="name of the layer")
    albedo: Number = _albedo()

    def evaluate(self, wi: Direction, wo: Direction) -> Colour:
        """BRDF [1/sr]."""
        return self.albedo / jnp.pi


class TwoParts(Surface):
    """A Lambertian part `kd`, which may be absent, beside lobes."""

    kd: Number

    @property
    def diffuse(self) -> Any:
        return None if self.kd is None else Lambert(albedo=self.kd)

    @property
    def lacks(self) -> tuple[str, ...]:
        """What it does without, in words."""
        return ("diffuse part",) if self.kd is None else ()


def kd_param() -> Any:
    """Declare the Lambertian part of a surface that has lobes too."""
    return param(default=None, lower=0.0, upper=1.0, scale="linear", doc="diffuse part", colour=True)


@chunk
def oren_nayar_qualitative(wi: Direction, wo: Direction, albedo: Colour, sigma: Scalar) -> Colour:
    """Oren and Nayar 1994, eq. 30: diffuse grooves, first order."""
    sigma2 = sigma * sigma
    A = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    # cos(phi) sin(larger) tan(smaller) is a dot product over the larger cosine: no angles, no 0 / 0.
    dot_xy = dot(along(wi), along(wo))
    return albedo / jnp.pi * (A + B * jnp.maximum(dot_xy, 0.0) / jnp.maximum(wi[-1], wo[-1]))


@chunk
def oren_nayar_full(wi: Direction, wo: Direction, albedo: Colour, sigma: Scalar) -> Colour:
    """Oren and Nayar 1994, eqs. 25 to 29: diffuse grooves with one interreflection."""
    sigma2 = sigma * sigma
    c1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    c2 = 0.45 * sigma2 / (sigma2 + 0.09)
    c3 = 0.125 * sigma2 / (sigma2 + 0.09)
    c4 = 0.17 * sigma2 / (sigma2 + 0.13)
    sin_i = safe_sqrt(sine2(wi))
    sin_o = safe_sqrt(sine2(wo))
    # Elevations rather than polar angles, and 1 - cos rather than cos: near grazing, differences of ones stand over small cosines.
    elevation_i = jnp.arctan2(wi[-1], sin_i) * (2.0 / jnp.pi)
    elevation_o = jnp.arctan2(wo[-1], sin_o) * (2.0 / jnp.pi)
    higher = jnp.maximum(elevation_i, elevation_o)
    lower_cos = jnp.minimum(wi[-1], wo[-1])
    larger_cos = jnp.maximum(wi[-1], wo[-1])
    larger_sin = jnp.maximum(sin_i, sin_o)
    dot_xy = dot(along(wi), along(wo))
    cos_phi = safe_divide(dot_xy, sin_i * sin_o)
    azimuth_i, azimuth_o = safe_divide(along(wi), sin_i), safe_divide(along(wo), sin_o)
    facing = dot_xy < 0.0
    apart = azimuth_i + where(facing, azimuth_o, -azimuth_o)
    aside = 0.5 * dot(apart, apart)  # 1 - |cos phi|
    # tan of the smaller polar angle has the larger cosine below it; tan of the mean angle is (sin + sin) / (cos + cos).
    forward = dot_xy / larger_cos
    gap = higher * (3.0 - higher * (3.0 - higher)) - lower_cos * lower_cos / (1.0 + larger_sin)
    backward = safe_divide(dot_xy * gap, larger_cos * larger_sin)
    tan_mean = (sin_i + sin_o) / (wi[-1] + wo[-1])
    smaller = 1.0 - higher
    product = smaller * (1.0 - jnp.minimum(elevation_i, elevation_o))
    direct = c1 + c2 * where(dot_xy >= 0.0, forward, backward)
    direct = direct + aside * c3 * (product * product) * tan_mean
    interreflected = c4 * (1.0 - cos_phi * (smaller * smaller))
    # Far from the light, grooves steeper than their fit was made for would reflect less than nothing.
    return albedo / jnp.pi * jnp.maximum(direct + albedo * interreflected, 0.0)


@layer
class OrenNayar(Diffuse):
    """A rough diffuse boundary: V-grooves of Lambertian facets (Oren and Nayar 1994)."""

    name: str = static(default="base", doc="name of the layer")
    albedo: Number = _albedo()
    sigma: Number = param(
        default=0.3, lower=0.0, upper=1.2, scale="softlog", doc="standard deviation of the facet angle", unit="rad", soft=0.1
    )
    form: str = choice(default="full", others=("qualitative",), doc="with one interreflection, or the short form")

    def evaluate(self, wi: Direction, wo: Direction) -> Colour:
        """BRDF [1/sr]."""
        chosen = oren_nayar_full if self.form == "full" else oren_nayar_qualitative
        return chosen(wi, wo, self.albedo, self.sigma)
