"""Rough boundaries made of microfacets: metal and dielectric."""

from dataclasses import replace
from typing import Any, Self

import jax.numpy as jnp

from .._chunk import chunk, static
from .._fields import choice, layer, param
from .._types import Colour, Direction, Number, Scalar
from ..optics.microfacet import Distribution, Masking, Width, density, half_cosine, half_vector, lobe, visibility
from .base import Lobe, Surface
from .facet import Clear, Fresnel, Metal, fresnel_choice, lazanyi_a, lazanyi_alpha, metal_eta, metal_k
from .film import Filmed, baked_f0, film_eta, film_nm, film_reflects


class Microfacets(Surface, Lobe):
    """A boundary whose facets have a width: one `alpha`, or `alpha_x` along the tangent and `alpha_y` across it."""

    alpha: Number
    alpha_x: Number
    alpha_y: Number
    distribution: Distribution
    masking: Masking

    @property
    def width(self) -> Width:
        return self.alpha if self.alpha_x is None else (self.alpha_x, self.alpha_y)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (self,)

    def density(self, h: Direction, width: Width | None = None) -> Scalar:
        """D(h) [1/sr] of these facets, or of wider ones."""
        return density(self.distribution, h, self.width if width is None else width)

    def visibility(self, wi: Direction, wo: Direction, width: Width | None = None) -> Scalar:
        """G / (4 NoL NoV) of these facets, or of wider ones."""
        return visibility(self.masking, self.distribution, wi, wo, self.width if width is None else width)

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        """D V."""
        return lobe(self.distribution, self.masking, wi, wo, h, self.width if width is None else width)

    def evaluate(self, wi: Direction, wo: Direction) -> Colour:
        """F D V [1/sr] of directions above the surface (Cook and Torrance 1982; Walter et al. 2007, eq. 20)."""
        F = self.reflectance(half_cosine(wi, wo))
        return F * self.shape(wi, wo, half_vector(wi, wo))


def alpha_param(*, default: float | None, which: str) -> Any:
    """Declare the width of facets, on both axes or on one."""
    doc = f"width of the facet slopes{which}; the square of an artist's roughness"
    return param(default=default, lower=1e-3, upper=1.0, scale="log", doc=doc)


@layer
class Conductor(Filmed, Metal, Microfacets):
    """A rough metal, bare or with a thin clear film on it."""

    name: str = static(default="base", doc="name of the layer")
    alpha: Number = alpha_param(default=0.2, which="")
    alpha_x: Number = alpha_param(default=None, which=" along the tangent")
    alpha_y: Number = alpha_param(default=None, which=" across the tangent")
    eta: Number = metal_eta()
    k: Number = metal_k()
    distribution: Distribution = choice(default="ggx", others=("beckmann",), doc="density of the facet normals")
    masking: Masking = choice(default="smith", others=("smith_separable", "vcavity"), doc="how facets hide one another")
    fresnel: Fresnel = fresnel_choice()
    lazanyi_a: Number = lazanyi_a()
    lazanyi_alpha: Number = lazanyi_alpha()
    film_nm: Number = film_nm()
    film_eta: Number = film_eta()

    def below(self, n: Scalar) -> Self:
        """The same metal under a medium of index `n`; with a film, what is baked of both stands for the metal."""
        if not self.has_film:
            return super().below(n)
        return replace(self, eta=None, k=None, **self.bake_film(n, self.eta / n, self.k / n))

    def reflectance(self, c: Scalar) -> Colour:
        return super().reflectance(c) if self.film_0 is None else film_reflects(c, film_on_metal(self, c))

    @property
    def f0(self) -> Colour:
        return super().f0 if self.film_0 is None else self.reflectance(jnp.ones(()))


@chunk
def film_on_metal(base: Conductor, c: Scalar) -> Colour:
    """What Schlick's formula takes for f0 of a metal with a film, in daylight."""
    return baked_f0(base, c)


@layer
class Dielectric(Clear, Microfacets):
    """A rough boundary to a clear or black medium of real index; what passes it is lost."""

    name: str = static(default="base", doc="name of the layer")
    alpha: Number = alpha_param(default=0.2, which="")
    alpha_x: Number = alpha_param(default=None, which=" along the tangent")
    alpha_y: Number = alpha_param(default=None, which=" across the tangent")
    eta: Number = param(default=1.5, lower=1.0, upper=4.0, scale="linear", doc="index of refraction", colour=True)
    distribution: Distribution = choice(default="ggx", others=("beckmann",), doc="density of the facet normals")
    masking: Masking = choice(default="smith", others=("smith_separable", "vcavity"), doc="how facets hide one another")
    fresnel: Fresnel = fresnel_choice()
    lazanyi_a: Number = lazanyi_a()
    lazanyi_alpha: Number = lazanyi_alpha()

    def below(self, n: Scalar) -> Self:
        """The same medium under one of index `n`."""
        return replace(self, eta=self.eta / n).fitted()
