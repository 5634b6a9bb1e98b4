"""A coat over a metal in the precise form, compact."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, member, static, struct
from .._types import Colour, Scalar, Vec2
from ..forms import one_coat
from ..forms.bounces import amount, wider
from ..forms.curves import P, curve, grazing, presence
from ..layers import Coat
from ..optics.interface import rough_transmittance
from .polynomial import Curve, Polynomial
from .surface import Compact, Recipe, colour_of, cosines
from .top import coat_lobe, hidden_cosine

LEAST_Z2 = 4e-4
"""A direction below never leans further than 1 - 0.9998^2."""


@struct
class PreciseWay:
    """One direction on its way through the coat's rough top."""

    NoW: Scalar = member("cosine above")
    sin2: Scalar = member("squared sine above")
    hidden: Scalar = member("NoW (1 + 2 Lambda) of the coat's facets")
    T: Scalar = member("energy that passes, over the index")
    bend: Scalar = member("sine below over that above")
    z2: Scalar = member("squared cosine below")
    z: Scalar = member("cosine below")
    width: Scalar = member("spread as a width, to the power in which widths add")
    tail: Scalar = member("its square, times its part in a lobe's tail")
    path: Scalar = member("mean path, in thicknesses")
    theta: Scalar = member("scale of the path's distribution")
    rest: Colour = member("square root of what leaves of the light that goes to and fro")
    again: Colour = member("half the weight of the lobe of light that met the metal twice")


@struct
class PreciseMetal(Compact):
    """Coat and metal, and the curves of what lies under the coat."""

    coat: Coat
    tilt: Scalar
    """Turn of the mean facet towards a grazing direction."""
    passed: Polynomial
    """Of the cosine of the mean facet: energy over the index, by the closed form."""
    bent: Polynomial
    """Of `grazing`: bend, width, path times the cosine below, and theta."""
    rest: Polynomial
    """Of `grazing`: square root of the light that is left, and what the energy is beyond the closed form."""
    again: Polynomial
    """Of `grazing`: half the weight of the second lobe, and the spread of the tail."""
    own: Polynomial
    """Of the sum of the cosines below: width of the metal, to the power in which widths add."""
    part: Polynomial
    """Of the metal's share in the width of its lobe: parts of the path's spread that count for absorption and for the projected area."""
    absorbing: Polynomial | None
    """Of theta: optical depth that counts."""
    reflectance: Polynomial
    """Of four times the squared half cosine below."""
    widths: Polynomial
    """Of the sum of the cosines below: widths of both lobes, to the power in which they add."""
    variance: Polynomial
    """Of those and the spreads together: squared widths."""
    peak: Polynomial
    """Of a lobe's ratio to GGX: the middle coefficient of its shape."""
    alpha2: Vec2
    """Squared widths of the metal's facets, and of those that stand for two meetings."""
    rise: Scalar
    """Growth of the first lobe."""
    ahead: Scalar
    """How much more of the light that is left goes on than back."""
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> PreciseWay:
        return precise_way(self.passed, self.bent, self.rest, self.again, self.coat, self.tilt, NoW)

    def meet(self, i: PreciseWay, o: PreciseWay, lean2: Scalar) -> Colour:
        between = metal_between(self.own, i, o, lean2)
        lobes = metal_lobes(self.widths, self.variance, self.peak, self.alpha2, i, o, between)
        F = self.reflectance(between.h2)
        again = F * (i.again + o.again) * lobes[1]
        rise = 1.0 + self.rise * between.share
        back = i.bend * o.bend * (lean2 - i.sin2 - o.sin2)
        rest = i.rest * o.rest * jnp.maximum(1.0 / math.pi - self.ahead * back, 0.0)
        parts = self.part(between.share)
        inverse_i, inverse_o = between.inverse_i, between.inverse_o
        path_i = (inverse_i - 1.0) + parts * (i.path - inverse_i)
        path_o = (inverse_o - 1.0) + parts * (o.path - inverse_o)
        throughput: Any = i.T * o.T
        if self.absorbing is None:
            U: Any = (1.0 + path_i[1]) * (1.0 + path_o[1])
        else:
            depth = path_i[0] * self.absorbing(parts[0] * i.theta) + path_o[0] * self.absorbing(parts[0] * o.theta)
            throughput = throughput * jnp.exp(-(2.0 * self.coat.tau + depth))
            U = projected_area(path_i[1], path_o[1], parts[1] * i.theta, parts[1] * o.theta, self.coat.tau)
        top = coat_lobe(self.coat, i.NoW, o.NoW, i.hidden, o.hidden, lean2)
        return top + throughput * (F * U * (rise * lobes[0] + again) + rest)


