"""One coat or two over a base in the corrected form, compact: metals, flakes, films and diffuse bases.

Below the top every boundary with a lobe is met by both directions, each by its own curves, and sends back three lobes; light that lost
its direction is a product of what happens to each.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, divide, dot, member, safe_sqrt, static, struct
from .._place import Place
from .._types import Colour, Scalar, Vec2, Vec3
from ..forms import corrected
from ..forms.crossing import mean_width
from ..layers import Coat
from ..optics.flakes import flake_tilt, kept_tilt, lost_variance
from ..optics.interface import steer
from ..surfaces import Conductor, Flakes, Lambert
from ..surfaces.base import Surface
from ..surfaces.flakes import FlakeLobe
from .polynomial import Curve, Polynomial
from .surface import Argument, Compact, Recipe, argument, at, best_argument, colour_of, cosines, half_root
from .top import coat_lobe, filmed, hidden_cosine, left_curve, reflectance_curve

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
        A = F if self.tau is None else F * (jnp.exp(-(self.tau * path)) if self.left is None else self.left(path))
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


@struct
class CorrectedStack(Compact):
    """Coats and base, and the curves of what lies under the top."""

    coat: Coat
    tilt: Scalar
    """Turn of the mean facet towards a grazing direction."""
    inner: Covered | None
    """The top of a second coat."""
    base: Covered | None
    """The lobe of the base."""
    through: Polynomial | None
    """Of the root of the mean facet's cosine: energy that comes to a base without a lobe, over the index."""
    lambertian: Polynomial | None
    """Of `argument`: square root of what leaves of light that lost its direction, over the energy that comes to the base."""
    flakes: Flakes | None
    """Where the base is flakes: which, and how they are tilted."""
    argument: Argument = static(default="cosine")
    name: str = static(default="material")
    note: str = static(default="")

    averages = True
    """Where there is no place it is seen as it is in the mean."""

    @property
    def reads(self) -> tuple[str, ...]:
        """What it needs to know of a place of the surface."""
        return () if self.flakes is None else self.flakes.reads

    @property
    def by_cosines(self) -> bool:
        """A flake lies along the surface, for which a frame is needed."""
        return self.flakes is None

    def way(self, NoW: Scalar) -> Any:
        hidden = hidden_cosine(NoW, self.coat.alpha * self.coat.alpha)
        lobes = [None if covered is None else covered.way(NoW, self.tilt) for covered in (self.inner, self.base)]
        if self.lambertian is None:
            return NoW, hidden, lobes, None
        left = self.lambertian(argument(self.argument, NoW, self.tilt))
        if self.through is not None:
            return NoW, hidden, lobes, self.through(argument("root", NoW, self.tilt)) * left
        there = lobes[1]
        assert there is not None
        return NoW, hidden, lobes, there.T * left

    def meet(self, i: Any, o: Any, lean2: Scalar) -> Colour:
        return self.met(i, o, lean2, None)

    def evaluate(self, wi: Vec3, wo: Vec3) -> Colour:
        if self.flakes is None:
            return super().evaluate(wi, wo)
        nothing = jnp.zeros_like(self.tilt)
        return FlakesBelow(self, jnp.stack([nothing, nothing]), nothing + 1.0).evaluate(wi, wo)

    def at(self, place: Place) -> Surface:
        """The flake at a place of the surface, below the coats."""
        flakes = self.flakes
        assert flakes is not None
        kept = kept_tilt(place.distance, flakes.half_distance)
        tilt = flake_tilt(place.uv, flakes.per_uv, flakes.sigma * kept, flakes.seed.astype(jnp.uint32))
        return FlakesBelow(self, tilt, lost_variance(place.distance, flakes.half_distance))

    def met(self, i: Any, o: Any, lean2: Scalar, flake: Callable[[LobeWay, LobeWay], Tilted] | None) -> Colour:
        """`meet`, of the flake at a place."""
        NoL, hidden_l, lobes_i, diffuse_i = i
        NoV, hidden_v, lobes_o, diffuse_o = o
        f: Any = coat_lobe(self.coat, NoL, NoV, hidden_l, hidden_v, lean2)
        for covered, at_i, at_o in zip((self.inner, self.base), lobes_i, lobes_o, strict=True):
            if covered is None:
                continue
            if flake is not None and covered is self.base:
                tilted = flake(at_i, at_o)
                f = f + covered.meet(at_i, at_o, dot(tilted.sum, tilted.sum), tilted)
            else:
                turned = at_i.bend - at_o.bend
                x2 = at_i.bend * at_o.bend * lean2 + turned * (at_i.bend * at_i.sin2 - at_o.bend * at_o.sin2)
                f = f + covered.meet(at_i, at_o, x2, None)
        return f if self.lambertian is None else f + diffuse_i * diffuse_o


