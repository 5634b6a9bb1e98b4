"""A compact material: to all that shades it is one surface, which asks for cosines alone."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import jax.numpy as jnp
import numpy as np

from .._types import Colour, Flag, Scalar, Vec3
from ..forms.curves import grazing
from ..layers import Coat
from ..optics.directions import above, both_above
from ..surfaces.base import Surface
from .polynomial import MIDDLE, Curve, Polynomial

NODES = 400
"""Arguments that a curve is fitted at."""

Argument = Literal["cosine", "facet", "root", "grazing"]
"""What a polynomial of one direction is in: its cosine, that of the mean facet, the root of that as -1 to 1 (a power
of a number about 0 keeps its digits), or what the precise form's curves are in."""


class Compact(Surface):
    """An isotropic material whose BRDF is made of what happens to one direction, twice, and of their meeting."""

    name: str
    note: str
    of_curves = True
    """It is made of polynomials, which hold the channels together."""

    @property
    def by_cosines(self) -> bool:
        """Whether its shader needs no frame: it takes NoL, NoV and how far the two directions lean apart."""
        return True

    @abstractmethod
    def way(self, NoW: Scalar) -> Any:
        """What becomes of one direction."""

    @abstractmethod
    def meet(self, i: Any, o: Any, lean2: Scalar, lit: Flag) -> Colour:
        """BRDF [1/sr] of two of them; `lean2` is the squared length of the sum of their parts along the surface.

        It is 0 where they are not `lit`, below the surface.
        """

    def shade(self, NoL: Scalar, NoV: Scalar, lean2: Scalar) -> Colour:
        """BRDF [1/sr]; 0 below the surface."""
        lit = both_above(NoL, NoV)
        way_i, way_o = self.way(above(lit, NoL)), self.way(above(lit, NoV))
        return self.meet(way_i, way_o, lean2, lit)

    def evaluate(self, wi: Vec3, wo: Vec3) -> Colour:
        """The same of directions in the frame of the surface."""
        x, y = wi[0] + wo[0], wi[1] + wo[1]
        return self.shade(wi[2], wo[2], x * x + y * y)


@dataclass(frozen=True)
class Recipe:
    """How a compact material is made of its exact one: the curves that it needs, and what is built from their polynomials."""

    curves: Mapping[str, Curve]
    build: Callable[[Mapping[str, Polynomial]], Compact]


def noted(made: Compact, note: str) -> Compact:
    """The same material with what its shader says of it."""
    surface: Any = made
    return replace(surface, note=note)


def plain(coat: Coat) -> bool:
    """Whether a coat is of the kind that `coat_lobe` is made for."""
    usual = (coat.distribution, coat.masking, coat.fresnel) == ("ggx", "smith", "exact")
    return usual and not isinstance(coat.width, tuple)


def cosines() -> np.ndarray:
    """Cosines (n,) from grazing to the normal, without both, closer at the ends: where the curves of one direction are fitted at."""
    return 0.5 * (1.0 - np.cos(np.linspace(0.005, np.pi - 0.005, NODES)))


def argument(name: Argument, NoW: Any, tilt: Any) -> Any:
    """The argument of that name; `tilt` is the turn of the mean facet towards a grazing direction."""
    if name in ("facet", "root"):
        facet = jnp.sqrt(tilt + (1.0 - tilt) * (NoW * NoW))
        return facet if name == "facet" else 2.0 * jnp.sqrt(facet) - 1.0
    return grazing(NoW) if name == "grazing" else NoW


def best_argument(NoW: np.ndarray, tilt: Any, y: np.ndarray, weight: Any) -> Argument:
    """In which argument a polynomial comes nearest to values y at cosines."""
    return min(get_args(Argument), key=lambda name: Curve(at(name, NoW, tilt), y, weight).off(MIDDLE))


def at(name: Argument, NoW: np.ndarray, tilt: Any) -> np.ndarray:
    """`argument` of many cosines."""
    return np.asarray(argument(name, jnp.asarray(NoW), tilt))


def half_root(s2: Any) -> Any:
    """Argument of a film's curve: the root of the half cosine as -1 to 1, from four times its square."""
    return jnp.sqrt(2.0 * jnp.sqrt(s2)) - 1.0


def colour_of(values: Any) -> Any:
    """The colour before the last number of a vector: three of four, or the one of two where it is grey."""
    return values[:3] if jnp.shape(values) == (4,) else values[0]
