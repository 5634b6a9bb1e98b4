"""What one rough interface does to light, apart from all else."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..forms.corrected import Corrected
from ..layers import Coat
from ..stack import Stack
from ..surfaces import Lambert
from ._events import at_facets
from ._facets import Direction, opposite, where
from ._material import Interface, Material, read
from ._random import even_uniforms, uniforms


@dataclass(frozen=True)
class Scattered:
    """Light of unit energy after one interface, as `count` samples of equal share.

    `d` (count, 3): unit directions of travel in the surface frame; `through` (count,): whether it is now on the other side of the
    interface; `energy` (count,): what is left of each sample, 1 or, in the `single` model, less. Mean energies have an error of
    less than count**-0.5 / 2: the first facet's samples are evenly spread (Roberts 2018), later ones are random.
    """

    d: np.ndarray
    through: np.ndarray
    energy: np.ndarray


def scatter(
    coat: Coat, wi: Any, *, count: int, seed: int = 0, interface: Interface = "single", below: bool = False
) -> Scattered:
    """Send light against the interface of a coat.

    `wi` (3,): where it comes from, unit, z > 0: above the interface or, if `below`, from the medium and seen in the frame of that
    side, whose z points down into it. `coat.eta` is the index of the coat over that of the medium above it.
    """
    material = jax.tree.map(lambda x: np.asarray(x, np.float32), read(_alone(coat), interface, {}))
    w = tuple(np.asarray(wi, np.float32))
    d, through, energy = jax.tree.map(
        np.asarray, _send(material, w, np.arange(count, dtype=np.uint32), np.uint32(seed), np.bool_(not below))
    )
    z = np.where(through == below, d[2], -d[2])
    return Scattered(np.stack([d[0], d[1], z], -1), through, energy)


def _alone(coat: Coat) -> Stack:
    bare = Coat(**{name: getattr(coat, name) for name in ("alpha", "alpha_x", "alpha_y", "eta", "distribution", "masking")})
    return jax.tree.map(lambda x: np.asarray(x, np.float32)[None], Stack((bare,), Lambert(albedo=0.0), Corrected()))


@jax.jit
def _send(material: Material, w: Direction, lane: jax.Array, seed: jax.Array, above: jax.Array) -> Any:
    material = jax.tree.map(lambda x: x[0], material)
    multi = material.interface == "multi"

    def once(index: jax.Array, turn: jax.Array, state: Any) -> Any:
        w, side, c, done, last = state
        u = where(turn == 0, even_uniforms(index, seed), uniforms(index, turn, turn, seed))
        up = (0.0 * w[2], 0.0 * w[2], jnp.ones_like(w[2]))
        event = at_facets(material, jnp.int32(0), side, jnp.bool_(False), w, c, up, u)
        now = event.d, side ^ event.through, event.weight[0]
        following = opposite(event.d), now[1], event.c, done | event.leaves, where(done, last, now)
        return following

    one = jnp.ones(lane.shape, jnp.float32)
    start = tuple(x * one for x in w), above & (one > 0), one if multi else None
    state = (*start, one < 0, (start[0], start[1], one))
    turn = jax.vmap(once, in_axes=(0, None, 0))

    def body(carry: Any) -> Any:
        k, state = carry
        return k + jnp.uint32(1), turn(lane, k, state)

    end = jax.lax.while_loop(lambda carry: ~jnp.all(carry[1][3]), body, (jnp.uint32(0), state))[1][4]
    return end[0], end[1] ^ above, end[2]
