"""The formula of the paper: Weidlich and Wilkie 2007 as adapted by Elek 2010.

f = f_top(wi, wo) + T12 f_below(wi', wo') a t, with t = (1 - G) + T21 G, recursively from the outermost layer inwards.
Kept as published, with the choices that the paper leaves open as options. It is 60 to 190 % off what a layered
surface does below its coat (no 1 / eta^2, one bounce, a smooth way through a rough coat): `corrected` is the form to fit with.
"""

import dataclasses
from typing import Any, Literal

from .._chunk import divide, safe_divide, struct, where
from .._types import Colour, Direction, Scalar
from ..layers import Coat
from ..optics.directions import above, both_above
from ..optics.medium import cosine_below, refract_about_facet, refract_about_normal, transmittance
from ..optics.microfacet import half_cosine, half_vector


@dataclasses.dataclass(frozen=True)
class Faithful:
    """Options of the faithful form: what the paper leaves open.

    `refract_at`: rays bend at the facet ("h", as Weidlich and Wilkie: facets much larger than the layer is thick) or at the
    surface ("n", not reciprocal). `fresnel_at`: transmittances are taken there. `absorb_at`: so is the path through the medium.
    `masked`: light that facets hide leaves without loss, the part 1 - G; without it t = T21, as below a smooth lacquer. With both
    at "n" that is Neumann and Neumann 1989.
    """

    refract_at: Literal["h", "n"] = "h"
    fresnel_at: Literal["h", "n"] = "h"
    absorb_at: Literal["n", "h"] = "n"
    masked: bool = True


def refuses(layers: tuple[Any, ...], base: Any) -> str | None:
    """Why a material is not of this form, or None."""
    scatters = next((layer.name for layer in layers if layer.tau_s is not None), None)
    return f"{scatters} scatters light, which this form does not know" if scatters else None


@struct
class Prepared:
    """A stack with every index relative to the medium above."""

    coats: tuple[Coat, ...]
    base: Any


def prepare(coats: tuple[Coat, ...], base: Any, options: Faithful) -> Prepared:
    """Relative indices, outermost coat first."""
    n: Any = 1.0
    relative = []
    for coat in coats:
        relative.append(coat.below(n))
        n = coat.eta
    return Prepared(tuple(relative), base.below(n))


def evaluate(prepared: Prepared, wi: Direction, wo: Direction, options: Faithful) -> Colour:
    """BRDF [1/sr] of unit directions above the surface."""
    lit = both_above(wi, wo)
    return where(lit, _evaluate(prepared.coats, prepared.base, above(lit, wi), above(lit, wo), None, options), 0.0)


Half = tuple[Direction, Scalar] | None
"""Half vector of two directions, and its cosine to them, where they are known."""


def _evaluate(coats: tuple[Coat, ...], base: Any, wi: Direction, wo: Direction, half: Half, options: Faithful) -> Colour:
    if coats:
        return _coat_over(coats[0], coats[1:], base, wi, wo, half, options)
    return base.evaluate(wi, wo) if half is None else base.about(wi, wo, *half)


def _coat_over(
    coat: Coat, below: tuple[Coat, ...], base: Any, wi: Direction, wo: Direction, half: Half, options: Faithful
) -> Colour:
    if half is None:
        h = half_vector(wi, wo)
        c = half_cosine(wi, wo)
    else:
        h, c = half
    F = coat.reflectance(c)
    D = coat.density(h)
    V = coat.visibility(wi, wo)
    top = F * V * D
    half = None
    if options.refract_at == "h":
        # Bent about it, both keep their half vector: all layers have the same.
        c_below = cosine_below(c, coat.eta)
        half = h, c_below
        wi_below = refract_about_facet(wi, h, c, c_below, coat.eta)
        wo_below = refract_about_facet(wo, h, c, c_below, coat.eta)
    else:
        wi_below = refract_about_normal(wi, coat.eta)
        wo_below = refract_about_normal(wo, coat.eta)
    if options.fresnel_at == "h":
        T12 = T21 = coat.transmittance(c)
        R21 = F
    else:
        T12 = coat.transmittance(wi[-1])
        T21 = coat.transmittance(wo[-1])
        R21 = 1.0 - T21
    t = 1.0 - 4.0 * wi[-1] * (R21 * V * wo[-1]) if options.masked else T21
    # Lost by total internal reflection: no light. The guard keeps derivatives finite.
    lit = both_above(wi_below, wo_below)
    wi_below, wo_below = above(lit, wi_below), above(lit, wo_below)
    rest = T12 * t * _evaluate(below, base, wi_below, wo_below, half, options)
    if coat.tau is not None:
        if options.absorb_at == "h":
            path = safe_divide(2.0, half_cosine(wi_below, wo_below) if half is None else half[1])
        else:
            path = divide(wi_below[-1] + wo_below[-1], wi_below[-1] * wo_below[-1])
        rest = rest * transmittance(coat.tau, path)
    return where(lit, top + rest, top)
