"""Fits of texels, batch by batch: equal batches for one executable, and no texel waits for the slowest."""

import dataclasses
from collections import deque
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from ..fit.parameters import Parametrisation
from ..fit.residuals import initial
from ..fit.starts import space_filling
from ..fit.weights import FLOOR_SHARE, MODEL_SHARE, NOISE_EXPONENT, robust
from ..stack import Stack
from . import model
from .model import Seen
from .texels import Texels

IN_CACHE = 8192
"""Evaluations of the model in a batch: as many as stay in a processor's cache with what is made of them."""

AT_ONCE = 6
"""Steps that a batch takes before the texels that are done leave it."""

MOST_STEPS = 60
ROUNDS = 2
"""Weightings by the model's values, after a first one that needs none."""

AHEAD = 3
"""Batches that are begun before the first is waited for."""


@dataclasses.dataclass
class Found:
    """Where texels came to, a row each; vectors in the coordinates of the fit."""

    u: np.ndarray
    gram: np.ndarray
    gradient: np.ndarray
    cost: np.ndarray
    """Half the sum of squares of weighted residuals."""
    done: np.ndarray
    """Whether it converged."""

    def some(self, which: Any) -> "Found":
        return Found(*(getattr(self, f.name)[which] for f in dataclasses.fields(self)))

    @staticmethod
    def together(parts: "list[Found]") -> "Found":
        return Found(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in dataclasses.fields(Found)))


