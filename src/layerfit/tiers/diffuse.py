"""A coat over a diffuse base, compact: light from below is a product of what happens to each direction.

Over diffuse grooves (Oren and Nayar 1994) a factor of both directions is left, which takes them as they are under the coat.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import chunk, member, safe_sqrt, static, struct, where
from .._types import Colour, Flag, Scalar
from ..forms import one_coat
from ..forms.crossing import cross
from ..forms.curves import curve, grazing
from ..layers import Coat
from ..optics.interface import with_second_facet
from ..surfaces.diffuse import Lambert, OrenNayar
from .polynomial import Curve, Polynomial
from .surface import Argument, Compact, Recipe, argument, at, best_argument, colour_of, cosines, half_root
from .top import coat_lobe, coat_shape, half_cosines, hidden_cosine, reflectance_curve, without_film


@struct
class DiffuseWay:
    """One direction on its way through the coat to a diffuse base, and back."""

    NoW: Scalar = member("cosine above")
    hidden: Scalar = member("NoW (1 + 2 Lambda) of the coat's facets")
    passed: Scalar = member("energy that passes the coat's top")
    left: Colour = member("square root of the share of the light that leaves, one way, over what passed")


@struct
class GroovedWay:
    """The same above diffuse grooves."""

    NoW: Scalar = member("cosine above")
    hidden: Scalar = member("NoW (1 + 2 Lambda) of the coat's facets")
    passed: Scalar = member("energy that passes the coat's top")
    left: Colour = member("square root of the share of the light that leaves, one way, over what passed")
    sin2: Scalar = member("squared sine above")
    sine: Scalar = member("sine above")
    bend: Scalar = member("sine below over that above")
    z: Scalar = member("cosine below")
    polar: Scalar = member("polar angle below, in right angles")


@struct
class DiffuseUnderCoat(Compact):
    """Coat and diffuse base, and the curves of what lies under the coat."""

    coat: Coat
    tilt: Scalar
    """Turn of the mean facet towards a grazing direction."""
    passed: Polynomial
    """Of the cosine of the mean facet, under a film of its root: energy that passes, by the closed form."""
    left: Polynomial
    """Of `argument`: what is left of it, and in the precise form what the energy is beyond the closed one."""
    film: Polynomial | None
    """Of the root of the half cosine: reflectance of the top with its film."""
    bent: Polynomial | None
    """Of `argument`: sine below over that above, and polar angle below over that sine, where the base has grooves."""
    grooves: OrenNayar | None
    argument: Argument = static(default="cosine")
    beyond: bool = static(default=False)
    """Whether `left` has the energy beyond the closed form."""
    name: str = static(default="material")
    note: str = static(default="")

    def way(self, NoW: Scalar) -> Any:
        x = argument(self.argument, NoW, self.tilt)
        left = self.left(x)
        T = self.passed(argument("facet" if self.film is None else "root", NoW, self.tilt))
        if self.beyond:
            T, left = T + left[-1], colour_of(left)
        hidden = hidden_cosine(NoW, self.coat.alpha * self.coat.alpha)
        if self.bent is None:
            return DiffuseWay(NoW, hidden, T, left)
        return grooved_way(self.bent(x), NoW, hidden, T, left)

    def meet(self, i: Any, o: Any, lean2: Scalar, lit: Flag) -> Colour:
        lobe = coat_lobe if self.film is None else coat_shape
        top: Any = where(lit, lobe(self.coat, i.NoW, o.NoW, i.hidden, o.hidden, lean2), 0.0)
        if self.film is not None:
            M = i.NoW + o.NoW
            top = self.film(half_root(lean2 + M * M)) * top
        passed: Any = i.passed * o.passed
        if self.grooves is not None:
            shape = grooves_full if self.grooves.form == "full" else grooves_qualitative
            passed = passed * shape(self.grooves, i, o, 0.5 * (lean2 - i.sin2 - o.sin2))
        # All colours are finite below the surface too. To choose numbers, not the sum, takes an eighth off the time of four lights.
        return top + i.left * o.left * where(lit, passed, 0.0)


@chunk
def grooved_way(bent: Any, NoW: Scalar, hidden: Scalar, passed: Scalar, left: Colour) -> GroovedWay:
    """What grooves ask for of one direction below the coat."""
    sin2 = (1.0 - NoW) * (1.0 + NoW)
    sine = safe_sqrt(sin2)
    bend = bent[0]
    z = jnp.sqrt(1.0 - bend * bend * sin2)
    return GroovedWay(NoW, hidden, passed, left, sin2, sine, bend, z, bent[1] * (bend * sine))


@chunk
def grooves_qualitative(base: OrenNayar, i: GroovedWay, o: GroovedWay, along: Scalar) -> Scalar:
    """`oren_nayar_qualitative` over Lambert; `along` is the product of the directions' parts along the surface, above the coat."""
    sigma2 = base.sigma * base.sigma
    A = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    return A + B * jnp.maximum(i.bend * o.bend * along, 0.0) / jnp.maximum(i.z, o.z)


