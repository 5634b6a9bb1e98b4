"""The precise form: the closed form nearest to the random walk, for one coat or two over a diffuse or a metal base.

`one_coat` says how it is made, `two_coats` what a second coat adds.
"""

import dataclasses
from typing import Any

from .._chunk import where
from .._types import Colour, Direction
from ..layers import Coat
from ..optics.directions import above, both_above
from ..surfaces.microfacet import Conductor
from . import one_coat, two_coats
from .tables import Kind

Prepared = one_coat.Prepared | two_coats.Prepared

BAKED = ("alpha", "alpha_x", "alpha_y", "eta")
"""Fields of the coats that a shader holds as constants, through the curves that they give."""


@dataclasses.dataclass(frozen=True)
class Precise:
    """The precise form. `interface` is what happens at the coat's rough top.

    `single`: light meets one facet, as in most renderers; a rough coat loses energy. `multi`: as many as it takes.
    """

    interface: Kind = "single"


def refuses(layers: tuple[Any, ...], base: Any) -> str | None:
    """Why a material is not of this form, or None."""
    if len(layers) not in (1, 2):
        return "it is for one coat or two" if layers else "there is no coat"
    for coat in layers:
        if coat.fresnel != "exact":
            return f"{coat.name} has the reflectance of {coat.fresnel}, and the tables were made with the exact one"
        if coat.tau_s is not None:
            return f"{coat.name} scatters light"
    surfaces = (*layers, base)
    if filmed := next((surface.name for surface in surfaces if getattr(surface, "has_film", False)), None):
        return f"{filmed} has a thin film, and the tables were made without"
    if len(layers) == 2 and (odd := next((surface for surface in surfaces if not _plain(surface)), None)):
        return f"{odd.name} is not isotropic GGX, and two coats are only of such"
    if not base.lobes:
        return None
    if not isinstance(base, Conductor):
        return f"{base.name} is neither diffuse alone (lambert, oren_nayar, kubelka_munk) nor a conductor, the bases that it was made for"
    if base.distribution != "ggx":
        return f"{base.name} is not GGX"
    return None


def _plain(surface: Any) -> bool:
    """Whether it has GGX facets of one width, or none at all."""
    return getattr(surface, "distribution", "ggx") == "ggx" and not isinstance(getattr(surface, "width", None), tuple)


def prepare(coats: tuple[Coat, ...], base: Any, options: Precise) -> Prepared:
    """Look up what the interfaces do and bake it, for a material that `refuses` has nothing against."""
    if len(coats) == 2:
        return two_coats.prepare(coats[0], coats[1], base, options.interface)
    return one_coat.prepare(coats[0], base, options.interface)


def held(prepared: Prepared) -> dict[str, Any]:
    """Parts of a prepared material that a shader holds as constants, also where its other numbers can be set."""
    form = two_coats if isinstance(prepared, two_coats.Prepared) else one_coat
    return {name: getattr(prepared, name) for name in form.HELD}


def evaluate(prepared: Prepared, wi: Direction, wo: Direction, options: Precise) -> Colour:
    """BRDF [1/sr] of unit directions above the surface; 0 where either is below it."""
    lit = both_above(wi, wo)
    wi, wo = above(lit, wi), above(lit, wo)
    if isinstance(prepared, two_coats.Prepared):
        return where(lit, two_coats.evaluate(prepared, wi, wo), 0.0)
    return where(lit, one_coat.evaluate(prepared, wi, wo), 0.0)
