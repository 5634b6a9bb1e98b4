"""A coat over a diffuse base, compact: light from below is a product of what happens to each direction."""

from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, member, static, struct
from .._types import Colour, Scalar
from ..forms import one_coat
from ..forms.crossing import cross
from ..forms.curves import curve, grazing
from ..layers import Coat
from ..optics.interface import rough_transmittance
from .polynomial import Curve, Polynomial
from .surface import Compact, Recipe, colour_of, cosines
from .top import coat_lobe, hidden_cosine

Argument = Literal["cosine", "grazing"]


@struct
class DiffuseWay:
    """One direction on its way through the coat to a diffuse base, and back."""

    NoW: Scalar = member("cosine above")
    hidden: Scalar = member("NoW (1 + 2 Lambda) of the coat's facets")
    left: Colour = member("square root of the share of the light that leaves, one way")


@struct
class DiffuseUnderCoat(Compact):
    """Coat and diffuse base, and the curves of what lies under the coat."""

    coat: Coat
    tilt: Scalar
    """Turn of the mean facet towards a grazing direction."""
    passed: Polynomial
    """Of the cosine of the mean facet: energy that passes, by the closed form."""
    left: Polynomial
    """Of the cosine, or of `grazing`: what is left of it, and in the precise form what the energy is beyond the closed one."""
    argument: Argument = static(default="cosine")
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> DiffuseWay:
        follow = diffuse_way if self.argument == "cosine" else diffuse_way_tabulated
        return follow(self.passed, self.left, self.coat, self.tilt, NoW)

    def meet(self, i: DiffuseWay, o: DiffuseWay, lean2: Scalar) -> Colour:
        return coat_lobe(self.coat, i.NoW, o.NoW, i.hidden, o.hidden, lean2) + i.left * o.left


@chunk
def diffuse_way(passed: Polynomial, left: Polynomial, coat: Coat, tilt: Scalar, NoW: Scalar) -> DiffuseWay:
    """Follow one direction into the coat and back."""
    NoW2 = NoW * NoW
    T = passed(jnp.sqrt(tilt + (1.0 - tilt) * NoW2))
    return DiffuseWay(NoW, hidden_cosine(NoW, coat.alpha * coat.alpha), T * left(NoW))


@chunk
def diffuse_way_tabulated(passed: Polynomial, left: Polynomial, coat: Coat, tilt: Scalar, NoW: Scalar) -> DiffuseWay:
    """Follow one direction into the coat and back, its energy corrected by the random walk's."""
    NoW2 = NoW * NoW
    remains = left(grazing(NoW))
    T = passed(jnp.sqrt(tilt + (1.0 - tilt) * NoW2)) + remains[-1]
    return DiffuseWay(NoW, hidden_cosine(NoW, coat.alpha * coat.alpha), T * colour_of(remains))


def recipe(prepared: Any, name: str, evaluate: Any) -> Recipe:
    """The curves of a prepared material, in double precision; `evaluate` is its BRDF."""
    precise = isinstance(prepared, one_coat.Prepared)
    coat = prepared.coat if precise else prepared.coats[0]
    interface: Any = prepared.interface if precise else prepared.interfaces[0]

    def follow(NoW: Any) -> Any:
        w = jnp.stack([jnp.sqrt((1.0 - NoW) * (1.0 + NoW)), 0.0 * NoW, NoW])
        # Light from below alone does not ask for the azimuth: here it is at a right angle.
        aside = w[jnp.array([1, 0, 2])]
        # Of a base that is not seen a difference of roundings is left, of either sign.
        below = jnp.maximum(evaluate(prepared, w, aside) - coat.evaluate(w, aside), 0.0)
        closed = rough_transmittance(jnp.sqrt(interface.tilt + (1.0 - interface.tilt) * NoW * NoW), coat.eta, interface.gain)
        if not precise:
            T = cross(interface, coat, w, w).T
            return NoW, closed, jnp.sqrt(below) / T
        s = grazing(NoW)
        T = one_coat.pass_interface(interface, coat.eta, coat.alpha, w).T
        beyond = curve(interface.passed, interface.passed_high, s)
        return s, closed, jnp.hstack([jnp.sqrt(below) / T, beyond])

    NoW = cosines()
    x, closed, left = (np.asarray(a) for a in jax.vmap(follow)(jnp.asarray(NoW)))
    facet = np.sqrt(interface.tilt + (1.0 - interface.tilt) * NoW**2)
    weight = np.broadcast_to(1.0 / np.maximum(np.abs(left).max(0), 1e-6), left.shape)
    curves = {"passed": Curve(facet, closed, 1.0 / closed), "left": Curve(x, left, weight)}
    argument: Argument = "grazing" if precise else "cosine"

    def build(fitted: Any) -> DiffuseUnderCoat:
        return DiffuseUnderCoat(coat, interface.tilt, **fitted, argument=argument, name=name)

    return Recipe(curves, build)
