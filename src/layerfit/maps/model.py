"""The model of many texels at once: each a material of its own under the lights that it was seen in."""

from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from .._chunk import struct
from .._compiled import Compiled
from ..fit.nuisances import THICKNESS
from ..fit.parameters import Parametrisation
from ..fit.residuals import scaled
from ..fit.solve import SOLVER, columns, normal_equations, tangents
from ..optics.flakes import tilted_normal
from ..render import shade
from ..stack import Stack


@struct
class Seen:
    """Observations of texels, an axis of texels in front: K each, of s light samples; channels before observations where there are any."""

    wi: Any
    """(K, s, 3)"""
    wo: Any
    """(K, 3)"""
    weight: Any
    """(3, K, s); where the normal is mapped, without the cosine."""
    target: Any
    """(3, K)"""
    inverse_sigma: Any
    """(3, K) weight of the residual; 0 where there is no observation."""


def turned(w: Any, slopes: Any) -> Any:
    """Directions (..., 3) in the frame of a normal along (x, y, 1): its tangent is the old one less its part along the normal, as in `lf_brdf`."""
    n = tilted_normal(slopes)
    t = jnp.array([1.0, 0.0, 0.0], n.dtype) - n[0] * n
    t = t / jnp.sqrt(jnp.sum(t * t))
    return jnp.stack([w @ t, w @ jnp.cross(n, t), w @ n], -1)


def _made(fields: Any, start: Stack, free: Parametrisation) -> tuple[Any, Any]:
    """The material of one texel, prepared, and the slopes of its normal, None where that is known."""
    stack = free.put(start, fields).astype(fields[0].dtype)
    thick = {f.layer: f.from_steps(u) for f, u in zip(free.free, fields, strict=True) if f.field == THICKNESS}
    if thick:
        stack = scaled(stack, [thick.get(k, 1.0) for k in range(len(stack.layers) + 1)])
    slopes = [u for f, u in zip(free.free, fields, strict=True) if f.layer is None]
    return stack.prepare(), jnp.stack(slopes) if slopes else None


def _radiance(made: tuple[Any, Any], seen: Seen, form: Any) -> Any:
    """What the observations of one texel should be, (3, K)."""
    prepared, slopes = made
    if slopes is None:
        return shade(prepared, seen.wi, seen.wo, seen.weight, form=form)
    wi, wo = turned(seen.wi, slopes), turned(seen.wo, slopes)
    return shade(prepared, wi, wo, seen.weight * jnp.maximum(wi[..., 2], 0.0), form=form)


def _normal(u: Any, seen: Seen, start: Stack, free: Parametrisation) -> Any:
    """The normal equations of one texel."""

    def residual(made: tuple[Any, Any]) -> Any:
        return (_radiance(made, seen, start.form) - seen.target) * seen.inverse_sigma

    made = tangents(lambda fields: _made(fields, start, free), free.fields(u.astype(seen.wi.dtype)))
    rows = columns(residual, *made).astype(float)
    products = jnp.sum(rows[:, None] * rows[None], -1)  # of a dozen observations: a call of a library a texel would take longer
    return normal_equations(jnp.moveaxis(products, -1, 0), free.slots[0], free.size)


def _values(u: Any, seen: Seen, start: Stack, *, free: Parametrisation) -> Any:
    """Models (texels, 3, K)."""

    def one(u: Any, seen: Seen) -> Any:
        return _radiance(_made(free.fields(u.astype(seen.wi.dtype)), start, free), seen, start.form)

    return jax.vmap(one)(u, seen)


def _descend(u: Any, state: Any, bounds: Any, seen: Seen, start: Stack, most: Any, *, free: Parametrisation) -> Any:
    """At most `most` steps of the solver in every texel; those that are done rest."""

    def goes_on(at: Any) -> Any:
        k, _, state = at
        return (k < most) & ~jnp.all(state.done)

    def one(u: Any, state: Any, lower: Any, upper: Any, seen: Seen) -> Any:
        normal = _normal(state.y_eval, seen, start, free)
        options = {"lower": lower, "upper": upper}
        moved = SOLVER.step(lambda y, args: normal, u, None, options, state, frozenset())[:2]
        return jax.tree.map(lambda old, new: jnp.where(state.done, old, new), (u, state), moved)

    def step(at: Any) -> Any:
        k, u, state = at
        return k + 1, *jax.vmap(one)(u, state, bounds[0], bounds[1], seen)

    _, u, state = lax.while_loop(goes_on, step, (0, u, state))
    return u, jax.tree.leaves(state)


values = Compiled(_values)
steps = Compiled(_descend)
