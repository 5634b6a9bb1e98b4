"""What anisotropy adds to the precise form: widths along the tangent and across it, and a rough top that depends on the azimuth.

A facet that is turned a little moves the light that it sends on in proportion to its slope, along each axis for itself. So widths
add axis by axis, in the light's projections on the surface, and a lobe's squared argument is that of an ellipse. What is of second order in
the slopes (energy, bend, path) adds up from both axes: it is mixed from isotropic tops of either width, by the azimuth of the light.
"""

import jax
import jax.numpy as jnp

from .._chunk import chunk, dot, safe_sqrt
from .._types import Scalar, Vec2, Vec3
from ..optics.microfacet import Width
from .curves import Interface, Nodes, bake
from .tables import Kind

Widths = Scalar | Vec2
"""One width, or along the tangent and across it."""


def widths(width: Width) -> Widths:
    """The same as an array, for formulas that treat each axis for itself."""
    return jnp.stack(width) if isinstance(width, tuple) else width


def even_width(width: Width) -> Scalar:
    """Width on one axis of a surface whose slopes spread as far in all: their squares add."""
    return safe_sqrt(0.5 * (width[0] * width[0] + width[1] * width[1])) if isinstance(width, tuple) else width


def over_axes(values: Widths) -> Scalar:
    """Mean of the axes."""
    return 0.5 * (values[0] + values[1]) if jnp.ndim(values) else values


def area(squares: Widths) -> Scalar:
    """Product of two widths, from their squares."""
    return safe_sqrt(squares[0] * squares[1]) if jnp.ndim(squares) else squares


def stretched(x: jax.Array, squares: Widths) -> Scalar:
    """Squared distance in widths along the surface, from squares of the widths."""
    return x[0] * x[0] / squares[0] + x[1] * x[1] / squares[1] if jnp.ndim(squares) else dot(x, x) / squares


def tops(eta: Scalar, width: Width, kind: Kind) -> tuple[Interface, Interface | None, Nodes]:
    """The rough top as light along the tangent meets it, as light across does where that differs, and what the mean of both does."""
    if not isinstance(width, tuple):
        interface, nodes = bake(eta, width, kind)
        return interface, None, nodes
    (tangent, nodes_x), (across, nodes_y) = (bake(eta, alpha, kind) for alpha in width)
    return tangent, across, jax.tree.map(lambda x, y: 0.5 * (x + y), nodes_x, nodes_y)


def towards(interface: Interface, across: Interface | None, w: Vec3) -> Interface:
    """The rough top as light of the direction w meets it."""
    return interface if across is None else mixed(interface, across, share_along(w))


@chunk
def share_along(w: Vec3) -> Scalar:
    """How much of a rough top's effect on light is by slopes along the tangent: half of it at the normal, all along the tangent."""
    return 0.5 * (1.0 + (w[0] - w[1]) * (w[0] + w[1]))


@chunk
def mixed(tangent: Interface, across: Interface, share: Scalar) -> Interface:
    """The mean of two rough tops, `share` of the first."""
    # Part by part and by name: so it is printed, and mapped over the parts it would print as one line without an end.
    rest = 1.0 - share
    tilt = share * tangent.tilt + rest * across.tilt
    gain = share * tangent.gain + rest * across.gain
    passed = share * tangent.passed + rest * across.passed
    passed_high = share * tangent.passed_high + rest * across.passed_high
    bend = share * tangent.bend + rest * across.bend
    bend_high = share * tangent.bend_high + rest * across.bend_high
    spread = share * tangent.spread + rest * across.spread
    spread_high = share * tangent.spread_high + rest * across.spread_high
    path = share * tangent.path + rest * across.path
    path_high = share * tangent.path_high + rest * across.path_high
    theta = share * tangent.theta + rest * across.theta
    theta_high = share * tangent.theta_high + rest * across.theta_high
    return Interface(tilt, gain, passed, passed_high, bend, bend_high, spread, spread_high, path, path_high, theta, theta_high)
