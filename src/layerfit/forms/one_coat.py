"""One coat over a diffuse or a metal base, in the precise form.

What the coat's rough top does to light is not computed but read, from tables that the random walk made (`tables`): the energy that
passes, the median direction of the refracted light, its spread, and the distribution of its path. Each is a function of one cosine;
`prepare` looks the material up and bakes the functions as polynomials, so that evaluation, in JAX and in the shader, is closed form.
The base then answers with a lobe for light that met it once; light that met it more often is summed by `bounces`. Reciprocal by
construction: light that comes and light that leaves are treated alike. Widths may differ by axis (`axes`).

The constants below were fitted to the random walk, on grids of random materials.
"""

import dataclasses
from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, clip, dot, member, struct
from .._types import Colour, Direction, Scalar
from ..layers import Coat
from ..optics.directions import along, direction, product, sine2
from ..optics.interface import facet_cosine, rough_transmittance
from ..optics.microfacet import Width, visibility
from .axes import Widths, area, even_width, over_axes, stretched, tops, towards, widths
from .bounces import Curve, amount, bounces, wider
from .curves import Interface, blurred2, curve, depth, diffuse_return, grazing, presence, spread_root
from .tables import Kind

HELD = ("interface", "again", "rest", "across")
"""Parts of a prepared material that a shader holds as constants, also where its other numbers can be set."""

CONDENSE = 0.8241
"""Share of the tilt of the facets that the base does not ask for, which the two crossings take."""
RISE = 0.3861
"""Growth of the first lobe with the coat's roughness."""
RATIO, TAIL = 0.3431, 0.8294
"""How a lobe that was widened differs from GGX: less peaked, with a longer tail."""
BECKMANN = 0.6
"""Width of the GGX facets that treat light which crosses as Beckmann facets of width 1 do: their slopes are less spread."""
LEAST_Z2 = 4e-4
"""Squared cosine below which no light is turned."""
DIRECT = 0.7911
"""Part of the path's spread that counts, over the base's share of the lobe's width."""


@struct
class Prepared:
    """Coat and base with relative indices, the baked interface, and what goes to and fro below it."""

    coat: Coat
    interface: Interface
    base: Any
    returned: Colour | None
    """Part of diffuse light that returns from the coat, for a diffuse base."""
    again: Curve | None
    """Of a metal: weight of the wider lobe of light that met it twice, as a factor of light and of view."""
    rest: Curve | None
    """Of a metal: fourth root of the light that is left."""
    across: Interface | None = None
    """Of an anisotropic coat: `interface` is for light along the tangent, this for light across it."""


@struct
class Crossing:
    """One direction below the interface."""

    w: Direction = member("median direction")
    T: Scalar = member("energy that passes")
    a: Widths = member("spread, as a width")
    path: Scalar = member("mean path, in thicknesses")
    theta: Scalar = member("scale of the path's distribution")
    s: Scalar = member("argument of the baked curves")
    air: Direction = member("direction above")


@struct
class Shares:
    """Parts of a lobe's width, which add up to 1."""

    base: Widths = member("due to the base")
    i: Widths = member("due to one crossing")
    o: Widths = member("due to the other")


def prepare(coat: Coat, base: Any, kind: Kind) -> Prepared:
    """Look up what the interface does and bake it."""
    width = crossed(coat)
    interface, across, nodes = tops(coat.eta, width, kind)
    coat = coat.below(jnp.ones_like(coat.eta))
    base = base.below(coat.eta)
    if base.lobes:
        even_base = dataclasses.replace(base, alpha=even_width(base.width), alpha_x=None, alpha_y=None)
        again, rest = bounces(nodes, even_width(width), coat, even_base)
        return Prepared(coat, interface, base, None, again, rest, across)
    return Prepared(coat, interface, base, diffuse_return(nodes, coat.tau), None, None, across)


def crossed(coat: Coat) -> Width:
    """Width of the GGX facets that light which crosses the coat meets."""
    if coat.distribution == "ggx":
        return coat.width
    if isinstance(coat.width, tuple):
        return BECKMANN * coat.width[0], BECKMANN * coat.width[1]
    return BECKMANN * coat.width


def cross(prepared: Prepared, w: Direction) -> Crossing:
    """Follow one direction into the coat."""
    interface = towards(prepared.interface, prepared.across, w)
    return pass_interface(interface, prepared.coat.eta, widths(crossed(prepared.coat)), w)


def evaluate(prepared: Prepared, wi: Direction, wo: Direction) -> Colour:
    """BRDF [1/sr] of unit directions above the surface."""
    i, o = (cross(prepared, w) for w in (wi, wo))
    return prepared.coat.evaluate(wi, wo) + below(i, o, prepared)


