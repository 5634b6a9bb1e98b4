"""What one facet reflects: the Fresnel reflectance of a metal or of a dielectric, exact or by an approximation."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, Literal, Self

import jax.numpy as jnp

from .._chunk import clip, where
from .._fields import choice, derived, param
from .._types import Colour, Number, Scalar
from ..optics.fresnel import (
    conductor_f0,
    dielectric_f0,
    fresnel_conductor,
    fresnel_dielectric,
    fresnel_schlick,
    rarer_cosine,
    transmittance_dielectric,
)
from ..optics.lazanyi import fit_lazanyi, fresnel_lazanyi
from .base import Surface

Fresnel = Literal["exact", "schlick", "lazanyi"]


def fresnel_choice() -> Any:
    """Declare how the reflectance of a facet is computed."""
    doc = "reflectance of a facet: exact, Schlick's, or Schlick's with a correction fitted to the index"
    return choice(default="exact", others=("schlick", "lazanyi"), doc=doc)


def lazanyi_a() -> Any:
    """Declare a constant of the fitted correction, which is there once a material is prepared."""
    return derived("strength of the correction to Schlick's reflectance")


def lazanyi_alpha() -> Any:
    """Declare the other."""
    return derived("exponent of the correction")


def metal_eta() -> Any:
    """Declare the index of a metal."""
    doc = "index of refraction, real part"
    return param(default=0.2, lower=0.02, upper=10.0, scale="log", doc=doc, colour=True, fitted=False)


def metal_k() -> Any:
    """Declare the extinction of a metal."""
    doc = "index of refraction, imaginary part"
    return param(default=3.5, lower=0.0, upper=15.0, scale="softlog", doc=doc, colour=True, fitted=False)


class Facet(Surface, ABC):
    """A boundary with an index of refraction, absolute (against air); a coat above divides it by its own."""

    eta: Number
    fresnel: Fresnel = "exact"
    lazanyi_a: Number = None
    lazanyi_alpha: Number = None

    @property
    @abstractmethod
    def f0(self) -> Colour:
        """Reflectance of a facet at normal incidence."""

    @abstractmethod
    def exact(self, c: Scalar) -> Colour:
        """Reflectance of a facet at the cosine `c`."""

    def approximate(self, c: Colour) -> Colour:
        """Its approximation, with the correction where there is one."""
        if self.fresnel == "schlick":
            return fresnel_schlick(c, self.f0)
        return clip(fresnel_lazanyi(c, self.f0, self.lazanyi_a, self.lazanyi_alpha), 0.0, 1.0)

    def reflectance(self, c: Scalar) -> Colour:
        """Reflectance of a facet, as `fresnel` says."""
        return self.exact(c) if self.fresnel == "exact" else self.approximate(c)

    def corrected(self, eta: Colour, k: Colour | float) -> Self:
        """The same with the constants of its approximation, fitted to a relative index."""
        if self.fresnel != "lazanyi":
            return self
        correction = fit_lazanyi(eta, k)
        made: Any = self
        return replace(made, lazanyi_a=correction.a, lazanyi_alpha=correction.alpha)


class Metal(Facet):
    """A boundary to a complex index of refraction."""

    k: Number

    def below(self, n: Scalar) -> Self:
        """The same metal under a medium of index `n`."""
        made: Any = self
        relative = replace(made, eta=self.eta / n, k=self.k / n)
        return relative.corrected(relative.eta, relative.k)

    def exact(self, c: Scalar) -> Colour:
        return fresnel_conductor(c, self.eta, self.k)

    @property
    def f0(self) -> Colour:
        return conductor_f0(self.eta, self.k)


class Clear(Facet):
    """A boundary to a real index of refraction."""

    def exact(self, c: Scalar) -> Colour:
        return fresnel_dielectric(c, self.eta)

    def approximate(self, c: Colour) -> Colour:
        """That of the rarer side."""
        return self._approximate_rarer(rarer_cosine(c, self.eta))

    def _approximate_rarer(self, c: Colour) -> Colour:
        """By the cosine on the rarer side; 0 where the indices match and there is no boundary."""
        return where(self.eta == 1.0, 0.0, super().approximate(c))

    def fitted(self) -> Self:
        """The same with the constants of its approximation, for the relative index that it has."""
        return self.corrected(jnp.maximum(self.eta, 1.0 / self.eta), 0.0)

    @property
    def f0(self) -> Colour:
        return dielectric_f0(self.eta)

    def transmittance(self, c: Scalar) -> Colour:
        """Part of the light that passes a facet at the cosine `c`."""
        return transmittance_dielectric(c, self.eta) if self.fresnel == "exact" else 1.0 - self.reflectance(c)

    def passes(self, c: Scalar) -> Colour:
        """The same by the cosine on the rarer side: that on the denser one has lost its digits where total reflection begins."""
        if self.fresnel == "exact":
            return transmittance_dielectric(c, where(self.eta >= 1.0, self.eta, 1.0 / self.eta))
        return 1.0 - self._approximate_rarer(c)
