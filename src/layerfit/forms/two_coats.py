"""Two coats over a base, in the precise form: to the base both tops are one, whose curves are composed.

The light crosses the top of the outer coat, then the inner coat's: each is read from the tables, the second at the directions that the first
sends on. Where the inner coat is the rarer one, light that enters it goes the way of light that leaves it, turned round. Both give
one curve of bend, spread, path and energy over the cosine above, so that evaluation is that of one coat, done twice:
the inner coat's top is a base below the outer coat, and the base is one below both. Light that goes to and fro between the tops adds
up to the energy that passes. Reciprocal by construction, and no constant is fitted.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._chunk import chunk, clip, dot, safe_sqrt, struct, where
from .._types import Colour, Direction, Scalar
from ..layers import Coat
from ..optics.directions import along, direction
from . import one_coat, tables
from .bounces import Curve, amount, bounces, cells_of
from .curves import (
    Interface,
    Nodes,
    absorbed,
    bake,
    blurred,
    curve,
    depth,
    diffuse_return,
    gauss,
    interpolated,
    parts,
    polynomial,
    presence,
    smaller,
    spread_root,
)
from .one_coat import DIRECT, Crossing, between, lean, pass_interface, split
from .tables import Kind

HELD = ("top", "both", "passed", "inner_again", "inner_rest", "returned", "again", "rest")
"""Parts of a prepared material that a shader holds as constants, also where its other numbers can be set."""

WIDEST_SINE = 0.9998
"""Of light on the rarer side of a boundary that came from the denser one."""

STEEPEST = 30.0
"""Largest factor by which refraction stretches the spread of a path."""

LONGEST = 8.0
"""Of what the spread of the light adds to its path, in thicknesses."""


@struct
class Prepared:
    """Both coats and the base with relative indices, what both tops do, and what goes to and fro below them."""

    coats: tuple[Coat, Coat]
    top: Interface
    """Of the outer coat."""
    both: Interface
    """Of the way from above to the inner coat's medium; its energy is that of the outer coat's top."""
    passed: Curve
    """Energy that the inner coat's top passes of what the outer's did, what comes back to it included."""
    inner_again: Curve
    """Of the inner coat's top: weight of the wider lobe of light that met it twice, as a factor of light and of view."""
    inner_rest: Curve
    """Of the inner coat's top: fourth root of the light that is left."""
    base: Any
    returned: Colour | None
    """Part of diffuse light that returns from both coats, for a diffuse base."""
    again: Curve | None
    rest: Curve | None


@dataclasses.dataclass(frozen=True)
class _Top:
    """One rough boundary as it was baked, for light from its rarer side."""

    interface: Interface
    nodes: Nodes
    eta: Scalar
    """Index of the denser side over that of the rarer."""
    alpha: Scalar

    @property
    def edge(self) -> Scalar:
        """Cosine at the edge of total reflection."""
        return safe_sqrt((self.eta - 1.0) * (self.eta + 1.0)) / self.eta

    def passes(self, w: Direction) -> Crossing:
        return pass_interface(self.interface, self.eta, self.alpha, w)

    def turns(self, s: Float[Array, " m"]) -> Float[Array, " m"]:
        """Sine below over that at a smooth boundary, beyond 1, for light that the curves' argument s belongs to."""
        assert self.nodes.turn is not None
        low, high = parts(polynomial(jnp.asarray(self.nodes.turn)))
        return jnp.minimum(jax.vmap(lambda s: curve(low, high, s))(s), self.eta - 1.0)

    def reflects(self, z: Float[Array, " k"]) -> Float[Array, " k"]:
        """Energy that is reflected of light from the denser side at cosines z: straight lines between all nodes at which it is known."""
        edge = self.edge
        cosines, widths = gauss(edge)
        known = jnp.concatenate([cells_of(edge), cosines])
        R = jnp.concatenate([jnp.asarray(self.nodes.R), self.nodes.weights / jnp.maximum(2.0 * cosines * widths, 1e-12)])
        order = jnp.argsort(known)
        return interpolated(z, known[order], R[order])