def below(i: Crossing, o: Crossing, prepared: Prepared) -> Colour:
    """Light from below the coat [1/sr]."""
    coat, base, tau = prepared.coat, prepared.base, prepared.coat.tau
    throughput = i.T * o.T / (coat.eta * coat.eta)
    if not base.lobes:
        if tau is not None:
            once = depth(i.path, spread_root(i.theta, tau), tau)
            throughput = throughput * jnp.exp(-(once + depth(o.path, spread_root(o.theta, tau), tau)))
        return throughput * base.evaluate(i.w, o.w) / jnp.maximum(1.0 - base.albedo * prepared.returned, 1e-6)
    alpha = crossed(coat)
    top, own = widths(alpha), widths(base.width)
    # Where the indices match there is no interface, and nothing of what it does.
    there = presence(coat.eta)
    shares = split(i, o, own)
    share = over_axes(shares.base)
    part = DIRECT * share
    yi, yo = lean(i, i, o, there * shares.i), lean(o, i, o, there * shares.o)
    path_i, path_o = between(yi, i, part), between(yo, o, part)
    if tau is None:
        U: Any = path_i * path_o
    else:
        root_i, root_o = spread_root(part * i.theta, tau), spread_root(part * o.theta, tau)
        U = (1.0 + (path_i - 1.0) / root_i) * (1.0 + (path_o - 1.0) / root_o)
        throughput = throughput * jnp.exp(-(depth(path_i, root_i, tau) + depth(path_o, root_o, tau)))
    h = yi + yo
    h2 = product(h, h)
    F = base.reflectance(jnp.minimum(0.5 * jnp.sqrt(h2), 1.0))
    even = even_width(alpha)
    rise = 1.0 + RISE * there * even * even * share
    wide, left = prepared.again, prepared.rest
    assert wide is not None
    assert left is not None
    again = F * (amount(wide, i.s) * amount(wide, o.s))
    lobes = rise * lobe(i, o, h[-1], own) + again * lobe(i, o, h[-1], wider(own, top))
    root = amount(left, i.s) * amount(left, o.s)
    rest = root * root * ahead(i, o, even_width(base.width))
    return throughput * (F * U * (seen(yi, yo, h2, own) * lobes) + rest)


@chunk
def ahead(i: Crossing, o: Crossing, alpha: Scalar) -> Scalar:
    """What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base."""
    # 1 - sin sin cos(phi), by the difference of both directions: the product itself has no digits of what is left where light goes back.
    apart = along(i.air) - along(o.air)
    back = 0.5 * (dot(apart, apart) + i.air[-1] * i.air[-1] + o.air[-1] * o.air[-1])
    own = jnp.minimum(alpha, 1.0)
    return (own + (1.0 - own) * back) / jnp.pi


@chunk
def pass_interface(interface: Interface, eta: Scalar, alpha: Widths, w: Direction) -> Crossing:
    """Follow one direction through the coat's rough top."""
    s = grazing(w[-1])
    T = rough_transmittance(facet_cosine(w, interface.tilt), eta, interface.gain)
    T = clip(T + curve(interface.passed, interface.passed_high, s), 0.0, 1.0)
    # What a denser medium refracts does not graze more than before. The cosine keeps its digits there, also where the indices match.
    bend = jnp.maximum(curve(interface.bend, interface.bend_high, s), 0.0)
    z = jnp.sqrt(w[-1] * w[-1] + bend * (2.0 - bend) * sine2(w))
    a = jnp.maximum(curve(interface.spread, interface.spread_high, s), 0.0) * alpha
    path = jnp.maximum(curve(interface.path, interface.path_high, s), 1.0) / z
    theta = jnp.maximum(curve(interface.theta, interface.theta_high, s), 0.0)
    return Crossing(direction(along(w) * (1.0 - bend), z), T, a, path, theta, s, w)


@chunk
def between(y: Direction, x: Crossing, part: Scalar) -> Scalar:
    """Mean path of light that the base sends on: between that of one direction and that of all that cross."""
    straight = 1.0 / y[-1]
    return straight + part * (x.path - straight)


@chunk
def split(i: Crossing, o: Crossing, alpha: Widths) -> Shares:
    """What the width of a lobe is due to."""
    base = alpha * (i.w[-1] + o.w[-1])
    inverse = 1.0 / (base + i.a + o.a)
    return Shares(base * inverse, i.a * inverse, o.a * inverse)


@chunk
def lean(x: Crossing, i: Crossing, o: Crossing, share: Widths) -> Direction:
    """The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone."""
    turn = CONDENSE * share * (along(i.w) + along(o.w))
    z2 = x.w[-1] * x.w[-1]
    # Grazing light is turned no further than to the last degree, unless it is there already.
    z2 = jnp.maximum(z2 + dot(turn, 2.0 * along(x.w) - turn), jnp.minimum(z2, LEAST_Z2))
    return direction(along(x.w) - turn, jnp.sqrt(z2))


@chunk
def lobe(i: Crossing, o: Crossing, M: Scalar, alpha: Widths) -> Scalar:
    """Density of a lobe about the refracted directions, of a base of width alpha seen through the interface twice; M is the sum of the cosines.

    Without an interface it is D of GGX over the square of M.
    """
    base = alpha * M
    width2 = blurred2(base, i.a + o.a)
    size = area(width2)
    x = RATIO * (size / area(base * base + TAIL * (i.a * i.a + o.a * o.a)) - 1.0)
    v = stretched(along(i.w) + along(o.w), width2)
    return 1.0 / (jnp.pi * size * (1.0 + v * (middle(x) + (1.0 + x) * v)))


def middle(x: Any) -> Any:
    """b such that the lobe 1 / (1 + b v + (1 + x) v^2) sends back as much as GGX, whose x is 0: within 2e-3 up to x = 1.3."""
    return 2.0 - x * (1.986 - x * (0.668 - 0.1745 * x))


@chunk
def seen(yi: Direction, yo: Direction, h2: Scalar, width: Widths) -> Scalar:
    """Part of a density of facets that is seen and hides nothing, without the projected areas; h2 is the square of the sum of both directions."""
    M = yi[-1] + yo[-1]
    slope = h2 / M
    axes = (width[0], width[1]) if jnp.ndim(width) else width
    return slope * slope * (yi[-1] * yo[-1]) * visibility("smith", "ggx", yi, yo, axes)
