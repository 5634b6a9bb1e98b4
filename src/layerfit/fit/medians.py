"""Sums and medians over the pixels of each reference, traced: what weights ask of blocks of pixels."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import lax

from .weights import Columns

_LAST = np.int32(2**31 - 1)
"""Bits that stand for no number: they come after those of all others."""


class InBlocks(Columns):
    """Of values (blocks, channels, pixels): what is asked of the channel of a reference stands beside each of its values."""

    xp: Any = jnp

    def __init__(self, there: Any, of: Any, references: int):
        """`there` (blocks, channels, pixels) says where there is a pixel, `of` (blocks,) of which reference."""
        self.there, self.of = there, of
        self.mine = (of == jnp.arange(references)[:, None])[:, :, None]

    def total(self, values: Any) -> Any:
        return self._beside(self._added(jnp.where(self.there, values, 0.0).sum(-1)))

    def middle(self, values: Any) -> Any:
        return self._median(values, self.there)

    def level(self, values: Any, known: Any) -> Any:
        flat = (len(values), 1, -1)
        found = self._median(values.reshape(flat), (known & self.there).reshape(flat))
        return jnp.where(jnp.isfinite(found), found, 0.0)

    def _added(self, of_block: Any) -> Any:
        """(references, channels) from (blocks, channels)."""
        return jnp.sum(jnp.where(self.mine, of_block, jnp.zeros((), of_block.dtype)), 1, dtype=of_block.dtype)

    def _beside(self, of_reference: Any) -> Any:
        return of_reference[self.of][:, :, None]

    def _median(self, values: Any, known: Any) -> Any:
        """By bisection of the numbers' bits, which are in the order of what they stand for where none is negative: a sort takes ten times as
        long. Of an even number the mean of both in the middle; NaN of none."""
        bits = jnp.where(known, lax.bitcast_convert_type(values, np.int32), _LAST)
        count = self._added(jnp.sum(known, -1, dtype=np.int32))

        def below(limit: Any) -> Any:
            return self._added(jnp.sum(bits < self._beside(limit), -1, dtype=np.int32))

        def closer(k: Any, found: Any) -> Any:
            trial = found | (np.int32(1) << (30 - k))
            return jnp.where(below(trial) <= (count - 1) // 2, trial, found)

        lower = lax.fori_loop(0, 31, closer, jnp.zeros_like(count))
        after = jnp.min(jnp.where(bits > self._beside(lower), bits, _LAST), -1)
        upper = jnp.where(below(lower + 1) > count // 2, lower, jnp.min(jnp.where(self.mine, after, _LAST), 1))
        low, high = (lax.bitcast_convert_type(end, np.float32) for end in (lower, upper))
        return self._beside(0.5 * (low + high))
