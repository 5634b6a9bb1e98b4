"""Microfacet distributions: densities of facet normals, masking, and both in the form that does not overflow.

Directions and half vectors are in the surface frame, normal (0, 0, 1). The width `alpha` is the GGX width or the root mean
square slope times sqrt(2) (Beckmann): one number, or a pair (alpha_x, alpha_y) for an anisotropic surface.

A reflection lobe is F D G / (4 NoL NoV). D and V = G / (4 NoL NoV) are computed as such: dividing a masking term by
two cosines loses its value at grazing angles.
"""

import math
from typing import Any, Literal

import jax
import jax.numpy as jnp

from .._chunk import chunk, divide, safe_divide, safe_sqrt, where
from .._types import Direction, Scalar, Vec3
from .directions import product, sine2

Distribution = Literal["ggx", "beckmann"]
Masking = Literal["smith", "smith_separable", "vcavity"]
Width = Scalar | tuple[Scalar, Scalar]

_INV_PI = 1.0 / math.pi
_INV_SQRT_PI = 1.0 / math.sqrt(math.pi)


@chunk
def ggx_d(h: Direction, alpha: Scalar) -> Scalar:
    """GGX density of facet normals (Walter et al. 2007, eq. 33)."""
    # |h.xy|^2 + alpha^2 h.z^2, never NoH^2 (alpha^2 - 1) + 1: that cancels where alpha is small.
    root = alpha * _INV_SQRT_PI / (sine2(h) + alpha * alpha * (h[-1] * h[-1]))
    return root * root


@chunk
def ggx_d_anisotropic(h: Vec3, alpha_x: Scalar, alpha_y: Scalar) -> Scalar:
    """Anisotropic GGX density of facet normals (Burley 2012, eq. 13)."""
    x = h[0] / alpha_x
    y = h[1] / alpha_y
    e = x * x + y * y + h[-1] * h[-1]
    return 1.0 / (jnp.pi * alpha_x * alpha_y * e * e)


@chunk
def beckmann_d(h: Direction, alpha: Scalar) -> Scalar:
    """Beckmann density of facet normals (Cook and Torrance 1982, eq. 14, normalised)."""
    return beckmann_by_slopes(sine2(h) / (alpha * alpha), h[-1], alpha * alpha)


@chunk
def beckmann_d_anisotropic(h: Vec3, alpha_x: Scalar, alpha_y: Scalar) -> Scalar:
    """Anisotropic Beckmann density of facet normals (Heitz 2014, eq. 80)."""
    x = h[0] / alpha_x
    y = h[1] / alpha_y
    return beckmann_by_slopes(x * x + y * y, h[-1], alpha_x * alpha_y)


def beckmann_by_slopes(stretched_xy2: Scalar, z: Scalar, area: Scalar) -> Scalar:
    """Beckmann's density by the squared slope in widths, times z^2, and the product of the widths."""
    # The exponent goes to -infinity at the horizon, where D is 0: the guarded z keeps the derivative finite there.
    above = z > 1e-4
    inverse = 1.0 / where(above, z * z, 1.0)
    # A factor each, not one divisor: its square, by which a quotient is differentiated, would be 0 in float32 near the horizon.
    return where(above, jnp.exp(-stretched_xy2 * inverse) * (inverse * inverse) / (jnp.pi * area), 0.0)


def density(distribution: Distribution, h: Direction, alpha: Width) -> Scalar:
    """D(h) [1/sr], normalised so that the integral of D(h) h.z is 1."""
    if isinstance(alpha, tuple):
        anisotropic = ggx_d_anisotropic if distribution == "ggx" else beckmann_d_anisotropic
        return anisotropic(h, *alpha)
    return (ggx_d if distribution == "ggx" else beckmann_d)(h, alpha)


def ggx_lambda(x: Any) -> Any:
    """Lambda of the GGX distribution, of the square of alpha tan(theta) (Heitz 2014, eq. 72)."""
    return 0.5 * x / (1.0 + jnp.sqrt(1.0 + x))


@chunk
def ggx_projection(w: Direction, alpha: Scalar) -> Scalar:
    """NoW (1 + 2 Lambda) of the GGX distribution (Heitz 2014, eq. 72, multiplied out)."""
    a2 = alpha * alpha
    return safe_sqrt(a2 + (1.0 - a2) * (w[-1] * w[-1]))


@chunk
def ggx_projection_anisotropic(w: Vec3, alpha_x: Scalar, alpha_y: Scalar) -> Scalar:
    """NoW (1 + 2 Lambda) of the anisotropic GGX distribution (Heitz 2014, eqs. 72 and 80)."""
    x = alpha_x * w[0]
    y = alpha_y * w[1]
    return safe_sqrt(w[-1] * w[-1] + x * x + y * y)


