"""Light in a medium that scatters: Kubelka-Munk's two fluxes, and single scattering after Hanrahan and Krueger.

Depths have no unit: `Kx` and `Sx` are Kubelka and Munk's coefficients times the thickness, `tau` is the optical depth of absorption
and scattering together, one way at normal incidence, and `albedo` the part of it that scatters. Each is a number or one a channel.
"""

import math

import jax.numpy as jnp

from .._chunk import chunk, member, safe_divide, safe_sqrt, struct, where
from .._types import Colour, Number, Scalar

_GRAZING = 1e-8
"""No cosine is taken to be smaller: its reciprocal is the length of a path."""


@struct
class TwoFlux:
    """What a layer does to diffuse light; from below the same as from above."""

    R: Colour = member("part that it sends back")
    T: Colour = member("part that it lets through")


@chunk
def kubelka_munk(Kx: Colour, Sx: Colour) -> TwoFlux:
    """A layer that absorbs (Kx >= 0) and scatters (Sx >= 0) diffuse light, over nothing (Kubelka 1948)."""
    # With z^2 = K (K + 2 S) x^2 in place of Kubelka's b S x nothing is divided by S, and series in z^2 keep the derivatives at K = 0.
    z2 = Kx * (Kx + 2.0 * Sx)
    thin = z2 < 0.1
    z = jnp.sqrt(where(thin, 1.0, z2))
    fall = where(thin, 1.0, jnp.exp(-z))  # sinh and cosh of a thick layer are kept divided by exp(z), which overflows
    sinh_z2 = 1.0 + z2 / 6.0 * (1.0 + z2 / 20.0 * (1.0 + z2 / 42.0 * (1.0 + z2 / 72.0 * (1.0 + z2 / 110.0))))
    cosh_z2 = 1.0 + z2 / 2.0 * (1.0 + z2 / 12.0 * (1.0 + z2 / 30.0 * (1.0 + z2 / 56.0 * (1.0 + z2 / 90.0))))
    sinh_z = where(thin, sinh_z2, 0.5 * (1.0 - fall * fall) / z)
    cosh_z = where(thin, cosh_z2, 0.5 * (1.0 + fall * fall))
    whole = (Kx + Sx) * sinh_z + cosh_z
    return TwoFlux(Sx * sinh_z / whole, fall / whole)


@chunk
def kubelka_munk_over(layer: TwoFlux, substrate: Colour) -> Colour:
    """Albedo of a layer over a substrate of a given albedo (Kubelka 1948)."""
    return layer.R + layer.T * layer.T * substrate / jnp.maximum(1.0 - layer.R * substrate, 1e-6)


@chunk
def kubelka_munk_infinite(K: Colour, S: Colour) -> Colour:
    """Albedo of a layer that hides what is below (Kubelka and Munk 1931); it depends on K / S alone, in any unit."""
    return safe_divide(S, K + S + safe_sqrt(K * (K + 2.0 * S)))


@chunk
def stacked(upper: TwoFlux, lower: TwoFlux) -> TwoFlux:
    """Two layers as one, seen from above (Kubelka 1954); `T` is the same from below, `R` is not unless the layers are alike."""
    series = 1.0 / jnp.maximum(1.0 - upper.R * lower.R, 1e-6)
    return TwoFlux(upper.R + upper.T * upper.T * lower.R * series, upper.T * lower.T * series)


@chunk
def saunderson(R: Colour, k1: Colour, k2: Colour) -> Colour:
    """Albedo of a diffuse layer below a boundary that reflects k1 of the light from outside and k2 of that from inside.

    Saunderson 1942. Over diffuse light; a coat of a `Stack` has the same series for every direction.
    """
    return k1 + (1.0 - k1) * (1.0 - k2) * R / jnp.maximum(1.0 - k2 * R, 1e-6)


@chunk
def henyey_greenstein(deflection: Scalar, g: Scalar) -> Scalar:
    """Phase function [1/sr] of mean cosine g (Henyey and Greenstein 1941, eq. 2); `deflection` is 1 - cos of the turn, 0 to 2."""
    # 1 + g^2 - 2 g cos as a sum of two positive terms: near its peak, g -> 1 forwards or -1 backwards, the plain form cancels.
    a = where(g < 0.0, -g, g)  # not abs, which has no derivative at 0: this has that from above, which is that of the whole
    spread = (1.0 - a) * (1.0 - a) + 2.0 * a * where(g < 0.0, 2.0 - deflection, deflection)
    return (1.0 - a) * (1.0 + a) / (4.0 * math.pi * (spread * jnp.sqrt(spread)))


@chunk
def scattered_back(phase: Number, albedo: Colour, tau: Colour, cos_i: Scalar, cos_o: Scalar) -> Colour:
    """BRDF [1/sr] of light that a slab scatters once, and back, without a boundary (Hanrahan and Krueger 1993)."""
    return once_back(phase, albedo * tau, tau, 1.0 / jnp.maximum(cos_i, _GRAZING), 1.0 / jnp.maximum(cos_o, _GRAZING))


@chunk
def scattered_through(phase: Scalar, albedo: Colour, tau: Colour, cos_i: Scalar, cos_t: Scalar) -> Colour:
    """BTDF [1/sr] of light that a slab scatters once, and on to the other side, without a boundary (Hanrahan and Krueger 1993)."""
    return once_through(phase, albedo * tau, tau, 1.0 / jnp.maximum(cos_i, _GRAZING), 1.0 / jnp.maximum(cos_t, _GRAZING))


@chunk
def once_back(phase: Scalar, tau_s: Colour, tau: Colour, path_i: Scalar, path_o: Scalar) -> Colour:
    """The same by the depth of scattering within `tau`, and paths in thicknesses: 1 / cos, or longer below a rough boundary."""
    return tau_s * (phase * path_i * path_o) * mean_transmittance(tau * (path_i + path_o))


@chunk
def once_through(phase: Scalar, tau_s: Colour, tau: Colour, path_i: Scalar, path_t: Scalar) -> Colour:
    """The same for light that goes on to the other side."""
    # (exp(-a) - exp(-b)) / (b - a), the shorter way taken out: it neither cancels at a = b nor overflows.
    a, b = tau * path_i, tau * path_t
    return tau_s * (phase * path_i * path_t) * jnp.exp(-jnp.minimum(a, b)) * mean_transmittance(jnp.abs(b - a))


@chunk
def mean_transmittance(x: Colour) -> Colour:
    """(1 - exp(-x)) / x for x >= 0: mean of exp(-x t) over t in [0, 1]."""
    thin = x < 1e-2
    safe = where(thin, 1.0, x)
    return where(thin, 1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0))), -jnp.expm1(-safe) / safe)


def unscattered(tau: Colour, cosine: Scalar) -> Colour:
    """Part of the light that crosses a slab without being scattered or absorbed."""
    return jnp.exp(-tau / jnp.maximum(cosine, _GRAZING))
