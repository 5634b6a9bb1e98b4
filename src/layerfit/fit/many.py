"""Many fits: those that take the ordinary way in groups of one structure, each group by one compiled function (see `together`).

The ordinary way is one start, light of which one sample is all that there is, differences taken as they are, and nothing that a reference has for
itself; a fit that then comes to a parameter without effect, to a coat that may hide its base, or to no end, leaves it. Those are for `fit`.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ..capture.load import AnyView
from ..capture.samples import View
from ..capture.scene import AMBIENT
from ..stack import Stack
from .asked import Asked, what_is_asked
from .blocks import Blocks, Layout, arrange, channels_first, power_of_two
from .difference import CURVED
from .pixels import chosen, directions, scales, sectors
from .problem import lights_of, told_apart
from .profile import deep
from .residuals import scaled
from .result import Fitted
from .solve import SOLVER, at_rest
from .starts import Minimum
from .together import Case, Found, fit_group
from .uncertainty import GROUPS, Sums, spread
from .weights import brightness, unexplained

GROUP = 16
"""Fits that are handed to the compiled function at a time."""

BLOCK = 512
"""Pixels of a block: the search takes one of each reference. Half as many as in `fit`, where several starts have to be told apart."""

LEAST = 4
"""Blocks that there is room for at least; beyond, a power of two."""


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A fit that may take the ordinary way, ready to be handed over."""

    case: Case
    asked: Asked
    metric: str
    loss: str

    @functools.cached_property
    def kind(self) -> Any:
        """What fits have in common that go together."""
        leaves, structure = jax.tree.flatten(self.case)
        return structure, tuple((np.shape(a), np.result_type(a)) for a in leaves), self.asked.free, self.metric, self.loss


def candidate(
    views: Sequence[AnyView],
    start: Stack,
    *,
    free: Sequence[str] | None = None,
    also: Sequence[str] = (),
    each: Sequence[str] = (),
    fixed: Mapping[str, Any] | None = None,
    metric: str = "law",
    loss: str = "square",
    starts: int = 1,
    seed: int = 0,
    where: str = "fit",
) -> Candidate | None:
    """A fit as `layerfit.fit` takes it, without the form's error; None for one that is not of the ordinary kind.

    Raises `InputError` for what cannot be fitted.
    """
    exact = [view for view in views if isinstance(view, View) and view.exact]
    if starts > 1 or metric in CURVED or len(exact) < len(views) or len({view.noise is None for view in exact}) > 1:
        return None
    asked = what_is_asked(views, start, free, also, each, fixed or {}, where)
    if asked.free.apart or AMBIENT in lights_of(asked.free):
        return None
    return Candidate(_case(exact, asked, seed), asked, metric, loss)


def _case(views: Sequence[View], asked: Asked, seed: int) -> Case:
    there = _Geometry(tuple(views), seed, asked.start.needs, asked.free)
    blocks, layout, parts, picked = _arranged(there)
    targets = [view.target[which].astype(np.float32) for view, which in zip(views, picked, strict=True)]
    bright = np.array([brightness(target) for target in targets], np.float32)
    target = _padded(channels_first(layout.scatter(targets, 0.0)), len(blocks.of))
    even = np.where(blocks.inverse_sigma > 0.0, 1.0 / bright[blocks.of][:, :, None], 0.0).astype(np.float32)
    scale = scales(views, asked.start)
    noise = [view.noise[which].astype(np.float32) for view, which in zip(views, picked, strict=True) if view.noise is not None]
    return Case(
        start=jax.tree.map(lambda a: np.asarray(a, np.float32), asked.start),
        vector=asked.free.pack(asked.start),
        blocks=dataclasses.replace(blocks, target=target, inverse_sigma=even),
        bright=bright,
        parts=parts,
        count=np.int32(len(layout.pixel)),
        noise=_padded(channels_first(layout.scatter(noise, 0.0)), len(blocks.of)) if noise else None,
        scale=None if scale is None else scale.astype(np.float32),
    )