class Descent:
    """Ways down in texels, from one start or several."""

    def __init__(self, texels: Texels, start: Stack, free: Parametrisation, loss: str, starts: int, seed: int) -> None:
        self.texels, self.free, self.loss = texels, free, loss
        self.start = jax.tree.map(lambda a: np.asarray(a, np.float32), start)
        self.points = [free.pack(start), *space_filling(free, starts - 1, seed)]
        self.bounds = free.bounds()
        self.tilted = any(f.layer is None for f in free.free)
        observations = texels.rows.shape[1] * texels.wi.shape[1]
        most = min(max(IN_CACHE // observations, 8), len(texels.index))
        self.batch = 2 ** max(int(most).bit_length() - 1, 3)

    def solve(self, which: np.ndarray) -> tuple[Found, Seen]:
        """Fit the texels of these numbers; and their observations, with the last weights."""
        seen = self.seen(which)
        u = self._begun(len(which), seen)
        found = self._descend(u, seen)
        for _ in range(ROUNDS):
            seen = self.weighed(found.u, seen, which)
            found = self._descend(found.u, seen)
        return found, seen

    def seen(self, which: np.ndarray) -> Seen:
        """Observations of texels, weighted by the brightness of their references: before there is a model."""
        texels = self.texels
        rows = texels.rows[which]
        there = (rows >= 0)[:, None]
        wi, weight = texels.wi[rows], texels.weight[rows]
        if self.tilted:
            weight = weight / np.maximum(wi[..., 2:], 1e-6)
        even = there / texels.bright[texels.of[rows]].transpose(0, 2, 1)
        return Seen(
            wi, texels.wo[rows], weight.transpose(0, 3, 1, 2), texels.target[rows].transpose(0, 2, 1), even.astype(np.float32)
        )

    def weighed(self, u: np.ndarray, seen: Seen, which: np.ndarray) -> Seen:
        """The same weighted by the law of `fit.weights`, at the model's values, and against outliers."""
        rows = self.texels.rows[which]
        of = self.texels.of[rows]
        bright, noise = self.texels.bright[of].transpose(0, 2, 1), self.texels.noise[of][:, None]
        values = self.values(u, seen)
        light = np.maximum(values, 0.0)
        variance = (MODEL_SHARE * light) ** 2 + (FLOOR_SHARE * bright) ** 2 + (noise * light**NOISE_EXPONENT) ** 2
        weight = (rows >= 0)[:, None] / np.sqrt(variance)
        residual = (values - seen.target) * weight
        # Observations of one texel and channel are what its others are judged by.
        flat = np.moveaxis(residual, -1, 0).reshape(residual.shape[-1], -1)
        factor = np.moveaxis(robust(flat, self.loss).reshape(-1, *residual.shape[:2]), 0, -1)
        return dataclasses.replace(seen, inverse_sigma=(weight * factor).astype(np.float32))

    def values(self, u: np.ndarray, seen: Seen, free: Parametrisation | None = None) -> np.ndarray:
        """Models (texels, 3, K); `free` are other parameters than those that are fitted."""
        free = free or self.free
        made = self._batches(len(u), lambda at: model.values(u[at], _rows(seen, at), self.start, free=free))
        return np.concatenate([np.asarray(rows)[: len(at)] for at, rows in made])

    def at(self, u: np.ndarray, seen: Seen) -> Found:
        """What texels are where they stand: a step leads nowhere, but is evaluated."""
        return dataclasses.replace(self._descend(u, seen, most=1), u=u)

    def pinned(self, u: np.ndarray, seen: Seen, slot: int, most: int) -> Found:
        """Where the others go while one parameter of each texel stays where it is."""
        lower, upper = (np.broadcast_to(end, u.shape).copy() for end in self.bounds)
        lower[:, slot] = upper[:, slot] = u[:, slot]
        return self._descend(u, seen, most, (lower, upper))

    def _begun(self, count: int, seen: Seen) -> np.ndarray:
        """The best of the starts for each texel."""
        first = np.broadcast_to(self.points[0], (count, len(self.points[0])))
        if len(self.points) == 1:
            return first.copy()
        costs = [self._cost(np.broadcast_to(point, first.shape), seen) for point in self.points]
        return np.array(self.points)[np.argmin(np.nan_to_num(costs, nan=np.inf), 0)]

    def _cost(self, u: np.ndarray, seen: Seen) -> np.ndarray:
        return np.sum(((self.values(u, seen) - seen.target) * seen.inverse_sigma) ** 2, (1, 2))

    def _descend(self, u: np.ndarray, seen: Seen, most: int = MOST_STEPS, bounds: Any = None) -> Found:
        """Follow every texel to its end, or for so many steps; the batches are dealt anew among those that are not done."""
        u = np.array(u, float)
        lower, upper = (np.broadcast_to(end, u.shape) for end in self.bounds) if bounds is None else bounds
        rest = initial(u[0])
        leaves = [np.repeat(np.asarray(a)[None], len(u), 0) for a in jax.tree.leaves(dataclasses.replace(rest, y_eval=u[0]))]
        structure = jax.tree.structure(rest)
        state = jax.tree.unflatten(structure, leaves)
        state = dataclasses.replace(state, y_eval=u.copy())
        left, taken = np.arange(len(u)), 0
        while left.size and taken < most:
            some = min(AT_ONCE, most - taken)

            def begin(at: np.ndarray, left: np.ndarray = left, state: Any = state, some: int = some) -> Any:
                here = left[at]
                args = (u[here], _rows(state, here), (lower[here], upper[here]), _rows(seen, here), self.start, np.int32(some))
                return model.steps(*args, free=self.free)

            for at, (moved, after) in self._batches(len(left), begin):
                here = left[at]
                u[here] = np.asarray(moved)[: len(here)]
                for kept, new in zip(jax.tree.leaves(state), after, strict=True):
                    kept[here] = np.asarray(new)[: len(here)]
            taken += some
            left = left[~state.done[left]]
        return Found(u, state.gram, state.gradient, state.loss, state.done & np.isfinite(state.loss))

    def _batches(self, count: int, begin: Any) -> Iterator[tuple[np.ndarray, Any]]:
        """What `begin` gives for the texels of each batch, the last one filled up; a few are begun ahead."""
        begun: deque[tuple[np.ndarray, Any]] = deque()
        for start in range(0, count, self.batch):
            at = np.arange(start, min(start + self.batch, count))
            begun.append((at, begin(np.pad(at, (0, self.batch - len(at)), "edge"))))
            if len(begun) > AHEAD:
                yield begun.popleft()
        yield from begun


def _rows(tree: Any, at: np.ndarray) -> Any:
    return jax.tree.map(lambda a: a[at], tree)
