"""A thin film on a boundary: temper colours, anodised titanium, a coating against reflections."""

from typing import Any

from .._chunk import clip
from .._fields import derived, layer, param
from .._types import Colour, Number, Scalar
from ..errors import InputError
from ..optics.film import TERMS, bake, chebyshev_argument, schlick_complement
from ..optics.fresnel import fresnel_schlick
from .facet import Facet


def film_nm() -> Any:
    """Declare the thickness of a film."""
    doc = "thickness of a clear film on its top, whose interference colours it; absent: no film"
    return param(default=None, lower=0.0, upper=2000.0, scale="softlog", soft=100.0, doc=doc, unit="nm")


def film_eta() -> Any:
    """Declare the index of a film."""
    doc = "index of refraction of the film, against air"
    return param(default=None, lower=1.0, upper=4.0, scale="linear", doc=doc, colour=True, fitted=False)


def _term(degree: int) -> Any:
    first = "f0 of the film, which depends on the angle, by Chebyshev polynomials of sqrt(c): degree 0"
    return derived(f"degree {degree}" if degree else first)


@layer
class Baked:
    """What a film comes to once a material is prepared: `optics.film.bake`."""

    film_0: Number = _term(0)
    film_1: Number = _term(1)
    film_2: Number = _term(2)
    film_3: Number = _term(3)
    film_4: Number = _term(4)
    film_5: Number = _term(5)
    film_6: Number = _term(6)
    film_7: Number = _term(7)
    film_8: Number = _term(8)
    film_9: Number = _term(9)


def baked_f0(film: Baked, c: Scalar) -> Colour:
    """f0 of a film at the cosine `c`."""
    s = chebyshev_argument(c)
    older, total = 0.0, film.film_9
    for degree in range(TERMS - 2, 0, -1):  # Clenshaw 1955
        older, total = total, getattr(film, f"film_{degree}") + 2.0 * s * total - older
    return film.film_0 + s * total - older


DARKEST = 0.0025
"""Least reflectance of a channel, about the polynomial's own error. A saturated colour of interference lies outside of Rec.709 and its
channel passes through 0; a hard edge there would have neither a derivative beyond it nor a digit near it."""


def _lift(reflected: Colour) -> Colour:
    """What is added to a reflectance so that it ends smoothly at the darkest: nothing from twice that on."""
    below = 1.0 - clip(reflected * (0.5 / DARKEST), 0.0, 1.0)
    return DARKEST * (below * below)


def film_reflects(c: Scalar, f0: Colour) -> Colour:
    """Light that a film reflects at the cosine `c`."""
    reflected = fresnel_schlick(c, f0)
    return clip(reflected, 0.0, 1.0) + _lift(reflected)


def film_passes(c: Scalar, f0: Colour) -> Colour:
    """The rest, with its own digits at grazing angles."""
    return clip((1.0 - f0) * schlick_complement(c), 0.0, 1.0) - _lift(fresnel_schlick(c, f0))


class Filmed(Baked, Facet):
    """A boundary that may have a film: then its reflectance is the film's, and its own where there is none."""

    name: str
    film_nm: Number
    film_eta: Number

    together = (("film_nm", "film_eta"),)
    """Fields that are given all or not at all."""

    @property
    def film_problem(self) -> str | None:
        """Why this film cannot be, or None."""
        if (self.film_nm is None) != (self.film_eta is None):
            return "film_nm and film_eta come together; one is missing"
        if self.film_nm is not None and self.fresnel != "exact":
            return f'the reflectance of a film is exact: leave fresnel = "{self.fresnel}" out, or the film'
        return None

    def bake_film(self, above: Colour, eta: Colour, k: Colour | float) -> dict[str, Any]:
        """Fields of the film below a medium of index `above`, on one of the relative index eta + i k: baked ones for those given."""
        if problem := self.film_problem:
            raise InputError(f"{self.name}: {problem}")
        terms = bake(self.film_eta / above, eta, k, self.film_nm * above)
        baked = {f"film_{degree}": term for degree, term in enumerate(terms)}
        return {"film_nm": None, "film_eta": None, **baked}

    @property
    def has_film(self) -> bool:
        """Whether there is a film: given, or baked."""
        return self.film_nm is not None or self.film_eta is not None or self.film_0 is not None