def prepare(outer: Coat, inner: Coat, base: Any, kind: Kind) -> Prepared:
    """Look up what both tops do, compose it and bake it."""
    n1, n2 = outer.eta, inner.eta
    step = jnp.maximum(n2 / n1, n1 / n2)
    first = _Top(*bake(n1, outer.alpha, kind), n1, outer.alpha)
    second = _Top(*bake(step, inner.alpha, kind), step, inner.alpha)
    coats = outer.below(jnp.ones_like(n1)), inner.below(n1)
    boundary = dataclasses.replace(coats[1], tau=None)
    inner_again, inner_rest = bounces(first.nodes, outer.alpha, coats[0], boundary)
    base = base.below(n2)
    way = _way(first, second, coats)
    both = _composed(first, second, way, n2)
    passed, returned, again, rest = _over_colours(first, second, coats, base, way)
    return Prepared(coats, first.interface, both, passed, inner_again, inner_rest, base, returned, again, rest)


def evaluate(prepared: Prepared, wi: Direction, wo: Direction) -> Colour:
    """BRDF [1/sr] of unit directions above the surface."""
    return prepared.coats[0].evaluate(wi, wo) + below(prepared, wi, wo)


def below(prepared: Prepared, wi: Direction, wo: Direction) -> Colour:
    """Light from below the outer coat's top [1/sr]."""
    p = prepared
    outer, inner = p.coats
    i1, o1 = (pass_interface(p.top, outer.eta, outer.alpha, w) for w in (wi, wo))
    i, o = (pass_interface(p.both, outer.eta, jnp.ones_like(outer.eta), w) for w in (wi, wo))
    upper = one_coat.Prepared(outer, p.top, inner, None, p.inner_again, p.inner_rest)
    lower = one_coat.Prepared(joined(outer, inner), p.both, p.base, p.returned, p.again, p.rest)
    kept = amount(p.passed, i.s) * amount(p.passed, o.s)
    if outer.tau is not None:
        kept = kept * absorbed_above(i1, o1, i, o, p)
    return one_coat.below(i1, o1, upper) + kept * one_coat.below(i, o, lower)


def joined(outer: Coat, inner: Coat) -> Coat:
    """The inner coat as if it were the only one: its medium under both tops, the lower of which fades where the indices match."""
    there = presence(jnp.maximum(inner.eta, 1.0 / inner.eta))
    alpha = outer.alpha + there * (inner.alpha - outer.alpha)
    return dataclasses.replace(inner, eta=outer.eta * inner.eta, alpha=alpha)


def absorbed_above(i1: Crossing, o1: Crossing, i: Crossing, o: Crossing, prepared: Prepared) -> Colour:
    """What the outer coat leaves of light on its way to the base and back."""
    (outer, inner), base = prepared.coats, prepared.base
    if not base.lobes:
        return absorbed(i1.path, i1.theta, outer.tau) * absorbed(o1.path, o1.theta, outer.tau)
    there, shares = presence(outer.eta * inner.eta), split(i, o, base.alpha)
    part = DIRECT * shares.base
    left: Any = 0.0
    for x, x1, share in ((i, i1, shares.i), (o, o1, shares.o)):
        y = upwards(lean(x, i, o, there * share), inner.eta)
        left = left + depth(between(y, x1, part), spread_root(part * x1.theta, outer.tau), outer.tau)
    return jnp.exp(-left)


@chunk
def upwards(w: Direction, eta: Scalar) -> Direction:
    """A direction below a smooth boundary, as it is above it; `eta` is the index below over that above."""
    part = eta * along(w)
    sine = safe_sqrt(dot(part, part))
    held = jnp.minimum(1.0, WIDEST_SINE / jnp.maximum(sine, 1e-6))
    sine = jnp.minimum(sine, WIDEST_SINE)
    return direction(part * held, safe_sqrt((1.0 - sine) * (1.0 + sine)))


