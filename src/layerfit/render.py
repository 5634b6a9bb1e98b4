"""Linear radiance of a material at samples: the sum over light samples of BRDF times weight."""

from functools import partial, reduce
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ._compiled import Compiled, side_by_side
from ._place import Place, narrowed
from .stack import Stack, at, evaluate, prepared


def radiance(
    stack: Stack,
    wi: Float[Array, "n s 3"],
    wo: Float[Array, "n 3"],
    weight: Float[Array, "n s 3"],
    place: Place | None = None,
) -> Float[Array, "n 3"]:
    """Linear radiance (n, 3) of n pixels with s light samples each; traced, for JAX to differentiate or compile.

    `wi` (n, s, 3) and `wo` (n, 3) are unit directions in the surface frame of each pixel; `weight` (n, s, 3) is what each light
    sample brings per unit of BRDF: irradiance times cosine for a distant light. `place` holds (n, 2) texture coordinates and (n,)
    distances, for materials that read them.
    """
    return channels(stack, wi, wo, jnp.moveaxis(weight, -1, 0), place).T


def channels(
    stack: Stack,
    wi: Float[Array, "n s 3"],
    wo: Float[Array, "n 3"],
    weight: Float[Array, "3 n s"],
    place: Place | None = None,
) -> Float[Array, "3 n"]:
    """`radiance` with the channels first, in and out."""
    return shade(stack.prepare(), wi, wo, weight, place, form=stack.form)


def shade(prepared: Any, wi: Any, wo: Any, weight: Any, place: Any = None, *, form: Any) -> Float[Array, "3 n"]:
    """`channels` of a prepared material.

    No channel depends on another: what they share is computed once, and the loops of the compiled code run over pixels.
    """
    if getattr(prepared, "of_curves", False):  # they hold the channels together
        return jax.vmap(lambda *pixel: _pixel(form, prepared, *pixel), out_axes=1)(wi, wo, jnp.moveaxis(weight, 0, -1), place)
    colours = jax.tree.map(lambda value: 0 if jnp.shape(value) == (3,) else None, prepared)

    def channel(prepared: Any, weight: Any) -> Any:
        return jax.vmap(lambda *pixel: _pixel(form, prepared, *pixel))(wi, wo, weight, place)

    return jax.vmap(channel, in_axes=(colours, 0))(prepared, weight)


# A unit of its own for the tracer: a fit differentiates it once a parameter, from one trace.
@partial(jax.jit, static_argnames="form")
def _pixel(form: Any, prepared: Any, wi: Any, wo: Any, weight: Any, place: Any) -> Any:
    prepared = at(prepared, place)
    if wi.shape[0] == 1:  # one light needs no axis: the compiler would carry it through every intermediate value
        return evaluate(form, prepared, wi[0], wo) * weight[0]
    return jnp.sum(jax.vmap(lambda w: evaluate(form, prepared, w, wo))(wi) * weight, 0)


_shaded = Compiled(shade)
_SAMPLES, _MOST = 32768, 16384
"""Light samples and pixels of a block, at most."""
_LIGHTS = 512
"""Light samples that are summed at once: the quadratures of a fit and of its pictures then share one executable."""


