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

# A tilt that is off by a millionth moves the lobe of a narrow flake by a part of its width. So tilts are made of sums, products, quotients and
# roots alone: a driver's logarithm, sine and cosine may be off by 5e-4. And no product goes straight into a sum: some compilers would round
# both at once, others one by one.


def _rounded(product: Scalar) -> Scalar:
    """A product >= 0 that is rounded before anything is added to it."""
    return jnp.abs(product)


@chunk
def flake_tilt(uv: Vec2, per_uv: Scalar, spread: Scalar, seed: UInt) -> Vec2:
    """Tilt of the flake at texture coordinates uv; `per_uv` flakes lie along one unit of them."""
    bits = hash_cell(jnp.floor(uv * per_uv), seed)
    # 1 - u by the complement of the bits: it would round to 0 for the steepest flakes.
    exponent = exponential(unit(bits[0], per_uv), unit(~bits[0], per_uv))
    return spread * safe_sqrt(exponent) * circle(unit(bits[1], per_uv))


@chunk
def exponential(u: Scalar, complement: Scalar) -> Scalar:
    """-log(1 - u) for u in (0, 1), with all digits at both ends; `complement` is 1 - u with its own."""
    x, halvings = complement, jnp.zeros_like(u)
    for k in (16, 8, 4, 2, 1, 0):
        small = x < (2.0**-k if k else math.sqrt(0.5))
        by = max(k, 1)
        x = where(small, x * 2.0**by, x)
        halvings = where(small, halvings + by, halvings)
    near = u < 0.25
    s = where(near, -u, x - 1.0) / where(near, 2.0 - u, x + 1.0)  # -log x = -2 artanh s, |s| < .172
    s2, total = s * s, jnp.zeros_like(s)
    for k in reversed(range(5 if u.dtype == jnp.float32 else 11)):
        total = _rounded(total * s2) + 1.0 / (2 * k + 1)
    return where(near, 0.0, _rounded(halvings * math.log(2.0))) - 2.0 * (s * total)  # twice is exact


@chunk
def circle(u: Scalar) -> Vec2:
    """Point of the unit circle, u turns from (1, 0); u in [0, 1]."""
    quarter = jnp.floor(4.0 * u + 0.5)
    x = 2.0 * math.pi * (u - 0.25 * quarter)  # an eighth of a turn at most
    x2 = x * x
    cosine, sine = _series(x2, 0), x * _series(x2, 1)
    odd = (quarter == 1.0) | (quarter == 3.0)
    left, below = (quarter == 1.0) | (quarter == 2.0), (quarter == 2.0) | (quarter == 3.0)
    across, along = where(odd, sine, cosine), where(odd, cosine, sine)
    return jnp.stack([where(left, -across, across), where(below, -along, along)])


def _series(x2: Scalar, odd: int) -> Scalar:
    """cos x, or sin x / x, for |x| < pi / 4: terms that fall, each from the one before."""
    total = jnp.ones_like(x2)
    for k in reversed(range(1, 6 if x2.dtype == jnp.float32 else 10)):
        total = 1.0 - _rounded(x2 * total / ((2 * k + odd) * (2 * k + odd - 1)))
    return total


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
    return 1.0 / (1.0 + _rounded(ratio * ratio))


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


@chunk
def half_into_facet(wi: Vec3, wo: Vec3, tilt: Vec2, n: Vec3) -> Vec3:
    """`into_facet` of the half vector of two directions, n the normal of that tilt: its small slopes keep their digits where it is near n."""
    # What the sum has beside the slope of n: all of x and y comes of it, as n itself turns into z. To turn it whole would round by the digits of 1.
    s = wi + wo
    beside = jnp.stack([s[0] / s[2] - tilt[0], s[1] / s[2] - tilt[1], jnp.zeros_like(s[2])])
    turned = s[2] * into_facet(beside, n)
    return jnp.stack([turned[0], turned[1], dot(s, n)]) / jnp.sqrt(jnp.maximum(dot(s, s), 1e-20))