def _way(first: _Top, second: _Top, coats: tuple[Coat, Coat]) -> tuple[Float[Array, "m 3"], Crossing, Crossing, Crossing]:
    """At the cosines of the tables: directions above, through the first top, through the second, through both."""
    mu = jnp.asarray(np.minimum(tables.load("single").mu, 1.0 - 1e-6), first.eta.dtype)
    w = _directions(mu)
    a = jax.vmap(first.passes)(w)
    b = jax.vmap(lambda w: _into(second, coats[1].eta, w))(a.w)
    return w, a, b, jax.vmap(lambda a, b: _after(a, b, coats[1].eta))(a, b)


def _directions(z: Float[Array, " m"]) -> Float[Array, "m 3"]:
    return jnp.stack([safe_sqrt((1.0 - z) * (1.0 + z)), jnp.zeros_like(z), z], -1)


def _into(top: _Top, eta: Scalar, w: Direction) -> Crossing:
    """Follow one direction of the outer coat into the inner one, whose index is `eta` of that coat's."""
    down = top.passes(w)
    # From the denser side the way of light from the rarer one, turned round: its direction is above, its spreads are as much wider.
    w2 = upwards(w, top.eta)
    up = top.passes(w2)
    widens = top.eta * top.eta * steepness(w2[-1]) / steepness(up.w[-1])
    path = 1.0 / w2[-1] + widens * (up.path - 1.0 / up.w[-1])
    theta = up.theta * jnp.minimum(widens, STEEPEST)
    turned = Crossing(w2, up.T, top.eta * up.a, jnp.minimum(path, STEEPEST), theta, up.s, w)
    return jax.tree.map(lambda x, y: where(eta >= 1.0, x, y), down, turned)


def steepness(z: Scalar) -> Scalar:
    """How much the mean path 1 / z of light grows with the spread of its slopes: half the Laplacian of 1 / z over its projection."""
    return 0.5 * (1.0 / z**3 + (3.0 - 2.0 * z * z) / z**5)


def _after(a: Crossing, b: Crossing, eta: Scalar) -> Crossing:
    """One crossing after the other: the spread of the first, as it is refracted, adds to that of the second."""
    k = jnp.minimum(steepness(b.w[-1]) / steepness(a.w[-1]) / (eta * eta), STEEPEST)
    before = (a.path - 1.0 / a.w[-1]) * k
    own = jnp.maximum(b.path - 1.0 / b.w[-1], 0.0)
    theta = (own * b.theta + before * a.theta * k) / jnp.maximum(own + before, 1e-6)
    path = 1.0 / b.w[-1] + held(own + before)
    return Crossing(b.w, a.T, blurred(a.a / eta, b.a), path, held(theta), a.s, a.air)


def held(x: Scalar) -> Scalar:
    """A part of the path or its scale, bounded: what is of second order in the spread has no meaning where it is long."""
    return x / jnp.sqrt(1.0 + (x / LONGEST) ** 2)


def _composed(first: _Top, second: _Top, way: tuple[Any, Crossing, Crossing, Crossing], n: Scalar) -> Interface:
    """Curves of the whole way to the medium of index n, to be read like those of one top: for the outer coat's index and a width of 1."""
    w, a, b, x = way
    # What both add to Snell's law: as the ratio of two sines it would have no digits where n is that of air.
    turn_a, turn_b = first.turns(a.s), second.turns(b.s)
    # So is the sine in a rarer inner coat, and how far it is from that of light along the surface.
    sine, more = w[:, 0], (second.eta - first.eta) / first.eta
    past = more + (1.0 + more) * (turn_a * sine - w[:, 2] * w[:, 2] / (1.0 + sine))
    held = jnp.minimum((WIDEST_SINE - 1.0 - past) / (1.0 + past), 0.0)
    turn_b = where(n >= first.eta, turn_b, held)
    rows = {
        "bend": smaller(n, turn_a + turn_b + turn_a * turn_b),
        "spread": x.a,
        "path": x.path * x.w[:, 2],
        "theta": x.theta,
    }
    halves: dict[str, Any] = {}
    for name, row in rows.items():
        halves[name], halves[f"{name}_high"] = parts(polynomial(row))
    return dataclasses.replace(first.interface, **halves)


