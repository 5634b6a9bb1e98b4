"""Fits of one structure, each whole from its start to what its sigmas are made of, in one compiled function.

`fit` goes through the same stages with Python between them, which for an image of a few thousand pixels takes most of the time. Here they are
a scan, and the fits of a group come one after the other: side by side, by `vmap`, each would wait for the slowest.

A step needs the model's derivatives at a point, and weights. The weights change from round to round where the point hardly does: so what the
model showed last is kept without them. Near the point where its derivatives were taken they serve on, and only its values are computed.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .._chunk import struct
from .._compiled import Compiled
from ..stack import Stack
from .blocks import Blocks
from .medians import InBlocks
from .parameters import Parametrisation
from .residuals import NEAR, materials, seen
from .solve import SOLVER, begun, columns, descend, entries, normal_equations, products
from .starts import FINE_STEPS
from .weights import lost, noise_law, robust, squares, weight

ROUNDS = 3
"""Reweightings: the weights follow the model's values, which follow the weights."""

STAGES = (
    (False, False, 1, 1.0),
    (False, False, FINE_STEPS, 1.0),
    *[(True, True, FINE_STEPS, NEAR)] * ROUNDS,
    (False, True, 1, NEAR),
)
"""Whether a stage weighs, and takes all blocks; its steps, and its trust in the first of them. The search has equal weights and few pixels. One
step leads nowhere: the first stage says what there is to see from the start, and the last one sees to it that what is kept is of the end."""

NEARBY = 2e-3
"""Way of a parameter, in the coordinate of the fit, on which its derivatives are taken as they were. It moves the minimum by as small a part of a
sigma: what of the residual is noise has no slope."""


@struct
class Case:
    """What a fit has for itself; in a group, with one axis more in front. b blocks of n pixels of r references."""

    start: Stack
    vector: Any
    blocks: Blocks
    """Their `inverse_sigma` is that of the first stage: 0 where there is no pixel."""
    bright: Any
    """(r, 3) `weights.brightness`."""
    parts: Any
    """(GROUPS, m) places of the pixels of each part of the image among those of all blocks; b n where a part has fewer."""
    count: Any
    """Blocks that hold pixels."""
    noise: Any = None
    """(b, 3, n) standard error of the targets; absent where no file has any."""
    scale: Any = None
    """(r, layers) as in `Residuals`."""


@struct
class Found:
    """Where a fit came to, and what `Fitted` is made of; k parameters."""

    vector: Any
    cost: Any
    gram: Any
    done: Any
    steps: Any
    effect: Any
    """(k,) what the start's first blocks say of each parameter, as a root of a sum of squares."""
    scatter: Any
    part_grams: Any
    part_gradients: Any
    alike: Any
    squares: Any
    """As `weights.unexplained` takes them."""


@struct
class _Shown:
    """What the model showed: its values at `at`, and their derivatives at `slopes_at`, on the first blocks."""

    at: Any
    slopes_at: Any
    count: Any
    columns: Any
    """(b, fields + 1, 3, n), the values last; without weights."""


@struct
class _Aim:
    """What the model is held against, (b, 3, n): targets, weights, and errors that all pixels of a reference have together."""

    target: Any
    inverse_sigma: Any
    alike: Any


