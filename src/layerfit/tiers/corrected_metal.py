"""A coat over a metal in the corrected form, compact."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, member, safe_power, safe_sqrt, static, struct
from .._types import Colour, Scalar
from ..forms import corrected
from ..forms.crossing import cross
from ..layers import Coat
from ..optics.interface import steer
from .polynomial import Curve, Polynomial
from .surface import Compact, Recipe, cosines
from .top import coat_lobe, hidden_cosine

ORDERS = 3


@struct
class CorrectedWay:
    """One direction on its way through the coat's rough top."""

    NoW: Scalar = member("cosine above")
    sin2: Scalar = member("squared sine above")
    hidden: Scalar = member("NoW (1 + 2 Lambda) of the coat's facets")
    bend: Scalar = member("sine below over that above")
    z2: Scalar = member("squared cosine below")
    z: Scalar = member("cosine below")
    T: Scalar = member("energy that passes, over the index")
    width: Scalar = member("what the coat adds to the width of a lobe, to the power in which widths add")
    path: Scalar = member("path, in thicknesses")
    edge: Scalar = member("half of what leaves the escape cone")


@struct
class CorrectedMetal(Compact):
    """Coat and metal, and the curves of what lies under the coat."""

    coat: Coat
    tilt: Scalar
    """Turn of the mean facet towards a grazing direction."""
    passed: Polynomial
    """Of the cosine of the mean facet: energy over the index, and width."""
    refracted: Polynomial
    """Of the cosine: bend and path."""
    edge: Polynomial
    """Of the sine: half of what leaves the escape cone."""
    variance: Polynomial
    """Of the width that the coat adds: squared widths of the lobes, one an order."""
    reflectance: Polynomial
    """Of four times the squared half cosine below."""
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> CorrectedWay:
        return corrected_way(self.passed, self.refracted, self.edge, self.coat, self.tilt, NoW)

    def meet(self, i: CorrectedWay, o: CorrectedWay, lean2: Scalar) -> Colour:
        return corrected_meet(self.variance, self.reflectance, self.coat, i, o, lean2)


@chunk
def corrected_way(
    passed: Polynomial, refracted: Polynomial, edge: Polynomial, coat: Coat, tilt: Scalar, NoW: Scalar
) -> CorrectedWay:
    """Follow one direction into the coat."""
    NoW2 = NoW * NoW
    sin2 = 1.0 - NoW2
    energy = passed(jnp.sqrt(tilt + (1.0 - tilt) * NoW2))
    below = refracted(NoW)
    T, width = energy[0], energy[1]
    bend, path = below[0], below[1]
    z2 = 1.0 - bend * bend * sin2
    leaves = edge(safe_sqrt(sin2))
    hidden = hidden_cosine(NoW, coat.alpha * coat.alpha)
    return CorrectedWay(NoW, sin2, hidden, bend, z2, jnp.sqrt(z2), T, width, path, leaves)


@chunk
def corrected_meet(
    variance: Polynomial, reflectance: Polynomial, coat: Coat, i: CorrectedWay, o: CorrectedWay, lean2: Scalar
) -> Colour:
    """BRDF [1/sr] of two directions: the coat's top, and three lobes of the metal."""
    top = coat_lobe(coat, i.NoW, o.NoW, i.hidden, o.hidden, lean2)
    turned = i.bend - o.bend
    x2 = i.bend * o.bend * lean2 + turned * (i.bend * i.sin2 - o.bend * o.sin2)
    M = i.z + o.z
    M2 = M * M
    h2 = M2 + x2
    F = reflectance(h2)
    A = F if coat.tau is None else F * jnp.exp(-(coat.tau * (i.path + o.path)))
    R = 1.0 - 0.5 * coat.eta * (i.T + o.T)
    q = A * (R + (1.0 - R) * (i.edge + o.edge))
    a2 = variance(i.width + o.width)
    # D V of the three lobes at once: a vector of them, not a colour.
    flat = 1.0 - a2
    e = x2 + a2 * M2
    hidden = o.z * jnp.sqrt(a2 + flat * i.z2) + i.z * jnp.sqrt(a2 + flat * o.z2)
    lobes = a2 / (e * e * hidden)
    series = lobes[0] + q * (lobes[1] + q * lobes[2] / (1.0 - q))
    return top + (i.T * o.T * (0.5 / math.pi) * (h2 * h2)) * A * series


def recipe(prepared: corrected.Prepared, name: str) -> Recipe:
    """The curves of a prepared material, in double precision."""
    coat: Any = prepared.coats[0]
    interface, base = prepared.interfaces[0], prepared.base
    eta, tilt = coat.eta, interface.tilt

    def follow(NoW: Any) -> Any:
        w = jnp.stack([jnp.sqrt((1.0 - NoW) * (1.0 + NoW)), 0.0 * NoW, NoW])
        crossing = cross(interface, coat, w, w)
        steered = steer(crossing.w, corrected.DIRECTIONAL_SHARE * crossing.drift)
        p = corrected.WIDTH_POWER["ggx"]
        width = safe_power(crossing.spread, p) * safe_power(coat.width, p)
        path = 1.0 / crossing.w[2] + corrected.DIRECTIONAL_SHARE * crossing.lengthening
        edge = 0.5 * corrected.edge_reflection(w[0], crossing.w[2], interface.n, base.width)
        return (
            jnp.stack([jnp.sqrt((1.0 - steered[2]) * (1.0 + steered[2])) / w[0], width, crossing.T / eta, path]),
            edge,
            steered[2],
        )

    NoW = cosines()
    below, edge, z = (np.asarray(a) for a in jax.vmap(follow)(jnp.asarray(NoW)))
    facet = np.sqrt(tilt + (1.0 - tilt) * NoW**2)
    width = np.linspace(2.0 * below[:, 1].min(), 2.0 * below[:, 1].max(), len(NoW))
    p = corrected.WIDTH_POWER["ggx"]
    own, add = base.width**p, coat.width**p
    grown = [np.minimum((width + k * own + (k - 1) * add) ** (1.0 / p), corrected.WIDEST) ** 2 for k in range(1, ORDERS + 1)]
    cosine = np.linspace(float(z.min()), 1.0, len(NoW))
    F = np.asarray(jax.vmap(base.reflectance)(jnp.asarray(cosine)))
    sine = np.sqrt(1.0 - NoW**2)
    curves = {
        "passed": Curve(facet, below[:, [2, 1]], 1.0 / below[:, [2, 1]]),
        "refracted": Curve(NoW, below[:, [0, 3]], 1.0 / below[:, [0, 3]]),
        "edge": Curve(sine, edge),
        "variance": Curve(width, np.stack(grown, -1), 1.0 / np.stack(grown, -1), 4),
        "reflectance": Curve(4.0 * cosine**2, F, 1.0 / F, 6),
    }

    def build(fitted: Any) -> CorrectedMetal:
        return CorrectedMetal(coat, tilt, **fitted, name=name)

    return Recipe(curves, build)
