"""Light through a medium: refraction into it and absorption along the way.

A refracted direction is reported pointing UP, away from what lies below, so that the layer below is evaluated by the same code.
"""

import jax.numpy as jnp

from .._chunk import chunk, safe_sqrt
from .._types import Colour, Direction, Scalar
from .directions import along, direction


@chunk
def refract_about_normal(w: Direction, eta: Scalar) -> Direction:
    """Direction below a boundary of relative index `eta` (Snell's law); its z is 0 under total internal reflection."""
    # (eta^2 - 1 + z^2) / eta^2 is 1 - (1 - z^2) / eta^2 without the cancellation at grazing angles.
    z2 = (eta - 1.0) * (eta + 1.0) + w[-1] * w[-1]
    inverse = 1.0 / eta
    return direction(along(w), safe_sqrt(z2)) * inverse


@chunk
def cosine_below(c: Scalar, eta: Scalar) -> Scalar:
    """Cosine below a boundary of relative index `eta` (Snell's law); 0 under total internal reflection."""
    return safe_sqrt((eta - 1.0) * (eta + 1.0) + c * c) * (1.0 / eta)


@chunk
def refract_about_facet(w: Direction, h: Direction, c: Scalar, c_below: Scalar, eta: Scalar) -> Direction:
    """Direction below a facet with normal `h`, c = w.h (Elek 2010 after Weidlich and Wilkie 2007); z may be <= 0."""
    inverse = 1.0 / eta
    turn = c_below - c * inverse
    return w * inverse + turn * h


@chunk
def transmittance(tau: Colour, path: Scalar) -> Colour:
    """Bouguer, Lambert and Beer: what remains after `path` times the optical depth at normal incidence."""
    return jnp.exp(-tau * path)
