"""The compact tier of a structure, which is made for one material at a time: some of its materials, in both precisions and as shaders.

It is for shaders alone, and no fit differentiates it: derivatives of it are not looked at.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..render import predict
from ..shader.export import print_material
from ..shader.verify import FLOOR, compare, random_pairs, shade_samples
from ..stack import Stack
from ..tiers.compact import compact, refuses
from .grid import Grid
from .measure import QUICKLY, value_error

MAX_ERROR = 1e-2
"""That polynomials are held to here: what is asked for in a shader that stands in for another."""
PAIRS = 2048


def try_compact(
    stack: Stack, tried: Grid, rows: list[int], pairs: tuple[np.ndarray, np.ndarray], shaders: bool
) -> dict[str, Any] | None:
    """What became of the materials `rows`; None where the structure has no such tier."""
    if refuses(stack):
        return None
    tiers = [compact(tried.material(stack, row), MAX_ERROR) for row in rows]
    made = [tier[0] for tier in tiers if not isinstance(tier, str)]
    values = [[_values(material, pairs, dtype)[None] for dtype in (np.float32, np.float64)] for material in made]
    return {
        "materials": len(made),
        "without": len(tiers) - len(made),
        "combinations": len(made) * len(pairs[0]),
        "not_finite": int(sum(np.sum(~np.isfinite(f)) for both in values for f in both)),
        "value_max": max((float(value_error(*both).max()) for both in values), default=0.0),
        "shader_max": max(map(_parity, made), default=0.0) if shaders else None,
    }


def _values(stack: Stack, pairs: tuple[np.ndarray, np.ndarray], dtype: Any) -> np.ndarray:
    """BRDF (d, 3)."""
    with jax.enable_x64(dtype == np.float64):
        of = jax.vmap(lambda i, o: jnp.broadcast_to(stack.astype(dtype).base.evaluate(i, o), (3,)))
        return np.asarray(jax.jit(of, compiler_options=QUICKLY)(*(jnp.asarray(w, dtype) for w in pairs)))


def _parity(stack: Stack) -> float:
    wi, wo = random_pairs(PAIRS, 0)
    samples = wi[:, None], wo, np.ones_like(wi)[:, None]
    return compare(shade_samples(print_material(stack, "stability"), *samples), predict(stack, *samples), FLOOR / np.pi).max_rel
