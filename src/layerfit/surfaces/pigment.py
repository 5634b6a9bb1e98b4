"""Pigment that hides or tints what is below: layers of two diffuse fluxes over a substrate."""

import itertools
from functools import reduce
from typing import Any, ClassVar

from .._chunk import static
from .._fields import layer, param
from .._types import Colour, Number, Scalar
from ..optics.scattering import TwoFlux, kubelka_munk, kubelka_munk_over
from .base import Surface
from .diffuse import Lambert

DARKENS, BRIGHTENS = ("kx", "kx_2", "kx_3"), ("sx", "sx_2", "sx_3", "substrate")
"""Fields by what they do to the albedo."""


def _kx(default: float | None, which: str = "") -> Any:
    doc = f"absorption of diffuse light, K times the thickness{which}"
    return _depth(default, doc, fitted=not which)


def _sx(default: float | None, which: str = "") -> Any:
    doc = f"scattering of diffuse light, S times the thickness{which}"
    return _depth(default, doc, fitted=False)


def _depth(default: float | None, doc: str, fitted: bool) -> Any:
    return param(default=default, lower=0.0, upper=1e3, scale="softlog", soft=0.05, doc=doc, colour=True, fitted=fitted)


def _gauges() -> tuple[tuple[str, str, float, str], ...]:
    why = "{} and {} are seen by the albedo alone that they make; of a layer that hides what is below, by their ratio"
    pairs = itertools.combinations((*DARKENS, *BRIGHTENS), 2)
    return tuple((a, b, -1.0 if (a in DARKENS) == (b in DARKENS) else 1.0, why.format(a, b)) for a, b in pairs)


@layer
class KubelkaMunk(Surface):
    """Paint, plaster or paper: up to three layers that absorb and scatter diffuse light (Kubelka and Munk 1931), outermost first.

    All of it is one albedo a channel, R = R1 + T1^2 R2 / (1 - R1 R2) from the substrate up, which is computed once a material: a shader
    holds that of a Lambertian boundary. There is no index. A body without a binder, such as plaster or chalk, has no boundary; a paint has
    one, and that is a clear coat above, which makes of Saunderson's correction one for every direction.
    """

    together: ClassVar = (("kx_2", "sx_2"), ("kx_3", "sx_3"))
    only_with: ClassVar = {"kx_3": ("kx_2",)}
    gauges: ClassVar = _gauges()
    """Pairs of fields that an image cannot tell apart: as the first grows, the second with it (1) or against it (-1); and why."""

    name: str = static(default="base", doc="name of the layer")
    kx: Number = _kx(2.0)
    sx: Number = _sx(20.0)
    kx_2: Number = _kx(None, ", of the layer below")
    sx_2: Number = _sx(None, ", of the layer below")
    kx_3: Number = _kx(None, ", of the third layer")
    sx_3: Number = _sx(None, ", of the third layer")
    substrate: Number = param(
        default=None,
        lower=0.0,
        upper=1.0,
        scale="linear",
        doc="light that comes back from below all layers; absent: none",
        colour=True,
        fitted=False,
    )

    @property
    def pigments(self) -> tuple[TwoFlux, ...]:
        """The layers, outermost first."""
        depths = ((self.kx, self.sx), (self.kx_2, self.sx_2), (self.kx_3, self.sx_3))
        return tuple(kubelka_munk(Kx, Sx) for Kx, Sx in depths if Kx is not None)

    @property
    def albedo(self) -> Colour:
        """Part of diffuse light that all layers and the substrate send back."""
        *above, lowest = self.pigments
        bottom = lowest.R if self.substrate is None else kubelka_munk_over(lowest, self.substrate)
        return reduce(lambda R, pigment: kubelka_munk_over(pigment, R), reversed(above), bottom)

    @property
    def diffuse(self) -> Lambert:
        return Lambert(name=self.name, albedo=self.albedo)

    def below(self, n: Scalar) -> Lambert:
        """What is left of it once a material: an albedo, under a medium of any index."""
        return self.diffuse

    @property
    def lacks(self) -> tuple[str, ...]:
        """What it does without, in words."""
        return ("substrate",) if self.substrate is None else ()
