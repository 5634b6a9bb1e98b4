"""One particle on its way through the layers, one event at a time: what every lane of the walk does in every turn of its loop.

A path has two halves. The first goes from the eye, `wo`, down through the interfaces as far as it is refracted; its direction in
each medium is the *exit* from that medium. The second carries flux from the light, `wi`. Wherever the flux is sent on in a medium - by
the boundary below or in haze - it is connected to the exit, and wherever the top interface sends it on from below, to `wo`.
So light that leaves from medium j, through j interfaces in a row, is found in j + 1 ways, by its last direction of flux: each is
best where the interfaces are smooth that the eye's half has passed and those rough that it has not. They are weighted by the balance
heuristic (Veach and Guibas 1995), whose sums run along both halves as in Georgiev et al. 2012, appendix A.

Boundaries are counted from the top, the last is the base; medium k lies above boundary k.
"""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp

from .._chunk import struct
from .._types import Flag, Scalar
from ..surfaces.microfacet import Microfacets
from ._events import Event, Uniforms, at_facets, at_formula, in_haze, pick
from ._facets import Direction, opposite, where
from ._material import Material
from ._random import Bits, uniforms

EYE, LIGHT, BELOW = 0, 1, 2
"""Stages of a path: down from the eye; down from the light, through the top interface; flux that has been below it."""

_FAINT = 0.1  # flux below this goes on by roulette
_LONG, _LINGER = 200, 0.98  # so does, after this many events, light that a smooth clear layer guides along itself
# Added to the density of exits through one facet, which leaves out masking. Any positive function is unbiased; this one lowers the
# variance over diffuse bases, by up to 3, and raises it nowhere.
_OTHER_EXITS = 0.5
_TINY = 1e-30


@struct
class Exit:
    """A way out to the eye: direction in its medium (up), radiance that passes by channel, and the balance of connections to it.

    The last is the sum, over the ways to connect further up, of their densities over that of this one, without the density of
    the connected direction itself.
    """

    direction: Direction
    passed: tuple[Scalar, ...]
    others: Scalar


@struct
class Particle:
    """The state of one lane.

    `w`: where the particle comes from, in the frame of the side it is on (in haze: the upper side); `above`: whether that is the
    upper side of boundary `at`; `c`: its height within the boundary, 1 on arrival (`multi` only); `haze`: whether it is within
    the medium above boundary `at`, and how deep, 1 being on the boundary. `flux` is, for the eye's half, radiance that passes.
    `others`: as in `Exit`, over the ways to connect further down, of flux that came from below; 0 of other flux.
    """

    path: Bits
    event: Bits
    stage: Scalar
    at: Scalar
    above: Flag
    w: Direction
    c: Scalar | None
    haze: tuple[Flag, Scalar] | None
    flux: tuple[Scalar, ...]
    others: Scalar
    exits: tuple[Exit, ...]
    radiance: tuple[Scalar, ...]


@struct
class Tally:
    """Sums over the finished paths of a lane: of their radiance and of its square, by channel."""

    sum: tuple[Scalar, ...]
    square: tuple[Scalar, ...]


def start(material: Material, wo: Direction, path: Bits) -> Particle:
    """A new path, at the eye."""
    one = jnp.ones_like(wo[2])
    zero = 0.0 * one
    black = (zero,) * material.channels
    hazy = any(medium.haze for medium in material.media)
    return Particle(
        path=path,
        event=jnp.zeros_like(path),
        stage=jnp.full_like(path, EYE, jnp.int32),
        at=jnp.zeros_like(path, jnp.int32),
        above=one > 0.0,
        w=wo,
        c=one if material.interface == "multi" else None,
        haze=(one < 0.0, one) if hazy else None,
        flux=(one,) * material.channels,
        others=zero,
        exits=tuple(Exit((zero, zero, one), black, zero) for _ in material.media),
        radiance=black,
    )