class _Geometry:
    """What the blocks of a fit depend on, but for what its images show. Images of one geometry share the arrays of their pixels: it is
    known by them."""

    def __init__(self, views: tuple[View, ...], seed: int, needs: tuple[str, ...], free: Any):
        self.views, self.seed, self.needs, self.free = views, seed, needs, free
        arrays = [id(a) for v in views for a in (v.index, v.position, v.normal, v.tangent, v.uv, v.view)]
        known = [(view.reference.camera, view.reference.lights) for view in views]
        self.key = (*arrays, *known, seed, needs, free)

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Geometry) and self.key == other.key


@functools.lru_cache(maxsize=4)
def _arranged(there: _Geometry) -> tuple[Blocks, Layout, np.ndarray, list[np.ndarray]]:
    """The blocks without targets, `inverse_sigma` 1 where there is a pixel; where each pixel is; the parts of the image, as in `Case`; and which
    pixels of each view are used."""
    views, seed = there.views, there.seed
    picked = [chosen(view, len(views), seed) for view in views]
    samples = [view.samples(which, directions(view), seed) for view, which in zip(views, picked, strict=True)]
    blocks, layout = arrange(samples, seed, there.needs, told_apart(there.free, samples), BLOCK)
    room = power_of_two(len(layout.pixel), LEAST)
    blocks = jax.tree.map(lambda a: np.asarray(a)[:room], blocks)
    is_pixel = _padded(np.broadcast_to((layout.pixel >= 0)[:, None], (len(layout.pixel), *blocks.target.shape[1:])), room)
    part = layout.scatter([sectors(each, GROUPS) for each in samples], -1.0).ravel()
    parts = np.full((GROUPS, -(-room * layout.pixel.shape[1] // GROUPS) + len(views)), room * layout.pixel.shape[1], np.int32)
    for row, k in zip(parts, range(GROUPS), strict=True):
        members = np.flatnonzero(part == k)
        row[: len(members)] = members
    return dataclasses.replace(blocks, inverse_sigma=is_pixel.astype(np.float32)), layout, parts, picked


def _padded(values: np.ndarray, room: int) -> np.ndarray:
    return np.pad(values, [(0, room - len(values))] + [(0, 0)] * (values.ndim - 1))


def begin(candidates: Sequence[Candidate]) -> Callable[[], list[Fitted | None]]:
    """Begin up to `GROUP` fits of one kind. What is returned waits for them; a fit that has left the ordinary way is None."""
    first = candidates[0]
    filled = [c.case for c in candidates] + [first.case] * (GROUP - len(candidates))
    with jax.enable_x64(True):
        cases = jax.tree.map(lambda *each: np.stack(each), *filled)
        rest = at_rest(SOLVER, first.asked.free.size)
        count = np.int32(len(candidates))
        found = fit_group(cases, count, rest, free=first.asked.free, metric=first.metric, loss=first.loss)

    def ended() -> list[Fitted | None]:
        arrays = jax.tree.map(np.asarray, found)
        return [_fitted(c, jax.tree.map(lambda a, k=k: a[k], arrays)) for k, c in enumerate(candidates)]

    return ended


def _fitted(candidate: Candidate, found: Found) -> Fitted | None:
    case, asked = candidate.case, candidate.asked
    if not (found.done and np.isfinite(found.cost) and np.all(found.effect > 1e-7 * np.max(found.effect))):
        return None
    residuals = int(np.sum(case.blocks.inverse_sigma > 0.0))
    parts = (found.scatter, found.part_grams, found.part_gradients, found.alike)
    uncertainty = spread(Sums(found.gram, *parts, residuals))
    vector = found.vector
    stack = asked.free.put(case.start, asked.free.fields(vector), np)
    stack = jax.tree.map(lambda a: np.asarray(a, np.float32), stack)
    materials = [stack] if case.scale is None else [scaled(stack, scale) for scale in case.scale]
    if deep(asked.free.free, materials, uncertainty.sigma):
        return None
    return Fitted(
        stack=stack,
        free=asked.free,
        vector=vector,
        start_vector=case.vector,
        gram=found.gram,
        uncertainty=uncertainty,
        discrepancy=None,
        held=asked.held,
        converged=True,
        cost=float(found.cost),
        steps=int(found.steps),
        minima=[Minimum((0,), vector, float(found.cost), found.gram, ended=True)],
        notes=[],
        misfit=unexplained(*found.squares),
        profiles=[],
        hidden=[],
    )
