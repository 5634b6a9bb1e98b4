"""The patina of a metal: bare metal where nothing has grown yet, elsewhere film and crust over it.

f = (1 - M) f_metal + M (f_film + w f_crust), after Elek 2010: M is what is covered at a place, f_film the film as a coat over the
metal, which may scatter, and f_crust the diffuse crust. As published (`mixing = "added"`) the film is clear, and light that is scattered once
below its boundary is added to the crust's. What is added hides nothing of the film: that energy is the user's to keep, by the absorption of
the film and by w.
"""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, member, struct, where
from .._place import Place
from .._types import Colour, Direction, Scalar
from ..errors import InputError
from ..layers import Patina
from ..optics.directions import above, both_above, product
from ..optics.fresnel import transmittance_dielectric
from ..optics.growth import onset, tarnish_thickness
from ..optics.medium import refract_about_normal
from ..optics.scattering import henyey_greenstein, kubelka_munk, scattered_back
from ..surfaces import Conductor
from . import corrected, faithful
from .enclosure import haze_below
from .growth import MEAN_SKY, Cover, Growth, aged_at, cover_at, field_at, growth_of, mean_cover
from .haze import EVENLY

FORMS = {corrected.Corrected: corrected, faithful.Faithful: faithful}
"""What the film can be computed in."""

NODES = 6
"""Of the quadrature over directions in a film that scatters, for each place anew: within .005 of what is scattered again."""


@struct
class Crust:
    """How a patina grows thicker, and what scatters light in it, one onset time after it began."""

    blur: Scalar = member("time in which growth sets in, in onset times")
    albedo: Colour | None = member("part that is scattered once, of the light that is met; as published")
    depth: Scalar | None = member("optical depth of what scatters once")
    g: Any = member("mean cosine of scattering once")
    absorbed: Colour | None = member("absorption of the crust, K times its thickness")
    scattered: Colour | None = member("scattering of the crust, S times its thickness")
    weight: Scalar | None = member("part that counts of the light that is added")


@struct
class Spot:
    """A patina at one place."""

    cover: Cover
    thickness: Scalar = member("thickness there, over that of one onset time")


@struct
class Prepared:
    """The film over the metal, the metal in air, how far the growth has come, and what scatters."""

    film: Any
    bare: Any
    growth: Growth
    crust: Crust
    spot: Spot | None
    """Absent for the mean over the surface."""

    def at(self, place: Place) -> "Prepared":
        """The patina of one place."""
        growth = aged_at(self.growth, place.sky)
        g = field_at(place.uv, growth)
        cover = cover_at(g, growth)
        thickness = thickness_at(g, growth, self.crust.blur)
        return dataclasses.replace(self, spot=Spot(cover, thickness))


@chunk
def thickness_at(g: Scalar, growth: Growth, blur: Scalar) -> Scalar:
    """Thickness where the field is g, over that of one onset time after the growth of a place began."""
    one = jnp.ones_like(g)
    t_on = onset(g, one, growth.steepness)
    return tarnish_thickness(growth.age, t_on, one, blur)


def mean_spot(prepared: Prepared) -> Spot:
    """What stands for a whole surface: the mean of what is covered, as thick as where the field has its mean of that."""
    growth = aged_at(prepared.growth, MEAN_SKY)
    cover, g = mean_cover(growth)
    return Spot(cover, thickness_at(g, growth, prepared.crust.blur))


def grows(layers: tuple[Any, ...]) -> bool:
    """Whether there is a patina among the layers."""
    return any(isinstance(layer, Patina) for layer in layers)


def refuses(layers: tuple[Any, ...], base: Any) -> str | None:
    """Why a patina cannot be where it is, or None."""
    name = next((layer.name for layer in layers if isinstance(layer, Patina)), None)
    if name is None or (len(layers) == 1 and isinstance(base, Conductor)):
        return None
    wrong = "it is one of several layers" if len(layers) > 1 else f"its base is {type(base).__name__}"
    return f"{name} is a patina, which lies alone over a conductor; here {wrong}"