def step(
    material: Material, wi: Direction, wo: Direction, lane: Bits, seed: Bits, paths: Bits, p: Particle, tally: Tally
) -> tuple[Particle, Tally]:
    """One event, and the way to the next one; a path that ends is counted and the next one begins."""
    u = uniforms(lane, p.path, p.event, seed)
    happened = _meet(material, wo, p, u)
    radiance = _connect(material, p, happened)
    moved, begun, entering, ended = _go_on(material, wi, p, happened, u)
    following = replace(where(entering, begun, moved), radiance=radiance)
    counts = ended & (p.path < paths)
    tally = Tally(
        tuple(s + where(counts, x, 0.0) for s, x in zip(tally.sum, radiance, strict=True)),
        tuple(s + where(counts, x * x, 0.0) for s, x in zip(tally.square, radiance, strict=True)),
    )
    return where(ended, start(material, wo, p.path + jnp.uint32(1)), following), tally


@jax.jit
def _meet(material: Material, wo: Direction, p: Particle, u: Uniforms) -> Event:
    """What happens where the particle is; its target is the exit from the medium above, or the eye."""
    target = pick(p.at, [wo, *(exit.direction for exit in p.exits)])
    entering = (p.stage == EYE) | (p.stage == LIGHT)
    happened = at_facets(material, p.at, p.above, entering, p.w, p.c, target, u)
    if not isinstance(material.base[0], Microfacets):
        happened = where(p.at == len(material.boundaries), at_formula(material, p.w, target, u), happened)
    if p.haze is None:
        return happened
    g = pick(p.at - 1, [0.0 * u[0] if medium.haze is None else medium.haze.g for medium in material.media])
    return where(p.haze[0], in_haze(material, g, p.w, target, u), happened)


@jax.jit
def _densities(material: Material, p: Particle, up: Scalar, down: Scalar, cosine: Scalar) -> tuple[Scalar, Scalar]:
    """Of a way through boundary `at`: how densely it is taken up from below and down from above, `cosine` being that below.

    `up` and `down` are those of one facet. Ways through several have none in closed form: in its place stands the peak of the lobe
    that the last facet sends, so that no connection is larger than the narrower of two lobes lets it be.
    """
    down = down + _OTHER_EXITS * cosine
    if p.c is None:
        return up, down
    (alpha_x, alpha_y), eta = pick(p.at, [(b.widths, b.eta) for b in material.boundaries])
    peak = 1.0 / (math.pi * alpha_x * alpha_y * (eta - 1.0) * (eta - 1.0))
    first = p.c >= 1.0
    return where(first, up, peak), where(first, down, peak)


@jax.jit
def _connect(material: Material, p: Particle, happened: Event) -> tuple[Scalar, ...]:
    """Radiance of this path towards the eye, with what this event sends there."""
    zero = jnp.zeros_like(p.others)
    exits = [Exit(p.w, tuple(zero + 1.0 for _ in p.flux), zero), *p.exits]
    exit = pick(p.at, exits)
    up, down = _densities(material, p, happened.target_pdf, happened.target_back, p.w[2])
    up = where(p.others > 0.0, up, happened.target_pdf)
    share = 1.0 / (1.0 + up * exit.others + down * p.others)
    way = (1.0 if p.haze is None else where(p.haze[0], p.haze[1], 1.0)) / exit.direction[2]
    way = where(p.at == 0, 0.0, way)
    passing = _passing(material, p.at, way, hazy=True)
    below = p.stage == BELOW
    return tuple(
        r + where(below, flux * share * value * x * t, 0.0)
        for r, flux, value, x, t in zip(p.radiance, p.flux, happened.value, exit.passed, passing, strict=True)
    )


def _passing(material: Material, medium: Scalar, way: Scalar, hazy: bool | Flag) -> tuple[Scalar, ...]:
    """What is not absorbed, and where `hazy` not scattered either, on a way through a medium."""
    zero = jnp.zeros_like(way)
    tau = pick(medium - 1, [(zero,) * material.channels if m.tau is None else m.tau for m in material.media])
    if any(m.haze for m in material.media):
        haze = pick(medium - 1, [zero if m.haze is None else m.haze.tau for m in material.media])
        tau = tuple(t + where(hazy, haze, 0.0) for t in tau)
    elif all(m.tau is None for m in material.media):
        return (zero + 1.0,) * material.channels
    return tuple(jnp.exp(-t * way) for t in tau)


