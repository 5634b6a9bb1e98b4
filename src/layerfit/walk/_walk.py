"""The walk of many particles: lanes, threads and sums."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._compiled import Compiled, fusion_emitters, side_by_side
from ..layers import Coat
from ..stack import Stack
from ._material import Haze, Interface, Material, read
from ._particle import Tally, start, step

LANES = 1024  # particles in flight in one thread: their state stays in its cache, and calls cost little beside them
LONGEST = 2048  # paths of one lane: sums in float32 lose nothing yet, and lanes that are done early wait little


@dataclass(frozen=True)
class Estimate:
    """BRDF [1/sr] with its standard error, both (n, 3) float64."""

    mean: np.ndarray
    se: np.ndarray


def walk(
    stack: Stack,
    wi: Any,
    wo: Any,
    *,
    paths: int,
    seed: int = 0,
    interface: Interface = "single",
    haze: Mapping[str, Haze] | None = None,
) -> Estimate:
    """BRDF [1/sr] of the light that comes from below the top interface.

    `wi` (3,) or one for each of `wo`, (n, 3), `wo` (n, 3): unit, away from the surface, above it. `paths`: for every row of `wo`, at least.
    `haze`: scattering in the medium of coats, by their names. The light that the top interface reflects is `top_lobe`, to be added.
    """
    wo = np.asarray(wo, np.float32)
    rows = jax.tree.map(lambda x: np.asarray(x, np.float32)[None], (stack, dict(haze or {})))
    return walk_rows(
        rows[0], np.atleast_2d(np.asarray(wi, np.float32)), wo, paths=paths, seed=seed, interface=interface, haze=rows[1]
    )


def walk_rows(
    stack: Stack,
    wi: Any,
    wo: Any,
    *,
    paths: int,
    seed: int = 0,
    interface: Interface = "single",
    haze: Mapping[str, Haze] | None = None,
) -> Estimate:
    """The same for rows of materials and directions: one compilation for all materials of one structure.

    `wi` and `wo` have shape (n, 3) and numbers of the stack and of the haze (n,) or, for colours, (n, 3); n may be 1 in any of them.
    """
    material, wi, wo = jax.tree.map(
        lambda x: np.asarray(x, np.float32), (read(stack, interface, haze or {}), np.asarray(wi), np.asarray(wo))
    )
    rows = max(x.shape[0] for x in jax.tree.leaves((material, wi, wo)))
    if not (np.all(wi[:, 2] > 0.0) and np.all(wo[:, 2] > 0.0)):
        raise ValueError("wi and wo are above the surface: their z is positive")
    # Enough lanes to fill the machine, then enough paths in each to make the wait for the slowest one short.
    per_lane = int(np.clip(paths * rows // (8 * LANES), 1, LONGEST))
    lanes_per_row = -(-paths // per_lane)
    row = np.repeat(np.arange(rows), lanes_per_row)
    lane = np.arange(row.size, dtype=np.uint32)
    filled = -(-row.size // LANES) * LANES
    row, lane = (np.concatenate([x, x[:1].repeat(filled - x.size)]) for x in (row, lane))

    def arguments(first: int) -> Any:
        of = slice(first, first + LANES)
        take = lambda x: x[row[of] if x.shape[0] > 1 else np.zeros(LANES, int)]  # noqa: E731
        return *jax.tree.map(take, (material, wi, wo)), lane[of], np.uint32(seed), np.uint32(per_lane)

    def group(first: int) -> Any:
        return jax.tree.map(np.asarray, _run(*arguments(first)))

    _run.ready(*arguments(0))
    tallies = side_by_side(group, range(0, filled, LANES))
    tally = jax.tree.map(lambda *x: np.concatenate(x)[: rows * lanes_per_row].reshape(rows, -1).sum(1, dtype=float), *tallies)
    count = per_lane * lanes_per_row
    mean, square = (np.broadcast_to(np.stack(x, -1) / count, (rows, 3)) for x in (tally.sum, tally.square))
    return Estimate(mean, np.sqrt(np.maximum(square - mean * mean, 0.0) / (count - 1)))


def _walked(material: Material, wi: jax.Array, wo: jax.Array, lane: jax.Array, seed: jax.Array, paths: jax.Array) -> Tally:
    """Walk `paths` paths in every lane. Leaves (lanes,), directions (lanes, 3)."""
    light, eye = ((w[:, 0], w[:, 1], w[:, 2]) for w in (wi, wo))
    particle = start(material, eye, jnp.zeros_like(lane))
    tally = Tally(particle.radiance, particle.radiance)
    turn = jax.vmap(step, in_axes=(0, 0, 0, 0, None, None, 0, 0))

    def body(state: Any) -> Any:
        return turn(material, light, eye, lane, seed, paths, *state)

    return jax.lax.while_loop(lambda state: jnp.any(state[0].path < paths), body, (particle, tally))[1]


# Functions under `jax.jit` stay calls, whose results are computed once. Inlined, XLA makes a loop for each number of a particle, and in
# each does all again that it can do cheaply: eight times the work, most of it random numbers.
_run = Compiled(_walked, **fusion_emitters(newer=True))


def begin(stack: Stack, interface: Interface, haze: Mapping[str, Haze]) -> None:
    """Have the walk through materials of this structure compiled, while other work goes on."""
    rows = jax.tree.map(lambda x: np.asarray(x, np.float32)[None], (stack, dict(haze)))
    lanes = lambda *shape: jax.ShapeDtypeStruct((LANES, *shape), np.float32)  # noqa: E731
    material = jax.tree.map(lambda x: lanes(*np.shape(x)[1:]), read(rows[0], interface, rows[1]))
    _run.begin(material, lanes(3), lanes(3), jax.ShapeDtypeStruct((LANES,), np.uint32), np.uint32(0), np.uint32(0))


def top_lobe(stack: Stack, wi: Any, wo: Any) -> np.ndarray:
    """BRDF [1/sr] of the top interface alone, one reflection, (n, 3): `wi` (3,) or (n, 3), `wo` (n, 3)."""
    wo = jnp.asarray(wo, float)
    coat = stack.astype(wo.dtype).layers[0]
    return np.asarray(_lobes(coat, jnp.broadcast_to(jnp.asarray(wi, wo.dtype), wo.shape), wo))


def _top(coat: Coat, wi: jax.Array, wo: jax.Array) -> jax.Array:
    return jax.vmap(lambda i, o: jnp.broadcast_to(coat.evaluate(i, o), (3,)))(wi, wo)


_lobes = Compiled(_top, optimise=0)
