"""Residuals of a material against blocks of samples, and the compiled descent of a fit."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._compiled import Compiled
from ..capture.scene import WHOLE, Lit, factor
from ..render import shade
from ..stack import Stack
from .blocks import Blocks
from .nuisances import depths
from .parameters import Parametrisation
from .solve import LONGEST, SOLVER, columns, dense, descend, normal_equations, products, tangents


def scaled(stack: Stack, scale: Any) -> Stack:
    """The material with its layers `scale` times as thick, the base last."""
    if scale is None:
        return stack

    def thicker(layer: Any, factor: Any) -> Any:
        return dataclasses.replace(layer, **{name: getattr(layer, name) * factor for name in depths(layer)})

    return stack.with_parts([thicker(layer, scale[k]) for k, layer in enumerate((*stack.layers, stack.base))])


def _material(u: Any, start: Stack, scale: Any, *, free: Parametrisation) -> tuple[Any, Any]:
    """The material of a reference at `u`, prepared, with how bright its lights are; and the derivatives of both."""

    def made(fields: Any) -> Any:
        stack = free.put(start, fields).astype(u.dtype)
        thickness = free.thickness(fields, scale, len(stack.layers) + 1)
        return scaled(stack, thickness).prepare(), free.light(fields)

    return tangents(made, free.fields(u))


def seen(made: tuple[Any, Any], block: Blocks, *, form: Any) -> Any:
    """What the model shows at one block of pixels, (channels, pixels), as it is compared; `made` is the material, prepared, and how bright its
    lights are."""
    prepared, lit = made
    weight = block.weight if block.lights is None else block.weight * _bright(block.lights, lit)[:, None]
    model = shade(prepared, block.wi, block.wo, weight, block.place, form=form)
    if lit and block.lights is None:
        model = model * lit[WHOLE][:, None]
    return model if block.curve is None else block.curve(model)


def _columns(material: tuple[Any, Any], block: Blocks, *, form: Any) -> Any:
    """The model's derivatives and residual over one block of pixels, in the precision of the block."""
    target = block.target if block.curve is None else block.curve(block.target)
    return columns(lambda made: (seen(made, block, form=form) - target) * block.inverse_sigma, *material)


def _bright(lights: Mapping[str, Any], lit: Lit) -> Any:
    """What the samples of lights are multiplied by, (3, samples)."""
    return sum(factor(name, lit)[:, None] * here for name, here in lights.items())


def _descend(
    u: Any, state: Any, bounds: Any, start: Stack, scale: Any, blocks: Blocks, count: Any, most: Any, *, free: Parametrisation
) -> Any:
    """The solver over the first `count` blocks; see `solve.descend`. Kept are the columns of the last evaluation."""
    fields, dtype = len(free.part.free) + 1, blocks.wi.dtype
    alike = scale is None and not free.apart

    def evaluate(u: Any, kept: Any) -> Any:
        made = materials(u.astype(dtype), start, None if scale is None else scale.astype(dtype), free)

        def add(k: Any, sums: Any) -> Any:
            total, kept = sums
            block = jax.tree.map(lambda a: a[k], blocks)
            found = _columns(made if alike else jax.tree.map(lambda a: a[block.of], made), block, form=start.form)
            part = block.of if free.apart else 0
            return total.at[part].add(products(found)), lax.dynamic_update_index_in_dim(kept, found, k, 0)

        total, kept = lax.fori_loop(0, count, add, (jnp.zeros((len(free.slots), 3, fields, fields)), kept))
        parts = [normal_equations(products, slots, free.size) for products, slots in zip(total, free.slots, strict=True)]
        return jax.tree.map(lambda *values: sum(values), *parts), kept

    size, channels, pixels = blocks.target.shape
    kept = jnp.zeros((size, fields, channels, pixels), dtype)
    u, state, losses, kept = descend(SOLVER, evaluate, u, state, bounds, most, kept)
    return u, jax.tree.leaves(state), losses, kept


def materials(u: Any, start: Stack, scale: Any, free: Parametrisation) -> tuple[Any, Any]:
    """`_material` of every reference, where they are not the same."""
    if scale is None and not free.apart:
        return _material(u, start, None, free=free)
    vectors = jnp.stack([free.taken(u, k) for k in range(len(free.slots) if scale is None else len(scale))])
    return lax.map(lambda at: _material(at[0], start, at[1], free=free.part), (vectors, scale))


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
        columns, of = (
            np.asarray(kept)[: self.count],
            np.asarray(self.blocks.of) if self.free.apart else np.zeros(self.count, int),
        )
        parts = [dense(part, self.free.slots[k], self.free.size) for part, k in zip(columns, of, strict=False)]
        jacobian, residual = zip(*parts, strict=True)
        return np.concatenate(jacobian), np.concatenate(residual)

    def _run(self, *at: Any) -> Any:
        return _descent(*self._arguments(*at), free=self.free)

    def _arguments(self, u: Any, state: Any, bounds: Any, count: int, most: int) -> tuple[Any, ...]:
        return u, state, bounds, self.start, self.scale, self.blocks, np.int32(count), np.int32(most)


NEAR = 1e4
"""Trust in the first step from a point that is near a minimum: nearly that of Gauss and Newton."""


SEARCHED = 1e-5
"""Part of the loss that a step has to promise in a search on few pixels: the others move its end much further."""


def initial(u: Any, trust: Any = 1.0, gain: float | None = None, solver: Any = SOLVER) -> Any:
    """State of the solver before its first step at `u`; `trust` is the inverse of its damping, `gain` the part of the loss that a step has to
    promise, where it is not the solver's own."""
    options = {"trust": trust} if gain is None else {"trust": trust, "gain": gain}
    return solver.init(None, u, None, options, None, None, frozenset())
