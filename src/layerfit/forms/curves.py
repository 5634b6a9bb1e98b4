"""What a coat's rough top does to light, as curves: from the tables of the random walk to the constants of a shader.

The tables have three arguments. Two of them, index and width, belong to the material: `bake` interpolates them away and leaves
functions of one cosine, as polynomials. Both steps are smooth in index and width, so that a fit can follow them.
"""

import dataclasses
from functools import cache
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .._chunk import chunk, member, safe_divide, safe_sqrt, struct
from .._types import Colour, Scalar, Vec4
from ..optics.interface import facet_tilt, second_facet
from . import tables

DEGREE = 7
"""Of the baked polynomials: their error (rms 2e-3 of the values) is below that of the form."""

SMOOTH_ETA = 1.15
"""First index of the tables; below it, an interface tends to none at all."""

GAUSS = 8
"""Nodes of the quadrature of diffuse light, inside and outside of the edge of total reflection each."""

STEER = 1.0288
"""Share of the tables' turn of the mean direction."""


@struct
class Interface:
    """The coat's rough top: functions of the cosine of light above it, each a polynomial in `grazing` with eight coefficients."""

    tilt: Scalar = member("turn of the mean facet towards a grazing direction")
    gain: Scalar = member("part of the reflected light that a second facet lets in")
    passed: Vec4 = member("energy that passes, beyond the closed form: four coefficients")
    passed_high: Vec4 = member("the other four, of higher powers")
    bend: Vec4 = member("sine of the refracted light over that at a smooth interface")
    bend_high: Vec4 = member("")
    spread: Vec4 = member("width of a lobe seen through it")
    spread_high: Vec4 = member("")
    path: Vec4 = member("mean path over that of the refracted direction")
    path_high: Vec4 = member("")
    theta: Vec4 = member("scale of the path's distribution")
    theta_high: Vec4 = member("")
    returned: Vec4 = member("energy that it reflects back down")
    returned_high: Vec4 = member("")


@chunk
def grazing(NoW: Scalar) -> Scalar:
    """Argument of the baked curves: sqrt(NoW) from the first node of the tables to 1, as -1 to 1."""
    first = float(np.sqrt(tables.load("single").mu[0]))
    return jnp.maximum(2.0 * (safe_sqrt(NoW) - first) / (1.0 - first) - 1.0, -1.0)


@chunk
def curve(low: Vec4, high: Vec4, s: Scalar) -> Scalar:
    """A polynomial of eight coefficients at s."""
    upper = high[0] + s * (high[1] + s * (high[2] + s * high[3]))
    return low[0] + s * (low[1] + s * (low[2] + s * (low[3] + s * upper)))


@chunk
def presence(eta: Scalar) -> Scalar:
    """0 where the indices match and there is no interface, 1 from the first index of the tables on."""
    t = jnp.clip((eta - 1.0) / (SMOOTH_ETA - 1.0), 0.0, 1.0)
    return t * (2.0 - t)


def bake(eta: Scalar, alpha: Scalar, kind: Literal["single", "multi"]) -> tuple[Interface, tuple[Any, Any]]:
    """Curves of one interface; and what it reflects back, as the cosines and weights of a quadrature (see `diffuse_return`).

    Numbers stay numbers, also inside a trace: a shader then has them as constants.
    """
    if isinstance(eta, Tracer) or isinstance(alpha, Tracer):
        return _bake(eta, alpha, kind)
    with jax.ensure_compile_time_eval():
        interface, (cosines, weights) = _bake(jnp.asarray(eta), jnp.asarray(alpha), kind)
    return interface, (np.asarray(cosines), np.asarray(weights))


def _bake(eta: Scalar, alpha: Scalar, kind: Literal["single", "multi"]) -> tuple[Interface, tuple[Any, Any]]:
    baked = _baking(kind)
    dtype = eta.dtype
    at = jnp.einsum("e,a,eaq->q", _cubic(eta, baked.eta), _cubic(alpha, baked.alpha), jnp.asarray(baked.values, dtype))
    nodes = len(baked.mu)
    dT, rx, w, m, theta = at[: 5 * nodes].reshape(5, nodes)
    R = at[5 * nodes :]
    there = presence(eta)
    mu = jnp.asarray(baked.mu, dtype)
    bend = 1.0 + STEER * there * (rx - 1.0)
    sine = jnp.minimum(jnp.sqrt((1.0 - mu) * (1.0 + mu)) * bend / eta, 0.9998)
    z = jnp.sqrt((1.0 - sine) * (1.0 + sine))
    # From below, the light that the median direction stands for comes at the cosine of a smooth interface, past its edge.
    edge = safe_sqrt((eta - 1.0) * (eta + 1.0)) / eta
    part = (jnp.sqrt((eta - 1.0) * (eta + 1.0) + mu * mu) / eta - edge) / (1.0 - edge)
    returned = jax.vmap(lambda p: _cubic(p, baked.part))(part) @ R
    rows = (there * dT, bend, there * w, 1.0 + there * (m * z - 1.0), theta, there * returned)
    halves = [half for row in rows for half in jnp.split(jnp.asarray(baked.fit, dtype) @ row, 2)]
    rough = jnp.minimum(alpha, 1.0)
    x, dx = (jnp.asarray(a, dtype) for a in _gauss())
    cosines = jnp.concatenate([edge * x, edge + (1.0 - edge) * x])
    widths = jnp.concatenate([edge * dx, (1.0 - edge) * dx])
    weights = 2.0 * there * (jnp.asarray(baked.quadrature, dtype) @ R) * cosines * widths
    return Interface(facet_tilt(rough), second_facet(rough), *halves), (cosines, weights)


