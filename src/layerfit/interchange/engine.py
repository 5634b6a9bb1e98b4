"""The coat over a base that other programs draw, as a surface like any other: what fits, draws and measures ours does theirs."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp

from .._chunk import clip, safe_sqrt, static
from .._fields import choice, derived, layer, param
from .._types import Colour, Number, Scalar, Vec3
from ..optics.fresnel import EDGE, dielectric_f0, fresnel_dielectric, fresnel_hoffman, fresnel_schlick
from ..optics.microfacet import density, half_cosine, half_vector, visibility
from ..surfaces.base import Surface
from .dialects import COAT_INDEX, DIALECTS, Dialect
from .iridescence import filmed_metal, filmed_reflectance, to_rgb


def _part(doc: str, default: float | None = None) -> Any:
    return param(default=default, lower=0.0, upper=1.0, scale="linear", doc=doc, colour=True)


NARROWEST, WIDEST = 1e-3, 1.0
"""GGX widths that an engine takes, as layers have them."""


def _width(which: str) -> Any:
    return param(default=None, lower=NARROWEST, upper=WIDEST, scale="log", doc=f"GGX width of {which}: its roughness squared")


def _index(which: str) -> Any:
    return param(default=None, lower=1.0, upper=3.0, scale="linear", doc=f"index of refraction of {which}", fitted=False)


def _adds(stimulus: str) -> Any:
    return derived(f"what {stimulus} of a film's light adds to each channel")


WIDE = 1.0
"""Width of the lobe that MaterialX keeps beside a base without one: the widest takes the least of the light."""


@layer
class Engine(Surface):
    """A coat over a base of metal, of something diffuse, or of both: what is absent a program is told to leave out."""

    name: str = static(default="engine", doc="name of the layer")
    dialect: str = choice(default="openpbr", others=("gltf", "blender", "three", "babylon"), doc="whose formula it is")
    base_color: Number = _part("reflectance of a metal at normal incidence, and albedo of a diffuse base", 0.5)
    base: str = choice(
        default="metal", others=("diffuse", "mixed", "glossy"), doc="what the base is: both, or a dielectric over diffuse"
    )
    metallic: Number = param(default=None, lower=0.0, upper=1.0, scale="linear", doc="part of a mixed base that is metal")
    edge_tint: Number = _part("what a metal's reflectance at 82 degrees is multiplied by")
    alpha: Number = _width("the lobe of the base")
    alpha_x: Number = _width("that lobe along the tangent")
    alpha_y: Number = _width("that lobe across the tangent")
    ior: Number = _index("a dielectric base, whose lobe lies over its diffuse part")
    coat_alpha: Number = _width("the coat")
    coat_ior: Number = _index("the coat")
    coat_tau: Number = param(
        default=None, lower=0.0, upper=10.0, scale="softlog", soft=0.05, doc="optical depth of the coat, one way", colour=True
    )
    film_nm: Number = param(
        default=None, lower=0.0, upper=2000.0, scale="softlog", soft=100.0, doc="thickness of a film on a metal", unit="nm"
    )
    film_eta: Number = _index("the film")
    film_x: Number = _adds("X")
    film_y: Number = _adds("Y")
    film_z: Number = _adds("Z")

    @property
    def rules(self) -> Dialect:
        """What its program does."""
        return DIALECTS[self.dialect]

    def below(self, n: Scalar) -> "Engine":
        """The same, with what turns the interference of a film to channels: it is colours as others are, not a matrix in the formula."""
        if self.film_nm is None:
            return self
        x, y, z = to_rgb(jnp.asarray(self.film_nm).dtype)
        return replace(self, film_x=x, film_y=y, film_z=z)

    def evaluate(self, wi: Vec3, wo: Vec3) -> Colour:
        """BRDF [1/sr] of directions above the surface."""
        h, c = half_vector(wi, wo), half_cosine(wi, wo)
        base = self._base(wi, wo, h, c)
        if self.coat_alpha is None:
            return base
        F = self._dielectric_reflectance(c, self._index)
        boost = self._compensation(wo[2], self.coat_alpha, F) if self.rules.compensates == "lobes" else 1.0
        coat = F * boost * density("ggx", h, self.coat_alpha) * self._coat_visibility(wi, wo, c)
        return coat + base * self._passed(wi, wo, c, boost)

    def _base(self, wi: Vec3, wo: Vec3, h: Vec3, c: Scalar) -> Any:
        """What lies below the coat, on its own."""
        if self.base == "diffuse":
            return self.base_color / jnp.pi * self._beside(wo, WIDE, 0.0)
        F = self._base_reflectance(wo, c)
        boost = self._base_compensation(wo[2], F)
        hidden = self._mean_width if self.rules.masks_evenly else self._base_width
        lobe = F * boost * density("ggx", h, self._base_width) * visibility("smith", "ggx", wi, wo, hidden)
        if self.base == "metal":
            return lobe
        if self.base == "mixed":
            diffuse = self.base_color / jnp.pi * self._beside(wo, self._mean_width, 0.0)
            if self.rules.metal_dims:
                diffuse = diffuse * (1.0 - self.metallic * self._schlick(c, 0.0))
            return lobe * self.metallic + diffuse * (1.0 - self.metallic)
        f0 = dielectric_f0(self.ior)
        lost = F if self.rules.beside == "half" else f0
        kept = self._beside(wo, self._mean_width, f0, boost) if self.rules.exact else 1.0 - lost
        return lobe + self.base_color / jnp.pi * kept

    def _beside(self, wo: Vec3, alpha: Any, f0: Any, boost: Any = 1.0) -> Any:
        """Part of the light that a dielectric lobe leaves to the diffuse part; MaterialX counts a lobe of no reflectance at the normal, too."""
        if self.rules.compensates != "lobes" and isinstance(f0, float):
            return 1.0
        return 1.0 - directional_albedo(wo[2], alpha, f0) * boost

    @property
    def _base_width(self) -> Any:
        """GGX width of the base, one or two."""
        width = (self.alpha,) if self.alpha_x is None else (self.alpha_x, self.alpha_y)
        if self.rules.widens and self.coat_alpha is not None:
            own = sum(alpha * alpha for alpha in width) / len(width)
            wider = jnp.sqrt(jnp.minimum(own + self.rules.widens * self.coat_alpha * self.coat_alpha, 1.0) / own)
            width = tuple(alpha * wider for alpha in width)
        return width if len(width) == 2 else width[0]

    @property
    def _mean_width(self) -> Any:
        """One width in place of two: of the same area of slopes."""
        width = self._base_width
        return jnp.sqrt(width[0] * width[1]) if isinstance(width, tuple) else width

    def _metal_reflectance(self, c: Scalar) -> Any:
        """Schlick 1994, with the dip before grazing angles where there is an edge tint."""
        if self.edge_tint is None:
            return self._schlick(c, self.base_color)
        return fresnel_hoffman(c, self.base_color, self._edge)

    @property
    def _edge(self) -> Any:
        """Reflectance of a metal at 82 degrees."""
        F = fresnel_schlick(jnp.asarray(EDGE), self.base_color)
        return F if self.edge_tint is None else F * self.edge_tint

    @property
    def _index(self) -> Any:
        return jnp.asarray(COAT_INDEX, self.coat_alpha.dtype) if self.coat_ior is None else self.coat_ior

    def _base_reflectance(self, wo: Vec3, c: Scalar) -> Any:
        if self.base == "glossy":
            return self._dielectric_reflectance(c, self.ior)
        if self.film_nm is None:
            return self._metal_reflectance(c)
        at = wo[2] if self.rules.film == "view" else c
        rgb = (self.film_x, self.film_y, self.film_z)
        if self.rules.film_on == "metal":
            return filmed_metal(at, self.film_nm, self.film_eta, self.base_color, self._edge, rgb)
        return filmed_reflectance(at, self.film_nm, self.film_eta, self.base_color, rgb, self._schlick)

    def _schlick(self, c: Scalar, f0: Any) -> Any:
        """Schlick 1994, or with 2^((-5.55473 c - 6.98316) c) for (1 - c)^5 (Lagarde 2012)."""
        if not self.rules.gaussian:
            return fresnel_schlick(c, f0)
        return f0 + (1.0 - f0) * jnp.exp2((-5.55473 * c - 6.98316) * c)

    def _dielectric_reflectance(self, c: Scalar, eta: Any) -> Any:
        return fresnel_dielectric(c, eta) if self.rules.exact else self._schlick(c, dielectric_f0(eta))

    def _coat_visibility(self, wi: Vec3, wo: Vec3, c: Scalar) -> Any:
        """G / (4 NoL NoV): Smith's, or the short one of Kelemen and Szirmay-Kalos 2001."""
        if self.rules.coat_masking == "smith":
            return visibility("smith", "ggx", wi, wo, self.coat_alpha)
        return 0.25 / jnp.maximum(c * c, 1e-4)

    def _passed(self, wi: Vec3, wo: Vec3, c: Scalar, boost: Any) -> Any:
        """Part of the base's light that comes through the coat."""
        if self.rules.passes == "albedo":
            passed = 1.0 - directional_albedo(wo[2], self.coat_alpha, dielectric_f0(self._index)) * boost
        else:
            passed = 1.0 - self._dielectric_reflectance(wo[2] if self.rules.passes == "view" else c, self._index)
        if self.coat_tau is not None:
            passed = passed * jnp.exp(-self.coat_tau * self._path(wi, wo))
        return passed * self._darkening if self.rules.darkens else passed

    def _path(self, wi: Vec3, wo: Vec3) -> Any:
        """Way through the coat and back, in thicknesses."""
        if self.rules.path == "flat":
            return 2.0
        bent = lambda w: safe_sqrt(1.0 - (1.0 - w[2] * w[2]) / (self._index * self._index))  # noqa: E731
        return 2.0 / bent(wo) if self.rules.path == "view" else 1.0 / bent(wi) + 1.0 / bent(wo)

    @property
    def _darkening(self) -> Any:
        """Light that goes to and fro below the coat, once it is diffuse (OpenPBR 1.1, "Coat darkening")."""
        if self.base != "diffuse":
            return 1.0  # written with coat_darkening = 0: a metal's lobe leaves by the coat
        K = 1.0 - (1.0 - dielectric_f0(self._index)) / (self._index * self._index)
        return (1.0 - K) / (1.0 - self.base_color * K)

    def _base_compensation(self, NoV: Scalar, F: Any) -> Any:
        """What the lobe of the base, of the reflectance F, is scaled by."""
        if self.rules.compensates is None:
            return 1.0
        if self.rules.compensates == "lobes":
            return self._compensation(NoV, self._mean_width, F)
        f0 = dielectric_f0(self.ior) if self.base == "glossy" else self.base_color
        if self.film_nm is not None and self.rules.compensates == "filmed":
            f0 = F
        across = self.alpha if self.alpha_x is None else jnp.minimum(self.alpha_x, self.alpha_y)
        return self._compensation(NoV, across, f0 * self.metallic if self.base == "mixed" else f0)

    def _compensation(self, NoV: Scalar, alpha: Any, F: Any) -> Any:
        """What a lobe is scaled by for light that meets several facets (Turquin 2019, eq. 16)."""
        single = directional_albedo(NoV, alpha, 1.0)
        return 1.0 + F * (1.0 - single) / single


