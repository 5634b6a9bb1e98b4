"""What a form asks of a boundary: its diffuse part, and its lobes.

A form never asks what class a boundary is. Light that keeps its direction below a coat meets the lobes, which rough coats widen; light
that has lost it meets the diffuse part.
"""

from abc import ABC, abstractmethod
from functools import reduce
from operator import add
from typing import Any

import jax.numpy as jnp

from .._types import Colour, Direction, Scalar
from ..optics.microfacet import Distribution, Width, half_cosine, half_vector


def variance(width: Width) -> Scalar:
    """alpha^2; of two widths that of their mean, for an isotropic lobe below a coat that has two."""
    return width[0] * width[1] if isinstance(width, tuple) else width * width


def widened_variance(own: Scalar, added: Width | None) -> Scalar:
    """alpha^2 of an isotropic lobe to whose slopes coats add theirs, of two widths that of their mean."""
    if added is None:
        return own
    return jnp.sqrt((own + added[0]) * (own + added[1])) if isinstance(added, tuple) else own + added


class Lobe(ABC):
    """Light that is sent back about a direction: f = reflectance(c) shape(wi, wo, h)."""

    distribution: Distribution = "beckmann"
    """How widths add: those of Gaussian lobes by their squares."""

    @property
    @abstractmethod
    def width(self) -> Width:
        """Width of the facets that would make such a lobe."""

    @abstractmethod
    def reflectance(self, c: Scalar) -> Colour:
        """What the lobe takes its colour from, at the half cosine `c`."""

    @abstractmethod
    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Any:
        """The rest [1/sr], of this lobe or of one widened to `width`; `h` is the half vector."""

    def widened(self, wi: Direction, wo: Direction, h: Direction, width: Width, added: Width) -> Any:
        """The same of a Gaussian lobe that coats have widened to `width`, and its variance by `added`."""
        return self.shape(wi, wo, h, width)

    def energy(self, reflectance: Colour) -> Colour:
        """Part of the light that the lobe sends back, 0 to 1, by its `reflectance`: it scales what goes to and fro below a coat."""
        return reflectance


class Surface:
    """A boundary: a diffuse part, lobes, or both. Each may be absent."""

    @property
    def diffuse(self) -> Any:
        """A diffuse boundary with an `albedo`, or None."""
        return None

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """The lobes; none on a diffuse boundary."""
        return ()

    def below(self, n: Scalar) -> "Surface":
        """The same boundary under a medium of index `n`, as a shader holds it: what has no index does not change."""
        return self

    def evaluate(self, wi: Direction, wo: Direction) -> Colour:
        """BRDF [1/sr] of directions above the surface."""
        h = half_vector(wi, wo)
        c = half_cosine(wi, wo)
        return self.about(wi, wo, h, c)

    def about(self, wi: Direction, wo: Direction, h: Direction, c: Scalar) -> Colour:
        """The same where the half vector `h` and its cosine to the directions are known."""
        parts: list[Any] = [lobe.reflectance(c) * lobe.shape(wi, wo, h) for lobe in self.lobes]
        if self.diffuse is not None:
            parts.append(self.diffuse.evaluate(wi, wo))
        return reduce(add, parts)