def form_refuses(layers: tuple[Any, ...], form: type) -> str | None:
    """Why a material that changes in time has not this form, or None."""
    if form not in FORMS:
        return "it changes in time"
    scatters = next((layer for layer in layers if isinstance(layer, Patina) and layer.film.tau_s is not None), None)
    if form is faithful.Faithful and scatters is not None:
        return f'{scatters.name} scatters light in its film, which this form does not know: give it mixing = "added"'
    return None


def prepare(layers: tuple[Any, ...], base: Any, form: Any) -> Prepared:
    """The film's constants in its form, and how far the growth has come. Raises `InputError` where a patina cannot be."""
    if reason := refuses(layers, base):
        raise InputError(reason)
    if type(form) not in FORMS:
        raise InputError(f"a patina has no {type(form).__name__.lower()} form: use corrected or faithful")
    if reason := form_refuses(layers, type(form)):
        raise InputError(reason)
    (layer,) = layers
    film = FORMS[type(form)].prepare((layer.film,), base, form)
    crust = Crust(**{field.name: getattr(layer, field.name) for field in dataclasses.fields(Crust)})
    if film.coats[0].tau_s is not None:
        film = dataclasses.replace(film, haze=None)  # that of every thickness is computed at its place
        crust = dataclasses.replace(crust, albedo=None, depth=None, g=None)
    return Prepared(film=film, bare=base.below(1.0), growth=growth_of(layer), crust=crust, spot=None)


def evaluate(prepared: Prepared, wi: Direction, wo: Direction, form: Any) -> Colour:
    """BRDF [1/sr] of unit directions above the surface; 0 where either is below it. `form` is that of the film."""
    lit = both_above(wi, wo)
    wi, wo = above(lit, wi), above(lit, wo)
    spot = prepared.spot or mean_spot(prepared)
    film = _as_thick(prepared.film, spot.thickness, form)
    patina = FORMS[type(form)].evaluate(film, wi, wo, form)
    scattered = _scattered(prepared.crust, film.coats[0].eta, spot.thickness, wi, wo)
    if scattered is not None:
        patina = patina + scattered
    bare = prepared.bare.evaluate(wi, wo)
    f = spot.cover.bare * bare + spot.cover.covered * patina
    return where(lit, f, 0.0)


def _as_thick(film: Any, thickness: Scalar, form: Any) -> Any:
    """The film where it is so many times as thick."""
    (coat,) = film.coats
    depths = {name: getattr(coat, name) * thickness for name in ("tau", "tau_s") if getattr(coat, name) is not None}
    coat = dataclasses.replace(coat, **depths)
    film = dataclasses.replace(film, coats=(coat,))
    if getattr(film, "trapped", None) is not None:
        film = dataclasses.replace(film, trapped=corrected.trapped_light(film.base, coat.extinction, coat.eta))
    if coat.tau_s is not None and form.multiple:
        film = dataclasses.replace(film, haze=haze_below([coat], list(film.interfaces), film.base, NODES))
    return film


def _scattered(crust: Crust, eta: Scalar, thickness: Scalar, wi: Direction, wo: Direction) -> Colour | None:
    """Light that film and crust scatter, or None where neither does."""
    total: Any = None
    if crust.albedo is not None and crust.depth is not None:
        once = scattered_once(wi, wo, eta, crust.albedo, crust.depth * thickness, crust.g)
        total = once
    if crust.absorbed is not None and crust.scattered is not None:
        layer = kubelka_munk(crust.absorbed * thickness, crust.scattered * thickness)
        diffuse = layer.R / math.pi
        total = diffuse if total is None else total + diffuse
    return total if total is None or crust.weight is None else crust.weight * total


@chunk
def scattered_once(wi: Direction, wo: Direction, eta: Scalar, albedo: Colour, depth: Scalar, g: Scalar | None) -> Colour:
    """BRDF [1/sr] of light that is scattered once below a smooth boundary (Hanrahan and Krueger 1993); without g the same to all sides."""
    T = transmittance_dielectric(wi[-1], eta) * transmittance_dielectric(wo[-1], eta)
    wi = refract_about_normal(wi, eta)
    wo = refract_about_normal(wo, eta)
    phase = EVENLY if g is None else henyey_greenstein(1.0 + product(wi, wo), g)
    return T / (eta * eta) * scattered_back(phase, albedo, depth, wi[-1], wo[-1])
