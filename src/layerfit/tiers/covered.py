"""A boundary with a lobe below coats in the corrected form, compact: what a metal, flakes, or the top of a second coat send back.

Both directions meet it, each by its own curves, and it sends back three lobes.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, divide, dot, member, safe_sqrt, static, struct
from .._types import Colour, Scalar, Vec2, Vec3
from ..forms import corrected
from ..forms.crossing import mean_width
from ..layers import Coat
from ..optics.interface import steer
from ..surfaces.flakes import FlakeLobe
from .polynomial import Curve, Polynomial
from .surface import argument, at, colour_of, half_root
from .top import filmed, left_curve, reflectance_curve

ORDERS = 3
MASKING = (1.14077, 0.0123766, 9.0)
"""Of `beckmann_hidden`: a, b and the largest t, where its error is smallest."""


@struct
class LobeWay:
    """One direction as it meets a boundary below coats."""

    sin2: Scalar = member("squared sine above the coats")
    bend: Scalar = member("sine below over that above")
    z2: Scalar = member("squared cosine below")
    z: Scalar = member("cosine below")
    T: Colour = member("energy that comes there, over the index")
    width: Scalar = member("what the coats add to the width of a lobe, to the power in which widths add")
    path: Scalar = member("path in the coat above, in thicknesses, where it absorbs")
    R: Colour = member("part of the light that is sent back down")
    edge: Scalar = member("half of what leaves the escape cone")


@struct
class Covered:
    """A boundary with a lobe below coats, and the curves of what it sends back."""

    passed: Polynomial
    """Of the cosine of the mean facet as -1 to 1: energy that comes there, over the index, and what the coats add to its width."""
    refracted: Polynomial
    """Of the cosine: bend, and path where the coat above absorbs."""
    edge: Polynomial
    """Of the sine: half of what leaves the escape cone."""
    back: Polynomial | None
    """Of the mean facet's too, as a polynomial of 0 to 1 is a sum of large terms: what two coats send back down; one coat sends back what does
    not pass."""
    variance: Polynomial
    """Of the width that the coats add: squared widths of the lobes, one an order; of Beckmann's what is more than its own."""
    reflectance: Polynomial
    """Of four times the squared half cosine below; of a film of the root of the half cosine."""
    left: Polynomial | None
    """Of the path there and back: what absorption leaves; None where no polynomial follows it."""
    own2: Scalar
    """Squared width of its facets."""
    n: Scalar
    """Index of the coat above."""
    tau: Colour | None
    """Optical depth of the coat above."""
    distribution: Literal["ggx", "beckmann"] = static(default="ggx")
    film: bool = static(default=False)

    def way(self, NoW: Scalar, tilt: Scalar) -> LobeWay:
        """Follow one direction there."""
        facet = 2.0 * argument("facet", NoW, tilt) - 1.0
        way = lobe_way(self.passed, self.refracted, self.edge, self.n, facet, NoW)
        return way if self.back is None else replace(way, R=self.back(facet))

    def meet(self, i: LobeWay, o: LobeWay, x2: Scalar, flake: "Tilted | None") -> Colour:
        """Its lobes [1/sr]; `x2` is the squared length of the sum of the directions' parts along the surface below the coats."""
        M = i.z + o.z
        M2 = M * M
        h2 = M2 + x2
        F = self.reflectance(half_root(h2) if self.film else h2)
        path = i.path + o.path
        A = F if self.tau is None else F * (jnp.exp(-self.tau * path) if self.left is None else self.left(path))
        R = 0.5 * (i.R + o.R)
        q = A * (R + (1.0 - R) * (i.edge + o.edge))
        a2 = self.variance(i.width + o.width)
        if self.distribution == "ggx":
            lobes = ggx_lobes(a2, i, o, M2, x2)
        elif flake is None:
            lobes = beckmann_lobes(self.own2 + a2, self.own2 + a2, i, o, M2, x2 / M2)
        else:
            apart = flake.sum / M - flake.tilt
            lobes = beckmann_lobes(flake.alpha2 + a2, self.own2 + a2, i, o, M2, dot(apart, apart))
        series = lobes[0] + q * (lobes[1] + q * lobes[2] / (1.0 - q))
        return (i.T * o.T * (0.5 / math.pi) * (h2 * h2)) * A * series


@dataclass(frozen=True)
class Tilted:
    """The flake at a place, and where two directions stand to it: a plain record, so that nothing of it is printed."""

    tilt: Vec2
    alpha2: Scalar
    """Squared width of its facets, and of the tilts that are not drawn."""
    sum: Vec2
    """Of the parts of both directions along the surface, below the coats."""


@chunk
def lobe_way(
    passed: Polynomial,
    refracted: Polynomial,
    edge: Polynomial,
    n: Scalar,
    facet: Scalar,
    NoW: Scalar,
) -> LobeWay:
    """Follow one direction to a boundary below coats; `facet` is the cosine of the mean facet as -1 to 1."""
    sin2 = 1.0 - NoW * NoW
    energy = passed(facet)
    T, width = colour_of(energy), energy[-1]
    below = refracted(NoW)
    absorbs = jnp.ndim(below) > 0
    bend = below[0] if absorbs else below
    path = below[1] if absorbs else jnp.zeros_like(below)
    z2 = 1.0 - bend * bend * sin2
    leaves = edge(safe_sqrt(sin2))
    return LobeWay(sin2, bend, z2, jnp.sqrt(z2), T, width, path, 1.0 - n * T, leaves)


