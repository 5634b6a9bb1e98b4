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

from .._chunk import chunk, clip, dot, member, safe_power, safe_sqrt, struct
from .._types import Colour, Direction, Number, Scalar
from ..layers import Coat
from ..optics.directions import along, direction, sine2
from ..optics.interface import facet_cosine, rough_transmittance
from ..optics.microfacet import Width, ggx_lambda, half_cosine
from .axes import Widths, area, even_width, over_axes, stretched, tops, towards, widths
from .bounces import Curve, amount, bounces, wider
from .curves import Interface, P, absorbed, curve, diffuse_return, grazing, presence
from .tables import Kind

HELD = ("interface", "again", "rest", "across")
"""Parts of a prepared material that a shader holds as constants, also where its other numbers can be set."""

CONDENSE = 0.7504
"""Share of the tilt of the facets that the base does not ask for, which the two crossings take."""
RISE = 0.3036
"""Growth of the first lobe with the coat's roughness."""
RATIO, TAIL = 0.3271, 0.5566
"""How a lobe that was widened differs from GGX: less peaked, with a longer tail."""
BECKMANN = 0.6
"""Width of the GGX facets that treat light which crosses as Beckmann facets of width 1 do: their slopes are less spread."""
DIRECT = (0.3296, 0.3522, 1.803)
"""Part of the path's spread that counts for absorption, by the share of the base in the lobe's width: d + c w^e."""
DIRECT_PATH = (0.3096, 0.2662, 1.772)
"""The same for the projected area."""


@struct
class Prepared:
    """Coat and base with relative indices, the baked interface, and what goes to and fro below it."""

    coat: Coat
    interface: Interface
    base: Any
    returned: Colour | None
    """Part of diffuse light that returns from the coat, for a diffuse base."""
    again: Curve | None
    """Of a metal: weight of the wider lobe of light that met it twice."""
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
    coat, base = prepared.coat, prepared.base
    throughput = i.T * o.T / (coat.eta * coat.eta)
    if not base.lobes:
        A = 1.0 if coat.tau is None else absorbed(i.path, i.theta, coat.tau) * absorbed(o.path, o.theta, coat.tau)
        return throughput * A * base.evaluate(i.w, o.w) / jnp.maximum(1.0 - base.albedo * prepared.returned, 1e-6)
    alpha = crossed(coat)
    top, own = widths(alpha), widths(base.width)
    share = base_share(i, o, own)
    yi, yo = lean(i, i, o, own), lean(o, i, o, own)
    A: Any = 1.0
    U: Any = 1.0
    for y, x in ((yi, i), (yo, o)):
        if coat.tau is not None:
            part = direct(share, *DIRECT)
            A = A * absorbed(between(y, x, part), part * x.theta, coat.tau)
        part = direct(share, *DIRECT_PATH)
        path = between(y, x, part)
        U = U * (path if coat.tau is None else projected(path, part * x.theta, coat.tau))
    F = base.reflectance(half_cosine(yi, yo))
    # Where the indices match there is no interface, and nothing of what it does.
    even = even_width(alpha)
    rise = 1.0 + RISE * presence(coat.eta) * even * even * share
    lobes: Any = rise * lobe(i, o, yi, yo, own, own)
    if prepared.again is None or prepared.rest is None:
        return throughput * F * A * U * lobes
    again = 0.5 * F * (amount(prepared.again, i.s) + amount(prepared.again, o.s))
    lobes = lobes + again * lobe(i, o, yi, yo, wider(own, top), own)
    root = amount(prepared.rest, i.s) * amount(prepared.rest, o.s)
    rest = root * root * ahead(i, o, coat.eta, even_width(base.width))
    return throughput * A * (F * U * lobes + rest)


@chunk
def ahead(i: Crossing, o: Crossing, eta: Scalar, alpha: Scalar) -> Scalar:
    """What is left of the direction in light that went to and fro, over pi: more goes on than back, the smoother the base."""
    back = eta * eta * dot(along(i.w), along(o.w))
    return jnp.maximum(1.0 - (1.0 - jnp.minimum(alpha, 1.0)) * back, 0.0) / jnp.pi


