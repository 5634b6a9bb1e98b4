"""One coat or two over a base in the corrected form, compact: metals, flakes, films and diffuse bases.

Below the top every boundary with a lobe is met by both directions, each by its own curves, and sends back three lobes; light that lost
its direction is a product of what happens to each.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import dot, static, struct, where
from .._place import Place
from .._types import Colour, Flag, Scalar, Vec2, Vec3
from ..forms import corrected
from ..layers import Coat
from ..optics.flakes import flake_tilt, kept_tilt, lost_variance
from ..surfaces import Conductor, Flakes, Lambert
from ..surfaces.base import Surface
from .covered import Covered, LobeWay, Tilted, crossed, curves_of
from .polynomial import Curve, Polynomial
from .surface import Argument, Compact, Recipe, argument, at, best_argument, cosines
from .top import coat_lobe, hidden_cosine


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

    def meet(self, i: Any, o: Any, lean2: Scalar, lit: Flag) -> Colour:
        return where(lit, self.met(i, o, lean2, None), 0.0)

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
        met = jax.vmap(lambda w, depth=depth, lobe=lobe: crossed(down(w, depth), lobe))(w)
        found, fixed[key] = curves_of(met, down(w[0], depth), NoW, tilt, lobe, coats)
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
        def there(key: str) -> Covered:
            found = {name.removeprefix(f"{key}."): curve for name, curve in fitted.items() if name.startswith(f"{key}.")}
            return Covered(**(fixed[key] | found))

        parts = {key: there(key) for key in fixed}
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
