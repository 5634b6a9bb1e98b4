"""A coat over a metal or a diffuse base in the faithful form, compact.

Its rays bend about one half vector for all layers, so that what lies under the coat needs no curves but one: a metal's reflectance. The
rest is the form itself in cosines, with what coat and base share computed once.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, divide, member, static, struct, where
from .._types import Colour, Flag, Scalar
from ..forms import faithful
from ..layers import Coat
from .polynomial import Curve, Polynomial
from .surface import Compact, Recipe
from .top import facet_of, hidden_cosine


@struct
class FaithfulWay:
    """One direction above the coat."""

    NoW: Scalar = member("cosine")
    hidden: Scalar = member("NoW (1 + 2 Lambda) of the coat's facets")


@struct
class FaithfulTop:
    """What a facet of the coat does, and all facets of it together."""

    reflected: Scalar = member("BRDF of the coat's top [1/sr]")
    left: Scalar = member("part of the light that passes a facet twice, and what facets hide")
    turn: Scalar = member("what bending about the half vector adds to both cosines")
    s2: Scalar = member("squared length of the sum of the directions: four times the squared half cosine")


@struct
class FaithfulUnderCoat(Compact):
    """Coat, base, and the curve of what a metal reflects under the coat."""

    coat: Coat
    alpha2: Scalar | None
    """Squared width of a metal; None over a diffuse base."""
    reflectance: Polynomial | None
    """Of four times the squared half cosine above: a metal's reflectance."""
    radiance: Colour | None
    """What a diffuse base sends back [1/sr]."""
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> FaithfulWay:
        return way_in(self.coat, NoW)

    def meet(self, i: FaithfulWay, o: FaithfulWay, lean2: Scalar, lit: Flag) -> Colour:
        top = faithful_top(self.coat, i, o, lean2)
        inverse = 1.0 / self.coat.eta
        z_i, z_o = i.NoW * inverse + top.turn, o.NoW * inverse + top.turn
        rest: Any = top.left
        if self.alpha2 is not None and self.reflectance is not None:
            M = i.NoW + o.NoW
            rest = self.reflectance(top.s2) * (rest * faithful_lobe(self.alpha2, top.s2, M, lean2, z_i, z_o))
        else:
            rest = self.radiance * rest
        if self.coat.tau is not None:
            rest = rest * jnp.exp(-self.coat.tau * ((z_i + z_o) / (z_i * z_o)))
        f = top.reflected + rest
        return where(lit, where(jnp.minimum(z_i, z_o) > 0.0, f, top.reflected), 0.0)


def way_in(coat: Coat, NoW: Scalar) -> FaithfulWay:
    """What one direction meets above the coat."""
    return FaithfulWay(NoW, hidden_cosine(NoW, coat.alpha * coat.alpha))


@chunk
def faithful_top(coat: Coat, i: FaithfulWay, o: FaithfulWay, lean2: Scalar) -> FaithfulTop:
    """The coat's top and the way through it: `fresnel_dielectric`, `ggx_d`, `v_smith` and `refract_about_facet` of one half vector."""
    M = i.NoW + o.NoW
    M2 = M * M
    s2 = lean2 + M2
    quarter = 0.25 * s2
    delta = (coat.eta - 1.0) * (coat.eta + 1.0)
    facet = facet_of(coat.eta, quarter)
    F = divide(facet.reflected * (0.5 * delta * delta), facet.product * facet.product)
    a2 = coat.alpha * coat.alpha
    narrow = s2 / (lean2 + a2 * M2)
    V = 0.5 / (o.NoW * i.hidden + i.NoW * o.hidden)
    G = 4.0 * i.NoW * o.NoW * V
    turn = (facet.cg / quarter - 1.0) * (0.5 / coat.eta) * M
    return FaithfulTop(F * V * (a2 / math.pi) * (narrow * narrow), (1.0 - F) * (1.0 - G * F), turn, s2)


@chunk
def faithful_lobe(alpha2: Scalar, s2: Scalar, M: Scalar, lean2: Scalar, z_i: Scalar, z_o: Scalar) -> Scalar:
    """D V of the metal about the same half vector: `ggx_d` and `v_smith`."""
    narrow = s2 / (lean2 + alpha2 * (M * M))
    hidden_i, hidden_o = hidden_cosine(z_i, alpha2), hidden_cosine(z_o, alpha2)
    return alpha2 * (0.5 / math.pi) * (narrow * narrow) / (z_o * hidden_i + z_i * hidden_o)


def recipe(prepared: faithful.Prepared, name: str) -> Recipe:
    """The curve of a prepared material, in double precision."""
    (coat,), base = prepared.coats, prepared.base
    if not base.lobes:
        radiance = base.albedo / math.pi
        return Recipe({}, lambda fitted: FaithfulUnderCoat(coat, None, None, radiance, name=name))
    s2 = 2.0 * (1.0 - np.cos(np.linspace(0.0, np.pi, 400)))
    below = np.sqrt(np.asarray(coat.eta) ** 2 - 1.0 + 0.25 * s2) / np.asarray(coat.eta)
    F = np.asarray(jax.vmap(base.reflectance)(jnp.asarray(below)))
    curves = {"reflectance": Curve(s2, F, 1.0 / F, 8)}
    return Recipe(
        curves, lambda fitted: FaithfulUnderCoat(coat, base.width * base.width, fitted["reflectance"], None, name=name)
    )
