"""One structure on its grid: is all of it finite, and how many digits has float32?"""

import dataclasses
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

QUICKLY: Any = {"xla_backend_optimization_level": 0} | fusion_emitters(newer=False)


@dataclasses.dataclass(frozen=True)
class Values:
    """BRDF (m, d) or (m, d, 3) [1/sr] of m materials at d pairs, and its derivatives, in one precision."""

    f: np.ndarray
    slopes: np.ndarray
    """Along each of n parameters and along both directions (n + 2, m, d[, 3]), forwards."""
    gradients: list[np.ndarray]
    """Of the sum over pairs, backwards, for every parameter (m,) and the directions; none in float64, which is for comparison."""


def values_of(stack: Stack, wi: np.ndarray, wo: np.ndarray, dtype: Any) -> Values:
    """Values and derivatives of every material of a stack of arrays (m,) at pairs of directions (d, 3)."""
    with jax.enable_x64(dtype == np.float64):
        inputs = stack, jnp.asarray(wi, dtype), jnp.asarray(wo, dtype)
        f, slopes = jax.jit(_forwards, compiler_options=QUICKLY)(*inputs)
        gradients = jax.jit(_backwards, compiler_options=QUICKLY)(*inputs) if dtype == np.float32 else None
        return Values(np.asarray(f), np.asarray(slopes), [np.asarray(g) for g in jax.tree.leaves(gradients)])


def _backwards(*inputs: Any) -> Any:
    return jax.grad(lambda *x: jnp.sum(_values(*x)), (0, 1, 2))(*inputs)


def _forwards(*inputs: Any) -> Any:
    leaves, structure = jax.tree.flatten(inputs)
    tangents = [jnp.stack([jnp.full_like(x, j == k) for k in range(len(leaves))]) for j, x in enumerate(leaves)]
    along = lambda t: jax.jvp(_values, inputs, jax.tree.unflatten(structure, t))  # noqa: E731
    return jax.vmap(along, out_axes=(None, 0))(tangents)


def _values(stack: Stack, wi: Any, wo: Any) -> Any:
    def of(material: Stack) -> Any:
        prepared = material.prepare()
        return jax.vmap(lambda i, o: evaluate(material.form, prepared, i, o))(wi, wo)

    return jax.vmap(of)(stack)


def value_error(single: Values, double: Values) -> np.ndarray:
    """|float32 - float64| over the larger of the value and the floor, (m, d); infinite where either is not finite."""
    return _worst(np.abs(single.f - double.f) / np.maximum(np.abs(double.f), FLOOR), single.f, double.f)


def slope_error(single: Values, double: Values, grid: Grid) -> np.ndarray:
    """The same of derivatives in the coordinate of a fit, (n, m, d)."""
    n = len(grid.free)
    columns = [f.slope(f.to_steps(column)) for f, column in zip(grid.free, grid.values.T, strict=True)]
    scale = np.array(columns).reshape(n, -1, *[1] * (double.f.ndim - 1))
    a, b = single.slopes[:n] * scale, double.slopes[:n] * scale
    return _worst(np.abs(a - b) / np.maximum(np.abs(b), SLOPE_FLOOR * np.abs(double.f) + FLOOR), a, b, axis=3)


def _worst(error: np.ndarray, a: np.ndarray, b: np.ndarray, axis: int = 2) -> np.ndarray:
    error = np.where(np.isfinite(a) & np.isfinite(b), error, np.inf)
    return error if error.ndim == axis else error.max(-1)
