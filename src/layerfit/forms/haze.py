"""Light in a coat that scatters: single scattering in closed form, all that follows by exchange between thirds of the medium.

Light that is scattered once is exact (Hanrahan and Krueger 1993). Of what follows, light scattered *forwards* goes on as if it had not
been: a part g of every scattering (the similarity of van de Hulst 1980), which leaves a medium that scatters evenly, of the optical depth
tau + (1 - g) tau_s. It is cut into thirds. A beam has a mean fluence in each and a flux on the base; each third, and the base if it is
diffuse, sends a part of that on, which comes to the others directly or by way of the coat's inner side and of a base with lobes, a
mirror here. These exchanges make a matrix, integrated over all directions once a material, and any number of them its inverse: the
method of collision probabilities (Carlvik 1967). Where nothing scatters the matrix is one number, the series of Saunderson 1942.

Both halves of a way are treated alike and the matrix is symmetric: all of it is reciprocal.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import Any

import jax.numpy as jnp

from .._chunk import chunk, member, safe_power, safe_sqrt, struct, where
from .._types import Colour, Direction, Number, Scalar
from ..layers import Coat
from ..optics.directions import along, direction, product
from ..optics.microfacet import Width, half_cosine
from ..optics.scattering import henyey_greenstein, mean_transmittance, once_back, once_through
from ..surfaces.base import Lobe, Surface

EVENLY: Number = 1.0 / (4.0 * math.pi)
"""Phase function [1/sr] of a medium that scatters the same in all directions."""

POWER = 1.34
"""Widths of a phase function and of rough boundaries add as powers, as those of GGX lobes do in `corrected`."""


@struct
class Fluence:
    """A beam of unit flux in a medium: mean fluence in its thirds, and flux on the base."""

    upper: Colour = member("in the upper third")
    middle: Colour = member("in the middle third")
    lower: Colour = member("in the lower third")
    base: Colour = member("flux on the base")


@struct
class Haze:
    """A scattering medium, beyond scattering once. Some members are absent: of even scattering, and of a base that is not diffuse."""

    reduced: Colour = member("optical depth, with light scattered forwards taken as not scattered")
    between: Number = member("the same, with light scattered forwards twice")
    upper_upper: Colour = member("light that goes on to and fro and stays within the upper third")
    upper_middle: Colour = member("that goes from the upper to the middle third, or back")
    upper_lower: Colour = member("from the upper to the lower third, or back")
    upper_base: Number = member("from the upper third to the base, or back")
    middle_middle: Colour = member("within the middle third")
    middle_lower: Colour = member("from the middle to the lower third, or back")
    middle_base: Number = member("from the middle third to the base, or back")
    lower_lower: Colour = member("within the lower third")
    lower_base: Number = member("from the lower third to the base, or back")
    returned: Number = member("gain of the base by light that comes back to it")


NODES = tuple(field.name for field in dataclasses.fields(Fluence))

Mean = Callable[[Callable[[Colour, Scalar], Sequence[Colour]]], Sequence[Colour]]
"""2 int f(R, mu) mu dmu over the directions in a medium, mu from 0 to 1; R is what the coat reflects back down."""


def prepare(coat: Coat, base: Surface, n: Scalar, mean: Mean) -> Haze:
    """The constants of a coat that scatters over a base, both of relative index; `n` is that of the coat against air."""
    reduced, even, between = coat.extinction, coat.tau_s, None
    if coat.g is not None:
        forwards = jnp.maximum(coat.g, 0.0)
        between = reduced - forwards * forwards * coat.tau_s
        reduced = reduced - forwards * coat.tau_s
        even = even - forwards * coat.tau_s
    # A third of the medium sends on evenly what a diffuse base of this albedo would send on of a flux: both are albedos here.
    albedos = [even / 12.0] * 3 + ([] if base.diffuse is None else [base.diffuse.albedo])
    count = len(albedos)
    pairs = [(j, k) for j in range(count) for k in range(j, count)]

    def arriving(R: Colour, cosine: Scalar) -> list[Colour]:
        table = _arriving(reduced, base, R, cosine)
        return [table[j][k] for j, k in pairs]

    direct = dict(zip(pairs, mean(arriving), strict=True))
    exchanges = _exchanges(albedos, [[direct[min(j, k), max(j, k)] for k in range(count)] for j in range(count)])
    left = 1.0 if coat.g is None else _left_to_exchange(coat.g, n)
    members: dict[str, Any] = {field.name: None for field in dataclasses.fields(Haze)}
    members |= {f"{NODES[j]}_{NODES[k]}": left * left * exchanges[j][k] * albedos[k] for j, k in pairs if k < 3}
    if count == 4:
        members |= {f"{NODES[k]}_base": left * exchanges[3][k] * albedos[k] for k in range(3)}
        members["returned"] = 1.0 + exchanges[3][3]
    return Haze(**(members | {"reduced": reduced, "between": between}))


def _left_to_exchange(g: Scalar, n: Scalar) -> Scalar:
    """Part of the light that is left when a medium scatters backwards, and so out at once, over that with even scattering.

    By the light within the cone that leaves a medium of index n, of a beam that enters along the normal. Each end of a way takes half of
    it, of which one half again is the measured part. Light scattered forwards is counted by `reduced`.
    """
    a = jnp.maximum(-g, 0.0)
    outside = 1.0 - safe_sqrt((1.0 - 1.0 / n) * (1.0 + 1.0 / n))
    root = jnp.sqrt((1.0 - a) * (1.0 - a) + 2.0 * a * outside)
    leaves = (1.0 + a) * outside / (root * (root + 1.0 - a))
    return safe_sqrt(safe_sqrt((1.0 - leaves) / (1.0 - 0.5 * outside)))


def reflected(lobe: Lobe, cosine: Scalar) -> Colour:
    """Part of the light that a lobe sends back, taken as a mirror."""
    return lobe.energy(lobe.reflectance(cosine))


def mirror(base: Surface, cosine: Scalar) -> Colour:
    """What all lobes of a base send back."""
    return reduce(add, (reflected(lobe, cosine) for lobe in base.lobes))


def _arriving(tau: Colour, base: Surface, R: Colour, cosine: Scalar) -> list[list[Colour]]:
    """What of light sent evenly into the directions of one cosine, by one node, is fluence or flux in another."""
    path = 1.0 / jnp.maximum(cosine, 1e-6)
    beam = fluence(tau, path)
    third = tau * path / 3.0
    own = 2.0 * path * path * _mean_absorptance(third)
    next_one = (path * mean_transmittance(third)) ** 2
    after_next = next_one * jnp.exp(-third)
    direct: Any = [
        [own, next_one, after_next, beam.lower],
        [next_one, own, next_one, beam.middle],
        [after_next, next_one, own, beam.upper],
        [beam.lower, beam.middle, beam.upper, 0.0],
    ]
    down: list[Any] = [beam.upper, beam.middle, beam.lower, beam.base]
    up: list[Any] = [beam.lower, beam.middle, beam.upper, 0.0]
    if not base.lobes:
        return [[direct[j][k] + R * down[j] * down[k] for k in range(4)] for j in range(4)]
    F = mirror(base, cosine)
    series = 1.0 / jnp.maximum(1.0 - R * F * beam.base * beam.base, 1e-6)
    across = R * F * beam.base

    def mirrored_twice(j: int, k: int) -> Colour:
        one_sided = R * down[j] * down[k] + F * up[j] * up[k]
        return series * (one_sided + across * (down[j] * up[k] + up[j] * down[k]))

    return [[direct[j][k] + mirrored_twice(j, k) for k in range(4)] for j in range(4)]


def _mean_absorptance(x: Colour) -> Colour:
    """(x - 1 + exp(-x)) / x^2: what a layer takes of the light that is sent out evenly in it, over its depth x."""
    thin = x < 0.1
    safe = where(thin, 1.0, x)
    series = 0.5 - x / 6.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0 * (1.0 - x / 7.0))))
    return where(thin, series, (1.0 - mean_transmittance(safe)) / safe)


def _exchanges(albedos: Sequence[Colour], arriving: Sequence[Sequence[Colour]]) -> list[list[Colour]]:
    """(1 - Q N)^-1 Q N, Q the diagonal of the albedos and N what arrives: one exchange and all that follow.

    By elimination, number by number, so that it prints; energy makes the diagonal the largest entry of its row.
    """
    count = len(albedos)
    once = [[albedos[j] * arriving[j][k] for k in range(count)] for j in range(count)]
    left: list[list[Any]] = [[(1.0 if j == k else 0.0) - once[j][k] for k in range(count)] for j in range(count)]
    right: list[list[Any]] = [list(row) for row in once]
    for pivot in range(count):
        scale = 1.0 / jnp.maximum(left[pivot][pivot], 1e-6)
        left[pivot] = [x * scale for x in left[pivot]]
        right[pivot] = [x * scale for x in right[pivot]]
        for row in range(count):
            if row != pivot:
                factor = left[row][pivot]
                left[row] = [x - factor * y for x, y in zip(left[row], left[pivot], strict=True)]
                right[row] = [x - factor * y for x, y in zip(right[row], right[pivot], strict=True)]
    return right


@dataclasses.dataclass(frozen=True)
class Way:
    """One direction within the medium: a plain record, so that nothing of it is printed."""

    w: Direction
    path: Scalar
    """Length of the way through the medium, in thicknesses."""
    R: Colour
    """What the coat reflects back down."""


def scattered(haze: Haze | None, coat: Coat, base: Surface, i: Way, o: Way, spread: Scalar) -> Colour:
    """Light [1/sr] that the medium scatters and light of a diffuse base: all but the lobes of a base seen clearly.

    Without `haze`, light scattered once by the medium alone. `spread` is what the interfaces passed add to the width of lobes, to the
    power `POWER`.
    """
    g, tau_s = coat.g, coat.tau_s
    back = 1.0 + product(i.w, o.w)
    phase = EVENLY if g is None else widened_phase(back, g, spread)
    if haze is None:
        return once_back(phase, tau_s, coat.extinction, i.path, o.path)
    even = EVENLY if g is None else EVENLY * (1.0 - jnp.maximum(g, 0.0))
    f = once_back(even, tau_s, haze.reduced, i.path, o.path)
    if g is not None:
        f = f + once_back(phase - even, tau_s, haze.between, i.path, o.path)
    beam_i, beam_o = fluence(haze.reduced, i.path), fluence(haze.reduced, o.path)
    for lobe in base.lobes:
        f = f + _by_way_of(lobe, haze, coat, i, o, spread)
    if base.lobes:
        beam_i = mirrored(beam_i, mirror(base, i.w[-1]), i.R)
        beam_o = mirrored(beam_o, mirror(base, o.w[-1]), o.R)
    if base.diffuse is not None:
        f = f + beam_i.base * beam_o.base * haze.returned * base.diffuse.evaluate(i.w, o.w)
    return f + exchanged(haze, beam_i, beam_o)


def _by_way_of(lobe: Lobe, haze: Haze, coat: Coat, i: Way, o: Way, spread: Scalar) -> Colour:
    """Light that met a lobe of the base, and was scattered once before or after it, or forwards more often."""
    g, tau_s, reduced = coat.g, coat.tau_s, haze.reduced
    F_i, F_o = reflected(lobe, i.w[-1]), reflected(lobe, o.w[-1])
    up_i, up_o = F_i * jnp.exp(-reduced * i.path), F_o * jnp.exp(-reduced * o.path)
    even = EVENLY if g is None else EVENLY * (1.0 - jnp.maximum(g, 0.0))
    f = once_by_mirror(even, even, tau_s, reduced, i.path, o.path, up_i, up_o)
    if g is None:
        return f
    tau = coat.extinction
    wider = spread + width_power(lobe.width)
    on = 1.0 - product(direction(-along(i.w), i.w[-1]), o.w)
    phase_on = widened_phase(on, g, wider) - even
    phase_back = widened_phase(1.0 + product(i.w, o.w), g, wider + width_power(lobe.width)) - even
    up_i, up_o = F_i * jnp.exp(-tau * i.path), F_o * jnp.exp(-tau * o.path)
    f = f + once_by_mirror(phase_on, phase_back, tau_s, tau, i.path, o.path, up_i, up_o)
    forwards = jnp.maximum(g, 0.0)
    blurred = widened_phase(on, forwards * forwards * forwards, wider)
    F = reflected(lobe, half_cosine(i.w, o.w))
    return f + F * seen_through(blurred, forwards * tau_s, reduced, i.path, o.path)


def width_power(width: Width) -> Scalar:
    """A width to the power in which they add."""
    return safe_power(width[0] * width[1], 0.5 * POWER) if isinstance(width, tuple) else safe_power(width, POWER)


@chunk
def fluence(tau: Colour, path: Scalar) -> Fluence:
    """A beam on its way down a medium of depth tau: mean fluence in its thirds, and what comes to the base."""
    third = tau * path / 3.0
    T = jnp.exp(-third)
    first = path * mean_transmittance(third)
    second = first * T
    return Fluence(first, second, second * T, T * T * T)


@chunk
def mirrored(down: Fluence, F: Colour, R: Colour) -> Fluence:
    """The same with what a base of reflectance F sends up again, and the coat's inner side of reflectance R down."""
    up = F * down.base
    series = 1.0 / jnp.maximum(1.0 - R * up * down.base, 1e-6)
    upper = series * (down.upper + up * down.lower)
    middle = series * (down.middle + up * down.middle)
    lower = series * (down.lower + up * down.upper)
    return Fluence(upper, middle, lower, series * down.base)


