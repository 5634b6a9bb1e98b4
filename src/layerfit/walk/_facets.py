"""A rough boundary as a particle meets it: which facets it sees, where it hits them, how they send it on.

Written for one particle; directions are tuples (x, y, z) of scalars, unit, in the frame of the side that the particle is on: z
points from the boundary into that side. `w` is where the particle comes from (opposite to its travel), `d` where it goes.
Inside the rough boundary `w.z` may be negative: the particle is on its way up from a facet.
Facet normals are GGX or Beckmann with the uniform heights of Heitz et al. 2016; a height is the part `c` of facets below it.
"""

import math
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .. import _chunk
from .._types import Flag, Scalar
from ..optics.fresnel import fresnel_dielectric
from ..optics.microfacet import Distribution, density

Direction = tuple[Scalar, Scalar, Scalar]
Widths = tuple[Scalar, Scalar]

_INV_SQRT_PI = 1.0 / math.sqrt(math.pi)
_TINY = 1e-30  # keeps a quotient finite where it is not used


def where(condition: bool | Flag, yes: Any, no: Any) -> Any:
    """`jnp.where` through tuples, in float32, and no function of its own."""

    def one(a: Any, b: Any) -> Any:
        return _chunk.where(
            condition, np.float32(a) if isinstance(a, float) else a, np.float32(b) if isinstance(b, float) else b
        )

    return jax.tree.map(one, yes, no)


def dot(a: Direction, b: Direction) -> Scalar:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jax.jit
def normalise(x: Scalar, y: Scalar, z: Scalar) -> Direction:
    scale = jax.lax.rsqrt(x * x + y * y + z * z + _TINY)
    return x * scale, y * scale, z * scale


@jax.jit
def turn(u: Scalar) -> tuple[Scalar, Scalar]:
    """Cosine and sine of 2 pi u, u in [0, 1)."""
    # The sine's series on a quarter turn about 0; XLA's own are not vectorised on every machine.
    quarter = jnp.floor(4.0 * u + 0.5)
    t = (u - 0.25 * quarter) * (2.0 * math.pi)
    t2 = t * t
    s = t * (1.0 + t2 * (-1.0 / 6.0 + t2 * (1.0 / 120.0 + t2 * (-1.0 / 5040.0 + t2 / 362880.0))))
    c = 1.0 + t2 * (-0.5 + t2 * (1.0 / 24.0 + t2 * (-1.0 / 720.0 + t2 / 40320.0)))
    odd = (quarter == 1.0) | (quarter == 3.0)
    cos_sign = where((quarter == 1.0) | (quarter == 2.0), -1.0, 1.0)
    sin_sign = where((quarter == 2.0) | (quarter == 3.0), -1.0, 1.0)
    return cos_sign * where(odd, s, c), sin_sign * where(odd, c, s)


@partial(jax.jit, static_argnums=0)
def facet_area(kind: Distribution, w: Direction, widths: Widths) -> Scalar:
    """Area of the facets that is seen from `w`, over that of the plane: NoW (1 + Lambda(w)), for any w (Heitz et al. 2016, eq. 4)."""
    x, y, z = widths[0] * w[0], widths[1] * w[1], w[2]
    slope2 = x * x + y * y
    if kind == "ggx":
        root = jnp.sqrt(z * z + slope2)
        # Seen from below, |z| cancels against the root.
        return where(z >= 0.0, 0.5 * (root + z), 0.5 * slope2 / jnp.maximum(root - z, _TINY))
    slope = jnp.sqrt(jnp.maximum(slope2, 1e-20))
    q = z / slope
    return jnp.maximum(0.5 * (slope * jnp.exp(-q * q) * _INV_SQRT_PI + z * jax.lax.erfc(-q)), 0.0)


@partial(jax.jit, static_argnums=0)
def facet_density(kind: Distribution, m: Direction, widths: Widths) -> Scalar:
    """D(m) [1/sr]; 0 for facets that look down."""
    return where(m[2] > 0.0, density(kind, jnp.stack(m), widths), 0.0)


@partial(jax.jit, static_argnums=0)
def sample_facet(kind: Distribution, w: Direction, widths: Widths, u: Scalar, v: Scalar) -> Direction:
    """A facet normal as `w` sees it, of density (w.m)+ D(m) / facet_area(w)."""
    stretched = normalise(widths[0] * w[0], widths[1] * w[1], w[2])
    sample = _sample_ggx if kind == "ggx" else _sample_beckmann
    x, y, z = sample(stretched, u, v)
    return normalise(widths[0] * x, widths[1] * y, z)


def _sample_ggx(w: Direction, u: Scalar, v: Scalar) -> Direction:
    """Facets of a unit GGX surface, through the cap of directions that they reflect to (Dupuy and Benyoub 2023, listing 3)."""
    rim2 = w[0] * w[0] + w[1] * w[1]
    cap = where(w[2] >= 0.0, 1.0 + w[2], rim2 / (1.0 - w[2]))  # 1 + z, whole in its digits from below
    rise = (1.0 - u) * cap
    z = rise - w[2]
    radius = jnp.sqrt(jnp.maximum((1.0 - z) * (1.0 + z), 0.0))
    cos_phi, sin_phi = turn(v)
    return radius * cos_phi + w[0], radius * sin_phi + w[1], rise


