"""What one rough dielectric interface does to light that passes through it.

Closed forms fitted to a Monte Carlo walk of the GGX interface with multiple scattering, indices 1.2 to 2, widths .05 to 1; exact
at width 0. `NoW` is the cosine just above the interface, `eta` its relative index.
"""

import jax.numpy as jnp

from .._chunk import chunk, safe_divide, safe_power, safe_sqrt
from .._types import Colour, Direction, Scalar
from .directions import along, direction, sine2
from .fresnel import transmittance_dielectric


def facet_tilt(alpha: Scalar) -> Scalar:
    """How far the mean facet turns towards a grazing direction, 0 (smooth) to about .18."""
    return 1.134 * safe_power(alpha, 1.479) / (1.0 + 5.189 * alpha)


def second_facet(alpha: Scalar) -> Scalar:
    """Part of the reflected light that enters after all, through a second facet."""
    a2 = alpha * alpha
    return 4.005 * a2 / (1.0 + 9.06 * a2)


def spread_lengthening(eta: Scalar, alpha: Scalar) -> Scalar:
    """Path through the medium, in thicknesses, that the spread of refracted directions adds."""
    a2 = alpha * alpha
    return 0.77 * (1.0 - 1.0 / eta) * a2 / (1.0 + 0.97 * a2)


def drift_scale(eta: Scalar, alpha: Scalar) -> Scalar:
    """Scale of `drift`."""
    return 41.0 * (eta - 1.0) / (eta - 1.0 + 0.07) * safe_power(alpha, 1.76)


@chunk
def facet_cosine(w: Direction, tilt: Scalar) -> Scalar:
    """Cosine between a direction and the facets that it meets."""
    return safe_sqrt(tilt + (1.0 - tilt) * (w[-1] * w[-1]))


@chunk
def with_second_facet(T: Colour, gain: Scalar) -> Colour:
    """Energy that passes a rough interface, from what passes the mean facet; `gain` is `second_facet`."""
    return T + (1.0 - T) * gain


def rough_transmittance(c: Scalar, eta: Scalar, gain: Scalar) -> Colour:
    """Energy that passes a rough interface of exact reflectance, from the facet cosine."""
    return with_second_facet(transmittance_dielectric(c, eta), gain)


@chunk
def drift(w: Direction, scale: Scalar, alpha: Scalar) -> Scalar:
    """Path added near grazing angles, where the facets that face the light take most of it."""
    one_minus = 1.0 - w[-1]
    # (1 - NoW)^3.16 exp(-7 alpha (1 - NoW)), by one exponential.
    return scale * jnp.exp(3.16 * jnp.log(jnp.maximum(one_minus, 1e-30)) - 7.0 * alpha * one_minus)


@chunk
def slope_spread(c: Scalar, eta: Scalar) -> Scalar:
    """Width of the refracted directions over the width of the facets, to first order in slope."""
    # |1 - c / (eta c')| / 2 with eta c' = g, without the cancellation at eta -> 1.
    delta = (eta - 1.0) * (eta + 1.0)
    g = safe_sqrt(delta + c * c)
    return safe_divide(0.5 * jnp.abs(delta), g * (g + c))


@chunk
def steer(w: Direction, lengthening: Scalar) -> Direction:
    """Turn a direction, azimuth kept, until its path 1 / w.z is longer by `lengthening`."""
    z = safe_divide(w[-1], 1.0 + lengthening * w[-1])
    # The squared sine grows by w.z^2 - z^2 = lengthening z w.z (w.z + z): written so, nothing cancels at the normal.
    growth = safe_divide(lengthening * z * w[-1] * (w[-1] + z), sine2(w))
    ratio = safe_sqrt(1.0 + growth)
    return direction(along(w) * ratio, z)
