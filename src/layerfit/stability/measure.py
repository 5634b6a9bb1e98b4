"""One structure on its grid: is all of it finite, and how many digits has float32?"""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._compiled import fusion_emitters
from .._directions import FLOOR as OF_WHITE
from ..stack import Stack, evaluate
from .grid import Grid

FLOOR = OF_WHITE / np.pi
"""Values [1/sr] below it are compared absolutely."""
SLOPE_FLOOR = 1e-2
"""Derivatives below this part of the value are compared with that: in the coordinate of a fit both have one unit."""

PART = 64
"""Materials that are evaluated at a time."""

QUICKLY: Any = {"xla_backend_optimization_level": 0} | fusion_emitters(newer=False)


@dataclasses.dataclass(frozen=True)
class Values:
    """BRDF (m, d) or (m, d, 3) [1/sr] of m materials at d pairs, and its derivatives, in one precision."""

    f: np.ndarray
    slopes: np.ndarray
    """Along each of n parameters and along a turn of both directions (n + 2, m, d[, 3]), forwards."""
    gradients: list[np.ndarray]
    """Of the sum over pairs and materials, backwards, for every parameter and the directions; none in float64, which is for comparison."""


def values_of(stack: Stack, wi: np.ndarray, wo: np.ndarray, dtype: Any) -> Values:
    """Values and derivatives of every material of a stack of arrays (m,) at pairs of directions (d, 3)."""
    forwards, backwards = (jax.jit(fn, compiler_options=QUICKLY) for fn in (_forwards, _backwards))
    with jax.enable_x64(dtype == np.float64):
        pairs = jnp.asarray(wi, dtype), jnp.asarray(wo, dtype)
        found = [forwards(part, *pairs) for part in _parts(stack)]
        gradients = [jax.tree.leaves(backwards(part, *pairs)) for part in _parts(stack)] if dtype == np.float32 else []
        count = len(jax.tree.leaves(stack)[0])
        f = np.concatenate([f for f, _ in found])[:count]
        slopes = np.concatenate([slopes for _, slopes in found], 1)[:, :count]
        return Values(f, slopes, [np.concatenate(leaves) for leaves in zip(*gradients, strict=True)])


def plain_values(stack: Stack, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Values (m, d[, 3]) alone, in float64."""
    values = jax.jit(_values, compiler_options=QUICKLY)
    with jax.enable_x64(True):
        found = [values(part, jnp.asarray(wi, float), jnp.asarray(wo, float)) for part in _parts(stack)]
        return np.concatenate(found)[: len(jax.tree.leaves(stack)[0])]


def _parts(stack: Stack) -> Iterator[Stack]:
    """A few materials at a time, always as many: memory is bounded, and what is compiled for one part serves all."""
    leaves, structure = jax.tree.flatten(stack)
    for start in range(0, len(leaves[0]), PART):
        part = [leaf[start : start + PART] for leaf in leaves]
        yield jax.tree.unflatten(structure, [jnp.asarray(np.pad(x, (0, PART - len(x)), "edge")) for x in part])


def _backwards(*inputs: Any) -> Any:
    return jax.grad(lambda *x: jnp.sum(_values(*x)), (0, 1, 2))(*inputs)


def _forwards(*inputs: Any) -> Any:
    leaves, structure = jax.tree.flatten(inputs)
    ways = [*(jnp.ones_like(x) for x in leaves[:-2]), *map(turn, leaves[-2:])]
    tangents = [jnp.stack([way * (j == k) for k in range(len(leaves))]) for j, way in enumerate(ways)]
    along = lambda t: jax.jvp(_values, inputs, jax.tree.unflatten(structure, t))  # noqa: E731
    return jax.vmap(along, out_axes=(None, 0))(tangents)


def turn(w: Any) -> jax.Array:
    """A tangent (d, 3) of unit directions (d, 3), aslant to polar angle and azimuth: along it a direction stays one."""
    flat = jnp.stack([-w[:, 1], w[:, 0], jnp.zeros_like(w[:, 0])], -1)
    size = jnp.linalg.norm(flat, axis=-1, keepdims=True)
    around = jnp.where(size > 0.0, flat / jnp.where(size > 0.0, size, 1.0), jnp.array([1.0, 0.0, 0.0], w.dtype))
    return (around + jnp.cross(around, w)) * math.sqrt(0.5)


def _values(stack: Stack, wi: Any, wo: Any) -> Any:
    def of(material: Stack) -> Any:
        prepared = material.prepare()
        return jax.vmap(lambda i, o: evaluate(material.form, prepared, i, o))(wi, wo)

    return jax.vmap(of)(stack)


def value_error(single: np.ndarray, double: np.ndarray) -> np.ndarray:
    """|float32 - float64| over the larger of the value and the floor, (m, d); infinite where either is not finite."""
    return _worst(np.abs(single - double) / np.maximum(np.abs(double), FLOOR), single, double)


ROUNDINGS = 4.0
"""As many of its inputs' last bits as a value may be off by: the steps of a formula round as the inputs did."""


def by_last_bits(double: Values, tried: Grid) -> np.ndarray:
    """How far values (m, d[, 3]) move with the last bit in float32 of every parameter and of both directions: what no formula has digits of."""
    sizes = np.concatenate([np.abs(tried.values.T), np.ones((2, len(tried.values)))])
    moved = np.einsum("nm,nm...->m...", sizes, np.abs(double.slopes))
    return ROUNDINGS * 0.5 * float(np.finfo(np.float32).eps) * moved


def fit_scale(tried: Grid) -> np.ndarray:
    """d value / d coordinate of a fit (n, m), of every parameter of every material."""
    columns = zip(tried.free, tried.values.T, strict=True)
    return np.array([f.slope(f.to_steps(column)) for f, column in columns]).reshape(len(tried.free), -1)


def slope_error(single: Values, double: Values, tried: Grid) -> np.ndarray:
    """The same of derivatives in the coordinate of a fit, (n, m, d)."""
    n = len(tried.free)
    scale = fit_scale(tried).reshape(n, -1, *[1] * (double.f.ndim - 1))
    a, b = single.slopes[:n] * scale, double.slopes[:n] * scale
    return _worst(np.abs(a - b) / np.maximum(np.abs(b), SLOPE_FLOOR * np.abs(double.f) + FLOOR), a, b, axis=3)


def _worst(error: np.ndarray, a: np.ndarray, b: np.ndarray, axis: int = 2) -> np.ndarray:
    error = np.where(np.isfinite(a) & np.isfinite(b), error, np.inf)
    return error if error.ndim == axis else error.max(-1)