def diffuse_return(below: tuple[Any, Any], tau: Colour | None) -> Colour:
    """Part of diffuse light that comes back from the coat: 2 int R exp(-2 tau / mu) mu dmu, by the quadrature of `bake`."""
    cosines, weights = below
    total: Any = 0.0
    for k in range(2 * GAUSS):
        kept = 1.0 if tau is None else jnp.exp(-(2.0 * tau) * safe_divide(1.0, jnp.asarray(cosines[k])))
        total = total + weights[k] * kept
    return jnp.asarray(total)


@dataclasses.dataclass(frozen=True, eq=False)
class _Baking:
    """Tables of one interface model, and the constant matrices that turn their rows into curves and quadratures."""

    eta: np.ndarray
    alpha: np.ndarray
    mu: np.ndarray
    part: np.ndarray
    values: np.ndarray
    """(eta, alpha, all that is tabulated)."""
    fit: np.ndarray
    """(DEGREE + 1, mu): least squares."""
    quadrature: np.ndarray
    """(2 Gauss nodes, part): interpolation."""


@cache
def _baking(kind: Literal["single", "multi"]) -> _Baking:
    t = tables.load(kind)
    mu = t.mu.astype(float)
    edge = np.sqrt(1.0 - 1.0 / t.eta[0].astype(float) ** 2)
    below = t.mu_below[0].astype(float)
    part = np.where(below < edge, below / edge, 1.0 + (below - edge) / (1.0 - edge)) - 1.0
    columns = (t.dT, t.rx, t.w, 1.0 + t.kt, np.exp(t.lt), t.Rb)
    s = np.maximum(2.0 * (np.sqrt(mu) - np.sqrt(mu[0])) / (1.0 - np.sqrt(mu[0])) - 1.0, -1.0)
    x, _ = _gauss()
    with jax.enable_x64(True), jax.ensure_compile_time_eval():
        at = np.concatenate([x - 1.0, x])
        quadrature = np.stack([np.asarray(_cubic(jnp.asarray(p), part)) for p in at])
    return _Baking(
        eta=t.eta.astype(float),
        alpha=t.alpha.astype(float),
        mu=mu,
        part=part,
        values=np.concatenate(columns, -1).astype(float),
        fit=np.linalg.pinv(np.polynomial.polynomial.polyvander(s, DEGREE)),
        quadrature=quadrature,
    )


@cache
def _gauss() -> tuple[np.ndarray, np.ndarray]:
    x, weight = np.polynomial.legendre.leggauss(GAUSS)
    return 0.5 * (x + 1.0), 0.5 * weight


def _cubic(x: Scalar, nodes: np.ndarray) -> Any:
    """Weights of the values at `nodes` in their C1 cubic interpolant at x, which is held inside the nodes.

    Hermite's cubic with the slopes of the parabola through a node and its neighbours (Catmull and Rom 1974, for uneven nodes).
    """
    n = len(nodes)
    h = np.diff(nodes)
    slope = np.zeros((n, n))
    for k in range(1, n - 1):
        left, right = h[k] / (h[k - 1] + h[k]), h[k - 1] / (h[k - 1] + h[k])
        slope[k, k - 1 : k + 2] = -left / h[k - 1], left / h[k - 1] - right / h[k], right / h[k]
    slope[0, :2] = -1.0 / h[0], 1.0 / h[0]
    slope[0] = 2.0 * slope[0] - slope[1]
    slope[-1, -2:] = -1.0 / h[-1], 1.0 / h[-1]
    slope[-1] = 2.0 * slope[-1] - slope[-2]
    dtype = x.dtype
    x = jnp.clip(x, float(nodes[0]), float(nodes[-1]))
    t = (x - jnp.asarray(nodes[:-1], dtype)) / jnp.asarray(h, dtype)
    inside = (x >= jnp.asarray(nodes[:-1], dtype)) & ((x < jnp.asarray(nodes[1:], dtype)) | (np.arange(n - 1) == n - 2))
    u = 1.0 - t
    value0 = jnp.where(inside, (1.0 + 2.0 * t) * u * u, 0.0)
    value1 = jnp.where(inside, (1.0 + 2.0 * u) * t * t, 0.0)
    slope0 = jnp.where(inside, jnp.asarray(h, dtype) * t * u * u, 0.0)
    slope1 = jnp.where(inside, -jnp.asarray(h, dtype) * u * t * t, 0.0)
    pad = jnp.zeros(1, dtype)
    value = jnp.concatenate([value0, pad]) + jnp.concatenate([pad, value1])
    return value + (jnp.concatenate([slope0, pad]) + jnp.concatenate([pad, slope1])) @ jnp.asarray(slope, dtype)
