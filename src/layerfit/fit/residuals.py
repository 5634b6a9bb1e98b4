"""Residuals of a material against blocks of samples, and the compiled descent of a fit."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._compiled import Compiled
from ..render import shade
from ..stack import Stack
from .blocks import Blocks
from .parameters import Parametrisation
from .solve import LONGEST, SOLVER, columns, dense, descend, normal_equations, products, tangents


def depths(layer: Any) -> list[str]:
    """Fields of a layer that grow with its thickness; of several layers of pigment, those of the outermost."""
    return [name for name in ("thickness_um", "tau", "tau_s", "kx", "sx") if getattr(layer, name, None) is not None]


def scaled(stack: Stack, scale: Any) -> Stack:
    """The material with its layers `scale` times as thick, the base last."""
    if scale is None:
        return stack

    def thicker(layer: Any, factor: Any) -> Any:
        return dataclasses.replace(layer, **{name: getattr(layer, name) * factor for name in depths(layer)})

    return stack.with_parts([thicker(layer, scale[k]) for k, layer in enumerate((*stack.layers, stack.base))])


def _material(u: Any, start: Stack, scale: Any, *, free: Parametrisation) -> tuple[Any, Any]:
    """The material at `u`, prepared, with what the lights are multiplied by; and the derivatives of both."""

    def made(fields: Any) -> Any:
        return scaled(free.put(start, fields).astype(u.dtype), scale).prepare(), free.light(fields)

    return tangents(made, free.fields(u))


def _columns(material: tuple[Any, Any], block: Blocks, *, form: Any) -> Any:
    """The model's derivatives and residual over one block of pixels, in the precision of the block."""

    def residual(made: Any) -> Any:
        prepared, light = made
        model = shade(prepared, block.wi, block.wo, block.weight, block.place, form=form)
        model = model if light is None else model * light[:, None]
        if block.curve is None:
            return (model - block.target) * block.inverse_sigma
        return (block.curve(model) - block.curve(block.target)) * block.inverse_sigma

    return columns(residual, *material)


def _descend(
    u: Any, state: Any, bounds: Any, start: Stack, scale: Any, blocks: Blocks, count: Any, most: Any, *, free: Parametrisation
) -> Any:
    """The solver over the first `count` blocks; see `solve.descend`. Kept are the columns of the last evaluation."""
    slots = tuple(f.slots for f in free.free)
    fields, dtype = len(slots) + 1, blocks.wi.dtype

    def evaluate(u: Any, kept: Any) -> Any:
        u = u.astype(dtype)
        # References of other thickness are made of other materials.
        made = (
            _material(u, start, None, free=free)
            if scale is None
            else lax.map(lambda s: _material(u, start, s, free=free), scale.astype(dtype))
        )

        def add(k: Any, sums: Any) -> Any:
            total, kept = sums
            block = jax.tree.map(lambda a: a[k], blocks)
            found = _columns(made if scale is None else jax.tree.map(lambda a: a[block.of], made), block, form=start.form)
            return total + products(found), lax.dynamic_update_index_in_dim(kept, found, k, 0)

        total, kept = lax.fori_loop(0, count, add, (jnp.zeros((3, fields, fields)), kept))
        return normal_equations(total, slots), kept

    size, channels, pixels = blocks.target.shape
    kept = jnp.zeros((size, fields, channels, pixels), dtype)
    u, state, losses, kept = descend(SOLVER, evaluate, u, state, bounds, most, kept)
    return u, jax.tree.leaves(state), losses, kept


_descent = Compiled(_descend)


@dataclasses.dataclass(frozen=True)
class Residuals:
    """Weighted residuals of a material against references, as a function of the vector of its free fields."""

    start: Stack
    """What is not free, in the precision of the blocks."""
    free: Parametrisation
    scale: np.ndarray | None
    """(references, layers): thickness over that of the material, the base last; None where it is 1 everywhere."""
    blocks: Blocks
    count: int
    """Blocks that hold pixels."""

    def begin(self) -> None:
        """Have what a descent needs compiled, while other work goes on."""
        u = self.free.pack(self.start)
        _descent.begin(*self._arguments(u, initial(u), self.free.bounds(), 0, 0), free=self.free)

    def steps(self, u: Any, state: Any, bounds: Any, count: int | None = None, most: int = LONGEST) -> tuple[Any, Any, Any]:
        """At most `most` steps of the solver from `u` over the first `count` blocks: the new point and state, and the loss after each step
        (NaN where none was taken). They are begun, not waited for: descents side by side use what cores there are.
        """
        u, leaves, losses, _ = self._run(u, state, bounds, self.count if count is None else count, most)
        return u, jax.tree.unflatten(jax.tree.structure(state), leaves), losses

    def rows(self, u: Any) -> tuple[np.ndarray, np.ndarray]:
        """Jacobian (pixels, channels, parameters) and residuals (pixels, channels) at `u`; the pixels block by block."""
        # By a step that leads nowhere: what a step evaluates is compiled already.
        *_, kept = self._run(u, initial(u), self.free.bounds(), self.count, 1)
        slots = tuple(f.slots for f in self.free.free)
        jacobian, residual = zip(*(dense(part, slots) for part in np.asarray(kept)[: self.count]), strict=True)
        return np.concatenate(jacobian), np.concatenate(residual)

    def _run(self, *at: Any) -> Any:
        return _descent(*self._arguments(*at), free=self.free)

    def _arguments(self, u: Any, state: Any, bounds: Any, count: int, most: int) -> tuple[Any, ...]:
        return u, state, bounds, self.start, self.scale, self.blocks, np.int32(count), np.int32(most)


NEAR = 1e4
"""Trust in the first step from a point that is near a minimum: nearly that of Gauss and Newton."""


def initial(u: Any, trust: Any = 1.0, solver: Any = SOLVER) -> Any:
    """State of the solver before its first step at `u`; `trust` is the inverse of its damping."""
    return solver.init(None, u, None, {"trust": trust}, None, None, frozenset())
