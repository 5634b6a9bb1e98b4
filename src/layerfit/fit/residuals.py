"""Residuals of a material against blocks of samples, and the compiled step of a fit."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from .._compiled import Compiled
from ..render import shade
from ..stack import Stack, prepared
from .blocks import Block
from .parameters import Parametrisation
from .solve import columns, dense, normal_equations, products, tangents


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


def _columns(material: tuple[Any, Any], block: Block, *, form: Any) -> Any:
    """The model's derivatives and residual over one block of pixels, in the precision of the block."""

    def residual(made: Any) -> Any:
        prepared, light = made
        model = shade(prepared, block.wi, block.wo, block.weight, block.place, form=form)
        model = model if light is None else model * light[:, None]
        if block.curve is None:
            return (model - block.target) * block.inverse_sigma
        return (block.curve(model) - block.curve(block.target)) * block.inverse_sigma

    return columns(residual, *material)


def _advance(u: Any, state: Any, bounds: Any, total: Any, *, free: Parametrisation, solver: Any) -> Any:
    """The solver's new point and the leaves of its new state, from the products at its trial point."""
    fn = lambda y, args: normal_equations(total, tuple(f.slots for f in free.free))  # noqa: E731
    u, state, _ = solver.step(fn, u, None, {"lower": bounds[0], "upper": bounds[1]}, state, frozenset())
    return u, jax.tree.leaves(state)


_derivatives = Compiled(_material, optimise=1)
_block_columns = Compiled(_columns)
_solver_step = Compiled(_advance, optimise=1)


def begin(u: Any, start: Stack, blocks: Sequence[Block], *, free: Parametrisation) -> None:
    """Have what a step needs compiled, while other work goes on."""
    with jax.enable_x64(False):
        lit = free.light(free.fields(np.asarray(u, np.float32)), np)
        made = prepared.begin(scaled(start.astype(np.float32), blocks[0].scale)), lit
    # The larger part first; that of the material goes on beside it.
    along = jax.tree.map(lambda a: jax.ShapeDtypeStruct((len(free.free), *a.shape), a.dtype), made)
    _block_columns.begin((made, along), blocks[0], form=start.form)
    _derivatives.begin(np.asarray(u).astype(np.float32), start, blocks[0].scale, free=free)


def begin_solver(u: Any, bounds: Any, blocks: Sequence[Block], *, free: Parametrisation, solver: Any) -> None:
    """The same of the solver's part of it, which is traced with small things that are compiled at once: begin it before what is large."""
    total = np.zeros((len(blocks[0].target), len(free.free) + 1, len(free.free) + 1))
    _solver_step.begin(u, initial(u, solver), bounds, total, free=free, solver=solver)


def _started(u: np.ndarray, start: Stack, blocks: Sequence[Block], free: Parametrisation) -> list[Any]:
    """Columns of all blocks, begun; references of one thickness share the prepared material."""
    materials: dict[bytes | None, Any] = {}
    begun = []
    for block in blocks:
        key = None if block.scale is None else np.asarray(block.scale).tobytes()
        if key not in materials:
            materials[key] = _derivatives(u, start, block.scale, free=free)
        begun.append(_block_columns(materials[key], block, form=start.form))
    return begun


def step(
    u: Any, state: Any, bounds: Any, start: Stack, blocks: Sequence[Block], *, free: Parametrisation, solver: Any
) -> tuple[Any, Any]:
    """One step of the solver from `u` over some blocks of pixels: the new point and the new state."""
    trial = np.asarray(state.y_eval).astype(blocks[0].wi.dtype)
    # All are started before the first is waited for: what cores there are work side by side.
    started = _started(trial, start, blocks, free)
    total = np.sum([products(part) for part in started], 0)
    u, leaves = _solver_step(u, state, bounds, total, free=free, solver=solver)
    return u, jax.tree.unflatten(jax.tree.structure(state), leaves)


def rows(u: Any, start: Stack, blocks: Sequence[Block], *, free: Parametrisation) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian (pixels, channels, parameters) and residuals (pixels, channels) at `u`, weighted; the pixels block by block."""
    slots = tuple(f.slots for f in free.free)
    parts = [dense(part, slots) for part in _started(np.asarray(u).astype(blocks[0].wi.dtype), start, blocks, free)]
    jacobian, residual = zip(*parts, strict=True)
    return np.concatenate(jacobian), np.concatenate(residual)


NEAR = 1e4
"""Trust in the first step from a point that is near a minimum: nearly that of Gauss and Newton."""


def initial(u: Any, solver: Any, trust: Any = 1.0) -> Any:
    """State of the solver before its first step at `u`; `trust` is the inverse of its damping."""
    return solver.init(None, u, None, {"trust": trust}, None, None, frozenset())
