"""One rough interface on the way of light: how much it passes, where to, and how far the light then goes.

Fits to the walk, for light that comes from the rarer side; into a rarer medium it passes as through a smooth interface.
"""

import jax.numpy as jnp

from .._chunk import chunk, member, safe_sqrt, struct, where
from .._types import Colour, Direction, Scalar
from ..layers import Coat
from ..optics.interface import (
    drift,
    drift_scale,
    facet_cosine,
    facet_tilt,
    second_facet,
    slope_spread,
    spread_lengthening,
    with_second_facet,
)
from ..optics.medium import cosine_below, refract_about_normal
from ..optics.microfacet import Width


@struct
class Interface:
    """What a coat's rough top does to light that passes."""

    n: Scalar = member("index of the medium below, against air")
    alpha: Scalar = member("width of the facets, mean of the axes")
    tilt: Scalar = member("turn of the mean facet towards a grazing direction")
    gain: Scalar = member("part of the reflected light that a second facet lets in")
    lengthening: Scalar = member("path added by the spread of refracted directions, in thicknesses")
    drift: Scalar = member("scale of the path added at grazing angles")


def mean_width(width: Width) -> Scalar:
    """One width for both axes."""
    return safe_sqrt(width[0] * width[1]) if isinstance(width, tuple) else width


def interface_of(coat: Coat, n: Scalar, rough: bool) -> Interface:
    """The top of a coat with its relative index; `n` is its absolute one. One that is not `rough` passes light as a smooth one."""
    alpha = jnp.minimum(mean_width(coat.width), 1.0)
    if not rough:
        alpha = jnp.zeros_like(alpha)
    # Where light leaves a denser medium for the base the fits do not hold: the interface is smooth there.
    enters = coat.eta >= 1.0
    eta = where(coat.eta < 1.0, 1.0, coat.eta)  # not max: at 1 its derivative is half of either side's
    return Interface(
        n=n,
        alpha=alpha,
        tilt=facet_tilt(alpha),
        gain=where(enters, second_facet(alpha), 0.0),
        lengthening=spread_lengthening(eta, alpha),
        drift=drift_scale(eta, alpha),
    )


@struct
class Crossing:
    """One direction on its way through one rough interface."""

    w: Direction = member("direction in the medium below")
    T: Colour = member("energy that passes")
    spread: Scalar = member("width of the refracted directions over that of the facets")
    lengthening: Scalar = member("path beyond that of the refracted direction, in thicknesses")
    drift: Scalar = member("the part of it due to grazing incidence")


@chunk
def cross(interface: Interface, coat: Coat, w: Direction, air: Direction) -> Crossing:
    """Follow one direction through the rough top of a coat with its relative index; `air` is the direction above all of them."""
    c = facet_cosine(w, interface.tilt)
    # Out of a denser medium the fits do not hold for the energy: there the interface passes light as a smooth one.
    rarer = where(coat.eta >= 1.0, c, cosine_below(air[-1], interface.n))
    T = with_second_facet(coat.passes(rarer), interface.gain)
    grazing = drift(w, interface.drift, interface.alpha)
    # From air at once, not from layer to layer: going back to index 1 gives the same direction to the last bit.
    below = refract_about_normal(air, interface.n)
    return Crossing(below, T, slope_spread(c, coat.eta), interface.lengthening + grazing, grazing)
