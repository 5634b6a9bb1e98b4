"""What happens to a particle at one place: at a facet of an interface or of the base, at a diffuse base, in haze.

Each event samples where the particle goes on, and evaluates how much of it would go to a given `target` direction.
"""

import math
from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import Any

import jax
import jax.numpy as jnp

from .._chunk import struct
from .._types import Flag, Scalar
from ..surfaces.microfacet import Microfacets
from ._facets import (
    Direction,
    dot,
    facet_area,
    facet_density,
    fresnel,
    leaving,
    next_height,
    normalise,
    opposite,
    reflect,
    reflecting_facet,
    refract,
    refracting_facet,
    sample_facet,
    turn,
    where,
)
from ._material import Material, widths

Uniforms = tuple[Scalar, ...]

_TINY = 1e-30


@struct
class Event:
    """Where a particle goes on, and what it sends to a target.

    `d`: direction of travel, in the frame of the side it is then on; `through`: whether that is the other side; `leaves`: whether
    it is done with the boundary, else it goes on at the height `c`; `weight`: what is left of it by channel, 0 where it is
    lost; `pdf` [1/sr]: density of d. `value` [1/sr]: radiance towards the target, by channel, for a unit of flux;
    `target_pdf`: density with which the target would have been sampled. `back` and `target_back`: densities with which light on the
    same way through one facet, but from the other end, would have come here.
    """

    d: Direction
    through: Flag
    leaves: Flag
    c: Scalar | None
    weight: tuple[Scalar, ...]
    pdf: Scalar
    value: tuple[Scalar, ...]
    target_pdf: Scalar
    back: Scalar
    target_back: Scalar


def pick(at: Scalar, values: Sequence[Any]) -> Any:
    """`values[at]`, the last of them beyond the end."""
    chosen = values[-1]
    for k in reversed(range(len(values) - 1)):
        chosen = where(at == k, values[k], chosen)
    return chosen


