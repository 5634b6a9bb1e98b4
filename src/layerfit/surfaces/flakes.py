"""Metallic paint: flakes of metal in a pigmented ground, each with a normal of its own."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp

from .._chunk import static, where
from .._fields import choice, layer, param
from .._place import TANGENT, Place
from .._types import Colour, Direction, Number, Scalar, Vec2
from ..optics.flakes import flake_tilt, half_into_facet, into_facet, kept_tilt, lost_variance, tilted_d, tilted_normal
from ..optics.microfacet import Width, density, visibility
from .base import Lobe, Surface, widened_variance
from .diffuse import Lambert
from .facet import Metal, metal_eta, metal_k
from .microfacet import alpha_param


def per_uv_param(default: float | None) -> Any:
    """Declare how many flakes there are."""
    doc = "flakes along one unit of the texture coordinates"
    return param(default=default, lower=1.0, upper=1e6, scale="log", fitted=False, doc=doc)


def half_distance_param(default: float | None) -> Any:
    """Declare how far they are seen."""
    doc = "distance at which half of the tilt is drawn, in the scene's unit"
    return param(default=default, lower=1e-6, upper=1e6, scale="log", fitted=False, doc=doc)


def seed_param(default: float | None) -> Any:
    """Declare which flakes they are."""
    doc = "whole number; another one, other flakes"
    return param(default=default, lower=0.0, upper=2**24 - 1, scale="linear", fitted=False, doc=doc)


@layer
class Flakes(Metal):
    """Metal flakes, tilted one by one, with pigment between them (after Elek 2010, section 5; Guenther et al. 2005).

    At a place of the surface the lobe stands about the normal of the flake there. Tilts are drawn less and less with the distance; the
    variance that is lost returns as roughness, alpha^2 + (1 - s^2) sigma^2, so that the mean look does not change. Without a place, as in a
    fit, the surface is seen from afar.
    """

    reads: ClassVar[tuple[str, ...]] = ("uv", "distance", TANGENT)
    averages: ClassVar[bool] = True
    together: ClassVar = (("coverage", "albedo"),)

    name: str = static(default="base", doc="name of the layer")
    alpha: Number = alpha_param(default=0.1, which=" of one flake")
    sigma: Number = param(
        default=0.2,
        lower=0.0,
        upper=1.0,
        scale="softlog",
        soft=0.05,
        fitted=False,
        doc="spread of the tilts, as a width of slopes",
    )
    eta: Number = metal_eta()
    k: Number = metal_k()
    coverage: Number = param(
        default=None, lower=0.0, upper=1.0, scale="linear", doc="part of the area that is flakes; absent: all of it"
    )
    albedo: Number = param(
        default=None, lower=0.0, upper=1.0, scale="linear", doc="light that the pigment between flakes sends back", colour=True
    )
    per_uv: Number = per_uv_param(400.0)
    half_distance: Number = half_distance_param(1.0)
    seed: Number = seed_param(0.0)
    lost: str = choice(default="roughness", others=("nothing",), doc="what becomes of the tilt that is not drawn")

    @property
    def diffuse(self) -> Any:
        return None if self.albedo is None else Lambert(albedo=(1.0 - self.coverage) * self.albedo)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (FlakeLobe(self),)

    @property
    def lacks(self) -> tuple[str, ...]:
        """What it does without, in words."""
        return ("pigment",) if self.albedo is None else ()

    def at(self, place: Place) -> Surface:
        """The flake at a place of the surface."""
        kept = kept_tilt(place.distance, self.half_distance)
        tilt = flake_tilt(place.uv, self.per_uv, self.sigma * kept, self.seed.astype(jnp.uint32))
        lost = lost_variance(place.distance, self.half_distance)
        return Flake(self, tilt, lost)


@dataclasses.dataclass(frozen=True)
class Flake(Surface):
    """One flake and the pigment beside it."""

    paint: Flakes
    tilt: Vec2
    lost: Scalar
    """Part 1 - s^2 of the variance of tilts that is not drawn."""

    @property
    def diffuse(self) -> Any:
        return self.paint.diffuse

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (FlakeLobe(self.paint, self),)


@dataclasses.dataclass(frozen=True)
class FlakeLobe(Lobe):
    """Light that a flake sends back, or in the mean all of them."""

    paint: Flakes
    flake: Flake | None = None

    @property
    def width(self) -> Width:
        """Of the facets of all flakes: what goes to and fro below a coat meets others."""
        paint = self.paint
        if paint.lost == "nothing":
            return paint.alpha
        return jnp.sqrt(paint.alpha * paint.alpha + paint.sigma * paint.sigma)

    def reflectance(self, c: Scalar) -> Colour:
        F = self.paint.reflectance(c)
        return F if self.paint.coverage is None else self.paint.coverage * F

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        if self.flake is None:
            width = self.width if width is None else width
            return density("beckmann", h, width) * visibility("smith", "beckmann", wi, wo, width)
        if self.paint.lost == "nothing":
            return self._in_its_frame(wi, wo, self.paint.alpha if width is None else width, self.flake)
        return self._among_others(wi, wo, h, self.width, None, self.flake)

    def widened(self, wi: Direction, wo: Direction, h: Direction, width: Width, added: Width) -> Scalar:
        if self.flake is None or self.paint.lost == "nothing":
            return self.shape(wi, wo, h, width)
        return self._among_others(wi, wo, h, width, added, self.flake)

    def _among_others(
        self, wi: Direction, wo: Direction, h: Direction, width: Width, added: Width | None, flake: Flake
    ) -> Scalar:
        """The lobe about a flake. Flakes hide one another by the slopes of all: the mean over flakes is the lobe seen from afar."""
        alpha, sigma = self.paint.alpha, self.paint.sigma
        # Of a flake alone, and what coats add: the width of all flakes, less their spread, would have the digits of that.
        alpha2 = widened_variance(alpha * alpha + flake.lost * (sigma * sigma), added)
        return tilted_d(h, flake.tilt, alpha2) * visibility("smith", "beckmann", wi, wo, width)

    def _in_its_frame(self, wi: Direction, wo: Direction, width: Width, flake: Flake) -> Scalar:
        """The lobe of a surface whose normal is that of the flake (Elek 2010): nothing where either direction is below it."""
        n = tilted_normal(flake.tilt)
        up = jnp.array([0.0, 0.0, 1.0], n.dtype)
        wi_flake, wo_flake = into_facet(wi, n), into_facet(wo, n)
        lit = (wi_flake[2] > 0.0) & (wo_flake[2] > 0.0)
        D = density("beckmann", half_into_facet(wi, wo, flake.tilt, n), width)
        V = visibility("smith", "beckmann", where(lit, wi_flake, up), where(lit, wo_flake, up), width)
        return where(lit, D * V, 0.0)
