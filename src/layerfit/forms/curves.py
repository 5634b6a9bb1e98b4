"""What a coat's rough top does to light, as curves: from the tables of the random walk to the constants of a shader.

The tables have three arguments. Two of them, index and width, belong to the material: `bake` interpolates them away and leaves
functions of one cosine, as polynomials. Both steps are smooth in index and width, so that a fit can follow them.
"""

import dataclasses
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from .._chunk import chunk, clip, member, safe_divide, safe_sqrt, struct, where
from .._types import Colour, Scalar, Vec4
from ..optics.interface import facet_tilt, rough_transmittance, second_facet
from . import tables
from .tables import Kind

DEGREE = 7
"""Of the baked polynomials: their error (rms 2e-3 of the values) is below that of the form."""

SMOOTH_ETA = 1.15
"""First index of the tables; below it, an interface tends to none at all."""

CELLS = 6
"""Of cosines below, inside and outside of the edge of total reflection each."""

GAUSS = 8
"""Nodes of the quadrature of diffuse light, inside and outside of the edge of total reflection each."""

STEER = 1.032
"""Share of the tables' turn of the mean direction."""

P = 1.412
"""Widths add as powers."""

WIDTH = 1.107
"""Width of a GGX lobe with the spread of the tables, over that spread."""


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


@struct
class Nodes:
    """The same at the cosines of the tables, and what the interface reflects back down: for what is summed once per material."""

    z: Float[Array, " m"]
    """Cosine of the median direction below."""
    T: Float[Array, " m"]
    """Energy that passes."""
    spread: Float[Array, " m"]
    path: Float[Array, " m"]
    """Mean path, in thicknesses."""
    theta: Float[Array, " m"]
    R: Float[Array, " k"]
    """Energy that is reflected of light from below, at cosines even from 0 to the edge of total reflection and from there to 1."""
    cosines: Float[Array, " q"]
    weights: Float[Array, " q"]
    """Of the quadrature of diffuse light from below, R and the cosines included."""


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
    t = clip((eta - 1.0) / (SMOOTH_ETA - 1.0), 0.0, 1.0)
    return t * (2.0 - t)


def bake(eta: Scalar, alpha: Scalar, kind: Kind) -> tuple[Interface, Nodes]:
    """Curves of one interface, and what they run through. Numbers stay numbers, also inside a trace: a shader has them as constants."""
    if isinstance(eta, Tracer) or isinstance(alpha, Tracer):
        return _bake(eta, alpha, kind)
    with jax.ensure_compile_time_eval():
        interface, nodes = _bake(jnp.asarray(eta), jnp.asarray(alpha), kind)
    return interface, jax.tree.map(np.asarray, nodes)


def _bake(eta: Scalar, alpha: Scalar, kind: Kind) -> tuple[Interface, Nodes]:
    baked = _baking(kind)
    dtype = eta.dtype
    at = jnp.einsum("e,a,eaq->q", _cubic(eta, baked.eta), _cubic(alpha, baked.alpha), jnp.asarray(baked.values, dtype))
    count = len(baked.mu)
    dT, rx, w, m, theta = at[: 5 * count].reshape(5, count)
    there = presence(eta)
    R = there * at[5 * count :]
    mu = jnp.asarray(baked.mu, dtype)
    sin2 = (1.0 - mu) * (1.0 + mu)
    bend = 1.0 + STEER * there * (rx - 1.0)
    sine = jnp.minimum(jnp.sqrt(sin2) * bend / eta, 0.9998)
    z = jnp.sqrt((1.0 - sine) * (1.0 + sine))
    spread = WIDTH * there * w
    rows = (there * dT, bend, spread, 1.0 + there * (m * z - 1.0), theta)
    curves = [half for row in rows for half in jnp.split(polynomial(row), 2)]
    rough = where(alpha > 1.0, 1.0, alpha)  # not min: at 1 its derivative is half of either side's
    tilt, gain = facet_tilt(rough), second_facet(rough)
    closed = jax.vmap(lambda c: rough_transmittance(c, eta, gain))(jnp.sqrt(mu * mu + tilt * sin2))
    T = clip(closed + rows[0], 0.0, 1.0)
    cosines, widths = gauss(safe_sqrt((eta - 1.0) * (eta + 1.0)) / eta)
    weights = 2.0 * (jnp.asarray(baked.quadrature, dtype) @ R) * cosines * widths
    nodes = Nodes(
        z,
        T,
        spread * alpha,
        jnp.maximum(rows[3], 1.0) / z,
        jnp.maximum(theta, 1e-4),
        jnp.asarray(baked.cells, dtype) @ R,
        cosines,
        weights,
    )
    return Interface(tilt, gain, *curves), nodes


def diffuse_return(nodes: Nodes, tau: Colour | None) -> Colour:
    """Part of diffuse light that comes back from the coat: 2 int R exp(-2 tau / mu) mu dmu."""
    if tau is None:
        return jnp.asarray(nodes.weights.sum())
    total: Any = 0.0
    for k in range(2 * GAUSS):
        kept = jnp.exp(-(2.0 * tau) * safe_divide(1.0, jnp.asarray(nodes.cosines[k])))
        total = total + nodes.weights[k] * kept
    return jnp.asarray(total)


