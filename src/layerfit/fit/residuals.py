"""Residuals of a material against blocks of samples, and the compiled step of a fit."""

import dataclasses
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from .._compiled import Compiled
from ..layers import Coat
from ..render import radiance
from ..stack import Stack
from .blocks import Blocks
from .parameters import Parametrisation
from .solve import normal_equations, products


def scaled(stack: Stack, scale: Any) -> Stack:
    """The material with the coats `scale` times as thick."""
    if scale is None:
        return stack

    def thicker(coat: Coat, factor: Any) -> Coat:
        if coat.thickness_um is not None:
            return dataclasses.replace(coat, thickness_um=coat.thickness_um * factor)
        return coat if coat.tau is None else dataclasses.replace(coat, tau=coat.tau * factor)

    layers = tuple(thicker(coat, scale[k]) for k, coat in enumerate(stack.layers))
    return dataclasses.replace(stack, layers=layers)


def _material(start: Stack, free: Parametrisation, fields: list[Any], block: Blocks) -> Stack:
    dtype = block.target.dtype
    stack = free.put(start, [f.astype(dtype) for f in fields]).astype(dtype)
    return scaled(stack, block.scale)


def _block(blocks: Blocks, k: Any) -> Blocks:
    return jax.tree.map(lambda a: jax.lax.dynamic_index_in_dim(a, k, keepdims=False), blocks)


def _normal(u: Any, start: Stack, free: Parametrisation, blocks: Blocks, count: Any) -> Any:
    """Normal equations over the first `count` blocks."""
    fields = free.fields(u)

    def of_block(k: Any) -> Any:
        block = _block(blocks, k)

        def residual(fields: list[Any]) -> Any:
            model = radiance(_material(start, free, fields, block), block.wi, block.wo, block.weight)
            return (model - block.target) * block.inverse_sigma

        return products(residual, [f.astype(block.target.dtype) for f in fields])

    columns = len(free.free) + 1
    zero = jnp.zeros((columns, columns, blocks.target.shape[-1]))
    total = jax.lax.fori_loop(0, count, lambda k, total: total + of_block(k), zero)
    return normal_equations(total, tuple(f.slots for f in free.free))


def _step(
    u: Any, state: Any, bounds: Any, start: Stack, blocks: Blocks, count: Any, *, free: Parametrisation, solver: Any
) -> Any:
    """One step of the solver from `u`: the new point and the new state."""
    fn = lambda y, args: _normal(y, start, free, blocks, count)  # noqa: E731
    options = {"lower": bounds[0], "upper": bounds[1]}
    u, state, _ = solver.step(fn, u, None, options, state, frozenset())
    return u, state


step = Compiled(_step, ("free", "solver"))


@partial(jax.jit, static_argnames="solver")
def initial(u: Any, solver: Any) -> Any:
    """State of the solver before its first step at `u`."""
    return solver.init(None, u, None, {}, None, None, frozenset())