@jax.jit
def at_facets(
    material: Material, at: Scalar, above: Flag, entering: Flag, w: Direction, c: Scalar | None, target: Direction, u: Uniforms
) -> Event:
    """A facet of boundary `at`, hit against `w` at the height `c` (`multi` only; 1 on arrival); the target lies above the boundary.

    `entering` light does not choose between reflection and refraction (`single` only): it goes through, weighted.
    """
    single = material.interface == "single"
    surfaces, faceted = material.boundaries, isinstance(material.base[0], Microfacets)
    kinds = [b.kind for b in surfaces] + ([material.base[0].distribution] if faceted else [])
    alpha = pick(at, [b.widths for b in surfaces] + ([widths(material.base[0])] if faceted else []))
    eta = pick(at, [b.eta for b in surfaces])
    eta = where(above, eta, 1.0 / eta)
    at_base = at == len(surfaces)

    def by_kind(fn: Callable[..., Any], *args: Any) -> Any:
        if len(set(kinds)) == 1:
            return fn(kinds[0], *args)
        return where(pick(at, [jnp.asarray(kind == "ggx") for kind in kinds]), fn("ggx", *args), fn("beckmann", *args))

    area = jnp.maximum(by_kind(facet_area, w, alpha), _TINY)
    if c is not None:
        # A particle that arrives has yet to find its height; the floor keeps the lowest facets within reach of the top.
        c = jnp.maximum(where(c >= 1.0, next_height(w, c, area, u[0]), c), 1e-7)
    m = by_kind(sample_facet, w, alpha, u[1], u[2])
    cosine = dot(w, m)
    reflectance = fresnel(cosine, eta)
    through = ~at_base & (u[3] > reflectance)
    kept = jnp.ones_like(cosine)
    if single:
        through = through | entering
        kept = where(entering, 1.0 - reflectance, 1.0)
    d = where(through, refract(w, m, cosine, eta), reflect(w, m, cosine))

    # The facet that would send the particle to the target, and what of it would get there.
    h_up, c_up = reflecting_facet(w, target)
    h_across, c_across, jacobian = refracting_facet(w, target, eta)
    h, c_h = where(above, (h_up, c_up), (h_across, c_across))
    D_h = by_kind(facet_density, h, alpha)
    F_h = fresnel(c_h, eta)
    target_pdf = where(above, 0.25 * D_h * F_h, c_h * D_h * (1.0 - F_h) * jacobian) / area
    # Density of the direction sampled: eta g / (c - g)^2 is the Jacobian of `refracting_facet` from this side, g = eta cos'.
    D_m = by_kind(facet_density, m, alpha)
    g = jnp.sqrt(jnp.maximum((eta - 1.0) * (eta + 1.0) + cosine * cosine, 0.0))
    across = cosine * (1.0 - reflectance) * eta * g / jnp.maximum((cosine - g) * (cosine - g), _TINY)
    pdf = where(through, across, 0.25 * reflectance) * D_m / area

    if single:
        area_d, area_t = by_kind(facet_area, d, alpha), by_kind(facet_area, target, alpha)
        separable = pick(at, [jnp.asarray(b.separable) for b in surfaces])
        seen = _seen(area, w, area_d, d, through | separable)
        seen_target = _seen(area, w, area_t, target, ~above | separable)
        kept = where(d[2] > 0.0, kept * seen * d[2], 0.0)
        leaves, c_next = jnp.full_like(above, True), None
    else:
        assert c is not None
        behind_d, behind_t = by_kind(facet_area, opposite(d), alpha), by_kind(facet_area, opposite(target), alpha)
        c_next = next_height(opposite(d), where(through, 1.0 - c, c), behind_d, u[4])
        leaves = c_next >= 1.0
        seen_target = leaving(target, where(above, c, 1.0 - c), behind_t) / target[2]
        area_d, area_t = behind_d + d[2], behind_t + target[2]
    # A facet that refracts has Jacobians from both sides that differ by eta^2 alone: densities differ by that and by the areas.
    reverse = area / (eta * eta)
    event = Event(
        d,
        through,
        leaves,
        c_next,
        (kept,) * material.channels,
        pdf,
        (target_pdf * seen_target,) * material.channels,
        target_pdf,
        pdf * reverse / jnp.maximum(area_d, _TINY),
        target_pdf * reverse / jnp.maximum(area_t, _TINY),
    )
    if not faceted:
        return event

    # A base of facets: one reflection, by its own closed form; its direction is the one reflected above.
    base, to_vec = material.base[0], jnp.stack
    V = base.visibility(to_vec(w), to_vec(d))
    V_target = base.visibility(to_vec(w), to_vec(target))
    kept = where(d[2] > 0.0, 4.0 * V * d[2] * area, 0.0)
    based = Event(
        d,
        through,
        jnp.full_like(through, True),
        c_next,
        material.by_channel(lambda b: kept * b.reflectance(cosine)),
        0.25 * D_m / area,
        material.by_channel(lambda b: D_h * V_target * b.reflectance(c_h)),
        0.25 * D_h / area,
        event.back,
        event.target_back,
    )
    return where(at_base, based, event)


@jax.jit
def _seen(area_w: Scalar, w: Direction, area_d: Scalar, d: Direction, separable: Flag) -> Scalar:
    """G(w, d) / (G1(w) d.z): 1 / (d.z (1 + Lambda)) apart, (1 + Lambda(w)) / (d.z (1 + Lambda(w) + Lambda(d))) together."""
    together = area_w / jnp.maximum(area_w * d[2] + area_d * w[2] - w[2] * d[2], _TINY)
    return where(separable, 1.0 / jnp.maximum(area_d, _TINY), together)


