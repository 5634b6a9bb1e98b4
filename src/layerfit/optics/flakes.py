"""Where flakes lie and how they are tilted: cells of a grid over the surface, each with a normal of its own.

A tilt is a point (x, y) of the plane of slopes: the normal is along (x, y, 1). Tilts have a Gaussian distribution there,
<x^2 + y^2> = spread^2, as the facets of a Beckmann surface of width `spread` have. Slopes of a flake and of its facets add, as in LEAN
mapping (Olano and Baker 2010): a pixel that holds many flakes sees a Beckmann surface of width sqrt(alpha^2 + spread^2), exactly.
"""

import math

import jax.numpy as jnp

from .._chunk import chunk, dot, safe_sqrt, where
from .._types import Scalar, UInt, Vec2, Vec3
from .hashing import hash_cell, unit
from .microfacet import beckmann_by_slopes


@chunk
def flake_tilt(uv: Vec2, per_uv: Scalar, spread: Scalar, seed: UInt) -> Vec2:
    """Tilt of the flake at texture coordinates uv; `per_uv` flakes lie along one unit of them."""
    bits = hash_cell(jnp.floor(uv * per_uv), seed)
    # log(1 - u) by the complement of the bits, since 1 - u would round to 0 for the steepest flakes, but not near 0: drivers' logarithms
    # lose their digits near 1.
    u = unit(bits[0], per_uv)
    exponent = where(u < 0.25, jnp.log1p(-u), jnp.log(unit(~bits[0], per_uv)))
    slope = spread * safe_sqrt(-exponent)
    phi = 2.0 * math.pi * (unit(bits[1], per_uv) - 0.5)  # from -pi, where a GPU's sine has its digits
    return -slope * jnp.stack([jnp.cos(phi), jnp.sin(phi)])


@chunk
def tilted_normal(tilt: Vec2) -> Vec3:
    """Unit normal of a flake."""
    return jnp.stack([tilt[0], tilt[1], jnp.ones_like(tilt[0])]) / jnp.sqrt(1.0 + tilt[0] * tilt[0] + tilt[1] * tilt[1])


@chunk
def tilted_d(h: Vec3, tilt: Vec2, alpha: Scalar) -> Scalar:
    """Density of the facet normals of a tilted flake: Beckmann's, moved in the plane of slopes (Olano and Baker 2010, eq. 7)."""
    x = h[0] - h[2] * tilt[0]
    y = h[1] - h[2] * tilt[1]
    return beckmann_by_slopes((x * x + y * y) / (alpha * alpha), h[2], alpha * alpha)


@chunk
def kept_tilt(distance: Scalar, half_distance: Scalar) -> Scalar:
    """Part of the tilt of flakes that is still drawn flake by flake: 1 near by, 1/2 at `half_distance`, 0 far off."""
    ratio = distance / half_distance
    return 1.0 / (1.0 + ratio * ratio)


@chunk
def lost_variance(distance: Scalar, half_distance: Scalar) -> Scalar:
    """Part of the variance of tilts that is not drawn flake by flake: 1 - kept_tilt^2, with its own digits near by."""
    ratio = distance / half_distance
    ratio2 = ratio * ratio
    kept = 1.0 / (1.0 + ratio2)
    return ratio2 * kept * (1.0 + kept)


@chunk
def into_facet(w: Vec3, n: Vec3) -> Vec3:
    """A direction in a frame whose z is n: half a turn about the vector halfway between n and the normal (0, 0, 1)."""
    m = n + jnp.array([0.0, 0.0, 1.0], n.dtype)
    return m * (dot(w, m) / m[2]) - w
