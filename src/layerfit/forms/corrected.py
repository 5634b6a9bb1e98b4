"""The corrected form: reciprocal, compressed by 1 / eta^2, through rough interfaces, with bounces between base and coat.

Directions are refracted about the normal. Light below the coats is f = E f_base(wi', wo'), where E is the product over the
coats of T(wi) T(wo) exp(-tau path) / eta^2: radiance L' = eta^2 T L on the way down, L = T L' / eta^2 on the way up.
A rough interface passes more light at grazing angles, lengthens the path, and widens the lobes below it; light that it reflects
back down makes a series of ever wider lobes. Holds for any number of coats; with three layers and more it is an approximation.
"""

import dataclasses
import itertools
from collections.abc import Callable
from functools import reduce
from operator import add
from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, safe_divide, safe_power, safe_sqrt, struct, where
from .._types import Colour, Direction, Scalar
from ..layers import Coat
from ..optics.directions import above, both_above, sine2
from ..optics.interface import steer
from ..optics.microfacet import Distribution, Width, half_cosine, half_vector
from ..surfaces.base import Lobe
from . import haze
from .crossing import Crossing, Interface, cross, interface_of, mean_width
from .enclosure import haze_below, left, remains

# Share of the path that a rough interface adds which light of a directional lobe takes: fitted, it lies between none and all.
DIRECTIONAL_SHARE = 0.5
# Widths add as powers: exactly 2 for Beckmann (Gaussian slopes); GGX is not closed, its peak asks for 1.26 and the walk for 1.34.
WIDTH_POWER = {"beckmann": 2.0, "ggx": 1.34}
MIXED_POWER = 1.5
"""Of lobes of one kind through boundaries of the other. The peak of a Gaussian lobe of width a, spread by GGX slopes of width b, is that of
one of width a / sqrt(e^k E2(k)), k = (b / a)^2, with E2 the exponential integral: for b <= a this power is within 2 % of it."""
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


def prepare(coats: tuple[Coat, ...], base: Any, options: Corrected) -> Prepared:
    """Relative indices, constants of the interfaces, and the light that returns to the base."""
    n = jnp.ones_like(coats[0].eta)
    relative, interfaces = [], []
    for coat in coats:
        relative.append(coat.below(n))
        n = coat.eta
        interfaces.append(interface_of(relative[-1], n, options.rough_interface))
    base = base.below(n)
    returned = lobes = trapped = light = None
    if relative[-1].tau_s is not None and options.multiple:
        light = haze_below(relative, interfaces, base)
    elif base.diffuse is not None and base.lobes:
        one = jnp.ones_like(n)
        lobes = jnp.minimum(reduce(add, (lobe.energy(lobe.reflectance(one)) for lobe in base.lobes)), 1.0)
    if base.diffuse is not None and light is None:
        returned = 1.0 / jnp.maximum(left(base.diffuse.albedo, lobes, relative, interfaces), 1e-6)
    if base.lobes and options.trapped:
        trapped = reduce(add, (trapped_light(lobe, relative[-1].extinction, n) for lobe in base.lobes))
    return Prepared(tuple(relative), tuple(interfaces), base, returned, lobes, trapped, light)


def evaluate(prepared: Prepared, wi: Direction, wo: Direction, options: Corrected) -> Colour:
    """BRDF [1/sr] of unit directions above the surface; 0 where either is below it."""
    lit = both_above(wi, wo)
    wi, wo = above(lit, wi), above(lit, wo)
    f = prepared.coats[0].evaluate(wi, wo)
    below = enter(None, wi, wo, prepared, options)
    for coat in prepared.coats[1:]:
        f = f + _bounced(coat, below, options)
        below = enter(below, wi, wo, prepared, options)
    for lobe in prepared.base.lobes:
        f = f + _bounced(lobe, below, options)
    if prepared.trapped is not None:
        f = f + below.throughput * below.directional * prepared.trapped
    if prepared.returned is not None:
        f = f + diffuse_part(prepared, below)
    if prepared.coats[-1].tau_s is not None:
        f = f + below.throughput * _scattered(prepared, below, options)
    return where(lit, f, 0.0)


def diffuse_part(prepared: Prepared, below: "Below") -> Colour:
    """Light of the base that lost its direction [1/sr]."""
    reflected = prepared.base.diffuse.evaluate(below.i.w, below.o.w) * prepared.returned
    if prepared.lobes is not None:
        reflected = reflected * _by_lobes(prepared.lobes, below.R_i, below.i, below.tau)
        reflected = reflected * _by_lobes(prepared.lobes, below.R_o, below.o, below.tau)
    return below.throughput * below.diffuse * reflected


@dataclasses.dataclass(frozen=True)
class Below:
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
    spreads: tuple[tuple[Width, Scalar, Scalar, Distribution], ...]
    """Facet width, spreads of the two directions and kind, of each interface passed."""