@jax.jit
def at_formula(material: Material, w: Direction, target: Direction, u: Uniforms) -> Event:
    """A base that is a formula, not facets: directions are drawn as its parts would send them, one part as often as another."""
    base = material.base[0]
    lobes = [(lobe.distribution, lobe.width if isinstance(lobe.width, tuple) else (lobe.width,) * 2) for lobe in base.lobes]
    areas = [jnp.maximum(facet_area(kind, w, alpha), _TINY) for kind, alpha in lobes]

    def density(to: Direction) -> Scalar:
        h, _ = reflecting_facet(w, to)
        parts = [0.25 * facet_density(kind, h, alpha) / area for (kind, alpha), area in zip(lobes, areas, strict=True)]
        if base.diffuse is not None:
            parts.append(to[2] / math.pi)
        return reduce(add, parts) / len(parts)

    ways = []
    for kind, alpha in lobes:
        m = sample_facet(kind, w, alpha, u[1], u[2])
        ways.append(reflect(w, m, dot(w, m)))
    if base.diffuse is not None:
        radius = jnp.sqrt(u[1])
        cos_phi, sin_phi = turn(u[2])
        ways.append((radius * cos_phi, radius * sin_phi, jnp.sqrt(1.0 - u[1])))
    d = pick(jnp.floor(u[3] * len(ways)), ways)
    up = d[2] > 0.0
    d = where(up, d, (0.0 * d[0], 0.0 * d[1], 0.0 * d[2] + 1.0))
    brdf = lambda to: material.by_channel(lambda b: b.evaluate(jnp.stack(w), jnp.stack(to)))  # noqa: E731
    pdf = density(d)
    weight = tuple(where(up, f * d[2] / jnp.maximum(pdf, _TINY), 0.0) for f in brdf(d))
    yes, none = jnp.full(up.shape, True), jnp.zeros_like(w[2])
    c = None if material.interface == "single" else jnp.ones_like(w[2])
    return Event(d, ~yes, yes, c, weight, pdf, brdf(target), density(target), none, none)


@jax.jit
def in_haze(material: Material, g: Scalar, w: Direction, target: Direction, u: Uniforms) -> Event:
    """A particle of haze; frame of the upper side, target above (Henyey and Greenstein 1941, eq. 2)."""
    s = 2.0 * u[1] - 1.0
    # The usual inverse multiplied out, so that nothing is divided by g.
    q = 1.0 + g * s
    cosine = (s + 0.5 * g * (3.0 + s * s) + g * g * s - 0.5 * g * g * g * (1.0 - s * s)) / (q * q)
    cosine = jnp.clip(cosine, -1.0, 1.0)
    sine = jnp.sqrt((1.0 - cosine) * (1.0 + cosine))
    cos_phi, sin_phi = turn(u[2])
    t = opposite(w)
    # An orthonormal frame about t without a branch (Duff et al. 2017, listing 3).
    sign = where(t[2] < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + t[2])
    b = t[0] * t[1] * a
    x, y = sine * cos_phi, sine * sin_phi
    d = normalise(
        x * (1.0 + sign * t[0] * t[0] * a) + y * b + cosine * t[0],
        x * sign * b + y * (sign + t[1] * t[1] * a) + cosine * t[1],
        -x * sign * t[0] - y * t[1] + cosine * t[2],
    )
    down = d[2] < 0.0
    one = jnp.ones_like(cosine)
    pdf, target_pdf = _henyey_greenstein(cosine, g), _henyey_greenstein(dot(t, target), g)
    channels = material.channels
    c = None if material.interface == "single" else one
    value = (target_pdf / target[2],) * channels
    return Event(
        (d[0], d[1], jnp.abs(d[2])), down, one > 0.0, c, (one,) * channels, pdf, value, target_pdf, 0.0 * one, 0.0 * one
    )


def _henyey_greenstein(cosine: Scalar, g: Scalar) -> Scalar:
    spread = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cosine)
    return (1.0 - g) * (1.0 + g) / (4.0 * math.pi * spread * jnp.sqrt(spread))
