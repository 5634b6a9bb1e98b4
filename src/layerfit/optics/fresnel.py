"""Fresnel reflectance of a smooth boundary, unpolarised.

`c` is the cosine between the direction and the normal of the facet, on the side of the incident medium, in [0, 1].
Indices are relative: the medium below divided by the medium above.
"""

import math

import jax.numpy as jnp

from .._chunk import chunk, divide, safe_divide, safe_sqrt, where
from .._types import Colour, Scalar


@chunk
def fresnel_dielectric(c: Scalar, eta: Colour) -> Colour:
    """Exact reflectance of a dielectric boundary (Born and Wolf 1999, 1.5.2); 1 under total internal reflection."""
    # (c - g) / (c + g) with g^2 = eta^2 - 1 + c^2 cancels as eta -> 1; -delta / (c + g)^2 is the same and does not.
    # delta is the product, not eta^2 - 1: in float32 that alone is worth a factor of 300 in error.
    delta = (eta - 1.0) * (eta + 1.0)
    g2 = delta + c * c
    near_tir = 1e-8 if g2.dtype == jnp.float32 else 1e-16
    refracts = g2 > near_tir
    g = jnp.sqrt(where(refracts, g2, 1.0))
    eta2 = eta * eta
    perpendicular = 1.0 / (c + g)
    parallel = 1.0 / (eta2 * c + g)
    # Over delta, which is a factor of both.
    rs = perpendicular * perpendicular
    rp = ((eta2 + 1.0) * (c * c) - 1.0) * (parallel * parallel)
    reflectance = 0.5 * (delta * delta) * (rs * rs + rp * rp)
    return where(eta == 1.0, 0.0, where(refracts, reflectance, 1.0))


@chunk
def transmittance_dielectric(c: Scalar, eta: Colour) -> Colour:
    """1 - fresnel_dielectric, with its own digits where the reflectance is near 1 (grazing); 0 under total internal reflection."""
    g = safe_sqrt((eta - 1.0) * (eta + 1.0) + c * c)
    eta2 = eta * eta
    perpendicular = safe_divide(1.0, c + g)
    parallel = safe_divide(1.0, eta2 * c + g)
    passed = 2.0 * c * g * (perpendicular * perpendicular + eta2 * (parallel * parallel))
    return where(eta == 1.0, 1.0, passed)


@chunk
def fresnel_conductor(c: Scalar, eta: Colour, k: Colour) -> Colour:
    """Exact reflectance of a conductor eta + i k (Born and Wolf 1999, 14.2)."""
    c2 = c * c
    s2 = 1.0 - c2
    p = (eta - k) * (eta + k) - 1.0 + c2
    nk2 = 2.0 * eta * k
    q = jnp.sqrt(jnp.maximum(p * p + nk2 * nk2, 1e-24))
    # a = sqrt((q + p) / 2) cancels where p < 0, as in every metal; there b = sqrt((q - p) / 2) does not and a = n k / b.
    larger = jnp.sqrt(q + jnp.abs(p))
    # All is multiplied by sqrt(2) b there, which spares the division.
    metal = p < 0.0
    b = where(metal, larger, 1.0)
    twice_abc = math.sqrt(2.0) * where(metal, nk2, larger) * c
    # Rp is Rs (even - odd) / (even + odd), so that the mean of both is Rs even / (even + odd).
    even = b * (q * c2 + s2 * s2)
    odd = twice_abc * s2
    across = b * (q + c2)
    return divide((across - twice_abc) * even, (across + twice_abc) * (even + odd))


@chunk
def fresnel_schlick(c: Scalar, f0: Colour) -> Colour:
    """Schlick 1994, eq. 15, from the reflectance at normal incidence."""
    m = 1.0 - c
    m2 = m * m
    return f0 + (1.0 - f0) * (m2 * m2 * m)


EDGE = 1.0 / 7.0
"""Cosine of 82 degrees, where Schlick's formula is lowest below the reflectance of a metal (Hoffman 2019)."""


def fresnel_hoffman(c: Scalar, f0: Colour, f82: Colour) -> Colour:
    """Schlick's formula with a dip before grazing angles, to the reflectance `f82` at 82 degrees (Hoffman 2019; Kutz et al. 2021, eq. 12)."""
    dip = fresnel_schlick(jnp.asarray(EDGE), f0) - f82
    return fresnel_schlick(c, f0) - dip / (EDGE * (1.0 - EDGE) ** 6) * c * (1.0 - c) ** 6


@chunk
def rarer_cosine(c: Scalar, eta: Colour) -> Colour:
    """The cosine on that side of a dielectric boundary where the index is lower; 0 under total internal reflection.

    Exact reflectance is the same from both sides of one ray. Approximations are made for light from the rarer medium.
    """
    return where(eta >= 1.0, c, safe_sqrt((eta - 1.0) * (eta + 1.0) + c * c) / eta)


def dielectric_f0(eta: Colour) -> Colour:
    """Reflectance of a dielectric boundary at normal incidence."""
    ratio = (eta - 1.0) / (eta + 1.0)
    return ratio * ratio


def conductor_f0(eta: Colour, k: Colour) -> Colour:
    """Reflectance of a conductor at normal incidence."""
    return ((eta - 1.0) ** 2 + k * k) / ((eta + 1.0) ** 2 + k * k)
