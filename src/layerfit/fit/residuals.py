"""Residuals of a material against blocks of samples, and the compiled functions of a fit."""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..layers import Coat
from ..render import radiance
from ..stack import Stack
from .blocks import Blocks
from .parameters import Parametrisation
from .solve import normal_equations


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
    slots = tuple(f.slots for f in free.free)

    def of_block(k: Any) -> Any:
        block = _block(blocks, k)

        def residual(fields: list[Any]) -> Any:
            model = radiance(_material(start, free, fields, block), block.wi, block.wo, block.weight)
            return (model - block.target) * block.inverse_sigma

        return normal_equations(residual, [f.astype(block.target.dtype) for f in fields], slots)

    zero = jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), jax.eval_shape(of_block, jnp.int32(0)))
    return jax.lax.fori_loop(0, count, lambda k, total: jax.tree.map(jnp.add, total, of_block(k)), zero)


@dataclasses.dataclass
class Clock:
    """Seconds that went into tracing and compiling, apart from running."""

    trace_s: float = 0.0
    compile_s: float = 0.0


class Compiled:
    """A traced function with one executable for each structure and size of its arguments, made when it is first called."""

    def __init__(self, fn: Callable[..., Any], static: tuple[str, ...]):
        self._jit = jax.jit(fn, static_argnames=static)
        self._executables: dict[Any, Any] = {}

    def __call__(self, clock: Clock, *args: Any, **static: Any) -> Any:
        leaves, structure = jax.tree.flatten(args)
        key = (structure, tuple((np.shape(a), np.result_type(a)) for a in leaves), tuple(static.values()))
        if key not in self._executables:
            start = time.perf_counter()
            lowered = self._jit.trace(*args, **static).lower()
            traced = time.perf_counter()
            self._executables[key] = lowered.compile()
            clock.trace_s += traced - start
            clock.compile_s += time.perf_counter() - traced
        return jax.block_until_ready(self._executables[key](*args))


def _step(
    u: Any, state: Any, bounds: Any, start: Stack, blocks: Blocks, count: Any, *, free: Parametrisation, solver: Any
) -> Any:
    """One step of the solver from `u`: the new point and the new state."""
    fn = lambda y, args: _normal(y, start, free, blocks, count)  # noqa: E731
    options = {"lower": bounds[0], "upper": bounds[1]}
    u, state, _ = solver.step(fn, u, None, options, state, frozenset())
    return u, state


step = Compiled(_step, ("free", "solver"))


def initial(u: Any, solver: Any) -> Any:
    """State of the solver before its first step at `u`."""
    return solver.init(None, u, None, {}, None, None, frozenset())


def _predict(u: Any, start: Stack, blocks: Blocks, *, free: Parametrisation) -> Any:
    """Radiance of every pixel of every block, (blocks, pixels, 3)."""

    def of_block(block: Blocks) -> Any:
        return radiance(_material(start, free, free.fields(u), block), block.wi, block.wo, block.weight)

    return jax.lax.map(of_block, blocks)


predict = Compiled(_predict, ("free",))
