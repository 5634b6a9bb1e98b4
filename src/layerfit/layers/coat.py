"""A clear or absorbing coat: a rough dielectric boundary with a medium below it."""

from dataclasses import replace
from typing import Self

from .._chunk import static
from .._fields import choice, layer, param
from .._types import Colour, Scalar
from ..optics.fresnel import fresnel_dielectric, transmittance_dielectric
from ..surfaces.microfacet import Microfacets, alpha_param


@layer
class Coat(Microfacets):
    """A dielectric layer, lacquer or varnish: light is reflected at its rough top and absorbed on its way through.

    Its medium is given by `tau`, by `absorption_per_mm` and `thickness_um`, or by none of them (a clear coat).
    Only their product tau = absorption * thickness is seen in one image.
    """

    name: str = static("coat", doc="name of the layer")
    alpha: Scalar | None = alpha_param(0.1, "")
    alpha_x: Scalar | None = alpha_param(None, " along the tangent")
    alpha_y: Scalar | None = alpha_param(None, " across the tangent")
    eta: Scalar = param(1.5, 1.0, 3.0, "linear", "index of refraction, against air")
    tau: Colour | None = param(
        None, 0.0, 50.0, "softlog", "optical depth, one way at normal incidence", colour=True, soft=0.05
    )
    absorption_per_mm: Colour | None = param(
        None, 0.0, 1e4, "softlog", "absorption coefficient", unit="1/mm", colour=True, soft=1.0
    )
    thickness_um: Scalar | None = param(None, 0.1, 5e3, "log", "thickness", unit="um", fitted=False)
    distribution: str = choice("ggx", "beckmann", doc="density of the facet normals")
    masking: str = choice("smith", "smith_separable", "vcavity", doc="how facets hide one another")

    @property
    def optical_depth(self) -> Colour | None:
        """tau [1], or None for a clear coat."""
        if self.absorption_per_mm is None:
            return self.tau
        return self.absorption_per_mm * (self.thickness_um * 1e-3)

    def below(self, n: Scalar) -> Self:
        """The same coat under a medium of index `n`: relative index, medium by its optical depth alone."""
        return replace(self, eta=self.eta / n, tau=self.optical_depth, absorption_per_mm=None, thickness_um=None)

    def fresnel(self, c: Scalar) -> Scalar:
        return fresnel_dielectric(c, self.eta)

    def transmittance(self, c: Scalar) -> Scalar:
        """Part of the light that passes one facet at the cosine `c`."""
        return transmittance_dielectric(c, self.eta)