def block_size(lights: int, samples: int, most: int) -> int:
    """Pixels, of so many light samples each, that are computed at a time: as many as stay in a processor's cache, and take longer than to be
    handed over."""
    return min(most, max(32, 2 ** ((samples // lights).bit_length() - 1)))


def predict(stack: Stack, wi: np.ndarray, wo: np.ndarray, weight: np.ndarray, place: Place | None = None) -> np.ndarray:
    """Linear radiance (n, 3) of any number of pixels, computed in float32 and block by block.

    `wi` and `weight` are (n, s, 3) for s light samples a pixel, channels last, and `wo` is (n, 3). `place` holds (n, 2) texture
    coordinates and (n,) distances, for materials that read them; without it they are drawn as they are in the mean. Materials of the
    same structure share one executable for each s up to 512, and beyond it for equal parts of s.
    """
    pieces, each, size = _shares(wi.shape[1])
    if missing := pieces * each - wi.shape[1]:
        wi = np.pad(wi, ((0, 0), (0, missing), (0, 0)), "edge")
        weight = np.pad(weight, ((0, 0), (0, missing), (0, 0)))
    stack = jax.tree.map(
        lambda a: np.asarray(a, np.float32), stack
    )  # not `astype`: on its way to JAX it need not go there twice
    place = narrowed(place, stack.reads)
    out = np.empty((len(wo), 3), np.float32)
    with jax.enable_x64(False):
        made = prepared(stack)
        shaded = _shaded.ready(made, *_shapes(size, each, place), form=stack.form)
    made = jax.tree.leaves(made)

    def block(start: int) -> None:
        to_light, to_eye, bright = (_padded(a[start : start + size], size) for a in (wi, wo, weight))
        bright = np.ascontiguousarray(np.moveaxis(bright, -1, 0))
        there = [_padded(a[start : start + size], size) for a in jax.tree.leaves(place)]
        lights = [slice(light, light + each) for light in range(0, pieces * each, each)]
        parts = [shaded(*made, to_light[:, some], to_eye, bright[:, :, some], *there) for some in lights]
        out[start : start + size] = reduce(np.add, map(np.asarray, parts)).T[: len(wo) - start]

    side_by_side(block, range(0, len(wo), size))
    return out


def brdf_values(stack: Stack, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """BRDF (n, 3) [1/sr] of pairs of directions (n, 3), by what `predict` has compiled for one light."""
    return predict(stack, wi[:, None], wo, np.ones((len(wi), 1, 3), np.float32))


def begin(stack: Stack, lights: int, place: Place | None = None) -> None:
    """Have what `predict` needs for pixels of so many light samples compiled, while other work goes on."""
    _, each, size = _shares(lights)
    stack = stack.astype(np.float32)
    with jax.enable_x64(False):
        made = prepared.begin(stack)
        _shaded.begin(made, *_shapes(size, each, narrowed(place, stack.reads)), form=stack.form)


def _shapes(size: int, lights: int, place: Place | None) -> tuple[Any, ...]:
    """What a block of pixels is computed from beside the material: directions, weights, and places like these."""
    array = lambda *shape: jax.ShapeDtypeStruct(shape, np.float32)  # noqa: E731
    there = jax.tree.map(lambda a: array(size, *a.shape[1:]), place)
    return array(size, lights, 3), array(size, 3), array(3, size, lights), there


def _shares(lights: int) -> tuple[int, int, int]:
    """Equal parts of the light samples, samples in each, and pixels of a block."""
    pieces = -(-lights // _LIGHTS)
    each = -(-lights // pieces)
    return pieces, each, block_size(each, _SAMPLES, _MOST)


def _padded(a: np.ndarray, size: int) -> np.ndarray:
    """Rows of float32, the last one repeated where there are too few."""
    a = a.astype(np.float32, copy=False)
    return a if len(a) == size else np.concatenate([a, np.repeat(a[-1:], size - len(a), 0)])


def brdf(
    stack: Stack,
    wi: Float[Array | np.ndarray, "n 3"],
    wo: Float[Array | np.ndarray, "n 3"],
    place: Place | None = None,
) -> Float[Array, "n 3"]:
    """BRDF (n, 3) [1/sr] of pairs of unit directions in the surface frame, `wi` (n, 3) and `wo` (n, 3); without the cosine.

    `place` holds (n, 2) texture coordinates and (n,) distances, for materials that read them.
    """
    dtype = jnp.result_type(jnp.float32, wi, wo)
    there = jax.tree.map(lambda a: jnp.asarray(a, dtype), narrowed(place, stack.reads))
    arguments = stack.astype(dtype), jnp.asarray(wi, dtype), jnp.asarray(wo, dtype), there
    # Operation by operation, a first call takes ten times as long.
    traced = any(isinstance(a, Tracer) for a in jax.tree.leaves(arguments))
    return (_brdf if traced else _compiled_brdf)(*arguments)


def _brdf(stack: Stack, wi: Any, wo: Any, place: Any) -> Any:
    prepared = stack.prepare()

    def one(i: Any, o: Any, there: Any) -> Any:
        return jnp.broadcast_to(evaluate(stack.form, at(prepared, there), i, o), (3,))

    return jax.vmap(one)(wi, wo, place)


# Compiled in half the time, and runs half as fast: it is mostly called once.
_compiled_brdf = Compiled(_brdf, optimise=0)