def _over_colours(
    first: _Top, second: _Top, coats: tuple[Coat, Coat], base: Any, way: Any
) -> tuple[Curve, Colour | None, Curve | None, Curve | None]:
    """What depends on absorption, colour by colour: energy that passes the inner top, and what goes to and fro below both."""
    taus = coats[0].tau, coats[1].tau
    metal = base if base.lobes else None
    given = taus, metal

    def one(taus: Any, metal: Any) -> Any:
        passed, nodes = _energies(first, second, coats, taus[0], way)
        if metal is None:
            return Curve(*polynomial(passed)), diffuse_return(nodes, taus[1]), None, None
        whole = dataclasses.replace(joined(*coats), tau=taus[1])
        again, rest = bounces(nodes, whole.alpha, whole, metal)
        return Curve(*polynomial(passed)), None, again, rest

    if all(jnp.ndim(value) == 0 for value in jax.tree.leaves(given)):
        return one(*given)
    colours = jax.tree.map(lambda value: 0 if jnp.ndim(value) else None, given)
    return jax.vmap(one, in_axes=colours)(*given)


def _energies(
    first: _Top, second: _Top, coats: tuple[Coat, Coat], tau: Scalar | None, way: Any
) -> tuple[Float[Array, " m"], Nodes]:
    """Energy that passes the inner top of what the outer did, and both tops as one for the light below; `tau` of the outer coat."""
    _, a, b, x = way
    once = jnp.ones_like(a.T) if tau is None else absorbed(a.path, a.theta, tau)
    twice = 1.0 if tau is None else jnp.exp(-2.0 * tau * a.path)
    passed = b.T / (1.0 - (1.0 - b.T) * first.reflects(a.w[:, 2]) * twice)
    whole = joined(*coats)
    edge = safe_sqrt((whole.eta - 1.0) * (whole.eta + 1.0)) / whole.eta
    cosines, widths = gauss(edge)
    from_below = lambda z: _reflected(first, second, coats, tau, z)  # noqa: E731
    weights = 2.0 * from_below(cosines) * cosines * widths
    nodes = Nodes(x.w[:, 2], None, a.T * passed * once, x.a, x.path, x.theta, from_below(cells_of(edge)), cosines, weights)
    return passed, nodes


def _reflected(
    first: _Top, second: _Top, coats: tuple[Coat, Coat], tau: Scalar | None, z: Float[Array, " k"]
) -> Float[Array, " k"]:
    """Energy that both tops reflect of light from below at cosines z: what goes to and fro between them summed."""
    eta = coats[1].eta
    sine = safe_sqrt((1.0 - z) * (1.0 + z)) * eta
    enters = sine < 1.0
    z1 = safe_sqrt(jnp.maximum((1.0 - sine) * (1.0 + sine), 1e-6))
    back = first.reflects(z1) * (1.0 if tau is None else jnp.exp(-2.0 * tau / z1))
    rarer = lambda z: jax.vmap(second.passes)(_directions(z)).T  # noqa: E731
    # Into the rarer outer coat, and out of it; or into the denser one.
    R = second.reflects(z)
    T = jnp.minimum(where(enters, rarer(z1), 0.0), 1.0 - R)
    up = R + T * T * back / jnp.maximum(1.0 - (1.0 - T) * back, 1e-3)
    T, R = rarer(z), second.reflects(z1)
    down = 1.0 - T + T * (1.0 - R) * back / jnp.maximum(1.0 - R * back, 1e-3)
    return clip(where(eta >= 1.0, up, down), 0.0, 1.0)
