"""The corrected form: reciprocal, compressed by 1 / eta^2, through rough interfaces, with bounces between base and coat.

Directions are refracted about the normal. Light below the coats is f = E f_base(wi', wo'), where E is the product over the
coats of T(wi) T(wo) exp(-tau path) / eta^2: radiance L' = eta^2 T L on the way down, L = T L' / eta^2 on the way up.
A rough interface passes more light at grazing angles, lengthens the path, and widens the lobes below it; light that it reflects
back down makes a series of ever wider lobes. Holds for any number of coats; with three layers and more it is an approximation.
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, member, safe_divide, safe_power, safe_sqrt, struct, where
from .._types import Colour, Scalar, Vec3
from ..layers import Coat
from ..optics.interface import (
    drift,
    drift_scale,
    facet_cosine,
    facet_tilt,
    second_facet,
    slope_spread,
    spread_lengthening,
    steer,
    with_second_facet,
)
from ..optics.medium import refract_about_normal, transmittance
from ..optics.microfacet import Width, half_cosine, half_vector
from ..surfaces.base import Lobe
from . import haze

# Share of the path that a rough interface adds which light of a directional lobe takes: fitted, it lies between none and all.
DIRECTIONAL_SHARE = 0.5
# Widths add as powers: exactly 2 for Beckmann (Gaussian slopes); GGX is not closed, its peak asks for 1.26 and the walk for 1.34.
WIDTH_POWER = {"beckmann": 2.0, "ggx": 1.34}
WIDEST = 1.5


@dataclasses.dataclass(frozen=True)
class Corrected:
    """Parts of the corrected form, each of which can be left out for study.

    `orders`: lobes between base and coat, the last one standing for all that follow; 0 takes the first bounce alone.
    `trapped`: light that total reflection keeps below the coat, as a diffuse term; it counts part of the light that `edge` counts.
    `multiple`: light that a coat scatters more than once; without it that of Hanrahan and Krueger 1993.
    """

    orders: int = 3
    rough_interface: bool = True
    broaden: bool = True
    lengthen: bool = True
    steer: bool = True
    edge: bool = True
    trapped: bool = False
    multiple: bool = True


def refuses(layers: tuple[Any, ...], base: Any) -> str | None:
    """Why a material is not of this form, or None."""
    for upper, lower in itertools.pairwise(layers):
        if upper.tau_s is not None:
            return f"{upper.name} scatters light and lies over {lower.name}: only the innermost coat may scatter"
    return None


@struct
class Interface:
    """What a coat's rough top does to light that passes."""

    n: Scalar = member("index of the medium below, against air")
    alpha: Scalar = member("width of the facets, mean of the axes")
    tilt: Scalar = member("turn of the mean facet towards a grazing direction")
    gain: Scalar = member("part of the reflected light that a second facet lets in")
    lengthening: Scalar = member("path added by the spread of refracted directions, in thicknesses")
    drift: Scalar = member("scale of the path added at grazing angles")


@struct
class Prepared:
    """Coats with relative indices, what their interfaces do, and the base with what returns to it."""

    coats: tuple[Coat, ...]
    interfaces: tuple[Interface, ...]
    base: Any
    returned: Colour | None
    """Gain of a diffuse base by light reflected back to it."""
    lobes: Colour | None
    """Part of the light that the lobes of a base send back which has a diffuse part too."""
    trapped: Colour | None
    """Diffuse light of a rough base, kept in by total reflection until it leaves [1/sr]."""
    haze: haze.Haze | None
    """What the innermost coat does to light that it scatters."""


def _mean_width(width: Width) -> Scalar:
    return safe_sqrt(width[0] * width[1]) if isinstance(width, tuple) else width


def _interface(coat: Coat, n: Scalar, options: Corrected) -> Interface:
    """`coat` with its relative index; `n` its absolute one."""
    alpha = jnp.minimum(_mean_width(coat.width), 1.0)
    if not options.rough_interface:
        alpha = jnp.zeros_like(alpha)
    # Where light leaves a denser medium for the base the fits do not hold: the interface is smooth there.
    enters = coat.eta >= 1.0
    eta = jnp.maximum(coat.eta, 1.0)
    return Interface(
        n=n,
        alpha=alpha,
        tilt=facet_tilt(alpha),
        gain=where(enters, second_facet(alpha), 0.0),
        lengthening=spread_lengthening(eta, alpha),
        drift=drift_scale(eta, alpha),
    )