@struct
class MetalBetween:
    """Two directions between coat and metal, where the coat's facets share the tilt that the metal's would need alone."""

    x2: Scalar = member("squared length of the sum of their parts along the surface, as they cross")
    share: Scalar = member("part of the lobe's width that is due to the metal")
    M: Scalar = member("sum of the cosines, turned")
    h2: Scalar = member("squared length of the sum of the directions, turned")
    z_i: Scalar = member("cosine, turned")
    z_o: Scalar = member("the same of the other")
    inverse_i: Scalar = member("one over the cosine")
    inverse_o: Scalar = member("the same of the other")


@chunk
def precise_way(
    passed: Polynomial, bent: Polynomial, rest: Polynomial, again: Polynomial, coat: Coat, tilt: Scalar, NoW: Scalar
) -> PreciseWay:
    """Follow one direction into the coat."""
    s = grazing(NoW)
    NoW2 = NoW * NoW
    sin2 = 1.0 - NoW2
    crossing = bent(s)
    left = rest(s)
    second = again(s)
    T = passed(jnp.sqrt(tilt + (1.0 - tilt) * NoW2)) + left[-1]
    bend = crossing[0]
    z2 = 1.0 - bend * bend * sin2
    inverse = jax.lax.rsqrt(z2)
    hidden = hidden_cosine(NoW, coat.alpha * coat.alpha)
    path = crossing[2] * inverse
    return PreciseWay(
        NoW,
        sin2,
        hidden,
        T,
        bend,
        z2,
        z2 * inverse,
        crossing[1],
        second[-1],
        path,
        crossing[3],
        colour_of(left),
        colour_of(second),
    )


@chunk
def metal_between(own: Polynomial, i: PreciseWay, o: PreciseWay, lean2: Scalar) -> MetalBetween:
    """Turn two directions towards the mirror direction, each by the share of its spread in the width of the lobe."""
    bends = i.bend - o.bend
    x2 = jnp.maximum(i.bend * o.bend * lean2 + bends * (i.bend * i.sin2 - o.bend * o.sin2), 0.0)
    base = own(i.z + o.z)
    inverse = 1.0 / (base + i.width + o.width)
    turns = one_coat.CONDENSE * inverse
    turn_i, turn_o = turns * i.width, turns * o.width
    apart = o.z2 - i.z2
    z2_i = jnp.maximum(i.z2 + turn_i * (apart + (1.0 - turn_i) * x2), LEAST_Z2)
    z2_o = jnp.maximum(o.z2 + turn_o * ((1.0 - turn_o) * x2 - apart), LEAST_Z2)
    inverse_i, inverse_o = jax.lax.rsqrt(z2_i), jax.lax.rsqrt(z2_o)
    z_i, z_o = z2_i * inverse_i, z2_o * inverse_o
    kept = 1.0 - turn_i - turn_o
    M = z_i + z_o
    return MetalBetween(x2, base * inverse, M, M * M + kept * kept * x2, z_i, z_o, inverse_i, inverse_o)


@chunk
def metal_lobes(
    widths: Polynomial,
    variance: Polynomial,
    peak: Polynomial,
    alpha2: Vec2,
    i: PreciseWay,
    o: PreciseWay,
    between: MetalBetween,
) -> Vec2:
    """D G / 4 of light that met the metal once, and of light that met it twice: two lobes at once."""
    M2 = between.M * between.M
    size = variance(widths(between.M) + (i.width + o.width))
    r = (1.0 - one_coat.RATIO) + one_coat.RATIO * size / (alpha2 * M2 + (i.tail + o.tail))
    shapes = size / (size * size + between.x2 * (peak(r) * size + r * between.x2))
    hidden_i, hidden_o = hidden_cosine(between.z_i, alpha2[0]), hidden_cosine(between.z_o, alpha2[0])
    G = between.z_i * between.z_o / (M2 * (between.z_o * hidden_i + between.z_i * hidden_o))
    return ((0.5 / math.pi) * between.h2 * between.h2 * G) * shapes


@chunk
def projected_area(path_i: Scalar, path_o: Scalar, theta_i: Scalar, theta_o: Scalar, tau: Colour) -> Colour:
    """Mean of u among the paths that are left, of both directions: 1 + path / (1 + theta tau), path the mean beyond 1."""
    spread_i, spread_o = 1.0 + theta_i * tau, 1.0 + theta_o * tau
    return (spread_i + path_i) * (spread_o + path_o) / (spread_i * spread_o)