def enter(above: Below | None, wi: Direction, wo: Direction, prepared: Prepared, options: Corrected) -> Below:
    """Pass the next interface; wi and wo in air."""
    depth = above.depth if above else 0
    coat, interface = prepared.coats[depth], prepared.interfaces[depth]
    i = cross(interface, coat, above.i.w if above else wi, wi)
    o = cross(interface, coat, above.o.w if above else wo, wo)
    throughput = i.T * o.T / (coat.eta * coat.eta)
    straight = safe_divide(i.w[-1] + o.w[-1], i.w[-1] * o.w[-1])
    added = i.lengthening + o.lengthening if options.lengthen else 0.0
    if above:
        sin_i, sin_o, spreads = above.sin_i, above.sin_o, above.spreads
        throughput = throughput * above.throughput * above.directional
        R_i = _reflected_above(i.T, above.R_i, above.tau, above.i.w[-1])
        R_o = _reflected_above(o.T, above.R_o, above.tau, above.o.w[-1])
    else:
        sin_i = safe_sqrt(sine2(wi))
        sin_o = safe_sqrt(sine2(wo))
        spreads = ()
        R_i, R_o = 1.0 - i.T, 1.0 - o.T
    return Below(
        depth=depth + 1,
        n=interface.n,
        tau=coat.extinction,
        i=i,
        o=o,
        sin_i=sin_i,
        sin_o=sin_o,
        throughput=throughput,
        directional=remains(coat.extinction, straight + DIRECTIONAL_SHARE * added),
        diffuse=remains(coat.extinction, straight + added),
        R_i=R_i,
        R_o=R_o,
        spreads=(*spreads, (coat.width, i.spread, o.spread, coat.distribution)),
    )


def _reflected_above(T: Scalar, R: Colour, tau: Colour | None, cosine: Scalar) -> Colour:
    """Add an interface below a stack that reflects R: what the two send back down, with absorption between them."""
    back = R * remains(tau, safe_divide(2.0, cosine))
    F = 1.0 - T
    return F + T * T * back / jnp.maximum(1.0 - F * back, 1e-6)


def _bounced(target: Lobe, below: Below, options: Corrected) -> Colour:
    """Light of one lobe below coats: its first reflection, and the ever wider lobes of light sent back to it."""
    wi, wo = below.i.w, below.o.w
    if options.steer:
        wi = steer(wi, DIRECTIONAL_SHARE * below.i.drift)
        wo = steer(wo, DIRECTIONAL_SHARE * below.o.drift)
    h = half_vector(wi, wo)
    F = target.reflectance(half_cosine(wi, wo))
    q = target.energy(F) * below.directional * _returned(target, below, options)
    spread = spread_of(target, below) if options.broaden else None
    lobes: Any = 0.0
    for order in range(max(options.orders, 1), 0, -1):
        lobe = _shape(target, wi, wo, h, order, below, spread)
        lobes = lobe / jnp.maximum(1.0 - q, 1e-6) if order == options.orders else lobe + q * lobes
    return below.throughput * (F * below.directional) * lobes


def _shape(target: Lobe, wi: Direction, wo: Direction, h: Direction, order: int, below: Below, spread: Width | None) -> Any:
    """The lobe of light that met `target` `order` times; `spread` is what the interfaces passed add to its width."""
    if spread is None:
        return target.shape(wi, wo, h, target.width)
    width = widened(target, order, below, spread)
    if target.distribution != "beckmann":
        return target.shape(wi, wo, h, width)
    return target.widened(wi, wo, h, width, _added(target, order, below, spread))


def _width_power(target: Lobe, below: Below) -> float:
    """The power in which widths add to that of a lobe."""
    kinds = {target.distribution, *(kind for *_, kind in below.spreads)}
    return WIDTH_POWER[target.distribution] if len(kinds) == 1 else MIXED_POWER


def _by_lobes(lobes: Colour, R: Colour, crossing: Crossing, tau: Colour | None) -> Colour:
    """Gain of a diffuse part by light of one direction that the lobes send to the coat first, and the coat back."""
    return 1.0 / jnp.maximum(1.0 - lobes * R * remains(tau, safe_divide(2.0, crossing.w[-1])), 1e-6)


def _returned(target: Lobe, below: Below, options: Corrected) -> Colour:
    """Part of the light leaving `target` that comes back to it."""
    R = 0.5 * (below.R_i + below.R_o)
    if not options.edge:
        return R
    alpha = mean_width(target.width)
    edge_i = edge_reflection(below.sin_i, below.i.w[-1], below.n, alpha)
    edge_o = edge_reflection(below.sin_o, below.o.w[-1], below.n, alpha)
    return R + (1.0 - R) * (0.5 * (edge_i + edge_o))


