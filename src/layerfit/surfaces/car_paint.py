"""Car paint as it is measured: a diffuse part and up to three lobes of facets (Guenther et al. 2005; Rump et al. 2008)."""

import dataclasses
import math
from typing import Any, ClassVar

import jax.numpy as jnp

from .._chunk import static
from .._fields import choice, layer, param
from .._types import Colour, Number, Scalar, Vec3
from ..optics.fresnel import fresnel_schlick
from ..optics.microfacet import Width, density, v_cavity
from .base import Lobe
from .diffuse import TwoParts, kd_param
from .microfacet import alpha_param

SCALES = {"normalized": 1.0, "rump": 4.0 / math.pi, "cook_torrance": 4.0}
"""What a lobe is over F D G / (4 NoL NoV), with D normalised."""


@dataclasses.dataclass(frozen=True)
class PaintLobe(Lobe):
    """One lobe: Beckmann facets in V-shaped grooves, reflectance by Schlick."""

    ks: Colour
    f0: Scalar
    alpha: Scalar
    scale: float

    @property
    def width(self) -> Width:
        return self.alpha

    def reflectance(self, c: Scalar) -> Colour:
        return self.scale * self.ks * fresnel_schlick(c, self.f0)

    def energy(self, reflectance: Colour) -> Colour:
        return jnp.minimum(reflectance, 1.0)

    def shape(self, wi: Vec3, wo: Vec3, h: Vec3, width: Width | None = None) -> Scalar:
        D = density("beckmann", h, self.alpha if width is None else width)
        V = v_cavity(wi, wo)
        return D * V


def _ks(default: float | None) -> Any:
    return param(default=default, lower=0.0, upper=1.0, scale="softlog", soft=0.01, doc="strength of the lobe", colour=True)


def _f0(default: float | None) -> Any:
    return param(
        default=default, lower=0.0, upper=1.0, scale="linear", doc="reflectance of its facets at the normal", fitted=False
    )


@layer
class CarPaint(TwoParts):
    """A diffuse part beside up to three Cook-Torrance lobes: kd / pi + sum of ks F D G / (q NoL NoV).

    Widths are the paper's m. `scaling` says what q is, and so what `ks` means: 4 with the normalised D; pi with it, as by Rump et al. 2008;
    pi with the D of Cook and Torrance 1982, which is pi times as large. Only the product of `ks` and `f0` is well known near the normal.
    A second and third lobe are there where all of their fields are. A lobe may stand for the clear coat, or there is a coat above.
    """

    together: ClassVar = (("ks_2", "f0_2", "alpha_2"), ("ks_3", "f0_3", "alpha_3"))

    name: str = static(default="base", doc="name of the layer")
    kd: Number = kd_param()
    ks: Number = _ks(0.1)
    f0: Number = _f0(0.5)
    alpha: Number = alpha_param(default=0.3, which=" of the lobe")
    ks_2: Number = _ks(None)
    f0_2: Number = _f0(None)
    alpha_2: Number = alpha_param(default=None, which=" of the second lobe")
    ks_3: Number = _ks(None)
    f0_3: Number = _f0(None)
    alpha_3: Number = alpha_param(default=None, which=" of the third lobe")
    scaling: str = choice(
        default="normalized", others=("rump", "cook_torrance"), doc="lobes by the light that they send back, or as published"
    )

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        return tuple(self._lobe(suffix) for suffix in ("", "_2", "_3") if getattr(self, f"ks{suffix}") is not None)

    def _lobe(self, suffix: str) -> PaintLobe:
        ks, f0, alpha = (getattr(self, f"{name}{suffix}") for name in ("ks", "f0", "alpha"))
        return PaintLobe(ks, f0, alpha, SCALES[self.scaling])