@chunk
def beckmann_projection(w: Direction, alpha: Scalar) -> Scalar:
    """NoW (1 + 2 Lambda) of the Beckmann distribution (Heitz 2014, eq. 66, multiplied out)."""
    return _beckmann_projection(w[-1], alpha * alpha * sine2(w))


@chunk
def beckmann_projection_anisotropic(w: Vec3, alpha_x: Scalar, alpha_y: Scalar) -> Scalar:
    """NoW (1 + 2 Lambda) of the anisotropic Beckmann distribution (Heitz 2014, eqs. 66 and 80)."""
    x = alpha_x * w[0]
    y = alpha_y * w[1]
    return _beckmann_projection(w[-1], x * x + y * y)


def _beckmann_projection(NoW: Scalar, slope2: Scalar) -> Scalar:
    # In this form the two terms add: the published one subtracts erfc from its own asymptote.
    slope = jnp.maximum(safe_sqrt(slope2), 1e-10)
    q = NoW / slope
    return NoW * jax.lax.erf(q) + slope * jnp.exp(-q * q) * _INV_SQRT_PI


def projection(distribution: Distribution, w: Direction, alpha: Width) -> Scalar:
    """NoW (1 + 2 Lambda(w)): twice the projected area of the facets minus that of the plane. Finite at grazing angles."""
    if isinstance(alpha, tuple):
        anisotropic = ggx_projection_anisotropic if distribution == "ggx" else beckmann_projection_anisotropic
        return anisotropic(w, *alpha)
    return (ggx_projection if distribution == "ggx" else beckmann_projection)(w, alpha)


@chunk
def v_smith(NoL: Scalar, NoV: Scalar, projection_l: Scalar, projection_v: Scalar) -> Scalar:
    """G / (4 NoL NoV), height-correlated Smith masking (Heitz 2014, eq. 99)."""
    return safe_divide(0.5, NoV * projection_l + NoL * projection_v)


@chunk
def v_smith_separable(NoL: Scalar, NoV: Scalar, projection_l: Scalar, projection_v: Scalar) -> Scalar:
    """G / (4 NoL NoV), Smith masking of the two directions taken as independent (Walter et al. 2007, eq. 23)."""
    return safe_divide(1.0, (NoL + projection_l) * (NoV + projection_v))


@chunk
def v_cavity(wi: Direction, wo: Direction) -> Scalar:
    """G / (4 NoL NoV), V-shaped grooves (Torrance and Sparrow 1967; Cook and Torrance 1982, eq. 10)."""
    s = wi + wo
    NoH_over_c = 2.0 * s[-1] / jnp.maximum(product(s, s), 1e-20)
    return jnp.minimum(safe_divide(0.25, wi[-1] * wo[-1]), safe_divide(0.5 * NoH_over_c, jnp.maximum(wi[-1], wo[-1])))


def visibility(masking: Masking, distribution: Distribution, wi: Direction, wo: Direction, alpha: Width) -> Scalar:
    """V = G / (4 NoL NoV) [no unit], finite at grazing angles."""
    if masking == "vcavity":
        return v_cavity(wi, wo)
    projection_i = projection(distribution, wi, alpha)
    projection_o = projection(distribution, wo, alpha)
    return (v_smith if masking == "smith" else v_smith_separable)(wi[-1], wo[-1], projection_i, projection_o)


@chunk
def ggx_lobe(wi: Direction, wo: Direction, h: Direction, alpha: Scalar) -> Scalar:
    """D V, the GGX density (Walter et al. 2007, eq. 33) and height-correlated Smith masking (Heitz 2014, eq. 99), by one division."""
    a2 = alpha * alpha
    e = sine2(h) + a2 * (h[-1] * h[-1])
    hidden = wo[-1] * ggx_projection(wi, alpha) + wi[-1] * ggx_projection(wo, alpha)
    return divide(0.5 * _INV_PI * a2, e * e * hidden)


def lobe(distribution: Distribution, masking: Masking, wi: Direction, wo: Direction, h: Direction, alpha: Width) -> Scalar:
    """D V [1/sr], the part of a reflection lobe that is not its colour."""
    if (distribution, masking) == ("ggx", "smith") and not isinstance(alpha, tuple):
        return ggx_lobe(wi, wo, h, alpha)
    D = density(distribution, h, alpha)
    V = visibility(masking, distribution, wi, wo, alpha)
    return D * V


@chunk
def half_vector(wi: Direction, wo: Direction) -> Direction:
    """The unit vector halfway between two directions on the same side of the surface."""
    s = wi + wo
    inverse = jax.lax.rsqrt(jnp.maximum(product(s, s), 1e-20))
    return s * inverse


@chunk
def half_cosine(wi: Direction, wo: Direction) -> Scalar:
    """The cosine between either direction and their half vector."""
    # |wi + wo| / 2: the dot product with the half vector loses it near 0 (grazing, opposite).
    s = wi + wo
    return 0.5 * jnp.sqrt(jnp.maximum(product(s, s), 1e-20))