def directional_albedo(NoV: Scalar, alpha: Any, f0: Any) -> Any:
    """Part of the light that a GGX lobe sends back to a viewer: MaterialX's fit to its table (`mx_ggx_dir_albedo_analytic`)."""
    x, y = NoV, alpha
    terms: Any = (1.0, x, y, x * y, x * x, y * y, x * x * y, x * y * y, x * x * y * y)
    r0, r1, r2, r3 = (sum((k * t for k, t in zip(row, terms, strict=True)), 0.0 * x) for row in _ALBEDO)
    return f0 * clip(r0 / r2, 0.0, 1.0) + clip(r1 / r3, 0.0, 1.0)


_ALBEDO = (
    (0.1003, -0.6303, 9.748, -2.038, 29.34, -8.245, -26.44, 19.99, -5.448),
    (0.9345, -2.323, 2.229, -3.748, 1.424, -0.7684, 1.436, 0.2913, 0.6286),
    (1.0, -1.765, 8.263, 11.53, 28.96, -7.507, -36.11, 15.86, 33.37),
    (1.0, 0.2281, 15.94, -55.83, 13.08, 41.26, 54.9, 300.2, -285.1),
)
"""Factors of 1, x, y, xy, x^2, y^2, x^2 y, x y^2, x^2 y^2 in both numerators, then in both denominators: numbers of MaterialX 1.39."""
