"""Where flakes lie and how they are tilted: cells of a grid over the surface, each with a normal of its own.

A tilt is a point (x, y) of the plane of slopes: the normal is along (x, y, 1). Tilts have a Gaussian distribution there,
<x^2 + y^2> = spread^2, as the facets of a Beckmann surface of width `spread` have. Slopes of a flake and of its facets add, as in LEAN
mapping (Olano and Baker 2010): a pixel that holds many flakes sees a Beckmann surface of width sqrt(alpha^2 + spread^2), exactly.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, dot, where
from .._types import Scalar, UInt, Vec2, Vec3
from .hashing import hash_cell
from .microfacet import beckmann_by_slopes

# A tilt that is off by a millionth moves the lobe of a narrow flake by a part of its width. So tilts are made of sums, products, quotients and
# roots alone: a driver's logarithm, sine and cosine may be off by 5e-4. And no product goes straight into a sum: some compilers would round
# both at once, others one by one.


def _rounded(product: Scalar | Vec2) -> Any:
    """A product >= 0 that is rounded before anything is added to it."""
    return jnp.abs(product)


ODD = 25
"""Bits of an odd whole number that stands for one in (0, 1), the middle of one of 2^24 parts: whole numbers keep all digits at both ends."""

_HALVED = int(np.float32(2.0**ODD * math.sqrt(0.5)).view(np.uint32)) + 2**23 - 1
"""Bits of the float below which such a number is to be doubled, and one short of a bit of its exponent."""


@chunk
def flake_tilt(uv: Vec2, per_uv: Scalar, spread: Scalar, seed: UInt) -> Vec2:
    """Tilt of the flake at texture coordinates uv; `per_uv` flakes lie along one unit of them."""
    bits = hash_cell(jnp.floor(uv * per_uv), seed)
    # -log(1 - u) by the complement of the bits.
    return spread * jnp.sqrt(exponential(~bits[0], per_uv)) * circle(bits[1], per_uv)


@chunk
def exponential(bits: UInt, like: Scalar) -> Scalar:
    """-log u of a number in (0, 1), 24 of the bits, with all digits at both ends; in the precision of `like`."""
    odd = odd_number(bits)
    # Doubled until it lies between sqrt(1/2) and sqrt(2), by the exponent of a float.
    near = jax.lax.bitcast_convert_type(odd.astype(jnp.float32), jnp.uint32)
    halvings = (jnp.uint32(_HALVED) - near) >> jnp.uint32(23)
    beyond_one = ((odd << halvings).astype(jnp.int32) - 2**ODD).astype(like.dtype)
    s = beyond_one / (beyond_one + 2.0 ** (ODD + 1))  # -log u = -2 artanh s, |s| < .172
    last = 3 if like.dtype == jnp.float32 else 10
    s2, total = s * s, jnp.full_like(s, 1.0 / (2 * last + 1))
    for k in reversed(range(last)):
        total = _rounded(total * s2) + 1.0 / (2 * k + 1)
    return _rounded(halvings.astype(like.dtype) * math.log(2.0)) - 2.0 * (s * total)  # twice is exact


@chunk
def circle(bits: UInt, like: Scalar) -> Vec2:
    """Point of the unit circle, u turns from (1, 0), u in (0, 1) by 24 of the bits; in the precision of `like`."""
    odd = odd_number(bits)
    quarter = (odd + jnp.uint32(2 ** (ODD - 3))) >> jnp.uint32(ODD - 2)
    # An eighth of a turn at most.
    x = (odd - (quarter << jnp.uint32(ODD - 2))).astype(jnp.int32).astype(like.dtype) * (2.0 * math.pi / 2**ODD)
    x2 = x * x
    # cos x and sin x / x: terms that fall.
    *lower, total = [
        jnp.array([1.0 / math.factorial(2 * k), 1.0 / math.factorial(2 * k + 1)], like.dtype)
        for k in range(5 if like.dtype == jnp.float32 else 10)
    ]
    for term in reversed(lower):
        total = term - _rounded(x2 * total)
    cosine, sine = total[0], x * total[1]
    turned = (quarter & jnp.uint32(1)) != 0
    left = ((quarter + jnp.uint32(1)) & jnp.uint32(2)) != 0
    below = (quarter & jnp.uint32(2)) != 0
    across, along = where(turned, sine, cosine), where(turned, cosine, sine)
    one = jnp.ones((), like.dtype)
    return jnp.stack([where(left, -one, one) * across, where(below, -one, one) * along])


def odd_number(bits: UInt) -> UInt:
    """2 k + 1 of the upper 24 bits k: u = (k + 1/2) / 2^24 times 2^25."""
    return (bits >> jnp.uint32(7)) | jnp.uint32(1)


@chunk
def tilted_normal(tilt: Vec2) -> Vec3:
    """Unit normal of a flake."""
    return jnp.stack([tilt[0], tilt[1], jnp.ones_like(tilt[0])]) / jnp.sqrt(1.0 + tilt[0] * tilt[0] + tilt[1] * tilt[1])


@chunk
def tilted_d(h: Vec3, tilt: Vec2, alpha2: Scalar) -> Scalar:
    """Density of a tilted flake's facet normals, their squared width alpha2: Beckmann's, moved among slopes (Olano and Baker 2010, eq. 7)."""
    x = h[0] - h[2] * tilt[0]
    y = h[1] - h[2] * tilt[1]
    return beckmann_by_slopes((x * x + y * y) / alpha2, h[2], alpha2)


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
