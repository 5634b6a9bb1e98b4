"""A coat over a metal in the precise form, compact."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, member, static, struct, where
from .._types import Colour, Flag, Scalar, Vec2
from ..forms import one_coat
from ..forms.bounces import amount, wider
from ..forms.curves import blurred2, curve, grazing, presence, spread_root
from ..layers import Coat
from ..optics.interface import rough_transmittance
from .polynomial import Curve, Polynomial
from .surface import Compact, Recipe, argument, at, colour_of, cosines
from .top import coat_lobe, hidden_cosine, left_curve, reflectance_curve


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
    spread: Scalar = member("spread as a width")
    path: Scalar = member("mean path, in thicknesses")
    theta: Scalar = member("scale of the path's distribution")
    rest: Colour = member("fourth root of what leaves of the light that goes to and fro")
    again: Colour = member("weight of the lobe of light that met the metal twice, as a factor of light and of view")


@struct
class PreciseMetal(Compact):
    """Coat and metal, and the curves of what lies under the coat."""

    coat: Coat
    tilt: Scalar
    """Turn of the mean facet towards a grazing direction."""
    passed: Polynomial
    """Of the cosine of the mean facet: energy over the index, by the closed form."""
    bent: Polynomial
    """Of `grazing`: bend, spread, path times the cosine below, and theta."""
    rest: Polynomial
    """Of `grazing`: fourth root of the light that is left, and what the energy is beyond the closed form."""
    again: Polynomial
    """Of `grazing`: factor of the weight of the second lobe."""
    absorbing: Polynomial | None
    """Of theta: optical depth that counts."""
    left: Polynomial | None
    """Of the optical depth beyond that at the normal: what absorption leaves; None where no polynomial follows it."""
    unspread: Polynomial | None
    """Of theta: one over `spread_root`."""
    reflectance: Polynomial
    """Of four times the squared half cosine below."""
    widths: Vec2
    """Width of the metal's facets, and of those that stand for two meetings."""
    least: Scalar | None
    """Squared cosine below which no light is turned; None where the coat bends all light away from the surface."""
    condense: Scalar
    """Share of the tilt of the facets, of what the metal does not ask for, that both crossings take."""
    rise: Scalar
    """Growth of the first lobe."""
    ahead: Scalar
    """How much more of the light that is left goes on than back."""
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> PreciseWay:
        return precise_way(self.passed, self.bent, self.rest, self.again, self.coat, self.tilt, NoW)

    def meet(self, i: PreciseWay, o: PreciseWay, lean2: Scalar, lit: Flag) -> Colour:
        between = metal_between(self.widths, self.condense, self.least, i, o, lean2)
        lobes = metal_lobes(self.widths, i, o, between)
        F = self.reflectance(between.h2)
        again = F * (i.again * o.again) * lobes[1]
        rise = 1.0 + self.rise * between.share
        back = lean2 - i.sin2 - o.sin2
        root = i.rest * o.rest
        rest = root * root * (1.0 / math.pi - self.ahead * back)
        part = one_coat.DIRECT * between.share
        path_i = (between.inverse_i - 1.0) + part * (i.path - between.inverse_i)
        path_o = (between.inverse_o - 1.0) + part * (o.path - between.inverse_o)
        throughput: Any = i.T * o.T
        if self.absorbing is None or self.unspread is None:
            U: Any = (1.0 + path_i) * (1.0 + path_o)
        else:
            theta_i, theta_o = part * i.theta, part * o.theta
            depth = path_i * self.absorbing(theta_i) + path_o * self.absorbing(theta_o)
            throughput = throughput * (jnp.exp(-(2.0 * self.coat.tau + depth)) if self.left is None else self.left(depth))
            U = (1.0 + path_i * self.unspread(theta_i)) * (1.0 + path_o * self.unspread(theta_o))
        top = coat_lobe(self.coat, i.NoW, o.NoW, i.hidden, o.hidden, lean2)
        return where(lit, top + throughput * (F * U * (rise * lobes[0] + again) + rest), 0.0)


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
    T = passed(argument("facet", NoW, tilt)) + left[-1]
    bend = crossing[0]
    z2 = NoW2 + (1.0 - bend * bend) * sin2
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
        path,
        crossing[3],
        colour_of(left),
        again(s),
    )


