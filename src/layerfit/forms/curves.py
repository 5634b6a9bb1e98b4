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
from .._types import Colour, Scalar, Vec2, Vec4
from ..optics.interface import facet_tilt, rough_transmittance, second_facet
from . import tables
from .tables import Kind

DEGREE = 5
"""Of the baked polynomials: their error (rms 2e-3 of the values) is below that of the form."""

BEND = 0.2
"""Cosine about which the argument of the polynomials goes from following light to following 1 / NoW: in it they need the lowest degree."""

MASKED = 0.005
"""Step of the index above which facets hide one another as the tables say: a coat without a step is not there, and hides nothing."""

CELLS = 6
"""Of cosines below, inside and outside of the edge of total reflection each."""

TAUS = (0.25, 2.0)
"""Optical depths at which the spread of paths in the tables is that of the walk."""

GAUSS = 8
"""Nodes of the quadrature of diffuse light, inside and outside of the edge of total reflection each."""

BOTH = 3.173
"""How far widths add beyond their squares: the tails of GGX are longer than a Gaussian's, whose squares add."""

WIDTH = 0.899
"""Width of a GGX lobe with the spread of the tables, over that spread."""


@struct
class Interface:
    """The coat's rough top: functions of the cosine of light above it, each a polynomial in `grazing` with six coefficients."""

    tilt: Scalar = member("turn of the mean facet towards a grazing direction")
    gain: Scalar = member("part of the reflected light that a second facet lets in")
    passed: Vec4 = member("energy that passes, beyond the closed form: four coefficients")
    passed_high: Vec2 = member("the other two, of higher powers")
    bend: Vec4 = member("part by which the sine of light becomes smaller below")
    bend_high: Vec2 = member("")
    spread: Vec4 = member("width of a lobe seen through it, over that of the facets")
    spread_high: Vec2 = member("")
    path: Vec4 = member("mean path over that of the refracted direction")
    path_high: Vec2 = member("")
    theta: Vec4 = member("scale of the path's distribution")
    theta_high: Vec2 = member("")


@struct
class Nodes:
    """The same at the cosines of the tables, and what the interface reflects back down: for what is summed once per material."""

    z: Float[Array, " m"]
    """Cosine of the median direction below."""
    turn: Float[Array, " m"] | None
    """Sine below over that at a smooth interface, beyond 1; not of several interfaces together."""
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
    """Argument of the baked curves: 1 / (NoW + .2) from the first node of the tables to 1, as -1 to 1."""
    a, b = _scale()
    return jnp.maximum(a - b / (NoW + BEND), -1.0)


@cache
def _scale() -> tuple[float, float]:
    """a and b such that a - b / (NoW + BEND) goes from -1 at the first node of the tables to 1 at the normal."""
    b = 2.0 / (1.0 / (float(tables.load("single").mu[0]) + BEND) - 1.0 / (1.0 + BEND))
    return 1.0 + b / (1.0 + BEND), b


@chunk
def curve(low: Vec4, high: Vec2, s: Scalar) -> Scalar:
    """A polynomial of six coefficients at s."""
    return low[0] + s * (low[1] + s * (low[2] + s * (low[3] + s * (high[0] + s * high[1]))))


@chunk
def blurred2(width: Any, spread: Any) -> Any:
    """The squared width of a lobe of this width, seen by way of slopes that spread it."""
    shared = safe_divide(width * spread, width + spread)
    return width * width + spread * spread + BOTH * (shared * shared)


def blurred(width: Any, spread: Any) -> Any:
    """Its width."""
    return safe_sqrt(blurred2(width, spread))


@chunk
def presence(eta: Scalar) -> Scalar:
    """0 where the indices match and there is no interface, 1 from 1.15 on."""
    t = clip((eta - 1.0) / 0.15, 0.0, 1.0)
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
    dT, turn, w, path, theta = at[: 5 * count].reshape(5, count)
    R = at[5 * count :]
    mu = jnp.asarray(baked.mu, dtype)
    sin2 = (1.0 - mu) * (1.0 + mu)
    # As a part of itself by which the sine changes, not as what is left of it: where the indices match that has no digit of the change.
    bend = smaller(eta, turn)
    z = _below(mu, sin2, bend)
    spread = WIDTH * w
    hidden = dT * clip((eta - 1.0) / MASKED, 0.0, 1.0)
    rows = (hidden, bend, spread, path, theta)
    curves = [part for row in rows for part in parts(polynomial(row))]
    rough = where(alpha > 1.0, 1.0, alpha)  # not min: at 1 its derivative is half of either side's
    tilt, gain = facet_tilt(rough), second_facet(rough)
    closed = jax.vmap(lambda c: rough_transmittance(c, eta, gain))(jnp.sqrt(mu * mu + tilt * sin2))
    T = clip(closed + hidden, 0.0, 1.0)
    cosines, widths = gauss(safe_sqrt((eta - 1.0) * (eta + 1.0)) / eta)
    weights = 2.0 * (jnp.asarray(baked.quadrature, dtype) @ R) * cosines * widths
    nodes = Nodes(
        z,
        turn,
        T,
        spread * alpha,
        jnp.maximum(path, 1.0) / z,
        jnp.maximum(theta, 0.0),
        jnp.asarray(baked.cells, dtype) @ R,
        cosines,
        weights,
    )
    return Interface(tilt, gain, *curves), nodes