@chunk
def exchanged(haze: Haze, i: Fluence, o: Fluence) -> Colour:
    """Light [1/sr] that went from one part of the medium to another before it left."""
    f = i.upper * (haze.upper_upper * o.upper + haze.upper_middle * o.middle + haze.upper_lower * o.lower)
    f = f + i.middle * (haze.upper_middle * o.upper + haze.middle_middle * o.middle + haze.middle_lower * o.lower)
    f = f + i.lower * (haze.upper_lower * o.upper + haze.middle_lower * o.middle + haze.lower_lower * o.lower)
    if haze.returned is not None:
        from_o = haze.upper_base * o.upper + haze.middle_base * o.middle + haze.lower_base * o.lower
        from_i = haze.upper_base * i.upper + haze.middle_base * i.middle + haze.lower_base * i.lower
        f = f + i.base * from_o + from_i * o.base
    return f / jnp.pi


@chunk
def once_by_mirror(
    on: Scalar, back: Scalar, tau_s: Colour, tau: Colour, path_i: Scalar, path_o: Scalar, up_i: Colour, up_o: Colour
) -> Colour:
    """Light scattered once on its way to or from a mirror, or between the two times that it meets it, by two phase functions.

    `up_i` and `up_o` are what comes back from the mirror of either direction.
    """
    f = once_through(on, tau_s, tau, path_i, path_o) * (up_i + up_o)
    return f + once_back(back, tau_s, tau, path_i, path_o) * up_i * up_o