class _Fit:
    """One fit, while it is traced."""

    def __init__(self, case: Case, rest: Any, free: Parametrisation, metric: str, loss: str):
        self.case, self.rest, self.free, self.metric, self.loss = case, rest, free, metric, loss
        self.references = len(case.bright)
        self.bounds = free.bounds()
        self.there = case.blocks.inverse_sigma > 0.0
        self.over = InBlocks(self.there, case.blocks.of, self.references)

    def run(self) -> Found:
        blocks, free = self.case.blocks, self.free
        shape = (len(blocks.target), len(free.part.free) + 1, *blocks.target.shape[1:])
        nowhere = jnp.full(free.size, jnp.nan)
        shown = _Shown(nowhere, nowhere, jnp.int32(0), jnp.zeros(shape, blocks.wi.dtype))
        even = _Aim(blocks.target, blocks.inverse_sigma, None if self.case.noise is None else jnp.zeros_like(blocks.target))
        stages = tuple(np.array(column) for column in zip(*STAGES, strict=True))
        (u, shown, aim), (cost, gram, done, steps) = lax.scan(self.stage, (self.case.vector, shown, even), stages)
        scatter, grams, gradients = self.parts(_weighted(shown.columns, aim))
        alike = jnp.zeros((0, free.size)) if aim.alike is None else self.pulls(shown.columns, aim)
        effect = jnp.sqrt(jnp.diagonal(gram[0]))
        end = (cost[-2], gram[-2], done[-2], jnp.sum(steps[1:-1]))
        return Found(u, *end, effect, scatter, grams, gradients, alike, self.squares(shown))

    def stage(self, at: Any, stage: Any) -> Any:
        """Weigh, and go down to where these weights lead."""
        u, shown, aim = at
        weighs, whole, most, trust = stage
        count = jnp.where(whole, self.case.count, self.references).astype(np.int32)

        def evaluate(u: Any, kept: Any) -> Any:
            shown, aim, weighs = kept
            shown = self.look(u, count, shown)
            aim = lax.cond(weighs, lambda: self.weigh(shown), lambda: aim)
            return self.normal(shown, aim, count), (shown, aim, jnp.array(False))

        at = (u, begun(self.rest, u, trust, self.rest.gain), self.bounds, most, (shown, aim, weighs))
        u, state, losses, (shown, aim, _) = descend(SOLVER, evaluate, *at)
        return (u, shown, aim), (state.loss, state.gram, state.done, jnp.sum(~jnp.isnan(losses), dtype=np.int32))

    def look(self, u: Any, count: Any, shown: _Shown) -> _Shown:
        """What the model shows at `u` on the first `count` blocks, by as much of what it showed before as holds there."""
        case, form = self.case, self.case.start.form
        wide = count <= shown.count
        same, near = wide & jnp.all(u == shown.at), wide & (jnp.max(jnp.abs(u - shown.slopes_at)) <= NEARBY)
        made = materials(u.astype(shown.columns.dtype), case.start, case.scale, self.free)

        def one(k: Any, kept: Any) -> Any:
            block = jax.tree.map(lambda a: a[k], case.blocks)
            here = made if case.scale is None else jax.tree.map(lambda a: a[block.of], made)
            values = lambda: kept[k].at[-1].set(seen(here[0], block, form=form))  # noqa: E731
            all_of_it = lambda: columns(lambda made: seen(made, block, form=form), *here)  # noqa: E731
            return lax.dynamic_update_index_in_dim(kept, lax.cond(near, values, all_of_it), k, 0)

        found = lax.fori_loop(0, jnp.where(same, 0, count), one, shown.columns)
        return _Shown(u, jnp.where(near, shown.slopes_at, u), jnp.where(same, shown.count, count), found)

    def normal(self, shown: _Shown, aim: _Aim, count: Any) -> Any:
        """Normal equations of the first `count` blocks."""
        fields = shown.columns.shape[1]

        def add(k: Any, total: Any) -> Any:
            return total + products(_weighted(shown.columns[k], jax.tree.map(lambda a: a[k], aim)))

        total = lax.fori_loop(0, count, add, jnp.zeros((3, fields, fields)))
        return normal_equations(total, self.free.slots[0], self.free.size)

    def weigh(self, shown: _Shown) -> _Aim:
        """Weights that follow the model, and targets with the light that they take from fireflies given back."""
        case, model = self.case, shown.columns[:, -1]
        law, plain = self._weight(model, self.metric)
        residual = (model - case.blocks.target) * plain
        factor = robust(residual, self.loss, self.over)
        inverse_sigma = jnp.where(self.there, plain * factor, 0.0)
        if law is None:
            return _Aim(case.blocks.target, inverse_sigma, None)
        off = lost(residual, factor, plain, law, self.over)
        return _Aim(case.blocks.target + off.mean, inverse_sigma, off.error)

    def _weight(self, model: Any, metric: str) -> tuple[Any, Any]:
        """The law of the noise where files have any, and the weights before fireflies are capped."""
        bright = self.case.bright[self.case.blocks.of][:, :, None]
        law = None if self.case.noise is None else noise_law(jnp.maximum(model, 0.0), self.case.noise, self.over)
        plain = weight(model, bright, law, metric, jnp)
        return law, jnp.broadcast_to(plain, model.shape).astype(model.dtype)

    def squares(self, shown: _Shown) -> Any:
        """What the misfit is made of: by the law, whatever the metric of the fit."""
        target, model = self.case.blocks.target, shown.columns[:, -1]
        _, plain = self._weight(model, "law")
        weights = jnp.where(self.there, plain * robust((model - target) * plain, self.loss, self.over), 0.0)
        return jnp.array(squares(model, target, self.case.noise, weights, jnp))

    def parts(self, rows: Any) -> tuple[Any, Any, Any]:
        """Products of the pixels' gradients added up, and J^T J and gradient of each part of the image, from weighted columns."""
        b, fields, channels, n = rows.shape
        flat = rows.transpose(1, 2, 0, 3).reshape(fields, channels, b * n)
        flat = jnp.pad(flat, ((0, 0), (0, 0), (0, 1)))[:, :, self.case.parts].astype(float)
        by_part = flat.transpose(2, 1, 0, 3)
        entry = entries(self.free.slots[0], self.free.size)
        sums = jax.vmap(lambda rows: normal_equations(rows, self.free.slots[0], self.free.size)[1])
        gradients, grams = sums(by_part @ by_part.swapaxes(-1, -2))
        each = jnp.einsum("kci,gckm->gim", entry, by_part[:, :, :-1] * by_part[:, :, -1:])
        return jnp.einsum("gim,gjm->ij", each, each), grams, gradients

    def pulls(self, shown: Any, aim: _Aim) -> Any:
        """(r * 3, k) gradients of the errors that all pixels of a channel of a reference have together."""
        rows = (shown[:, :-1] * (aim.inverse_sigma**2 * aim.alike)[:, None]).astype(float).sum(-1)
        mine = (self.case.blocks.of == jnp.arange(self.references)[:, None]).astype(float)
        pulls = jnp.einsum("rb,bkc,kci->rci", mine, rows, entries(self.free.slots[0], self.free.size))
        return pulls.reshape(-1, self.free.size)


def _weighted(columns: Any, aim: _Aim) -> Any:
    """Derivatives and residual, weighted; (..., fields + 1, channels, pixels)."""
    return columns.at[..., -1, :, :].add(-aim.target) * aim.inverse_sigma[..., None, :, :]


def _fit_group(cases: Case, count: Any, rest: Any, *, free: Parametrisation, metric: str, loss: str) -> Found:
    """The first `count` of a group of cases, one after the other: `lax.map`, but that not every place of the group need hold one."""

    def one(k: Any) -> Found:
        return _Fit(jax.tree.map(lambda a: a[k], cases), rest, free, metric, loss).run()

    size = len(cases.count)
    found = jax.tree.map(lambda a: jnp.zeros((size, *a.shape), a.dtype), jax.eval_shape(one, 0))
    return lax.fori_loop(0, count, lambda k, found: jax.tree.map(lambda all, a: all.at[k].set(a), found, one(k)), found)


fit_group = Compiled(_fit_group)