def prepare(coats: tuple[Coat, ...], base: Any, options: Corrected) -> Prepared:
    """Relative indices, constants of the interfaces, and the light that returns to the base."""
    n = jnp.ones_like(coats[0].eta)
    relative, interfaces = [], []
    for coat in coats:
        relative.append(coat.below(n))
        n = coat.eta
        interfaces.append(_interface(relative[-1], n, options))
    base = base.below(n)
    returned = lobes = trapped = light = None
    if relative[-1].tau_s is not None and options.multiple:
        light = _haze(relative, interfaces, base)
    elif base.diffuse is not None and base.lobes:
        one = jnp.ones_like(n)
        lobes = jnp.minimum(reduce(add, (lobe.energy(lobe.reflectance(one)) for lobe in base.lobes)), 1.0)
    if base.diffuse is not None and light is None:
        returned = 1.0 / jnp.maximum(_left(base.diffuse.albedo, lobes, relative, interfaces), 1e-6)
    if base.lobes and options.trapped:
        trapped = reduce(add, (trapped_light(lobe, relative[-1].extinction, n) for lobe in base.lobes))
    return Prepared(tuple(relative), tuple(interfaces), base, returned, lobes, trapped, light)


def _left(albedo: Colour, lobes: Colour | None, coats: list[Coat], interfaces: list[Interface]) -> Colour:
    """What is left of light between two meetings with the diffuse part, taken from 1: 1 - d 2 int R / (1 - s R) mu dmu.

    d and s are the albedos of the diffuse part and of the lobes, R is what comes back. In between, light meets the lobes as it would
    a mirror. Written by x = 1 - R, nothing cancels where d + s is near 1, which is also the most that it counts.
    """
    escape = _escape(coats, interfaces, lobes)
    if lobes is None:
        return 1.0 - albedo + albedo * escape
    both = jnp.minimum(albedo + lobes, 1.0)
    return (1.0 - both) / jnp.maximum(1.0 - lobes, 1e-6) * (1.0 - lobes * escape) + both * escape


def evaluate(prepared: Prepared, wi: Vec3, wo: Vec3, options: Corrected) -> Colour:
    """BRDF [1/sr] of unit directions above the surface; 0 where either is below it."""
    lit = (wi[2] > 0.0) & (wo[2] > 0.0)
    up = jnp.array([0.0, 0.0, 1.0], wi.dtype)
    wi = where(lit, wi, up)
    wo = where(lit, wo, up)
    f = prepared.coats[0].evaluate(wi, wo)
    below = _enter(None, wi, wo, prepared, options)
    for coat in prepared.coats[1:]:
        f = f + _bounced(coat, below, options)
        below = _enter(below, wi, wo, prepared, options)
    for lobe in prepared.base.lobes:
        f = f + _bounced(lobe, below, options)
    if prepared.trapped is not None:
        f = f + below.throughput * below.directional * prepared.trapped
    if prepared.returned is not None:
        reflected = prepared.base.diffuse.evaluate(below.i.w, below.o.w) * prepared.returned
        if prepared.lobes is not None:
            reflected = reflected * _by_lobes(prepared.lobes, below.R_i, below.i, below.tau)
            reflected = reflected * _by_lobes(prepared.lobes, below.R_o, below.o, below.tau)
        f = f + below.throughput * below.diffuse * reflected
    if prepared.coats[-1].tau_s is not None:
        f = f + below.throughput * _scattered(prepared, below, options)
    return where(lit, f, 0.0)


@struct
class Crossing:
    """One direction on its way through one rough interface."""

    w: Vec3 = member("direction in the medium below")
    T: Colour = member("energy that passes")
    spread: Scalar = member("width of the refracted directions over that of the facets")
    lengthening: Scalar = member("path beyond that of the refracted direction, in thicknesses")
    drift: Scalar = member("the part of it due to grazing incidence")


@chunk
def cross(interface: Interface, coat: Coat, w: Vec3, air: Vec3) -> Crossing:
    """Follow one direction through the rough top of a coat with its relative index; `air` is the direction above all of them."""
    c = facet_cosine(w, interface.tilt)
    # Out of a denser medium the fits do not hold for the energy: there the interface passes light as a smooth one.
    c_energy = where(coat.eta >= 1.0, c, w[2])
    T = with_second_facet(coat.transmittance(c_energy), interface.gain)
    grazing = drift(w, interface.drift, interface.alpha)
    # From air at once, not from layer to layer: going back to index 1 gives the same direction to the last bit.
    below = refract_about_normal(air, interface.n)
    return Crossing(below, T, slope_spread(c, coat.eta), interface.lengthening + grazing, grazing)