@chunk
def seen_through(blurred: Scalar, forwards: Colour, reduced: Colour, path_i: Scalar, path_o: Scalar) -> Colour:
    """A mirror [1/sr] as light sees it that was scattered forwards twice or more; the phase function `blurred` is its lobe."""
    path = path_i + path_o
    depth = forwards * path
    often = -jnp.expm1(-depth) - depth * jnp.exp(-depth)  # Poisson: neither never nor once
    return blurred * (2.0 * path_i * path_o / path) * jnp.exp(-reduced * path) * often


@chunk
def widened_phase(deflection: Scalar, g: Scalar, spread: Scalar) -> Scalar:
    """The phase function [1/sr] as seen by way of rough boundaries, which widen it: by `spread`, to the power in which widths add."""
    # A mirror that blurs light as the phase function does has facets of the width (1 - g) / (2 sqrt(g)).
    a = jnp.maximum(jnp.abs(g), 1e-6)
    own = (1.0 - a) / (2.0 * jnp.sqrt(a))
    width = safe_power(safe_power(own, POWER) + spread, 1.0 / POWER)
    ratio = (own + jnp.sqrt(1.0 + own * own)) / (width + jnp.sqrt(1.0 + width * width))
    return henyey_greenstein(deflection, g * ratio * ratio)