@jax.jit
def _go_on(
    material: Material, wi: Direction, p: Particle, happened: Event, u: Uniforms
) -> tuple[Particle, Particle, Flag, Flag]:
    """The particle at its next event, that at the start of the second half, whether it is there, and whether the path has ended."""
    d, leaves, eye = happened.d, happened.leaves, p.stage == EYE
    arriving = -d[0], -d[1], d[2]  # where it comes from, in the frame of the next boundary
    upwards = p.above ^ happened.through
    medium = where(upwards if p.haze is None else upwards | p.haze[0], p.at, p.at + 1)
    flux = tuple(f * w for f, w in zip(p.flux, happened.weight, strict=True))

    # Flux that rises: the ways to find it from further down. The first half: the ways from further up, and the exit from a medium.
    up, down = _densities(material, p, happened.pdf, happened.back, p.w[2])
    rising = where(p.others > 0.0, (1.0 + down * p.others) / jnp.maximum(up, _TINY), 1.0 / jnp.maximum(happened.pdf, _TINY))
    up, down = _densities(material, p, happened.back, happened.pdf, d[2])
    above = pick(p.at, [0.0 * d[2], *(exit.others for exit in p.exits)])
    eta = pick(p.at, [b.eta for b in material.boundaries])
    # Radiance leaves thinner by eta^2 than it is below: reciprocity of refraction (Walter et al. 2007, section 5).
    flux = tuple(where(eye & leaves, f / (eta * eta), f) for f in flux)
    exit = Exit(arriving, flux, (1.0 + up * above) / jnp.maximum(down, _TINY))
    alive = flux[0] > 0.0
    exits = tuple(where(eye & leaves & ~upwards & alive & (p.at == k), exit, old) for k, old in enumerate(p.exits))

    moved = replace(
        p,
        event=p.event + jnp.uint32(1),
        stage=where(leaves & ~eye, BELOW, p.stage),
        at=where(leaves, where(upwards, medium - 1, medium), p.at),
        above=upwards ^ leaves,
        w=where(leaves, arriving, opposite(d)),
        c=None if happened.c is None else where(leaves, 1.0, happened.c),
        others=where(leaves, where(upwards, rising, 0.0), p.others),
        exits=exits,
    )
    way = 1.0 / jnp.maximum(d[2], _TINY)
    if p.haze is not None:
        moved, way = _drift(material, moved, p.haze, d, upwards, medium, leaves & ~eye, u[6])
    flux = tuple(where(leaves, f * t, f) for f, t in zip(flux, _passing(material, medium, way, eye), strict=True))

    # The first half ends above the base or where it turns; the second begins.
    last = p.at == len(material.boundaries) - 1
    entering = eye & leaves & (upwards | last | ~alive)
    begun = start(material, wi, p.path)
    begun = replace(begun, event=moved.event, stage=jnp.full_like(p.stage, LIGHT), exits=exits)
    brightest = flux[0] if len(flux) == 1 else jnp.maximum(jnp.maximum(flux[0], flux[1]), flux[2])
    chance = jnp.minimum(brightest / _FAINT, 1.0) * where(p.event > _LONG, _LINGER, 1.0)
    chance = where(leaves & ~eye, chance, 1.0)
    ended = leaves & ~eye & (((p.at == 0) & upwards) | ~(u[5] < chance))
    moved = replace(moved, flux=tuple(f / jnp.maximum(chance, _TINY) for f in flux))
    return moved, begun, entering, ended


@jax.jit
def _drift(
    material: Material,
    moved: Particle,
    haze: tuple[Flag, Scalar],
    d: Direction,
    upwards: Flag,
    medium: Scalar,
    can_stop: Flag,
    u: Scalar,
) -> tuple[Particle, Scalar]:
    """The same with a stop in the haze where the particle is scattered; and how far it comes, in thicknesses."""
    tau = pick(medium - 1, [jnp.zeros_like(u) if m.haze is None else m.haze.tau for m in material.media])
    depth = where(haze[0], haze[1], where(upwards, 1.0, 0.0))
    cosine = jnp.maximum(d[2], _TINY)
    way = where(upwards, depth, 1.0 - depth) / cosine
    free = -jnp.log(u) / jnp.maximum(tau, _TINY)
    stops = can_stop & (free < way)
    way = where(can_stop, jnp.minimum(free, way), way)
    stopped = replace(
        moved,
        at=medium,
        above=jnp.full_like(stops, True),
        w=(-d[0], -d[1], where(upwards, -d[2], d[2])),
        others=jnp.zeros_like(u),
    )
    reached = where(upwards, depth - way * cosine, depth + way * cosine)
    return replace(where(stops, stopped, moved), haze=(stops, reached)), way
