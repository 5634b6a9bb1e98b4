"""Metals of V-shaped grooves, as published: Torrance and Sparrow 1967, Cook and Torrance 1982."""

import math
from typing import ClassVar, Literal

import jax.numpy as jnp

from .._chunk import chunk, safe_sqrt, static
from .._fields import choice, layer, param
from .._types import Colour, Direction, Number, Scalar
from ..optics.directions import sine2
from ..optics.microfacet import Distribution, Masking, Width, v_cavity
from .base import Lobe, variance
from .diffuse import TwoParts, kd_param
from .facet import Fresnel, Metal, fresnel_choice, lazanyi_a, lazanyi_alpha, metal_eta, metal_k
from .microfacet import Microfacets, alpha_param


@layer
class CookTorrance(TwoParts, Metal, Microfacets):
    """Beckmann facets in V-shaped grooves beside a diffuse part: kd / pi + ks F D G / (4 NoL NoV) (Cook and Torrance 1982).

    The paper has pi for 4, with which a rough metal sends back more than it gets: `faithful` is that.
    """

    distribution: ClassVar[Distribution] = "beckmann"
    masking: ClassVar[Masking] = "vcavity"
    alpha_x: ClassVar[None] = None
    alpha_y: ClassVar[None] = None

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = param(default=1.0, lower=0.0, upper=1.0, scale="linear", doc="part of the surface that is facets", colour=True)
    alpha: Number = alpha_param(default=0.2, which=", the paper's m")
    eta: Number = metal_eta()
    k: Number = metal_k()
    fresnel: Fresnel = fresnel_choice()
    lazanyi_a: Number = lazanyi_a()
    lazanyi_alpha: Number = lazanyi_alpha()
    scaling: Literal["normalized", "faithful"] = choice(
        default="normalized", others=("faithful",), doc="divided by 4, or by pi as published"
    )

    def reflectance(self, c: Scalar) -> Colour:
        F = self.ks * super().reflectance(c)
        return F if self.scaling == "normalized" else F * (4.0 / math.pi)

    def evaluate(self, wi: Direction, wo: Direction) -> Colour:
        f = super().evaluate(wi, wo)
        return f if self.diffuse is None else f + self.diffuse.evaluate(wi, wo)

    def energy(self, reflectance: Colour) -> Colour:
        return reflectance if self.scaling == "normalized" else jnp.minimum(reflectance, 1.0)


@chunk
def torrance_sparrow_d(h: Direction, kappa: Scalar) -> Scalar:
    """exp(-(kappa delta)^2), delta the angle between facet and surface (Torrance and Sparrow 1967)."""
    delta = jnp.arctan2(safe_sqrt(sine2(h)), h[-1])
    slope = kappa * delta
    return jnp.exp(-(slope * slope))


@layer
class TorranceSparrow(TwoParts, Metal, Lobe):
    """Facets with a Gaussian of angles in V-shaped grooves beside a diffuse part (Torrance and Sparrow 1967).

    f = kd / pi + ks F exp(-(kappa delta)^2) G / (4 NoL NoV). The lobe is not normalised: ks = kappa^2 / pi is about that of all facets.
    """

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = param(default=15.0, lower=0.0, upper=1e5, scale="softlog", doc="strength of the lobe", colour=True)
    kappa: Number = param(default=7.0, lower=0.5, upper=1e3, scale="log", doc="narrowness of the facet angles", unit="1/rad")
    eta: Number = metal_eta()
    k: Number = metal_k()
    fresnel: Fresnel = fresnel_choice()
    lazanyi_a: Number = lazanyi_a()
    lazanyi_alpha: Number = lazanyi_alpha()

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return (self,)

    @property
    def width(self) -> Width:
        """Beckmann's with the same peak and curvature."""
        return 1.0 / self.kappa

    def reflectance(self, c: Scalar) -> Colour:
        return self.ks * super().reflectance(c)

    def energy(self, reflectance: Colour) -> Colour:
        return jnp.minimum(reflectance * (math.pi / (self.kappa * self.kappa)), 1.0)

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        V = v_cavity(wi, wo)
        if width is None:
            return torrance_sparrow_d(h, self.kappa) * V
        alpha2 = variance(width)
        same_light = 1.0 / (alpha2 * self.kappa * self.kappa)
        return same_light * torrance_sparrow_d(h, 1.0 / safe_sqrt(alpha2)) * V
