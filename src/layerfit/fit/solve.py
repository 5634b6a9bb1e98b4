"""The solver: Levenberg-Marquardt of optimistix on normal equations with the structure of a material. The only file with optimistix.

A fit has few parameters and many residuals, and channel c of a residual depends on channel c of a colour only. So one tangent
a field (a scalar, or a colour with all its channels at once) gives every column that there is, and the normal equations are
accumulated from the columns without a tall matrix ever being factored. Sums are float64.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jax import lax
from jaxtyping import Array, Float, PyTree

Normal = tuple[Float[Array, ""], tuple[Float[Array, " n"], Float[Array, "n n"]]]
"""Half the sum of squares, its gradient, and J^T J."""


def tangents(material: Callable[[list[Any]], Any], fields: list[Any]) -> tuple[Any, Any]:
    """A prepared material, and its derivatives with one axis more in front: along each field, all channels of a colour at once."""
    one_hot = np.eye(len(fields), dtype=fields[0].dtype)

    def along(direction: Any) -> tuple[Any, Any]:
        return jax.jvp(material, (fields,), ([jnp.broadcast_to(d, f.shape) for d, f in zip(direction, fields, strict=True)],))

    return jax.vmap(along, out_axes=(None, 0))(one_hot)


def columns(residual: Callable[[Any], Any], prepared: Any, tangents: Any) -> Float[Array, "k c n"]:
    """Columns of the Jacobian, one a field, and the residual as the last.

    `residual` maps a prepared material to (channels, pixels); its channel c must depend on channel c of a colour only.
    """
    # Not `linearize`: half as long again to trace and to compile, and no faster to run.
    r, along = jax.vmap(lambda tangent: jax.jvp(residual, (prepared,), (tangent,)), out_axes=(None, 0))(tangents)
    return jnp.concatenate([along, r[None]])


# A function of its own to the compiler: in one loop with what makes the columns, it evaluates the model one number at a time.
@jax.jit
def products(columns: Float[Array, "k c n"]) -> Float[Array, "c k k"]:
    """Inner products of `columns` over the pixels, channel by channel and in float64; `normal_equations` reads them.

    Those of several blocks of pixels add up.
    """
    rows = jnp.swapaxes(columns, 0, 1).astype(float)
    return rows @ jnp.swapaxes(rows, 1, 2)


def dense(columns: np.ndarray, slots: tuple[tuple[int, ...], ...], size: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian (pixels, channels, parameters) and residual (pixels, channels) in float64; `slots` and `size` as for `normal_equations`."""
    *derivatives, residual = np.asarray(columns, float).swapaxes(1, 2)
    jacobian = np.zeros((*residual.shape, sum(len(at) for at in slots) if size is None else size))
    for derivative, at in zip(derivatives, slots, strict=True):
        for channel in range(residual.shape[1]) if at else ():
            jacobian[:, channel, at[channel % len(at)]] = derivative[:, channel]
    return jacobian, residual


def normal_equations(products: Float[Array, "c k k"], slots: tuple[tuple[int, ...], ...], size: int | None = None) -> Normal:
    """Half the sum of squares, its gradient and J^T J; `slots` are the places of each field's entries in the vector of parameters, of
    `size` entries: none of a field that is held. Left out, there are as many as places."""
    size = sum(len(s) for s in slots) if size is None else size
    entry = entries(slots, size, len(products))
    gram = jnp.einsum("kci,ckl,lcj->ij", entry, products[:, :-1, :-1], entry)
    gradient = jnp.einsum("kci,ck->i", entry, products[:, :-1, -1])
    return 0.5 * jnp.sum(products[:, -1, -1]), (gradient, gram)


def entries(slots: tuple[tuple[int, ...], ...], size: int, channels: int = 3) -> np.ndarray:
    """(fields, channels, size): 1 where a channel of a field is, or is part of, a parameter."""
    entry = np.zeros((len(slots), channels, size))
    for k, at in enumerate(slots):
        if at:
            entry[k, np.arange(channels), np.array(at)] = 1.0
    return entry