@chunk
def grooves_full(base: OrenNayar, i: GroovedWay, o: GroovedWay, along: Scalar) -> Colour:
    """`oren_nayar_full` over Lambert; `along` is the product of the directions' parts along the surface, above the coat."""
    sigma2 = base.sigma * base.sigma
    c1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    c2 = 0.45 * sigma2 / (sigma2 + 0.09)
    c3 = 0.125 * sigma2 / (sigma2 + 0.09)
    c4 = 0.17 * sigma2 / (sigma2 + 0.13)
    sin_i, sin_o = i.bend * i.sine, o.bend * o.sine
    smaller = jnp.minimum(i.polar, o.polar)
    smaller2 = smaller * smaller
    cos_phi = along / jnp.maximum(i.sine * o.sine, 1e-9)
    facing = smaller2 * smaller / jnp.maximum(jnp.maximum(sin_i, sin_o), 1e-4)
    gap = 1.0 - where(along < 0.0, facing, 0.0)
    tangent = i.bend * o.bend * along * gap / jnp.maximum(i.z, o.z)
    product = i.polar * o.polar
    aside = jnp.maximum(1.0 - jnp.abs(cos_phi), 0.0)
    direct = c1 + c2 * tangent + aside * c3 * (product * product) * ((sin_i + sin_o) / (i.z + o.z))
    return jnp.maximum(direct + base.albedo * (c4 * (1.0 - cos_phi * smaller2)), 0.0)


def recipe(prepared: Any, name: str, evaluate: Any) -> Recipe:
    """The curves of a prepared material, in double precision; `evaluate` is its BRDF."""
    precise = isinstance(prepared, one_coat.Prepared)
    coat = prepared.coat if precise else prepared.coats[0]
    interface: Any = prepared.interface if precise else prepared.interfaces[0]
    grooves = prepared.base if isinstance(prepared.base, OrenNayar) else None
    even = dataclasses.replace(prepared, base=Lambert(albedo=prepared.base.diffuse.albedo))

    def follow(NoW: Any) -> Any:
        w = jnp.stack([jnp.sqrt((1.0 - NoW) * (1.0 + NoW)), 0.0 * NoW, NoW])
        # Light from below alone does not ask for the azimuth: here it is at a right angle.
        aside = w[jnp.array([1, 0, 2])]
        # Of a base that is not seen a difference of roundings is left, of either sign.
        below = jnp.maximum(evaluate(even, w, aside) - coat.evaluate(w, aside), 0.0)
        if precise:
            crossing = one_coat.pass_interface(interface, coat.eta, coat.alpha, w)
            beyond = curve(interface.passed, interface.passed_high, grazing(NoW))
        else:
            crossing, beyond = cross(interface, coat, w, w), 0.0 * NoW
        closed = with_second_facet(coat.transmittance(argument("facet", NoW, interface.tilt)), interface.gain)
        sine = jnp.sqrt((1.0 - crossing.w[2]) * (1.0 + crossing.w[2]))
        return closed, jnp.sqrt(below), crossing.T, beyond, jnp.stack([sine / w[0], jnp.arcsin(sine) * (2.0 / jnp.pi) / sine])

    NoW = cosines()
    closed, root, T, beyond, bent = (np.asarray(a) for a in jax.vmap(follow)(jnp.asarray(NoW)))
    film = reflectance_curve(coat, half_cosines()) if coat.has_film else None
    left = root / (T if root.ndim == T.ndim else T[:, None])
    if precise:
        left = np.column_stack([left, beyond])
    weight = np.broadcast_to(1.0 / np.maximum(np.abs(left).max(0), 1e-6), left.shape)
    x = best_argument(NoW, interface.tilt, left, weight)
    arguments = at(x, NoW, interface.tilt)
    curves = {
        "passed": Curve(at("root" if film else "facet", NoW, interface.tilt), closed, 1.0 / closed),
        "left": Curve(arguments, left, weight),
        "film": film,
        "bent": None if grooves is None else Curve(arguments, bent, np.broadcast_to(1.0 / bent.max(0), bent.shape)),
    }
    absent: dict[str, Any] = {key: None for key, c in curves.items() if c is None}

    def build(fitted: Any) -> DiffuseUnderCoat:
        return DiffuseUnderCoat(
            without_film(coat),
            interface.tilt,
            **(absent | dict(fitted)),
            grooves=grooves,
            argument=x,
            beyond=precise,
            name=name,
        )

    return Recipe({key: c for key, c in curves.items() if c is not None}, build)