def gauss(edge: Scalar) -> tuple[Float[Array, " q"], Float[Array, " q"]]:
    """Cosines and weights of the quadrature of light from below: inside and outside of the edge of total reflection."""
    x, dx = (jnp.asarray(a, edge.dtype) for a in _gauss())
    return jnp.concatenate([edge * x, edge + (1.0 - edge) * x]), jnp.concatenate([edge * dx, (1.0 - edge) * dx])


def hemispherical(values: Float[Array, " m"]) -> Scalar:
    """2 int f mu dmu of values at the cosines of the tables above."""
    return jnp.asarray(_above()[1], values.dtype) @ values


def polynomial(values: Float[Array, " m"]) -> Float[Array, " c"]:
    """Coefficients of the curve through values at the cosines of the tables above: least squares."""
    return jnp.asarray(_above()[0], values.dtype) @ values


@chunk
def absorbed(path: Scalar, theta: Scalar, tau: Colour) -> Colour:
    """Mean of exp(-tau u) over paths u = 1 + Gamma of mean `path` and scale theta."""
    scale = jnp.maximum(theta, 1e-6)
    return jnp.exp(-(tau + jnp.maximum(path - 1.0, 1e-9) * (jnp.log1p(scale * tau) / scale)))


@dataclasses.dataclass(frozen=True, eq=False)
class _Baking:
    """Tables of one interface model, and the constant matrices that turn their rows into curves and quadratures."""

    eta: np.ndarray
    alpha: np.ndarray
    mu: np.ndarray
    values: np.ndarray
    """(eta, alpha, all that is tabulated)."""
    quadrature: np.ndarray
    """(2 Gauss nodes, part): interpolation."""
    cells: np.ndarray
    """(2 CELLS + 1, part): interpolation."""


@cache
def _baking(kind: Kind) -> _Baking:
    t = tables.load(kind)
    edge = np.sqrt(1.0 - 1.0 / t.eta[0].astype(float) ** 2)
    below = t.mu_below[0].astype(float)
    part = np.where(below < edge, below / edge, 1.0 + (below - edge) / (1.0 - edge)) - 1.0
    columns = (t.dT, t.rx, t.w, 1.0 + t.kt, np.exp(t.lt), t.Rb)
    x, _ = _gauss()
    at = lambda parts: np.stack([_cubic(p, part, np) for p in parts])  # noqa: E731
    quadrature, cells = at(np.concatenate([x - 1.0, x])), at(np.arange(2 * CELLS + 1) / CELLS - 1.0)
    return _Baking(
        eta=t.eta.astype(float),
        alpha=t.alpha.astype(float),
        mu=t.mu.astype(float),
        values=np.concatenate(columns, -1).astype(float),
        quadrature=quadrature,
        cells=cells,
    )


@cache
def _above() -> tuple[np.ndarray, np.ndarray]:
    """For values at the cosines of the tables above: coefficients of the polynomial, and 2 int f mu dmu of it."""
    mu = tables.load("single").mu.astype(float)
    first = np.sqrt(mu[0])
    powers = lambda mu: np.polynomial.polynomial.polyvander(  # noqa: E731
        np.maximum(2.0 * (np.sqrt(mu) - first) / (1.0 - first) - 1.0, -1.0), DEGREE
    )
    fit = np.linalg.pinv(powers(mu))
    x, dx = np.polynomial.legendre.leggauss(40)
    x = 0.5 * (x + 1.0)
    return fit, (dx * x) @ powers(x) @ fit


@cache
def _gauss() -> tuple[np.ndarray, np.ndarray]:
    x, weight = np.polynomial.legendre.leggauss(GAUSS)
    return 0.5 * (x + 1.0), 0.5 * weight


def _cubic(x: Any, nodes: np.ndarray, xp: Any = jnp) -> Any:
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
    start, end, h = (xp.asarray(a, x.dtype) for a in (nodes[:-1], nodes[1:], h))
    first, last = float(nodes[0]), float(nodes[-1])
    x = xp.where(x > last, last, xp.where(x < first, first, x))  # not min and max: at an end they have half of the slope
    t = (x - start) / h
    u = 1.0 - t
    here = ((x >= start) & ((x < end) | (np.arange(n - 1) == n - 2))).astype(x.dtype)
    value0, value1 = here * (1.0 + 2.0 * t) * u * u, here * (1.0 + 2.0 * u) * t * t
    slope0, slope1 = here * h * t * u * u, -here * h * u * t * t
    pad = xp.zeros(1, x.dtype)
    value = xp.concatenate([value0, pad]) + xp.concatenate([pad, value1])
    return value + (xp.concatenate([slope0, pad]) + xp.concatenate([pad, slope1])) @ xp.asarray(slope, x.dtype)
