"""Car paint as it is measured: a diffuse part and up to three lobes of facets (Guenther et al. 2005; Rump et al. 2008).

Rump et al. tell a paint's mean look, which those are, from what its particles do to single points: a residual, whose mean over the surface
is zero. Theirs is a table of pictures. Here it is drawn: a part of each lobe's spread of slopes is the tilt of flakes, hashed
from their place. The lobe of one flake is narrower, and their mean is the lobe, exactly, since slopes of Beckmann's facets add.
"""

import dataclasses
import math
from typing import Any, ClassVar

import jax.numpy as jnp

from .._chunk import safe_sqrt, static
from .._fields import choice, layer, param
from .._place import TANGENT, Place
from .._types import Colour, Direction, Number, Scalar, Vec2
from ..optics.flakes import flake_tilt, kept_tilt, lost_variance, tilted_d
from ..optics.fresnel import fresnel_schlick
from ..optics.microfacet import Width, density, v_cavity
from .base import Lobe, Surface, widened_variance
from .diffuse import TwoParts, kd_param
from .flakes import half_distance_param, per_uv_param, seed_param
from .microfacet import alpha_param

SCALES = {"normalized": 1.0, "rump": 4.0 / math.pi, "cook_torrance": 4.0}
"""What a lobe is over F D G / (4 NoL NoV), with D normalised."""


@dataclasses.dataclass(frozen=True)
class Tilt:
    """How the flake at a place is tilted, among tilts of spread 1; `lost` of their variance is not drawn at its distance."""

    slope: Vec2
    lost: Scalar


@dataclasses.dataclass(frozen=True)
class PaintLobe(Lobe):
    """One lobe: Beckmann facets in V-shaped grooves, reflectance by Schlick."""

    ks: Colour
    f0: Scalar
    alpha: Scalar
    scale: float
    sparkle: Scalar | None = None
    tilt: Tilt | None = None
    """Of the flake at a place; absent for the mean over the surface, and where nothing sparkles."""

    @property
    def width(self) -> Width:
        return self.alpha

    def reflectance(self, c: Scalar) -> Colour:
        return self.scale * self.ks * fresnel_schlick(c, self.f0)

    def energy(self, reflectance: Colour) -> Colour:
        return jnp.minimum(reflectance, 1.0)

    def shape(self, wi: Direction, wo: Direction, h: Direction, width: Width | None = None) -> Scalar:
        V = v_cavity(wi, wo)
        if self.sparkle is not None and self.tilt is not None:
            return self._flake_d(h, self.sparkle, self.tilt, None) * V
        D = density("beckmann", h, self.alpha if width is None else width)
        return D * V

    def widened(self, wi: Direction, wo: Direction, h: Direction, width: Width, added: Width) -> Scalar:
        if self.sparkle is None or self.tilt is None:
            return self.shape(wi, wo, h, width)
        return self._flake_d(h, self.sparkle, self.tilt, added) * v_cavity(wi, wo)

    def _flake_d(self, h: Direction, sparkle: Scalar, tilt: Tilt, added: Width | None) -> Scalar:
        """Density of the facets of one flake: they lack the part of the spread that its tilt is drawn of."""
        whole = self.alpha * self.alpha
        own = whole * (1.0 - sparkle) + tilt.lost * (sparkle * whole)
        return tilted_d(h, safe_sqrt(sparkle) * self.alpha * tilt.slope, widened_variance(own, added))


def _ks(default: float | None) -> Any:
    return param(default=default, lower=0.0, upper=1.0, scale="softlog", soft=0.01, doc="strength of the lobe", colour=True)


def _f0(default: float | None) -> Any:
    return param(
        default=default, lower=0.0, upper=1.0, scale="linear", doc="reflectance of its facets at the normal", fitted=False
    )


def _sparkle(which: str) -> Any:
    doc = f"part of the spread of slopes{which} that is from flake to flake; absent: none"
    return param(default=None, lower=0.0, upper=0.99, scale="linear", doc=doc, fitted=False)


@layer
class CarPaint(TwoParts):
    """A diffuse part beside up to three Cook-Torrance lobes: kd / pi + sum of ks F D G / (q NoL NoV).

    Widths are the paper's m. `scaling` says what q is, and so what `ks` means: 4 with the normalised D; pi with it, as by Rump et al. 2008;
    pi with the D of Cook and Torrance 1982, which is pi times as large. Only the product of `ks` and `f0` is well known near the normal.
    A second and third lobe are there where all of their fields are. A lobe may stand for the clear coat, or there is a coat above.
    With `sparkle` the paint is seen flake by flake, less and less with the distance, and in the mean where there is no place.
    """

    together: ClassVar = (
        ("ks_2", "f0_2", "alpha_2"),
        ("ks_3", "f0_3", "alpha_3"),
        ("sparkle", "per_uv", "half_distance", "seed"),
    )
    only_with: ClassVar = {"sparkle_2": ("ks_2", "sparkle"), "sparkle_3": ("ks_3", "sparkle")}
    averages: ClassVar[bool] = True

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = _ks(0.1)
    f0: Number = _f0(0.5)
    alpha: Number = alpha_param(default=0.3, which=" of the lobe")
    sparkle: Number = _sparkle("")
    ks_2: Number = _ks(None)
    f0_2: Number = _f0(None)
    alpha_2: Number = alpha_param(default=None, which=" of the second lobe")
    sparkle_2: Number = _sparkle(" of the second lobe")
    ks_3: Number = _ks(None)
    f0_3: Number = _f0(None)
    alpha_3: Number = alpha_param(default=None, which=" of the third lobe")
    sparkle_3: Number = _sparkle(" of the third lobe")
    per_uv: Number = per_uv_param(None)
    half_distance: Number = half_distance_param(None)
    seed: Number = seed_param(None)
    scaling: str = choice(
        default="normalized", others=("rump", "cook_torrance"), doc="lobes by the light that they send back, or as published"
    )

    @property
    def reads(self) -> tuple[str, ...]:
        """What it needs to know of a place of the surface."""
        return () if self.sparkle is None else ("uv", "distance", TANGENT)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return self.lobes_of(None)

    def lobes_of(self, tilt: Tilt | None) -> tuple[Lobe, ...]:
        """The lobes of the flake at a place, or of all in the mean."""
        return tuple(self._lobe(suffix, tilt) for suffix in ("", "_2", "_3") if getattr(self, f"ks{suffix}") is not None)

    def _lobe(self, suffix: str, tilt: Tilt | None) -> PaintLobe:
        ks, f0, alpha, sparkle = (getattr(self, f"{name}{suffix}") for name in ("ks", "f0", "alpha", "sparkle"))
        return PaintLobe(ks, f0, alpha, SCALES[self.scaling], sparkle, tilt)

    def at(self, place: Place) -> Surface:
        """The paint at a place of the surface."""
        kept = kept_tilt(place.distance, self.half_distance)
        slope = flake_tilt(place.uv, self.per_uv, kept, self.seed.astype(jnp.uint32))
        lost = lost_variance(place.distance, self.half_distance)
        return PaintThere(self, Tilt(slope, lost))


@dataclasses.dataclass(frozen=True)
class PaintThere(Surface):
    """The flake at one place, and the rest of the paint."""

    paint: CarPaint
    tilt: Tilt

    @property
    def diffuse(self) -> Any:
        return self.paint.diffuse

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return self.paint.lobes_of(self.tilt)