def _sample_beckmann(w: Direction, u: Scalar, v: Scalar) -> Direction:
    """Facets of a unit Beckmann surface, by the inverse of the slopes' distribution (Heitz and d'Eon 2014, supplemental)."""
    sine = jnp.sqrt(jnp.maximum(w[0] * w[0] + w[1] * w[1], 1e-14))
    cos_phi, sin_phi = w[0] / sine, w[1] / sine
    # Slopes t towards w are seen up to its own, the cumulative area being (cos (1 + erf t) + sin exp(-t^2) / sqrt(pi)) / 2.
    edge = w[2] / sine
    total = _seen_slopes(edge, w[2], sine)
    high = jnp.minimum(edge, 4.0)

    def newton(_: Any, bracketed: Any) -> Any:
        t, low, high = bracketed
        excess = _seen_slopes(t, w[2], sine) - u * total
        low, high = where(excess < 0.0, t, low), where(excess < 0.0, high, t)
        rate = (w[2] - t * sine) * jnp.exp(-t * t) * _INV_SQRT_PI
        step = t - excess / jnp.maximum(rate, _TINY)
        return where((step > low) & (step < high), step, 0.5 * (low + high)), low, high

    low = jnp.full_like(edge, -4.0)
    first = jnp.minimum(jnp.zeros_like(edge), 0.5 * (low + high))
    t = jax.lax.fori_loop(0, 12, newton, (first, low, high))[
        0
    ]  # to rounding after seven, a bisection where it leaves its bracket
    across = jax.lax.erf_inv(2.0 * v - 1.0)
    return -(t * cos_phi - across * sin_phi), -(t * sin_phi + across * cos_phi), jnp.ones_like(t)


def _seen_slopes(t: Scalar, cosine: Scalar, sine: Scalar) -> Scalar:
    return 0.5 * (cosine * jax.lax.erfc(-t) + sine * jnp.exp(-t * t) * _INV_SQRT_PI)


@jax.jit
def next_height(w: Direction, c: Scalar, area: Scalar, u: Scalar) -> Scalar:
    """Height of the next hit, from height `c` and against `w`; 1 or more where the particle leaves (Heitz et al. 2016, eq. 21)."""
    # Their cases of rays up and down are one: c u^(1 / (1 + Lambda)), with Lambda(-w) = -1 - Lambda(w).
    return c * _power(u, w[2] / jnp.maximum(area, _TINY))


@jax.jit
def leaving(d: Direction, c: Scalar, area_behind: Scalar) -> Scalar:
    """Part of the light at height `c` that leaves along d, d.z > 0; `area_behind` is facet_area(-d)."""
    return _power(jnp.maximum(c, _TINY), area_behind / jnp.maximum(d[2], _TINY))


def _power(x: Scalar, exponent: Scalar) -> Scalar:
    # XLA's own is a call of a library for every lane.
    return jnp.exp(exponent * jnp.log(x))


def opposite(w: Direction) -> Direction:
    return -w[0], -w[1], -w[2]


def mirrored(w: Direction) -> Direction:
    """The same direction in the frame of the other side of the boundary."""
    return w[0], w[1], -w[2]


@jax.jit
def reflect(w: Direction, m: Direction, c: Scalar) -> Direction:
    return 2.0 * c * m[0] - w[0], 2.0 * c * m[1] - w[1], 2.0 * c * m[2] - w[2]


@jax.jit
def refract(w: Direction, m: Direction, c: Scalar, eta: Scalar) -> Direction:
    """Direction of travel behind a facet, in the frame of the other side; `eta` is the index there over the index here."""
    g = jnp.sqrt(jnp.maximum((eta - 1.0) * (eta + 1.0) + c * c, 0.0))
    inverse = 1.0 / eta
    return (
        ((c - g) * m[0] - w[0]) * inverse,
        ((c - g) * m[1] - w[1]) * inverse,
        (w[2] - (c - g) * m[2]) * inverse,
    )


@jax.jit
def reflecting_facet(w: Direction, d: Direction) -> tuple[Direction, Scalar]:
    """The normal that reflects w to d, and the cosine between it and either."""
    h = normalise(w[0] + d[0], w[1] + d[1], w[2] + d[2])
    return h, dot(w, h)


@jax.jit
def refracting_facet(w: Direction, d: Direction, eta: Scalar) -> tuple[Direction, Scalar, Scalar]:
    """The normal that refracts w to d (in the frame of the other side), its cosine with w, and how densely directions lie.

    The last is |dm/dd| = eta^2 |d.h| / (w.h + eta d.h)^2 (Walter et al. 2007, eq. 17), 0 where no facet does it.
    """
    x, y, z = w[0] + eta * d[0], w[1] + eta * d[1], w[2] - eta * d[2]
    length2 = x * x + y * y + z * z + _TINY
    scale = jax.lax.rsqrt(length2)
    scale = where(z < 0.0, -scale, scale)
    h = x * scale, y * scale, z * scale
    c, behind = dot(w, h), -dot(mirrored(d), h)
    jacobian = eta * eta * behind / length2
    return h, c, where((c > 0.0) & (behind > 0.0), jacobian, 0.0)


def fresnel(c: Scalar, eta: Scalar) -> Scalar:
    """Reflectance of a facet."""
    return fresnel_dielectric(jnp.maximum(c, 0.0), eta)