@chunk
def edge_reflection(sine: Scalar, cosine: Scalar, n: Scalar, alpha: Scalar) -> Scalar:
    """Part of a lobe of width alpha that leaves the escape cone: sine in air, cosine in the medium of index n."""
    rise, width = 1.0 - sine, 2.0 * alpha * n * cosine
    return where(n > 1.0, 0.5 - safe_divide(0.5 * rise, safe_sqrt(width * width + rise * rise)), 0.0)


def _per_axis(widths: list[Width], width_along: Callable[[int], Scalar]) -> Width:
    """One width where every interface so far is isotropic, one an axis otherwise."""
    if any(isinstance(width, tuple) for width in widths):
        return width_along(0), width_along(1)
    return width_along(0)


def _component(width: Width, axis: int) -> Scalar:
    return width[axis] if isinstance(width, tuple) else width


def spread_of(target: Lobe, below: Below) -> Width:
    """What the interfaces passed add to the width of every lobe, to the power in which widths add."""
    p = _width_power(target, below)

    def along(axis: int) -> Scalar:
        spread: Any = 0.0
        for width, spread_i, spread_o, _ in below.spreads:
            spread = spread + (_power(spread_i, p) + _power(spread_o, p)) * _power(_component(width, axis), p)
        return spread

    return _per_axis([target.width, *(width for width, *_ in below.spreads)], along)


def _grown(target: Lobe, order: int, below: Below, spread: Width, axis: int, more: bool = False) -> Scalar:
    """Width, to its power, of the lobe of light that met `target` `order` times, and the interface above it in between; or what is `more`
    than its own."""
    p = _width_power(target, below)
    # The lobe meets itself in the power of its own kind.
    times = order ** (p / WIDTH_POWER[target.distribution]) - more
    total = _component(spread, axis) + times * _power(_component(target.width, axis), p)
    if order > 1:
        total = total + (order - 1) * _power(_component(below.spreads[-1][0], axis), p)
    return total


def widened(target: Lobe, order: int, below: Below, spread: Width) -> Width:
    """Width of that lobe."""
    p = _width_power(target, below)

    def along(axis: int) -> Scalar:
        total = _grown(target, order, below, spread, axis)
        return jnp.minimum(safe_sqrt(total) if p == 2.0 else safe_power(total, 1.0 / p), WIDEST)

    return _per_axis([spread], along)


def _added(target: Lobe, order: int, below: Below, spread: Width) -> Width:
    """What `widened` adds to the variance of a Gaussian lobe: for those that know a small part of their own."""
    p = _width_power(target, below)

    def along(axis: int) -> Scalar:
        own = _component(target.width, axis)
        own2 = own * own
        more = _grown(target, order, below, spread, axis, more=True)
        added = more if p == 2.0 else own2 * jnp.expm1(2.0 / p * jnp.log1p(more / _power(own, p)))
        return jnp.minimum(added, WIDEST * WIDEST - own2)

    return _per_axis([spread], along)


def _power(x: Scalar, p: float) -> Scalar:
    return x * x if p == 2.0 else safe_power(x, p)


def trapped_light(lobe: Lobe, tau: Colour | None, n: Scalar) -> Colour:
    """Radiance factor [1/sr] of light kept below the coat by total reflection until a rough base frees it."""
    alpha = jnp.minimum(mean_width(lobe.width), 1.0)
    a2 = alpha * alpha
    scattered = 0.95 * (1.0 - 0.6 * alpha) * a2 / (a2 + 0.03)
    lost = 1.55 * a2 / (1.0 + 1.3 * a2)
    critical = safe_sqrt((1.0 - 1.0 / n) * (1.0 + 1.0 / n))
    t = remains(tau, safe_divide(3.0, critical))
    F0 = lobe.energy(lobe.reflectance(jnp.ones_like(n)))
    kept = jnp.maximum(0.0, 1.0 - lost - scattered / (n * n))
    freed = F0 * F0 * scattered * scattered * (critical * critical) * t / jnp.pi
    return where(critical > 1e-4, freed / jnp.maximum(1.0 - F0 * kept * t, 1e-6), 0.0)


def _scattered(prepared: Prepared, below: Below, options: Corrected) -> Colour:
    """Light that the innermost coat scatters."""

    def way(crossing: Crossing, R: Colour) -> haze.Way:
        path = safe_divide(1.0, crossing.w[-1])
        if options.lengthen:
            path = path + crossing.lengthening
        return haze.Way(crossing.w, path, R)

    spread: Any = 0.0
    for width, spread_i, spread_o, _ in below.spreads if options.broaden else ():
        both = safe_power(spread_i, haze.POWER) + safe_power(spread_o, haze.POWER)
        spread = spread + both * haze.width_power(width)
    i, o = way(below.i, below.R_i), way(below.o, below.R_o)
    return haze.scattered(prepared.haze, prepared.coats[-1], prepared.base, i, o, spread)