@chunk
def pass_interface(interface: Interface, eta: Scalar, alpha: Widths, w: Direction) -> Crossing:
    """Follow one direction through the coat's rough top."""
    s = grazing(w[-1])
    T = rough_transmittance(facet_cosine(w, interface.tilt), eta, interface.gain)
    T = clip(T + curve(interface.passed, interface.passed_high, s), 0.0, 1.0)
    bend = curve(interface.bend, interface.bend_high, s) / eta
    sine = safe_sqrt(sine2(w))
    bend = jnp.minimum(bend, 0.9998 / jnp.maximum(sine, 1e-6))
    sine = sine * bend
    z = safe_sqrt((1.0 - sine) * (1.0 + sine))
    a = jnp.maximum(curve(interface.spread, interface.spread_high, s), 0.0) * alpha
    path = jnp.maximum(curve(interface.path, interface.path_high, s), 1.0) / z
    theta = jnp.maximum(curve(interface.theta, interface.theta_high, s), 1e-4)
    return Crossing(direction(along(w) * bend, z), T, a, path, theta, s)


@chunk
def projected(path: Scalar, theta: Scalar, tau: Colour) -> Colour:
    """Mean of u among the paths that are left: sum of u exp(-tau u) over that of exp(-tau u)."""
    return 1.0 + jnp.maximum(path - 1.0, 1e-9) / (1.0 + jnp.maximum(theta, 1e-6) * tau)


@chunk
def between(y: Direction, x: Crossing, part: Scalar) -> Scalar:
    """Mean path of light that the base sends on: between that of one direction and that of all that cross."""
    straight = 1.0 / y[-1]
    return straight + part * (x.path - straight)


@chunk
def base_share(i: Crossing, o: Crossing, alpha: Widths) -> Scalar:
    """Part of a lobe's width, as a power, that is due to the base."""
    base = safe_power(alpha * (i.w[-1] + o.w[-1]), P)
    return over_axes(base / (base + safe_power(i.a, P) + safe_power(o.a, P)))


@chunk
def lean(x: Crossing, i: Crossing, o: Crossing, alpha: Widths) -> Direction:
    """The direction of one crossing, turned by its share of the tilt that the facets of the base would need alone."""
    own = safe_power(x.a, P)
    total = safe_power(alpha * (i.w[-1] + o.w[-1]), P) + safe_power(i.a, P) + safe_power(o.a, P)
    turn = CONDENSE * own / total
    y = along(x.w) - turn * (along(i.w) + along(o.w))
    sine = safe_sqrt(dot(y, y))
    held = jnp.minimum(1.0, 0.9998 / jnp.maximum(sine, 1e-6))
    sine = jnp.minimum(sine, 0.9998)
    return direction(y * held, safe_sqrt((1.0 - sine) * (1.0 + sine)))


@chunk
def direct(share: Scalar, d: Number, c: Number, e: Number) -> Scalar:
    """Part of the path's spread that counts, by the base's share of the width."""
    return clip(d + c * jnp.power(jnp.maximum(share, 1e-30), e), 0.0, 1.5)


@chunk
def lobe(i: Crossing, o: Crossing, yi: Direction, yo: Direction, alpha: Widths, masked: Widths) -> Scalar:
    """D G / 4 of a base of width alpha, seen through the interface twice; `masked` is the width that shadows itself.

    Without an interface, and times the projected areas, it is D V of GGX.
    """
    M = yi[-1] + yo[-1]
    M2 = M * M
    spread = safe_power(i.a, P) + safe_power(o.a, P)
    width2 = safe_power(safe_power(alpha * M, P) + spread, 2.0 / P)
    own2 = alpha * alpha * M2 + TAIL * (i.a * i.a + o.a * o.a)
    size = area(width2)
    r = clip(1.0 + RATIO * (size / area(own2) - 1.0), 0.6, 4.0)
    log_r = jnp.log(r)
    b = 2.0 - log_r * (1.993 + log_r * (0.197 + 0.051 * log_r))
    v = stretched(along(i.w) + along(o.w), width2)
    Y = along(yi) + along(yo)
    tilt = 1.0 + dot(Y, Y) / M2
    G = 1.0 / (1.0 + smith_lambda(yi, masked) + smith_lambda(yo, masked))
    return M2 * tilt * tilt * (0.25 * G) / (jnp.pi * size * (1.0 + v * (b + r * v)))


@chunk
def smith_lambda(w: Direction, alpha: Widths) -> Scalar:
    """Lambda of the GGX distribution (Heitz 2014, eq. 72)."""
    if jnp.ndim(alpha):
        x, y = alpha[0] * w[0], alpha[1] * w[1]
        return ggx_lambda((x * x + y * y) / (w[-1] * w[-1]))
    tan2 = sine2(w) / (w[-1] * w[-1])
    x = alpha * alpha * tan2
    return ggx_lambda(x)