@dataclasses.dataclass(frozen=True)
class _Below:
    """Light below `depth` coats, on its way to the next boundary: a plain record, so that nothing of it is printed."""

    depth: int
    n: Scalar
    tau: Colour | None
    i: Crossing
    o: Crossing
    sin_i: Scalar
    """Sine in air."""
    sin_o: Scalar
    throughput: Colour
    """T T / eta^2 of every interface passed and absorption in every medium passed, without the present one."""
    directional: Colour
    """Absorption in the present medium on the way to and from a boundary that keeps directions."""
    diffuse: Colour
    """The same for a diffuse boundary."""
    R_i: Colour
    """Energy that the stack above sends back down."""
    R_o: Colour
    spreads: tuple[tuple[Width, Scalar, Scalar], ...]
    """Facet width and spreads of the two directions, of each interface passed."""


def _enter(above: _Below | None, wi: Vec3, wo: Vec3, prepared: Prepared, options: Corrected) -> _Below:
    """Pass the next interface; wi and wo in air."""
    depth = above.depth if above else 0
    coat, interface = prepared.coats[depth], prepared.interfaces[depth]
    i = cross(interface, coat, above.i.w if above else wi, wi)
    o = cross(interface, coat, above.o.w if above else wo, wo)
    throughput = i.T * o.T / (coat.eta * coat.eta)
    straight = safe_divide(1.0, i.w[2]) + safe_divide(1.0, o.w[2])
    added = i.lengthening + o.lengthening if options.lengthen else 0.0
    if above:
        sin_i, sin_o, spreads = above.sin_i, above.sin_o, above.spreads
        throughput = throughput * above.throughput * above.directional
        R_i = _reflected_above(i.T, above.R_i, above.tau, above.i.w[2])
        R_o = _reflected_above(o.T, above.R_o, above.tau, above.o.w[2])
    else:
        sin_i = safe_sqrt(wi[0] * wi[0] + wi[1] * wi[1])
        sin_o = safe_sqrt(wo[0] * wo[0] + wo[1] * wo[1])
        spreads = ()
        R_i, R_o = 1.0 - i.T, 1.0 - o.T
    return _Below(
        depth=depth + 1,
        n=interface.n,
        tau=coat.extinction,
        i=i,
        o=o,
        sin_i=sin_i,
        sin_o=sin_o,
        throughput=throughput,
        directional=_absorbed(coat.extinction, straight + DIRECTIONAL_SHARE * added),
        diffuse=_absorbed(coat.extinction, straight + added),
        R_i=R_i,
        R_o=R_o,
        spreads=(*spreads, (coat.width, i.spread, o.spread)),
    )


def _absorbed(tau: Colour | None, path: Scalar) -> Any:
    return 1.0 if tau is None else transmittance(tau, path)


def _reflected_above(T: Scalar, R: Colour, tau: Colour | None, cosine: Scalar) -> Colour:
    """Add an interface below a stack that reflects R: what the two send back down, with absorption between them."""
    back = R * _absorbed(tau, safe_divide(2.0, cosine))
    F = 1.0 - T
    return F + T * T * back / jnp.maximum(1.0 - F * back, 1e-6)


def _bounced(target: Lobe, below: _Below, options: Corrected) -> Colour:
    """Light of one lobe below coats: its first reflection, and the ever wider lobes of light sent back to it."""
    wi, wo = below.i.w, below.o.w
    if options.steer:
        wi = steer(wi, DIRECTIONAL_SHARE * below.i.drift)
        wo = steer(wo, DIRECTIONAL_SHARE * below.o.drift)
    h = half_vector(wi, wo)
    F = target.reflectance(half_cosine(wi, wo))
    q = target.energy(F) * _returned(target, below, options) * below.directional
    spread = _spread(target, below) if options.broaden else None
    lobes: Any = 0.0
    for order in range(max(options.orders, 1), 0, -1):
        width = target.width if spread is None else _widened(target, order, below, spread)
        lobe = target.shape(wi, wo, h, width)
        lobes = lobe / jnp.maximum(1.0 - q, 1e-6) if order == options.orders else lobe + q * lobes
    return below.throughput * below.directional * F * lobes


def _by_lobes(lobes: Colour, R: Colour, crossing: Crossing, tau: Colour | None) -> Colour:
    """Gain of a diffuse part by light of one direction that the lobes send to the coat first, and the coat back."""
    return 1.0 / jnp.maximum(1.0 - lobes * R * _absorbed(tau, safe_divide(2.0, crossing.w[2])), 1e-6)


