"""Light between a diffuse or scattering layer and the coats over it: what comes back, by quadrature over its directions, once a material."""

import itertools
from collections.abc import Callable, Sequence
from functools import partial, reduce
from operator import add
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._chunk import safe_divide, safe_sqrt, where
from .._types import Colour, Scalar
from ..layers import Coat
from ..optics.interface import facet_cosine, with_second_facet
from ..optics.medium import transmittance
from . import haze
from .crossing import Interface


def left(albedo: Colour, lobes: Colour | None, coats: list[Coat], interfaces: list[Interface]) -> Colour:
    """What is left of light between two meetings with the diffuse part, taken from 1: 1 - d 2 int R / (1 - s R) mu dmu.

    d and s are the albedos of the diffuse part and of the lobes, R is what comes back. In between, light meets the lobes as it would
    a mirror. Written by x = 1 - R, nothing cancels where d + s is near 1, which is also the most that it counts.
    """
    escape = _escape(coats, interfaces, lobes)
    if lobes is None:
        return 1.0 - albedo + albedo * escape
    both = jnp.minimum(albedo + lobes, 1.0)
    return (1.0 - both) / jnp.maximum(1.0 - lobes, 1e-6) * (1.0 - lobes * escape) + both * escape


# Not for speed: outside of a trace, a scan over a new function would compile again at every call.
@jax.jit
def _escape(coats: list[Coat], interfaces: list[Interface], lobes: Colour | None = None) -> Colour:
    """Part of the light of a diffuse base that gets out at its first try: 2 int x mu dmu, x = 1 - R exp(-2 tau / mu).

    Of a base with lobes of albedo s too, 2 int x / (1 - s + s x) mu dmu.
    """

    def tries(S: Colour, cosine: Scalar) -> list[Colour]:
        x = S + (1.0 - S) * _lost(coats[-1].extinction, cosine)
        return [x if lobes is None else x / jnp.maximum(1.0 - lobes + lobes * x, 1e-6)]

    return _over_directions(tries, coats, interfaces)[0]


@partial(jax.jit, static_argnames="nodes")
def haze_below(coats: list[Coat], interfaces: list[Interface], base: Any, nodes: int | None = None) -> haze.Haze:
    """What the innermost coat does to light that it scatters; `nodes` of the quadrature, by default as many as the precision asks for."""

    def mean(f: Callable[[Colour, Scalar], Sequence[Colour]]) -> Sequence[Colour]:
        return _over_directions(lambda S, cosine: f(1.0 - S, cosine), coats, interfaces, nodes)

    return haze.prepare(coats[-1], base, interfaces[-1].n, mean)


def _over_directions(
    f: Callable[[Colour, Scalar], Sequence[Colour]], coats: list[Coat], interfaces: list[Interface], nodes: int | None = None
) -> Sequence[Colour]:
    """2 int f(S, mu) mu dmu over the directions in the innermost medium, mu from 0 to 1; S is what passes up and out."""
    n = interfaces[-1].n
    edges = _edges(interfaces)

    def at(u: Scalar) -> Sequence[Colour]:
        # Between two edges directions are counted by u^3, the root of how far n sin is from the upper one: in it the integrand is
        # smooth, at any width, and the cube gathers nodes where short paths through a thin medium make it steep.
        u3 = u * u * u
        total: list[Any] = []
        for lower, upper in itertools.pairwise((jnp.zeros_like(n), *edges, n)):
            span = (upper - lower) * (upper + lower)
            along_normal = partial(_along_normal, upper, span * u3 * u3)
            cosine = safe_sqrt(along_normal(n)) / n
            S = 0.0 * cosine if upper is n else _passed_up(coats, interfaces, along_normal)
            total.append([6.0 * u * u * u3 * (span / (n * n)) * value for value in f(S, cosine)])
        return [reduce(add, values) for values in zip(*total, strict=True)]

    def accumulate(total: Sequence[Colour], node: tuple[Scalar, Scalar]) -> tuple[Sequence[Colour], None]:
        u, weight = node
        return [t + weight * value for t, value in zip(total, at(u), strict=True)], None

    u, weight = _nodes(n.dtype, nodes)
    # A colour as soon as anything is: a medium above, a lobe.
    zeros = [jnp.zeros(x.shape, x.dtype) for x in jax.eval_shape(at, n)]
    return jax.lax.scan(accumulate, zeros, (jnp.asarray(u), jnp.asarray(weight)))[0]


def _edges(interfaces: list[Interface]) -> list[Scalar]:
    """n sin of the edges of total reflection, which light from below meets on its way to air and to every coat but its own; ascending."""
    least, edges = interfaces[-1].n, []
    for n in [*(interface.n for interface in interfaces[-2::-1]), jnp.ones_like(least)]:
        least = where(least < n, least, n)  # not min: at matching indices its derivative is half of either side's
        edges.insert(0, least)
    return edges


def _along_normal(edge: Scalar, below: Scalar, n: Scalar) -> Scalar:
    """(n cos)^2 in a medium of index n, of light whose (n sin)^2 is so much `below` that of an edge."""
    return (n - edge) * (n + edge) + below


def _lost(tau: Colour | None, cosine: Scalar) -> Any:
    """Absorbed on the way up and down again."""
    return 0.0 if tau is None else -jnp.expm1(-tau * safe_divide(2.0, cosine))


def _passed_up(coats: list[Coat], interfaces: list[Interface], along_normal: Callable[[Scalar], Scalar]) -> Colour:
    """Part of the light from below that leaves the stack; `along_normal` is (n cos)^2 of it in a medium of index n."""
    S: Any = 1.0
    n_above = jnp.ones_like(interfaces[0].n)
    for depth, (coat, interface) in enumerate(zip(coats, interfaces, strict=True)):
        above = along_normal(n_above)
        z, z_below = safe_sqrt(above) / n_above, safe_sqrt(along_normal(interface.n)) / interface.n
        w = jnp.stack([safe_sqrt((1.0 - z) * (1.0 + z)), jnp.zeros_like(z), z])
        c = where(coat.eta >= 1.0, facet_cosine(w, interface.tilt), z_below)
        T = where(above > 0.0, with_second_facet(coat.passes(c), interface.gain), 0.0)
        if depth == 0:
            S = T
        else:
            back = (1.0 - S) * remains(coats[depth - 1].extinction, safe_divide(2.0, z))
            S = T * (1.0 - back) / jnp.maximum(1.0 - (1.0 - T) * back, 1e-6)
        n_above = interface.n
    return S


def remains(tau: Colour | None, path: Scalar) -> Any:
    """Part of light left after a path [thicknesses]: all of it in a clear medium."""
    return 1.0 if tau is None else transmittance(tau, path)


def _nodes(dtype: np.dtype, count: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on [0, 1]: `count`, or enough for the precision of `dtype`."""
    x, w = np.polynomial.legendre.leggauss(count or (16 if dtype == np.float32 else 64))
    return (0.5 * (x + 1.0)).astype(dtype), (0.5 * w).astype(dtype)
