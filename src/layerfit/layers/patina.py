"""What grows on a metal in time: an oxide film, and a mineral crust that scatters light."""

import dataclasses
from typing import ClassVar

from .._chunk import static
from .._fields import choice, layer, param
from .._types import Colour, Number
from ..optics.microfacet import Distribution, Masking
from ..surfaces.microfacet import alpha_param
from .coat import Coat
from .growing import Growing


@layer
class Patina(Growing):
    """A film and a crust that cover a metal place by place, and thicken there by the parabolic law of tarnish (Elek 2010).

    `tau` (or `absorption_per_mm` and `thickness_um`) is of the film; `albedo`, `depth` and `g` are of what scatters in it, `absorbed` and
    `scattered` of the diffuse crust (Kubelka and Munk 1931). They are as they stand one onset time after a place was reached, and grow
    with the film. A patina is of age and onset by their ratio alone.
    """

    name: str = static(default="patina", doc="name of the layer")
    blur: Number = param(
        default=0.05, lower=1e-3, upper=1.0, scale="log", doc="time in which growth sets in, in onset times", fitted=False
    )
    alpha: Number = alpha_param(default=0.3, which="")
    alpha_x: Number = alpha_param(default=None, which=" along the tangent")
    alpha_y: Number = alpha_param(default=None, which=" across the tangent")
    eta: Number = param(default=2.7, lower=1.0, upper=4.0, scale="linear", doc="index of refraction of the film, against air")
    tau: Number = param(
        default=None,
        lower=0.0,
        upper=50.0,
        scale="softlog",
        doc="optical depth of the film, one way at normal incidence",
        colour=True,
        soft=0.05,
    )
    absorption_per_mm: Number = param(
        default=None, lower=0.0, upper=1e5, scale="softlog", doc="absorption coefficient of the film", unit="1/mm", colour=True
    )
    thickness_um: Number = param(
        default=None, lower=1e-3, upper=5e3, scale="log", doc="thickness of the film", unit="um", fitted=False
    )
    albedo: Number = param(
        default=None, lower=0.0, upper=1.0, scale="linear", doc="part that scatters, of the light that is met", colour=True
    )
    depth: Number = param(
        default=None,
        lower=0.0,
        upper=50.0,
        scale="softlog",
        doc="optical depth of what scatters in the film",
        soft=0.05,
        fitted=False,
    )
    g: Number = param(
        default=None,
        lower=-0.95,
        upper=0.95,
        scale="linear",
        doc="mean cosine of scattering; absent, the same in all directions",
        fitted=False,
    )
    mixing: str = choice(
        default="medium",
        others=("added",),
        doc="one medium that absorbs and scatters, or light scattered once added to the film's, as published",
    )
    absorbed: Number = param(
        default=None,
        lower=0.0,
        upper=100.0,
        scale="softlog",
        doc="absorption of the crust, K times its thickness",
        colour=True,
        soft=0.05,
    )
    scattered: Number = param(
        default=None,
        lower=0.0,
        upper=100.0,
        scale="softlog",
        doc="scattering of the crust, S times its thickness",
        colour=True,
        soft=0.05,
    )
    weight: Number = param(
        default=None,
        lower=0.0,
        upper=1.0,
        scale="linear",
        doc="part that counts of the light that is added to the film's; absent for the whole",
    )
    distribution: Distribution = choice(default="ggx", others=("beckmann",), doc="density of the facet normals")
    masking: Masking = choice(default="smith", others=("smith_separable", "vcavity"), doc="how facets hide one another")

    together = (("albedo", "depth"), ("absorbed", "scattered"))
    """Fields that are given all or not at all."""
    only_with: ClassVar = {"g": ("albedo",)}
    gauges = (*Coat.gauges, ("years", "onset_years", 1.0, "age and onset enter only as their ratio"))
    """Pairs of fields that an image cannot tell apart: as the first grows, the second with it (1) or against it (-1); and why."""

    @property
    def lacks(self) -> list[str]:
        """What it does without, in words."""
        parts = {"soft edge": self.softness, "scattering": self.albedo, "crust": self.scattered}
        return [words for words, value in parts.items() if value is None]

    @property
    def optical_depth(self) -> Colour | None:
        """tau [1] of the film, or None for a clear one."""
        if self.absorption_per_mm is None:
            return self.tau
        return self.absorption_per_mm * (self.thickness_um * 1e-3)

    @property
    def film(self) -> Coat:
        """The film as a coat: of what is met in one medium a part scatters, its albedo, and the rest absorbs."""
        kept = ("name", "alpha", "alpha_x", "alpha_y", "eta", "distribution", "masking")
        film = Coat(**{field: getattr(self, field) for field in kept}, tau=self.optical_depth)
        if self.albedo is None or self.depth is None or self.mixing == "added":
            return film
        absorbed = (1.0 - self.albedo) * self.depth
        tau = absorbed if film.tau is None else film.tau + absorbed
        return dataclasses.replace(film, tau=tau, tau_s=self.albedo * self.depth, g=self.g)
