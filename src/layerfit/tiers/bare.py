"""A bare metal, or one with a film, compact: its reflectance is a curve, and its lobe takes cosines alone."""

import math
from typing import Any

from .._chunk import static, struct, where
from .._types import Colour, Flag, Scalar
from ..surfaces import Conductor
from .polynomial import Polynomial
from .surface import Compact, Recipe, half_root
from .top import half_cosines, hidden_cosine, reflectance_curve


@struct
class BareMetal(Compact):
    """GGX facets of one width, and the curve of what one of them reflects."""

    alpha2: Scalar
    """Squared width of the facets."""
    reflectance: Polynomial
    """Of four times the squared half cosine; of a film of the root of the half cosine."""
    film: bool = static(default=False)
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> Any:
        return NoW, hidden_cosine(NoW, self.alpha2)

    def meet(self, i: Any, o: Any, lean2: Scalar, lit: Flag) -> Colour:
        (NoL, hidden_l), (NoV, hidden_v) = i, o
        M = NoL + NoV
        M2 = M * M
        s2 = lean2 + M2
        F = self.reflectance(half_root(s2) if self.film else s2)
        narrow = s2 / (lean2 + self.alpha2 * M2)
        f = F * (self.alpha2 * (0.5 / math.pi) * (narrow * narrow) / (NoV * hidden_l + NoL * hidden_v))
        return where(lit, f, 0.0)


def recipe(base: Conductor, name: str) -> Recipe:
    """The curve of a prepared metal, in double precision."""
    curve = reflectance_curve(base, half_cosines())
    alpha: Any = base.width
    return Recipe(
        {"reflectance": curve}, lambda fitted: BareMetal(alpha * alpha, fitted["reflectance"], film=base.has_film, name=name)
    )