def recipe(prepared: one_coat.Prepared, name: str) -> Recipe:
    """The curves of a prepared material, in double precision."""
    coat: Any = prepared.coat
    interface, base = prepared.interface, prepared.base
    again, rest = prepared.again, prepared.rest
    assert again is not None
    assert rest is not None
    eta, tilt = coat.eta, interface.tilt

    def follow(NoW: Any) -> Any:
        crossing = one_coat.pass_interface(interface, eta, coat.alpha, jnp.stack([jnp.sqrt(1.0 - NoW * NoW), 0.0 * NoW, NoW]))
        s, z = crossing.s, crossing.w[2]
        bend = curve(interface.bend, interface.bend_high, s) / eta
        root = amount(rest, s)
        beyond = curve(interface.passed, interface.passed_high, s) / eta
        return (
            s,
            z,
            jnp.stack([bend, crossing.a**P, crossing.path * z, crossing.theta]),
            jnp.hstack([root * root, beyond]),
            jnp.hstack([0.5 * amount(again, s), one_coat.TAIL * crossing.a * crossing.a]),
        )

    NoW = cosines()
    s, z, bent, left, second = (np.asarray(a) for a in jax.vmap(follow)(jnp.asarray(NoW)))
    facet = np.sqrt(tilt + (1.0 - tilt) * NoW**2)
    closed = np.asarray(jax.vmap(lambda c: rough_transmittance(c, eta, interface.gain))(jnp.asarray(facet))) / eta
    alphas = np.array([float(base.width), float(wider(base.width, coat.width))])
    M = np.linspace(1.96 * z.min(), 2.0, len(NoW))
    widths = (alphas * M[:, None]) ** P
    spread = 2.0 * bent[:, 1].min(), 2.0 * bent[:, 1].max()
    least, most = 1.0 / (1.0 + spread[1] / widths[0, 0]), 1.0 / (1.0 + spread[0] / widths[-1, 0])
    share = np.linspace(least, most, len(NoW))
    parts = np.stack([np.clip(d + c * share**e, 0.0, 1.5) for d, c, e in (one_coat.DIRECT, one_coat.DIRECT_PATH)], -1)
    theta = np.linspace(1e-6, bent[:, 3].max() * parts.max(), len(NoW))[:, None]
    total = np.linspace(widths[0].min() + spread[0], widths[-1].max() + spread[1], len(NoW))
    ratio = np.linspace(0.6, 1.0 + one_coat.RATIO * 1.0, len(NoW))
    log_r = np.log(ratio)
    cosine = np.linspace(0.98 * z.min(), 1.0, len(NoW))
    F = np.asarray(jax.vmap(base.reflectance)(jnp.asarray(cosine)))
    tau = None if coat.tau is None else np.asarray(coat.tau)
    curves = {
        "passed": Curve(facet, closed, 1.0 / closed),
        "bent": Curve(s, bent, np.broadcast_to(1.0 / bent.max(0), bent.shape)),
        "rest": Curve(s, left),
        "again": Curve(s, second),
        "own": Curve(M, widths[:, 0], 1.0 / widths[:, 0], 4),
        "part": Curve(share, parts, 1.0, 5),
        "absorbing": None if tau is None else Curve(theta[:, 0], np.squeeze(np.log1p(theta * tau) / theta), 1.0, 5),
        "reflectance": Curve(4.0 * cosine**2, F, 1.0 / F, 6),
        "widths": Curve(M, widths, 1.0 / widths, 4),
        "variance": Curve(total, total ** (2.0 / P), total ** (-2.0 / P), 5),
        "peak": Curve(ratio, 2.0 - log_r * (1.993 + log_r * (0.197 + 0.051 * log_r)), 1.0, 4),
    }
    rise = one_coat.RISE * presence(eta) * coat.alpha * coat.alpha
    ahead = 0.5 / math.pi * eta * eta * (1.0 - jnp.minimum(base.width, 1.0))

    def build(p: Any) -> PreciseMetal:
        return PreciseMetal(
            coat=coat, tilt=tilt, alpha2=jnp.asarray(alphas**2), rise=rise, ahead=ahead, name=name, **({"absorbing": None} | p)
        )

    return Recipe({key: c for key, c in curves.items() if c is not None}, build)