class _State(eqx.Module):
    first: Any
    y_eval: Any
    loss: Any
    gradient: Any
    gram: Any
    search: Any
    step_size: Any
    gain: Any
    done: Any
    result: Any


class NormalLevenbergMarquardt(optx.AbstractMinimiser):
    """Levenberg-Marquardt for a function that returns its loss and, as auxiliary output, gradient and J^T J.

    Optimistix's trust region and damped Newton descent, in coordinates scaled by the diagonal of J^T J (Marquardt 1963) so that the
    units of the parameters do not matter. Bounds, `options["lower"]` and `options["upper"]`, always hold: a parameter that would go
    beyond its own is stiffened by the distance to it (after Coleman and Li 1996), a step is clipped to them, and a parameter on its bound
    that the gradient pushes outwards sits out.
    """

    rtol: float = 1e-5
    atol: float = 1e-6
    gain: float = 1e-8
    """Part of the loss that a step has to promise to be worth taking, where `options["gain"]` says nothing else: far less than noise can
    tell apart."""
    least: float = 1e-9
    """Trust below which no step is taken."""
    landing: float = 1e-3
    """Part of its range before a bound within which a parameter that would go beyond goes there."""
    norm: Callable[[PyTree], Any] = optx.max_norm
    descent: optx.AbstractDescent = optx.DampedNewtonDescent(linear_solver=lx.Cholesky())
    search: optx.AbstractSearch = optx.ClassicalTrustRegion()

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        trust, gain = options.get("trust", 1.0), options.get("gain", self.gain)
        return begun(at_rest(self, y.size), y, np.asarray(trust, float), np.asarray(gain, float))

    def step(self, fn, y, args, options, state, tags):
        lower, upper = options["lower"], options["upper"]
        loss, (gradient, gram) = fn(state.y_eval, args)
        # A trial that is not finite is a trial that failed: the trust region shrinks.
        loss = jnp.where(jnp.isfinite(loss) & jnp.all(jnp.isfinite(gram)), loss, jnp.inf)
        before = self._info(state.loss, state.gradient, state.gram)
        trial = self._info(loss, gradient, gram)
        step_size, accept, result, search = self.search.step(state.first, y, state.y_eval, before, trial, state.search)
        moved = jnp.abs(state.y_eval - y)
        small = jnp.all(moved <= self.atol + self.rtol * jnp.abs(y))
        gained = state.loss - loss
        # A small step that gains little is the last one, and so is one that fails: float32 residuals cannot show a smaller one.
        done = ~state.first & small & (gained <= self.rtol * state.loss)
        y = jnp.where(accept, state.y_eval, y)
        loss, gradient, gram = (
            jnp.where(accept, new, old) for new, old in ((loss, state.loss), (gradient, state.gradient), (gram, state.gram))
        )
        held = ((y <= lower) & (gradient > 0.0)) | ((y >= upper) & (gradient < 0.0))
        room = jnp.where(gradient > 0.0, y - lower, upper - y)
        # What bends before a bound would never come to it.
        lands = (room < self.landing * (upper - lower)) & (jnp.abs(gradient) >= jnp.diagonal(gram) * room)
        edge = jnp.where(gradient > 0.0, lower, upper)
        step = lambda trust: self._descend(gradient, gram, held, room, trust)  # noqa: E731
        kept_in = lambda by: jnp.where(lands, edge, jnp.clip(y + by, lower, upper)) - y  # noqa: E731
        promise = lambda by: -(gradient @ by + 0.5 * by @ gram @ by)  # noqa: E731
        first = step(step_size)
        done = done | (promise(first) <= state.gain * loss) | ~jnp.isfinite(loss)
        # Cut off at the bounds, a step can lead uphill. A shorter one is nearer to the gradient, and in the end does not.
        step_size, move = lax.while_loop(
            lambda at: (promise(at[1]) <= 0.0) & (at[0] > self.least) & ~done,
            lambda at: (0.25 * at[0], kept_in(step(0.25 * at[0]))),
            (step_size, kept_in(first)),
        )
        done = done | (step_size <= self.least)
        y_eval = y + move
        search = eqx.tree_at(lambda s: s.step_size, search, step_size)
        state = _State(jnp.array(False), y_eval, loss, gradient, gram, search, step_size, state.gain, done, result)
        return y, state, (gradient, gram)

    def _info(self, loss, gradient, gram):
        operator = lx.MatrixLinearOperator(gram, lx.positive_semidefinite_tag)
        return optx.FunctionInfo.EvalGradHessian(loss, gradient, operator)

    def _descend(self, gradient, gram, held, room, step_size):
        """One damped step of the parameters that are not held, in scaled coordinates; `room` is how far each may go before its bound."""
        diagonal = jnp.diagonal(gram)
        still = held | (diagonal <= 0.0)  # a parameter with no effect has no scale of its own; it stays where it is
        # A slope ever smaller, as below a coat that hides nearly all, asks for a step ever longer. Stiffened so that it stays within its
        # room, it is known to the others; where a step would be far shorter than the room, next to nothing is added.
        needed = jnp.abs(gradient) / jnp.where(room > 0.0, room, 1.0)
        bent = jnp.where(still, 0.0, jnp.hypot(needed, diagonal) - diagonal)
        scale = jnp.where(still, 0.0, 1.0 / jnp.sqrt(jnp.where(still, 1.0, diagonal + bent)))
        scaled = (gram + jnp.diag(bent)) * scale[:, None] * scale[None, :]
        scaled = scaled + jnp.diag(jnp.where(still, 1.0, 1e-12))
        info = self._info(jnp.zeros(()), gradient * scale, scaled)
        state = self.descent.query(gradient, info, self.descent.init(gradient, info))
        step, _ = self.descent.step(step_size, state)
        return jnp.nan_to_num(step) * scale

    def terminate(self, fn, y, args, options, state, tags):
        return state.done, state.result

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        return y, aux, {}