def _returned(target: Lobe, below: _Below, options: Corrected) -> Colour:
    """Part of the light leaving `target` that comes back to it."""
    R = 0.5 * (below.R_i + below.R_o)
    if not options.edge:
        return R
    alpha = _mean_width(target.width)
    edge_i = edge_reflection(below.sin_i, below.i.w[2], below.n, alpha)
    edge_o = edge_reflection(below.sin_o, below.o.w[2], below.n, alpha)
    return R + (1.0 - R) * (0.5 * (edge_i + edge_o))


@chunk
def edge_reflection(sine: Scalar, cosine: Scalar, n: Scalar, alpha: Scalar) -> Scalar:
    """Part of a lobe of width alpha that leaves the escape cone: sine in air, cosine in the medium of index n."""
    m = safe_divide(0.5 * (1.0 - sine), n * cosine)
    return where(n > 1.0, 0.5 - safe_divide(0.5 * m, safe_sqrt(alpha * alpha + m * m)), 0.0)


def _per_axis(widths: list[Width], width_along: Callable[[int], Scalar]) -> Width:
    """One width where every interface so far is isotropic, one an axis otherwise."""
    if any(isinstance(width, tuple) for width in widths):
        return width_along(0), width_along(1)
    return width_along(0)


def _component(width: Width, axis: int) -> Scalar:
    return width[axis] if isinstance(width, tuple) else width


def _spread(target: Lobe, below: _Below) -> Width:
    """What the interfaces passed add to the width of every lobe, to the power in which widths add."""
    p = WIDTH_POWER[target.distribution]

    def along(axis: int) -> Scalar:
        spread: Any = 0.0
        for width, spread_i, spread_o in below.spreads:
            spread = spread + (_power(spread_i, p) + _power(spread_o, p)) * _power(_component(width, axis), p)
        return spread

    return _per_axis([target.width, *(width for width, _, _ in below.spreads)], along)


def _widened(target: Lobe, order: int, below: _Below, spread: Width) -> Width:
    """Width of the lobe of light that met `target` `order` times, and the interface above it in between."""
    p = WIDTH_POWER[target.distribution]

    def along(axis: int) -> Scalar:
        total = _component(spread, axis) + order * _power(_component(target.width, axis), p)
        if order > 1:
            total = total + (order - 1) * _power(_component(below.spreads[-1][0], axis), p)
        width = jnp.minimum(safe_sqrt(total) if p == 2.0 else safe_power(total, 1.0 / p), WIDEST)
        return width

    return _per_axis([spread], along)


def _power(x: Scalar, p: float) -> Scalar:
    return x * x if p == 2.0 else safe_power(x, p)


def trapped_light(lobe: Lobe, tau: Colour | None, n: Scalar) -> Colour:
    """Radiance factor [1/sr] of light kept below the coat by total reflection until a rough base frees it."""
    alpha = jnp.minimum(_mean_width(lobe.width), 1.0)
    a2 = alpha * alpha
    scattered = 0.95 * (1.0 - 0.6 * alpha) * a2 / (a2 + 0.03)
    lost = 1.55 * a2 / (1.0 + 1.3 * a2)
    critical = safe_sqrt((1.0 - 1.0 / n) * (1.0 + 1.0 / n))
    t = _absorbed(tau, safe_divide(3.0, critical))
    F0 = lobe.energy(lobe.reflectance(jnp.ones_like(n)))
    kept = jnp.maximum(0.0, 1.0 - lost - scattered / (n * n))
    freed = F0 * F0 * scattered * scattered * (critical * critical) * t / jnp.pi
    return where(critical > 1e-4, freed / jnp.maximum(1.0 - F0 * kept * t, 1e-6), 0.0)


