"""Residuals of a material against blocks of samples, and the compiled step of a fit."""

import dataclasses
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import numpy as np

from .._compiled import Compiled
from ..render import channels
from ..stack import Stack
from .blocks import Block
from .parameters import Parametrisation
from .solve import Normal, columns, normal_equations, products


def depths(layer: Any) -> list[str]:
    """Fields of a layer that grow with its thickness; of several layers of pigment, those of the outermost."""
    return [name for name in ("thickness_um", "tau", "tau_s", "kx", "sx") if getattr(layer, name, None) is not None]


def scaled(stack: Stack, scale: Any) -> Stack:
    """The material with its layers `scale` times as thick, the base last."""
    if scale is None:
        return stack

    def thicker(layer: Any, factor: Any) -> Any:
        return dataclasses.replace(layer, **{name: getattr(layer, name) * factor for name in depths(layer)})

    *layers, base = (thicker(layer, scale[k]) for k, layer in enumerate((*stack.layers, stack.base)))
    return dataclasses.replace(stack, layers=tuple(layers), base=base)


def _material(start: Stack, free: Parametrisation, fields: list[Any], block: Block) -> Stack:
    return scaled(free.put(start, fields).astype(block.target.dtype), block.scale)


def _columns(u: Any, start: Stack, block: Block, *, free: Parametrisation) -> Any:
    """The model's derivatives and residual over one block of pixels at `u`, in the precision of the block."""

    def residual(fields: list[Any]) -> Any:
        model = channels(_material(start, free, fields, block), block.wi, block.wo, block.weight, block.place)
        return (model - block.target) * block.inverse_sigma

    return columns(residual, free.fields(u))


def _advance(u: Any, state: Any, bounds: Any, total: Any, *, free: Parametrisation, solver: Any) -> Any:
    """The solver's new point and state, from the products at its trial point."""
    fn = lambda y, args: normal_equations(total, tuple(f.slots for f in free.free))  # noqa: E731
    u, state, _ = solver.step(fn, u, None, {"lower": bounds[0], "upper": bounds[1]}, state, frozenset())
    return u, state


_block_columns = Compiled(_columns, ("free",))
_solver_step = Compiled(_advance, ("free", "solver"))


def step(
    u: Any, state: Any, bounds: Any, start: Stack, blocks: Sequence[Block], *, free: Parametrisation, solver: Any
) -> tuple[Any, Any]:
    """One step of the solver from `u` over some blocks of pixels: the new point and the new state."""
    trial = np.asarray(state.y_eval).astype(np.float32)
    # All are started before the first is waited for: what cores there are work side by side.
    started = [_block_columns(trial, start, block, free=free) for block in blocks]
    total = np.sum([products(part) for part in started], 0)
    return _solver_step(u, state, bounds, total, free=free, solver=solver)


def parts(u: Any, start: Stack, blocks: Sequence[Block], groups: np.ndarray, *, free: Parametrisation) -> list[Normal]:
    """Normal equations of groups of pixels, from one evaluation of the model at `u`; `groups` (groups, blocks, pixels) are masks."""
    slots = tuple(f.slots for f in free.free)
    evaluated = [_block_columns(np.asarray(u).astype(np.float32), start, block, free=free) for block in blocks]
    evaluated = [[np.asarray(column) for column in part] for part in evaluated]
    return [
        normal_equations(np.sum([products([c * m for c in part]) for part, m in zip(evaluated, mask, strict=True)], 0), slots)
        for mask in groups
    ]


NEAR = 1e4
"""Trust in the first step from a point that is near a minimum: nearly that of Gauss and Newton."""


@partial(jax.jit, static_argnames="solver")
def initial(u: Any, solver: Any, trust: Any = 1.0) -> Any:
    """State of the solver before its first step at `u`; `trust` is the inverse of its damping."""
    return solver.init(None, u, None, {"trust": trust}, None, None, frozenset())
