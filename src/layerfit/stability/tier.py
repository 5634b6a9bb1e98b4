"""The tiers that are made for one material at a time, `compact` and `tables`: some materials of a structure, in both precisions and as shaders.

They are for shaders, and no fit differentiates their numbers, which are constants: derivatives are along turns of the directions.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..forms.faithful import Faithful
from ..render import predict
from ..shader.export import print_material
from ..shader.verify import FLOOR, compare, random_pairs, random_places, shade_samples
from ..stack import Stack
from ..tiers.compact import compact, tables
from .grid import Grid
from .measure import QUICKLY, turn, value_error

MAX_ERROR = 1e-2
"""That polynomials are held to here: what is asked for in a shader that stands in for another."""
PAIRS = 2048

Made = tuple[Stack, float] | str
TIERS: dict[str, Callable[[Stack], Made]] = {
    "compact": lambda stack: compact(stack, MAX_ERROR),
    "tables": lambda stack: tables(stack) if isinstance(stack.form, Faithful) else "they are of the faithful form",
}


def try_tier(
    name: str, stack: Stack, tried: Grid, rows: list[int], pairs: tuple[np.ndarray, np.ndarray], shaders: bool
) -> dict[str, Any] | None:
    """What became of the materials `rows` in a tier; None where none of them has it."""
    found = [TIERS[name](tried.material(stack, row)) for row in rows]
    made = [tier[0] for tier in found if not isinstance(tier, str)]
    if not made:
        return None
    values = [[_values(material, pairs, dtype) for dtype in (np.float32, np.float64)] for material in made]
    drawn = [_drawn(material) for material in made] if shaders else []
    lost = sum(np.sum(~np.isfinite(part)) for both in values for found in both for part in found)
    return {
        "materials": len(made),
        "without": len(found) - len(made),
        "combinations": len(made) * len(pairs[0]),
        "not_finite": int(lost) + sum(lost for lost, _ in drawn),
        "value_max": max(float(value_error(single[0][None], double[0][None]).max()) for single, double in values),
        "shader_max": max(error for _, error in drawn) if shaders else None,
    }


def _values(stack: Stack, pairs: tuple[np.ndarray, np.ndarray], dtype: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """BRDF (d, 3), and its derivatives along a turn of either direction."""
    with jax.enable_x64(dtype == np.float64):
        material = stack.astype(dtype)
        of = jax.vmap(lambda i, o: jnp.broadcast_to(material.base.evaluate(i, o), (3,)))
        wi, wo = (jnp.asarray(w, dtype) for w in pairs)

        def both(wi: Any, wo: Any) -> Any:
            f, along_i = jax.jvp(lambda w: of(w, wo), (wi,), (turn(wi),))
            return f, along_i, jax.jvp(lambda w: of(wi, w), (wo,), (turn(wo),))[1]

        f, along_i, along_o = jax.jit(both, compiler_options=QUICKLY)(wi, wo)
        return np.asarray(f), np.asarray(along_i), np.asarray(along_o)


def _drawn(stack: Stack) -> tuple[int, float]:
    """How many numbers of its shader are not finite, and the largest error against JAX."""
    wi, wo = random_pairs(PAIRS, 0)
    samples = wi[:, None], wo, np.ones_like(wi)[:, None], random_places(PAIRS, 0) if stack.reads else None
    values = shade_samples(print_material(stack, "stability"), *samples)
    return int(np.sum(~np.isfinite(values))), compare(values, predict(stack, *samples), FLOOR / np.pi).max_rel
