"""A short Fresnel formula for metals, fitted to each: Schlick's plus a correction (Lazanyi and Szirmay-Kalos 2005).

F = f0 + (1 - f0) (1 - c)^5 - a c (1 - c)^alpha. The two constants are no material constants that one could look up: they
are fitted here to the exact reflectance, per metal and channel, once a material.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, clip, struct, where
from .._types import Colour, Number, Scalar
from .fresnel import conductor_f0, fresnel_conductor, fresnel_schlick

ANGLES = 256
STEPS = 3
"""Of the Gauss-Newton method, after which the constants stand still."""

NEGLIGIBLE = 1e-3
"""Schlick's error below which it is left as it is."""


@struct
class Lazanyi:
    """The constants of the correction, a number or one a channel."""

    a: Colour
    alpha: Colour
    error: Colour
    """Largest difference to the exact reflectance, over all angles."""


@chunk
def fresnel_lazanyi(c: Scalar, f0: Colour, a: Colour, alpha: Colour) -> Colour:
    """Lazanyi and Szirmay-Kalos 2005: Schlick's reflectance less a c (1 - c)^alpha. It may leave [0, 1] by its error."""
    # 1 - c is kept above 0, whose power has no derivative in alpha; c near 1 takes the term to 0 alike.
    return fresnel_schlick(c, f0) - a * c * jnp.power(jnp.maximum(1.0 - c, 1e-30), alpha)


def fit_lazanyi(eta: Number, k: Number) -> Lazanyi:
    """Fit the correction for a relative index eta + i k, a number or (3,), and say how good it is.

    Least squares over 256 angles, uniform from the normal to grazing. The start is at the largest residual, where the correction
    peaks at c = 1 / (1 + alpha). `layerfit.fit_lazanyi(eta=0.2, k=3.9).error` is the largest error of reflectance.
    """
    eta, k = jnp.broadcast_arrays(jnp.asarray(eta), jnp.asarray(k))
    eta, k = (x.astype(jnp.result_type(eta, k, jnp.float32)) for x in (eta, k))
    dtype = eta.dtype
    # Rounded to float32 in every precision: beside the edge of total reflection another cosine is another reflectance.
    c = jnp.asarray(np.cos(np.arange(ANGLES) * (0.5 * np.pi / ANGLES)).astype(np.float32), dtype)
    f0 = conductor_f0(eta, k)
    exact = jax.vmap(lambda c: fresnel_conductor(c, eta, k))(c)
    residual = jax.vmap(lambda c: fresnel_schlick(c, f0))(c) - exact
    column = c.reshape(-1, *(1,) * eta.ndim)
    a, log_alpha = _start(c, residual)
    for _ in range(STEPS):
        a, log_alpha = _step(column, residual, a, log_alpha)
    alpha = jnp.exp(log_alpha)

    def error(a: Any) -> Any:
        return jnp.max(jnp.abs(jax.vmap(lambda c: fresnel_lazanyi(c, f0, a, alpha))(c) - exact), 0)

    plain = error(jnp.zeros_like(a))
    corrected = error(a)
    # Where the correction has the wrong shape for the residual, as for weak absorbers, Schlick's formula is left as it is.
    helps = (plain >= NEGLIGIBLE) & (corrected < plain)
    return Lazanyi(where(helps, a, 0.0), alpha, where(helps, corrected, plain))


def _start(c: Any, residual: Any) -> tuple[Colour, Colour]:
    """Amplitude and log exponent of a correction that has the peak of the residual."""
    at = jnp.argmax(jnp.abs(residual), 0)
    peak = jnp.take_along_axis(residual, at[None], 0)[0]
    place = clip(c[at], 0.02, 0.9)
    alpha = 1.0 / place - 1.0
    return peak / (place * (1.0 - place) ** alpha), jnp.log(alpha)


def _step(c: Any, residual: Any, a: Colour, log_alpha: Colour) -> tuple[Colour, Colour]:
    """One step of Gauss and Newton, held to a factor of e in the exponent."""
    alpha = jnp.exp(log_alpha)
    one_minus = jnp.maximum(1.0 - c, 1e-12)
    by_a = c * one_minus**alpha
    by_alpha = a * by_a * alpha * jnp.log(one_minus)
    left = residual - a * by_a
    aa, ab, bb = (jnp.sum(x, 0) for x in (by_a * by_a, by_a * by_alpha, by_alpha * by_alpha))
    ra, rb = jnp.sum(by_a * left, 0), jnp.sum(by_alpha * left, 0)
    determinant = aa * bb - ab * ab
    solved = determinant > 1e-6 * aa * bb
    safe = where(solved, determinant, 1.0)
    da = where(solved, (ra * bb - rb * ab) / safe, 0.0)
    db = where(solved, (rb * aa - ra * ab) / safe, 0.0)
    return a + da, clip(log_alpha + clip(db, -1.0, 1.0), -2.0, 4.0)