def _nodes(dtype: np.dtype) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on [0, 1], enough for the precision of `dtype`."""
    x, w = np.polynomial.legendre.leggauss(16 if dtype == np.float32 else 64)
    return (0.5 * (x + 1.0)).astype(dtype), (0.5 * w).astype(dtype)


def _scattered(prepared: Prepared, below: _Below, options: Corrected) -> Colour:
    """Light that the innermost coat scatters."""

    def way(crossing: Crossing, R: Colour) -> haze.Way:
        path = safe_divide(1.0, crossing.w[2])
        if options.lengthen:
            path = path + crossing.lengthening
        return haze.Way(crossing.w, path, R)

    spread: Any = 0.0
    for width, spread_i, spread_o in below.spreads if options.broaden else ():
        both = safe_power(spread_i, haze.POWER) + safe_power(spread_o, haze.POWER)
        spread = spread + both * haze.width_power(width)
    i, o = way(below.i, below.R_i), way(below.o, below.R_o)
    return haze.scattered(prepared.haze, prepared.coats[-1], prepared.base, i, o, spread)


# Not for speed: outside of a trace, a scan over a new function would compile again at every call.
@jax.jit
def _escape(coats: list[Coat], interfaces: list[Interface], lobes: Colour | None = None) -> Colour:
    """Part of the light of a diffuse base that gets out at its first try: 2 int x mu dmu, x = 1 - R exp(-2 tau / mu).

    Of a base with lobes of albedo s too, 2 int x / (1 - s + s x) mu dmu.
    """

    def tries(S: Colour, cosine: Scalar) -> list[Colour]:
        x = S + (1.0 - S) * _lost(coats[-1].extinction, cosine)
        return [x if lobes is None else x / jnp.maximum(1.0 - lobes + lobes * x, 1e-6)]

    return _over_directions(tries, coats, interfaces)[0]


@jax.jit
def _haze(coats: list[Coat], interfaces: list[Interface], base: Any) -> haze.Haze:
    """What the innermost coat does to light that it scatters."""

    def mean(f: Callable[[Colour, Scalar], Sequence[Colour]]) -> Sequence[Colour]:
        return _over_directions(lambda S, cosine: f(1.0 - S, cosine), coats, interfaces)

    return haze.prepare(coats[-1], base, interfaces[-1].n, mean)


def _over_directions(
    f: Callable[[Colour, Scalar], Sequence[Colour]], coats: list[Coat], interfaces: list[Interface]
) -> Sequence[Colour]:
    """2 int f(S, mu) mu dmu over the directions in the innermost medium, mu from 0 to 1; S is what passes up and out."""
    n = interfaces[-1].n
    n_above = interfaces[-2].n if len(interfaces) > 1 else jnp.ones_like(n)
    # Directions are counted by their cosine u^3 in the rarer of the two media: there the integrand is smooth, at any
    # width, and the cube gathers nodes where short paths through a thin medium make it steep.
    rare = jnp.minimum(n, n_above)
    cone = (rare / n) ** 2

    def at(u: Scalar) -> Sequence[Colour]:
        u2 = u * u
        u3 = u2 * u
        jacobian = 6.0 * u2 * u3
        p2 = (1.0 - u3) * (1.0 + u3) * rare * rare
        S = _passed_up(coats, interfaces, p2)
        cosine = safe_sqrt((rare * u3) ** 2 + (n - rare) * (n + rare)) / n
        outside = u3 * safe_sqrt(1.0 - cone)
        within, beyond = f(S, cosine), f(jnp.zeros_like(S), outside)
        return [jacobian * (cone * w + (1.0 - cone) * b) for w, b in zip(within, beyond, strict=True)]

    def accumulate(total: Sequence[Colour], node: tuple[Scalar, Scalar]) -> tuple[Sequence[Colour], None]:
        u, weight = node
        return [t + weight * value for t, value in zip(total, at(u), strict=True)], None

    u, weight = _nodes(n.dtype)
    # A colour as soon as anything is: a medium above, a lobe.
    zeros = [jnp.zeros(x.shape, x.dtype) for x in jax.eval_shape(at, n)]
    return jax.lax.scan(accumulate, zeros, (jnp.asarray(u), jnp.asarray(weight)))[0]


def _lost(tau: Colour | None, cosine: Scalar) -> Any:
    """Absorbed on the way up and down again."""
    return 0.0 if tau is None else -jnp.expm1(-tau * safe_divide(2.0, cosine))


def _passed_up(coats: list[Coat], interfaces: list[Interface], p2: Scalar) -> Colour:
    """Part of the light from below that leaves the stack; p2 = (n sin)^2, the same in every medium."""
    S: Any = 1.0
    n_above = jnp.ones_like(interfaces[0].n)
    for depth, (coat, interface) in enumerate(zip(coats, interfaces, strict=True)):
        cosine2 = 1.0 - p2 / (n_above * n_above)
        w = jnp.stack([safe_sqrt(p2) / n_above, jnp.zeros_like(p2), safe_sqrt(cosine2)])
        c = where(coat.eta >= 1.0, facet_cosine(w, interface.tilt), w[2])
        T = where(cosine2 > 0.0, with_second_facet(coat.transmittance(c), interface.gain), 0.0)
        if depth == 0:
            S = T
        else:
            back = (1.0 - S) * _absorbed(coats[depth - 1].extinction, safe_divide(2.0, w[2]))
            S = T * (1.0 - back) / jnp.maximum(1.0 - (1.0 - T) * back, 1e-6)
        n_above = interface.n
    return S
