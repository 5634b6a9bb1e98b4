"""How a layer grows over a surface in time: where it has begun, and how thick it is there.

A field g in (0, 1) over the surface (`noise.fbm`) says which places are early: a place is covered once the coverage theta of the whole has
come up to its g. Times are in one unit, years where they are a layer's; only their ratios to the onset `t0` are seen.
"""

import jax.numpy as jnp

from .._chunk import chunk, clip, safe_divide, safe_sqrt, where
from .._types import Scalar

COVERED = 7.0
"""Logarithm of the power of time from which on nothing is left to cover: exp(-exp(7)) is 0 in every precision. The power itself would
overflow, and its derivative not be a number."""


def softplus(x: Scalar) -> Scalar:
    """log(1 + exp(x)) without overflow."""
    return jnp.maximum(x, 0.0) + jnp.log1p(jnp.exp(-jnp.abs(x)))


@chunk
def exposed_part(sky: Scalar, exposure: Scalar) -> Scalar:
    """Part of the age that a place feels which sees so much of the sky: from 1 in the open to 1 - exposure."""
    return 1.0 - exposure * (1.0 - sky)


@chunk
def coverage(t: Scalar, t0: Scalar, p: Scalar) -> Scalar:
    """Threshold theta in [0, 1) at the time t: growth from random nuclei (Avrami 1939), 1 - 1/e at the onset t0."""
    # At 0 a power below 1 has no derivative.
    logarithm = p * jnp.log(jnp.maximum(t / t0, 1e-30))
    return -jnp.expm1(-jnp.exp(jnp.minimum(logarithm, COVERED)))


@chunk
def grown(theta: Scalar, g: Scalar) -> Scalar:
    """1 where the layer has begun, 0 elsewhere."""
    return where(theta > g, 1.0, 0.0).astype(g.dtype)


@chunk
def partly_grown(theta: Scalar, g: Scalar, softness: Scalar) -> Scalar:
    """Part of a place that is covered, with a soft edge; `grown` in the limit of softness 0 (range 1e-3 and more)."""
    # Beyond 80 the exponential would overflow, and nothing is left to see.
    return 1.0 / (1.0 + jnp.exp(jnp.minimum((g - theta) / softness, 80.0)))


@chunk
def onset(g: Scalar, t0: Scalar, p: Scalar) -> Scalar:
    """When a place is reached: the inverse of `coverage`."""
    # The field never reaches 0 or 1 but by rounding, where the logarithm would be infinite.
    tiny = float(jnp.finfo(g.dtype).epsneg)
    begun = -jnp.log1p(-clip(g, tiny, 1.0 - tiny))
    return t0 * jnp.exp(jnp.log(begun) / p)


@chunk
def tarnish_thickness(t: Scalar, t_on: Scalar, rate: Scalar, blur: Scalar) -> Scalar:
    """Thickness of a layer that slows its own growth (parabolic law, Tammann 1920; Wagner 1933): rate sqrt(t - t_on) after the onset.

    `rate` is per root of time, `blur` the time over which growth sets in: the plain law has an infinite slope there.
    """
    return rate * safe_sqrt(blur * softplus(safe_divide(t - t_on, blur)))