@chunk
def metal_between(
    widths: Vec2, condense: Scalar, least: Scalar | None, i: PreciseWay, o: PreciseWay, lean2: Scalar
) -> MetalBetween:
    """Turn two directions towards the mirror direction, each by the share of its spread in the width of the lobe."""
    bends = i.bend - o.bend
    x2 = jnp.maximum(i.bend * o.bend * lean2 + bends * (i.bend * i.sin2 - o.bend * o.sin2), 0.0)
    base = widths[0] * (i.z + o.z)
    inverse = 1.0 / (base + i.spread + o.spread)
    turns = condense * inverse
    turn_i, turn_o = turns * i.spread, turns * o.spread
    apart = o.z2 - i.z2
    # Neither grazes more than the other did: only what rounding takes below 0 needs a limit.
    z2_i = i.z2 + turn_i * (apart + (1.0 - turn_i) * x2)
    z2_o = o.z2 + turn_o * ((1.0 - turn_o) * x2 - apart)
    if least is not None:
        z2_i, z2_o = jnp.maximum(z2_i, least), jnp.maximum(z2_o, least)
    inverse_i, inverse_o = jax.lax.rsqrt(z2_i), jax.lax.rsqrt(z2_o)
    z_i, z_o = z2_i * inverse_i, z2_o * inverse_o
    kept = 1.0 - turn_i - turn_o
    M = z_i + z_o
    h2 = M * M + kept * kept * x2
    return MetalBetween(x2, base * inverse, M, h2, z_i, z_o, inverse_i, inverse_o)


@chunk
def metal_lobes(widths: Vec2, i: PreciseWay, o: PreciseWay, between: MetalBetween) -> Vec2:
    """D G / 4 of light that met the metal once, and of light that met it twice: two lobes at once."""
    base = widths * between.M
    size = blurred2(base, i.spread + o.spread)
    tail = one_coat.TAIL * (i.spread * i.spread + o.spread * o.spread)
    x = one_coat.RATIO * (size / (base * base + tail)) - one_coat.RATIO
    shapes = size / (size * size + between.x2 * (one_coat.middle(x) * size + (1.0 + x) * between.x2))
    hidden_i, hidden_o = (hidden_cosine(z, widths[0] * widths[0]) for z in (between.z_i, between.z_o))
    slope = between.h2 / between.M
    seen = between.z_i * between.z_o / (between.z_o * hidden_i + between.z_i * hidden_o)
    return ((0.5 / math.pi) * (slope * slope) * seen) * shapes


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
        bend = 1.0 - curve(interface.bend, interface.bend_high, s)
        beyond = curve(interface.passed, interface.passed_high, s) / eta
        return (
            s,
            z,
            jnp.stack([jnp.minimum(bend, 1.0), crossing.a, crossing.path * z, crossing.theta]),
            jnp.hstack([amount(rest, s), beyond]),
            amount(again, s),
        )

    NoW = cosines()
    s, z, bent, left, second = (np.asarray(a) for a in jax.vmap(follow)(jnp.asarray(NoW)))
    path = bent[:, 2] / z
    facet = at("facet", NoW, tilt)
    closed = np.asarray(jax.vmap(lambda c: rough_transmittance(c, eta, interface.gain))(jnp.asarray(facet))) / eta
    theta = np.linspace(0.0, bent[:, 3].max() * one_coat.DIRECT, len(NoW))
    cosine = np.linspace(0.98 * z.min(), 1.0, len(NoW))
    curves = {
        "passed": Curve(facet, closed, 1.0 / closed),
        "bent": Curve(s, bent, np.broadcast_to(1.0 / bent.max(0), bent.shape)),
        "rest": Curve(s, left),
        "again": Curve(s, second),
        "reflectance": reflectance_curve(base, cosine, 6),
    }
    if coat.tau is not None:
        root = np.squeeze(np.asarray(spread_root(theta[:, None], jnp.asarray(coat.tau))))
        curves |= {
            "absorbing": Curve(theta, np.squeeze(2.0 * np.asarray(coat.tau) / (1.0 + root)), 1.0, 5),
            "unspread": Curve(theta, 1.0 / root, 1.0, 5),
        }
        tau = np.asarray(coat.tau)
        longest = max(1.0 / z.min(), path.max()) - 1.0
        beyond = np.linspace(0.0, 2.0 * longest * tau.max(), len(NoW))
        if (kept := left_curve(beyond, np.add.outer(beyond, 2.0 * tau))) is not None:
            curves["left"] = kept
    lowest = z.min() ** 2
    least = None if lowest > 10.0 * one_coat.LEAST_Z2 else jnp.asarray(min(one_coat.LEAST_Z2, lowest))
    there = presence(eta)
    ahead = 0.5 / math.pi * (1.0 - jnp.minimum(base.width, 1.0))

    def build(p: Any) -> PreciseMetal:
        absorption = {"absorbing": None, "unspread": None, "left": None}
        return PreciseMetal(
            coat=coat,
            tilt=tilt,
            widths=jnp.stack([base.width, wider(base.width, coat.width)]),
            least=least,
            condense=one_coat.CONDENSE * there,
            rise=one_coat.RISE * there * coat.alpha * coat.alpha,
            ahead=ahead,
            name=name,
            **(absorption | p),
        )

    return Recipe(curves, build)
