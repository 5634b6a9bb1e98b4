"""A clear or absorbing coat: a rough dielectric boundary with a medium below it."""

from dataclasses import replace
from typing import Self

from .._chunk import static
from .._fields import choice, layer, param
from .._types import Colour, Number, Scalar
from ..optics.microfacet import Distribution, Masking
from ..surfaces.facet import Clear, Fresnel, fresnel_choice, lazanyi_a, lazanyi_alpha
from ..surfaces.microfacet import Microfacets, alpha_param


@layer
class Coat(Clear, Microfacets):
    """A dielectric layer, lacquer or varnish: light is reflected at its rough top and absorbed on its way through.

    Its medium is given by `tau`, by `absorption_per_mm` and `thickness_um`, or by none of them (a clear coat).
    Only their product tau = absorption * thickness is seen in one image. With `tau_s` it scatters too: a milky or cloudy coat.
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
        return replace(self, eta=self.eta / n, tau=self.optical_depth, absorption_per_mm=None, thickness_um=None).fitted()