@chunk
def ggx_lobes(a2: Vec3, i: LobeWay, o: LobeWay, M2: Scalar, x2: Scalar) -> Vec3:
    """D V of three GGX lobes at once, over a factor that they share; a vector of lobes, not a colour."""
    flat = 1.0 - a2
    e = x2 + a2 * M2
    hidden = o.z * jnp.sqrt(a2 + flat * i.z2) + i.z * jnp.sqrt(a2 + flat * o.z2)
    return a2 / (e * e * hidden)


@chunk
def beckmann_lobes(own2: Vec3, all2: Vec3, i: LobeWay, o: LobeWay, M2: Scalar, slope2: Scalar) -> Vec3:
    """The same of Beckmann's: `own2` of the flake that is seen, `all2` of all that hide one another; `slope2` from its normal."""
    hidden = o.z * beckmann_hidden(all2, i.z2) + i.z * beckmann_hidden(all2, o.z2)
    return jnp.exp(-(slope2 / own2)) / (own2 * hidden * (M2 * M2))


@chunk
def beckmann_hidden(alpha2: Vec3, z2: Scalar) -> Vec3:
    """z (1 + 2 Lambda) of Beckmann facets, within 2.3e-5.

    With t = cot^2 / alpha^2 it is slope (sqrt(t) erf(sqrt(t)) + exp(-t) / sqrt(pi)), whose square is slope^2 (t + exp(-c t) / pi) with a c
    that hardly depends on t.
    """
    a, b, most = MASKING
    slope2 = alpha2 * (1.0 - z2)
    t = jnp.minimum(divide(z2, jnp.maximum(slope2, 1e-20)), most)
    return jnp.sqrt(z2 + (1.0 / math.pi) * slope2 * jnp.exp(-(t * (a - b * t))))


def crossed(below: Any, lobe: Any) -> dict[str, Any]:
    """What one direction is where it meets a lobe: `below` has it twice."""
    crossing = below.i
    steered = steer(crossing.w, corrected.DIRECTIONAL_SHARE * crossing.drift)
    sine = jnp.sqrt((1.0 - steered[2]) * (1.0 + steered[2]))
    return {
        "bend": sine / below.sin_i,
        "z": steered[2],
        "T": jnp.sqrt(below.throughput),
        "path": 1.0 / crossing.w[2] + corrected.DIRECTIONAL_SHARE * crossing.lengthening,
        "R": below.R_i,
        "edge": 0.5 * corrected.edge_reflection(below.sin_i, crossing.w[2], below.n, mean_width(lobe.width)),
        "width": 0.5 * jnp.asarray(corrected.spread_of(lobe, below)),
    }


def curves_of(
    met: dict[str, Any], below: corrected.Below, NoW: np.ndarray, tilt: Any, lobe: Any, coats: tuple[Coat, ...]
) -> tuple[dict[str, Curve], dict[str, Any]]:
    """The curves of one lobe, and the other fields of its `Covered`; `below` is any light that comes there."""
    depth = below.depth
    met = {key: np.asarray(value) for key, value in met.items()}
    above = coats[depth - 1]
    energy = np.column_stack([met["T"], met["width"]])
    refracted = met["bend"] if above.extinction is None else np.column_stack([met["bend"], met["path"]])
    width = np.linspace(2.0 * met["width"].min(), 2.0 * met["width"].max(), len(NoW))
    ggx = lobe.distribution == "ggx"
    own2 = np.square(np.asarray(lobe.width, float))
    widened = jax.vmap(
        lambda spread: jnp.stack([jnp.asarray(corrected.widened(lobe, k, below, spread)) for k in range(1, ORDERS + 1)])
    )
    grown = np.asarray(widened(jnp.asarray(width))) ** 2
    drawn = np.asarray(lobe.paint.sigma) ** 2 if isinstance(lobe, FlakeLobe) else 0.0  # near by, the lobe has the rest alone
    cosine = np.linspace(0.98 * float(met["z"].min()), 1.0, len(NoW))
    curves = {
        "passed": Curve(2.0 * at("facet", NoW, tilt) - 1.0, energy, 1.0 / energy),
        "refracted": Curve(NoW, refracted, 1.0 / refracted),
        "edge": Curve(np.sqrt(1.0 - NoW**2), met["edge"]),
        "variance": Curve(width, grown if ggx else grown - own2, 1.0 / (grown - drawn), 6),
        "reflectance": reflectance_curve(lobe, cosine, 6),
    }
    if above.extinction is not None:
        path = np.linspace(2.0 * met["path"].min(), 2.0 * met["path"].max(), len(NoW))
        if (left := left_curve(path, np.multiply.outer(path, np.asarray(above.extinction)))) is not None:
            curves["left"] = left
    if depth > 1:
        curves["back"] = Curve(curves["passed"].x, met["R"])
    n = float(np.prod([float(coat.eta) for coat in coats[:depth]]))
    rest = {"own2": own2, "n": jnp.asarray(n), "tau": above.extinction, "distribution": lobe.distribution, "film": filmed(lobe)}
    rest |= {"back": None, "left": None}  # where they have no curve
    return curves, rest
