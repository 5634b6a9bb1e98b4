"""A clear or absorbing coat: a rough dielectric boundary with a medium below it."""

from dataclasses import replace
from typing import Self

import jax.numpy as jnp

from .._chunk import chunk, static
from .._fields import choice, layer, param
from .._types import Colour, Number, Scalar
from ..optics.fresnel import rarer_cosine
from ..optics.microfacet import Distribution, Masking
from ..surfaces.facet import Clear, Fresnel, fresnel_choice, lazanyi_a, lazanyi_alpha
from ..surfaces.film import Filmed, baked_f0, film_eta, film_nm, film_passes, film_reflects
from ..surfaces.microfacet import Microfacets, alpha_param


@layer
class Coat(Filmed, Clear, Microfacets):
    """A dielectric layer, lacquer or varnish: light is reflected at its rough top and absorbed on its way through.

    Its medium is given by `tau`, by `absorption_per_mm` and `thickness_um`, or by none of them (a clear coat).
    Only their product tau = absorption * thickness is seen in one image. With `tau_s` it scatters too: a milky or cloudy coat.
    With `film_nm` and `film_eta` there is a thin clear film on its top.
    """

    name: str = static(default="coat", doc="name of the layer")
    alpha: Number = alpha_param(default=0.1, which="")
    alpha_x: Number = alpha_param(default=None, which=" along the tangent")
    alpha_y: Number = alpha_param(default=None, which=" across the tangent")
    eta: Number = param(default=1.5, lower=1.0, upper=3.0, scale="linear", doc="index of refraction, against air")
    tau: Number = param(
        default=None,
        lower=0.0,
        upper=50.0,
        scale="softlog",
        doc="optical depth, one way at normal incidence",
        colour=True,
        soft=0.05,
    )
    absorption_per_mm: Number = param(
        default=None, lower=0.0, upper=1e4, scale="softlog", doc="absorption coefficient", unit="1/mm", colour=True, soft=1.0
    )
    thickness_um: Number = param(default=None, lower=0.1, upper=5e3, scale="log", doc="thickness", unit="um", fitted=False)
    tau_s: Number = param(
        default=None,
        lower=0.0,
        upper=50.0,
        scale="softlog",
        doc="optical depth of scattering, beside that of absorption",
        colour=True,
        soft=0.05,
    )
    g: Number = param(
        default=None,
        lower=-0.95,
        upper=0.95,
        scale="linear",
        doc="mean cosine of scattering: forwards above 0, backwards below; absent, the same in all directions",
    )
    distribution: Distribution = choice(default="ggx", others=("beckmann",), doc="density of the facet normals")
    masking: Masking = choice(default="smith", others=("smith_separable", "vcavity"), doc="how facets hide one another")
    fresnel: Fresnel = fresnel_choice()
    lazanyi_a: Number = lazanyi_a()
    lazanyi_alpha: Number = lazanyi_alpha()
    film_nm: Number = film_nm()
    film_eta: Number = film_eta()

    gauges = (("absorption_per_mm", "thickness_um", -1.0, "absorption and thickness enter only as tau, their product"),)
    """Pairs of fields that an image cannot tell apart: as the first grows, the second with it (1) or against it (-1); and why."""

    @property
    def optical_depth(self) -> Colour | None:
        """tau [1], or None for a clear coat."""
        if self.absorption_per_mm is None:
            return self.tau
        return self.absorption_per_mm * (self.thickness_um * 1e-3)

    @property
    def extinction(self) -> Number:
        """Optical depth [1] of absorption and scattering together, a colour; None for a clear coat."""
        if self.tau_s is None:
            return self.optical_depth
        return self.tau_s if self.optical_depth is None else self.optical_depth + self.tau_s

    def below(self, n: Scalar) -> Self:
        """The same coat under a medium of index `n`: relative index, medium by its optical depth alone."""
        film = {}
        if self.has_film:
            # The same from both sides of one ray, as without a film: baked for light from the rarer one.
            rarer, denser = jnp.minimum(self.eta, n), jnp.maximum(self.eta, n)
            film = self.bake_film(rarer, denser / rarer, 0.0)
        medium = {"tau": self.optical_depth, "absorption_per_mm": None, "thickness_um": None}
        return replace(self, eta=self.eta / n, **medium, **film).fitted()

    def reflectance(self, c: Scalar) -> Colour:
        if self.film_0 is None:
            return super().reflectance(c)
        c = rarer_cosine(c, self.eta)
        return film_reflects(c, film_on_coat(self, c))

    def transmittance(self, c: Scalar) -> Colour:
        """Part of the light that passes a facet at the cosine `c`, and its film."""
        if self.film_0 is None:
            return super().transmittance(c)
        return self.passes(rarer_cosine(c, self.eta))

    def passes(self, c: Scalar) -> Colour:
        if self.film_0 is None:
            return super().passes(c)
        return film_passes(c, film_on_coat(self, c))


@chunk
def film_on_coat(coat: Coat, c: Scalar) -> Colour:
    """What Schlick's formula takes for f0 of a coat with a film, in daylight; `c` on the rarer side."""
    return baked_f0(coat, c)