def smaller(n: Any, turn: Any) -> Any:
    """Part by which the sine of light becomes smaller in a medium of index n, where it is 1 + turn times that of Snell's law."""
    return ((n - 1.0) - turn) / n


def _below(mu: Any, sin2: Any, bend: Any, xp: Any = jnp) -> Any:
    """Cosine below of light whose sine becomes smaller by the part `bend`; what a denser medium refracts does not graze more than before."""
    bend = xp.maximum(bend, 0.0)
    return xp.sqrt(mu * mu + bend * (2.0 - bend) * sin2)


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


def interpolated(x: Float[Array, "*n"], known: Float[Array, " k"], values: Float[Array, " k"]) -> Float[Array, "*n"]:
    """Straight lines between values at growing arguments, and level beyond them."""
    return values[0] + passed(x, known) @ jnp.diff(values)


def passed(x: Float[Array, "*n"], known: Float[Array, " k"]) -> Float[Array, "*n k-1"]:
    """Part of each interval between growing arguments that lies before x."""
    # Not `jnp.interp`, which looks places up: a page computes this too, and has no step for that.
    return clip(safe_divide(x[..., None] - known[:-1], jnp.diff(known)), 0.0, 1.0)


def hemispherical(values: Float[Array, " m"]) -> Scalar:
    """2 int f mu dmu of values at the cosines of the tables above."""
    return jnp.asarray(_above()[1], values.dtype) @ values


def polynomial(values: Float[Array, " m"]) -> Float[Array, " c"]:
    """Coefficients of the curve through values at the cosines of the tables above: least squares."""
    return jnp.asarray(_above()[0], values.dtype) @ values


def parts(coefficients: Float[Array, " c"]) -> list[Float[Array, " p"]]:
    """Coefficients as an `Interface` holds them: no three are one vector, which would be a colour."""
    return jnp.split(coefficients, [4])


@chunk
def spread_root(theta: Scalar, tau: Colour) -> Colour:
    """How the spread of paths shows at depth tau, 1 where all are alike: of an inverse Gaussian (Tweedie 1957)."""
    return jnp.sqrt(1.0 + 2.0 * theta * tau)


def depth(path: Scalar, root: Colour, tau: Colour) -> Colour:
    """-log of the mean of exp(-tau u) over paths u; root is their `spread_root`."""
    return tau + (path - 1.0) * (2.0 * tau / (1.0 + root))


def absorbed(path: Scalar, theta: Scalar, tau: Colour) -> Colour:
    """Mean of exp(-tau u) over paths u beyond 1 of mean `path` and scale theta."""
    return jnp.exp(-depth(path, spread_root(theta, tau), tau))


def inverse_gaussian(kt: Any, theta: Any) -> tuple[Any, Any]:
    """Mean beyond 1 and scale of paths, from those of the tables' Gamma distribution.

    Both have the same mean of exp(-tau u) at the two depths of the tables. Elsewhere this one is nearer to the walk, and needs no logarithm.
    """
    thin, thick = (kt / theta * np.log1p(theta * tau) for tau in TAUS)
    # With s = sqrt(1 + 2 theta tau), thin / thick = (1 + s_thick) / (8 (1 + s_thin)) and s_thick^2 - 1 = 8 (s_thin^2 - 1).
    ratio = np.clip(8.0 * thin / np.maximum(thick, 1e-30), 1.0, 2.7)
    root = (8.0 + ratio * (ratio - 2.0)) / (8.0 - ratio * ratio)
    return 0.5 * (1.0 + root) * thin / TAUS[0], 0.5 * (root * root - 1.0) / TAUS[0]


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
    eta, mu = t.eta.astype(float), t.mu.astype(float)
    edge = np.sqrt(1.0 - 1.0 / eta[-1] ** 2)
    below = t.mu_below[-1].astype(float)
    part = np.where(below < edge, below / edge, 1.0 + (below - edge) / (1.0 - edge)) - 1.0
    mean, theta = inverse_gaussian(t.kt.astype(float), np.exp(t.lt.astype(float)))
    turn = t.rx.astype(float) - 1.0
    z = _below(mu, 1.0 - mu * mu, smaller(eta[:, None, None], turn), np)
    # Where the indices match light goes straight on.
    nothing = np.zeros_like(t.dT[:1])
    first = (t.dT[:1], nothing, nothing, nothing + 1.0, nothing, np.zeros_like(t.Rb[:1]))
    columns = [np.concatenate(pair) for pair in zip(first, (t.dT, turn, t.w, (1.0 + mean) * z, theta, t.Rb), strict=True)]
    x, _ = _gauss()
    at = lambda parts: np.stack([_cubic(p, part, np) for p in parts])  # noqa: E731
    quadrature, cells = at(np.concatenate([x - 1.0, x])), at(np.arange(2 * CELLS + 1) / CELLS - 1.0)
    return _Baking(
        eta=np.concatenate([[1.0], eta]),
        alpha=t.alpha.astype(float),
        mu=mu,
        values=np.concatenate(columns, -1).astype(float),
        quadrature=quadrature,
        cells=cells,
    )


@cache
def _above() -> tuple[np.ndarray, np.ndarray]:
    """For values at the cosines of the tables above: coefficients of the polynomial, and 2 int f mu dmu of it."""
    mu = tables.load("single").mu.astype(float)
    a, b = _scale()
    powers = lambda mu: np.polynomial.polynomial.polyvander(np.maximum(a - b / (mu + BEND), -1.0), DEGREE)  # noqa: E731
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