SOLVER = NormalLevenbergMarquardt()
"""That of every fit."""

LONGEST = 64
"""Steps that are taken at once, at most."""


def descend(
    solver: NormalLevenbergMarquardt,
    evaluate: Callable[[Any, Any], tuple[Normal, Any]],
    y: Float[Array, " n"],
    state: Any,
    bounds: tuple[Any, Any],
    most: Any,
    kept: Any,
) -> tuple[Any, Any, Array, Any]:
    """At most `most` steps from `y`: the new point and state, the loss after each step (NaN where none was taken), and what was kept.

    `evaluate` maps a point, and what was kept of the one before it, to the normal equations there and what is kept of this one.
    """

    def goes_on(at: Any) -> Any:
        k, _, state, _, _ = at
        return (k < most) & ~state.done

    def step(at: Any) -> Any:
        k, y, state, losses, kept = at
        normal, kept = evaluate(state.y_eval, kept)
        options = {"lower": bounds[0], "upper": bounds[1]}
        y, state, _ = solver.step(lambda y, args: normal, y, None, options, state, frozenset())
        return k + 1, y, state, losses.at[k].set(state.loss), kept

    at = (0, y, state, jnp.full(LONGEST, jnp.nan), kept)
    return lax.while_loop(goes_on, step, at)[1:]


def begun(rest: Any, y: Any, trust: Any, gain: Any) -> Any:
    """The state before the first step from `y`, with this trust in it, and the part of the loss that each step has to promise."""
    return dataclasses.replace(
        rest, y_eval=y, step_size=trust, gain=gain, search=dataclasses.replace(rest.search, step_size=trust)
    )


@functools.cache
def at_rest(solver: NormalLevenbergMarquardt, n: int) -> _State:
    """State before the first step, of n parameters: numbers of NumPy, for nothing here is worth a compiler's time."""
    zero = np.zeros(())
    info = solver._info(zero, np.zeros(n), np.eye(n))
    search = jax.eval_shape(solver.search.init, np.zeros(n), info)
    return jax.device_put(
        _State(
            first=np.array(True),
            y_eval=np.zeros(n),
            loss=zero,
            gradient=np.zeros(n),
            gram=np.eye(n),
            search=jax.tree.map(lambda a: np.zeros(a.shape, a.dtype), search),
            step_size=zero,
            gain=np.array(solver.gain),
            done=np.array(False),
            result=optx.RESULTS.successful,
        )
    )