@dataclass(frozen=True)
class FlakesBelow(Surface):
    """One flake below coats, or in the mean all of them, and what else is there."""

    made: CorrectedStack
    tilt: Vec2
    lost: Scalar
    """Part of the variance of tilts that is not drawn."""

    def evaluate(self, wi: Vec3, wo: Vec3) -> Colour:
        """BRDF [1/sr] of directions in the frame of the surface."""
        flakes = self.made.flakes
        assert flakes is not None
        alpha2 = flakes.alpha * flakes.alpha + self.lost * (flakes.sigma * flakes.sigma)
        lean = wi[:2] + wo[:2]

        def flake(i: LobeWay, o: LobeWay) -> Tilted:
            return Tilted(self.tilt, alpha2, i.bend * wi[:2] + o.bend * wo[:2])

        return self.made.met(self.made.way(wi[2]), self.made.way(wo[2]), dot(lean, lean), flake)


def refuses(stack: Any) -> str | None:
    """Why a stack of coats that are all plain is not of this kind, or None."""
    base = stack.base
    if len(stack.layers) > 2:
        return "it has more than two coats"
    if stack.layers[0].has_film:
        return f"{stack.layers[0].name} has a film, over more than a diffuse base"
    if len(base.lobes) > 1 or (not isinstance(base, Conductor | Flakes) and base.lobes):
        return f"{base.name} is neither diffuse, flakes nor a metal"
    if base.diffuse is not None and not isinstance(base.diffuse, Lambert):
        return f"{base.name} is not the same from all sides"
    if isinstance(base, Conductor) and (isinstance(base.width, tuple) or base.masking != "smith"):
        return f"{base.name} is not isotropic, or its facets hide one another otherwise than Smith's"
    if isinstance(base, Flakes) and base.lost != "roughness":
        return f"{base.name} lose what distance takes"
    return None


def recipe(prepared: corrected.Prepared, name: str) -> Recipe:
    """The curves of a prepared material, in double precision."""
    coats, base = prepared.coats, prepared.base
    lobes = {"inner": (1, coats[1])} if len(coats) == 2 else {}
    lobes |= {"base": (len(coats), base.lobes[0])} if base.lobes else {}
    # The top of a coat that matches the index above sends nothing back.
    c = jnp.linspace(0.0, 1.0, 50)
    lobes = {key: (depth, lobe) for key, (depth, lobe) in lobes.items() if np.any(jax.vmap(lobe.reflectance)(c) > 0.0)}
    NoW, tilt = cosines(), prepared.interfaces[0].tilt
    w = jnp.stack([jnp.sqrt((1.0 - NoW) * (1.0 + NoW)), 0.0 * NoW, NoW], -1)

    def down(w: Any, depth: int) -> Any:
        below = None
        for _ in range(depth):
            below = corrected.enter(below, w, w, prepared, corrected.Corrected())
        return below

    curves: dict[str, Curve] = {}
    fixed: dict[str, Any] = {}
    for key, (depth, lobe) in lobes.items():
        met = jax.vmap(lambda w, depth=depth, lobe=lobe: _met(down(w, depth), lobe))(w)
        found, fixed[key] = _covered(met, down(w[0], depth), NoW, tilt, lobe, coats)
        curves |= {f"{key}.{part}": curve for part, curve in found.items()}
    x: Argument = "cosine"
    if base.diffuse is not None:
        parts = jax.vmap(lambda w: (corrected.diffuse_part(prepared, below := down(w, len(coats))), below.throughput))(w)
        left, T = (np.sqrt(np.asarray(part)) for part in parts)
        if "base" not in lobes:
            curves["through"] = Curve(at("root", NoW, tilt), T, 1.0 / T)
        left = left / (T if left.ndim == T.ndim else T[:, None])
        weight = np.broadcast_to(1.0 / np.maximum(left.max(0), 1e-6), left.shape)
        x = best_argument(NoW, tilt, left, weight)
        curves["lambertian"] = Curve(at(x, NoW, tilt), left, weight)
    flakes = replace(base, eta=None, k=None, coverage=None, albedo=None) if isinstance(base, Flakes) else None

    def build(fitted: Any) -> CorrectedStack:
        parts = {
            key: Covered(
                **(
                    {"back": None, "left": None}
                    | {part: fitted[f"{key}.{part}"] for part in _PARTS if f"{key}.{part}" in fitted}
                ),
                **rest,
            )
            for key, rest in fixed.items()
        }
        return CorrectedStack(
            coats[0],
            tilt,
            parts.get("inner"),
            parts.get("base"),
            fitted.get("through"),
            fitted.get("lambertian"),
            flakes,
            argument=x,
            name=name,
        )

    return Recipe(curves, build)


_PARTS = ("passed", "refracted", "edge", "back", "variance", "reflectance", "left")


def _met(below: Any, lobe: Any) -> dict[str, Any]:
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


def _covered(
    met: dict[str, Any], below: corrected.Below, NoW: np.ndarray, tilt: Any, lobe: Any, coats: tuple[Coat, ...]
) -> tuple[dict[str, Curve], dict[str, Any]]:
    """The curves of one lobe, and its other fields; `below` is any light that comes there."""
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
    return curves, rest
