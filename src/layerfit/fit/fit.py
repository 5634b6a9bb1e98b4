"""The fit: from a scene to a material with its uncertainties."""

import dataclasses
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

from .. import render
from .._compiled import CLOCK
from .._place import narrowed
from ..capture.load import AnyView
from ..capture.samples import QUADRATURE, Samples
from ..capture.scene import METRICS
from ..documents import nearest
from ..errors import InputError
from ..stack import Stack
from . import discrepancy
from .blocks import Block, arrange, channels_first
from .difference import Curve, compared, curve, slope
from .parameters import Parametrisation, parametrise, with_fixed
from .residuals import NEAR, begin, depths, initial, rows, scaled, step
from .result import FitResult, Held, Minimum, Row
from .solve import NormalLevenbergMarquardt
from .uncertainty import GROUPS, estimate
from .weights import brightness, inverse_sigma, misfit, robust

PIXELS = 65536
"""Pixels that a fit uses at most, all references together: more of them do not change the answer by what it can be wrong by."""

EVALUATIONS = 250_000
"""BRDF evaluations that a step may take where light is a quadrature: it decides how many pixels are used."""

DIRECTIONS = QUADRATURE // 2
"""Light samples a pixel of a quadrature: its error is drawn anew for each pixel, so that few hundred of them average it out."""

COARSE_BLOCKS = 2
"""Blocks of pixels for the search, and at least one of each reference: enough to tell minima apart."""

COARSE_STEPS = 12
FINE_STEPS = 60
ROUNDS = 3
"""Reweightings: the weights follow the model's values, which follow the weights."""


def fit(
    views: Sequence[AnyView],
    start: Stack,
    *,
    free: Sequence[str] | None = None,
    fixed: dict[str, Any] | None = None,
    metric: str = "law",
    loss: str = "square",
    starts: int = 8,
    seed: int = 0,
    model_error: bool = False,
    where: str = "fit",
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> FitResult:
    """Fit the free parameters of `start` to the references.

    `free` are names such as "coat.alpha" (left out: what an image can tell), `fixed` are values by name. `metric` is "law", "uniform",
    "relative", "log" or "cube_root" (see `difference`), `loss` "square", "huber" or "cauchy". `starts` space-filling starts are tried beside
    the given one, all coarsely on few pixels, the best of them to the end. With `model_error` sigmas hold what the form of the model gets
    wrong, too: a random walk tells it, at the fitted material (see `discrepancy`). Raises `InputError` for what cannot be fitted.
    """
    if metric not in METRICS:
        raise InputError(f"{where}.metric = {metric!r}: should be one of {', '.join(METRICS)}{nearest(metric, METRICS)}")
    with jax.enable_x64(True):
        return _Fit(views, start, free, fixed or {}, metric, loss, starts, seed, model_error, where, progress).run()


class _Fit:
    def __init__(self, views, start, free, fixed, metric, loss, starts, seed, model_error, where, progress):
        start = with_fixed(start, fixed, f"{where}.fixed")
        free, self.held = _without_gauge(start, free, views)
        start, self.free = parametrise(start, free, tuple(fixed), where)
        self.explicit = free is not None
        self.notes: list[str] = []
        self.start = start.astype(np.float32)
        for view in views:
            view.check(start)
        self.views, self.metric, self.loss, self.starts, self.seed, self.where = views, metric, loss, starts, seed, where
        self.model_error, self.progress = model_error, progress
        self.trace: list[Row] = []
        self.clock = dataclasses.replace(CLOCK)
        self.began = time.perf_counter()
        self.samples = [view.samples(_chosen(view, len(views), seed), DIRECTIONS, seed) for view in views]
        blocks, self.layout = arrange(self.samples, _scales(views, start), seed, start.needs)
        self.curves = [curve(metric, brightness(s.target)) for s in self.samples]
        self.blocks = [_compared_by(self.curves[of[0]], block) for of, block in zip(self.layout.reference, blocks, strict=True)]
        self.solver = NormalLevenbergMarquardt()
        self._set_bounds()

    def _set_bounds(self) -> None:
        self.bounds = self.free.bounds()

    def run(self) -> FitResult:
        origin = self.free.pack(self.start)
        begin(origin, self.start, self.blocks, free=self.free)
        for view, samples in zip(self.views, self.samples, strict=True):
            stack = scaled(self.start, view.scales(self.start))
            render.begin(stack, samples.wi.shape[1], narrowed(samples.place, stack.needs))
        if self.model_error:
            discrepancy.begin(self.start)
        self._weigh(None)
        self._drop_blind(origin)
        origin = self.free.pack(self.start)
        minima = self._search(origin)
        best = minima[0]
        u = best.vector
        for k in range(ROUNDS):
            self._weigh(u)
            u, cost, converged, gram = self._descend(u, self.blocks, FINE_STEPS, f"fine {k + 1}", best.start)
            self.progress("fine", (k + 1) / ROUNDS)
        held = (u <= self.bounds[0]) | (u >= self.bounds[1])
        jacobian, residual = rows(u, self.start, self.blocks, free=self.free)
        uncertainty = estimate(gram, held, jacobian, residual, self._sectors())
        models = self._models(u)
        off = self._discrepancy(u, models, jacobian, gram, held) if self.model_error else None
        clock = CLOCK.since(self.clock)
        return FitResult(
            stack=self._material(u),
            start=self.start,
            free=self.free,
            vector=u,
            start_vector=origin,
            gram=gram,
            uncertainty=uncertainty,
            discrepancy=off,
            held=self.held,
            converged=converged,
            cost=cost,
            steps=len(self.trace),
            minima=minima,
            notes=self.notes,
            trace=self.trace,
            models=models,
            misfit=misfit(models, self.samples, self._weights(models, "law")),
            samples=self.samples,
            views=self.views,
            clock=clock,
            solve_s=time.perf_counter() - self.began - clock.trace_s - clock.compile_s,
        )

    def _weigh(self, u: np.ndarray | None) -> None:
        """Set the residual weights from the model at `u`, or equal ones before there is a model."""
        first = "uniform" if self.curves[0] is None else self.metric
        even = [inverse_sigma(s.target, s.target, None, first) for s in self.samples]
        values = even if u is None else self._weights(self._models(u), self.metric)
        weight = channels_first(self.layout.scatter(values, 0.0))
        self.brightness = [
            float(np.sum((w * compared(block.target, block.curve)).astype(float) ** 2))
            for w, block in zip(weight, self.blocks, strict=True)
        ]
        self.blocks = [_weighted(block, w) for block, w in zip(self.blocks, weight, strict=True)]

    def _weights(self, models: Sequence[np.ndarray], metric: str) -> list[np.ndarray]:
        """Weights of the residuals of these models, a reference each."""
        values = []
        for model, samples in zip(models, self.samples, strict=True):
            weight = inverse_sigma(model, samples.target, samples.noise, metric)
            by = curve(metric, brightness(samples.target))
            difference = compared(model, by) - compared(samples.target, by)
            values.append(weight * robust(difference * weight, self.loss))
        return values

    def _models(self, u: np.ndarray) -> list[np.ndarray]:
        stack = self._material(u)
        return [
            render.predict(scaled(stack, view.scales(stack)), s.wi, s.wo, s.weight, narrowed(s.place, stack.needs))
            for view, s in zip(self.views, self.samples, strict=True)
        ]

    def _material(self, u: np.ndarray) -> Stack:
        stack = self.free.put(self.start, self.free.fields(u), np)
        return jax.tree.map(lambda a: np.asarray(a, np.float32), stack)

    def _step(self, u: Any, state: Any, blocks: Sequence[Block]) -> Any:
        return step(u, state, self.bounds, self.start, blocks, free=self.free, solver=self.solver)

    def _descend(
        self, u: Any, blocks: Sequence[Block], most: int, stage: str, start: int, trust: float = NEAR
    ) -> tuple[np.ndarray, float, bool, np.ndarray]:
        """Run the solver from `u` on some blocks; returns the point, its cost, whether it converged, and J^T J."""
        u = np.asarray(u, float)
        state = initial(u, self.solver, trust)
        scale = max(sum(self.brightness[: len(blocks)]), 1e-30)
        for k in range(most):
            u, state = self._step(u, state, blocks)
            error = float(np.sqrt(2.0 * float(state.loss) / scale))
            self.trace.append(Row(time.perf_counter() - self.began, stage, start, k, error))
            if bool(state.done):
                break
        return (
            np.asarray(u),
            float(state.loss),
            bool(state.done) and bool(np.isfinite(float(state.loss))),
            np.asarray(state.gram),
        )

    def _drop_blind(self, origin: np.ndarray) -> None:
        """Hold what has no effect on these images, with a reason; a parameter that the user asked for by name is an error."""
        at = np.asarray(origin)
        _, state = self._step(at, initial(at, self.solver), self.blocks)
        if not np.isfinite(float(state.loss)):
            raise InputError(f"{self.where}: the start gives no finite image; choose other values in [material]")
        effect = np.sqrt(np.diag(np.asarray(state.gram)))
        blind = [f for f in self.free.free if np.all(effect[list(f.slots)] <= 1e-7 * effect.max())]
        if not blind:
            return
        names = [f.name for f in blind]
        if self.explicit:
            raise InputError(
                f"{self.where}.free: {_have_no_effect(names)} at the start; leave {'it' if len(names) == 1 else 'them'} out, or start where "
                "there is one (a base below an opaque coat has none)"
            )
        self.notes.append(f"{_have_no_effect(names)} and {'was' if len(names) == 1 else 'were'} held at the start")
        left = [f.name for f in self.free.free if f.name not in names]
        self.start, self.free = parametrise(self.start, left, (), self.where)
        self._set_bounds()

    def _search(self, origin: np.ndarray) -> list[Minimum]:
        """Minima of the coarse fit, best first: from the given start and from space-filling ones."""
        found = []
        sample = self.blocks[: max(COARSE_BLOCKS, len(self.views))]
        points = [origin, *_space_filling(self.free, origin, self.starts - 1, self.seed)]
        for k, point in enumerate(points):
            u, cost, _, _ = self._descend(point, sample, COARSE_STEPS, "coarse", k, 1.0)
            found.append(Minimum(k, u, cost if np.isfinite(cost) else np.inf))
            self.progress("coarse", (k + 1) / len(points))
        found.sort(key=lambda m: m.cost)
        polished = []
        for minimum in found[:3]:
            u, cost, _, _ = self._descend(minimum.vector, sample, FINE_STEPS, "polish", minimum.start)
            polished.append(Minimum(minimum.start, u, cost))
        return sorted(polished, key=lambda m: m.cost) + found[3:]

    def _discrepancy(
        self, u: np.ndarray, models: Sequence[np.ndarray], jacobian: np.ndarray, gram: np.ndarray, held: np.ndarray
    ) -> discrepancy.Discrepancy | None:
        """What the form gets wrong; None, with a note, where no random walk can tell."""
        stack = self._material(u)
        if reason := discrepancy.unmeasured(stack):
            self.notes.append(f"what the form of the model gets wrong is in no sigma: {reason}")
            return None
        self.progress("walk", 0.0)
        place = self.layout.reference.ravel(), self.layout.pixel.ravel()
        slopes = self.layout.scatter([slope(m, by) for m, by in zip(models, self.curves, strict=True)], 0.0).reshape(-1, 3)
        weights = np.concatenate([np.asarray(block.inverse_sigma).T for block in self.blocks])
        return discrepancy.measure(stack, self.views, self.samples, place, jacobian, slopes * weights, gram, held, self.seed)

    def _sectors(self) -> np.ndarray:
        """Sector of the image that each pixel of the blocks is in, around the highlight: each has its share of every half angle."""
        return self.layout.scatter([_sectors(samples, GROUPS) for samples in self.samples], -1.0).ravel()


def _have_no_effect(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no effect on this image"


def _compared_by(by: Curve | None, block: Block) -> Block:
    """A block that is compared in other values than its own; they stand beside channels that come first."""
    return block if by is None else dataclasses.replace(block, curve=jax.device_put(jax.tree.map(lambda a: a[:, None], by)))


def _weighted(block: Block, inverse_sigma: np.ndarray) -> Block:
    return dataclasses.replace(block, inverse_sigma=jax.device_put(inverse_sigma))


def _without_gauge(
    start: Stack, free: Sequence[str] | None, views: Sequence[AnyView]
) -> tuple[Sequence[str] | None, list[Held]]:
    """Hold one of two fields that enter only together, such as the thickness of a coat whose absorption is fitted too.

    What a base does with light is another matter at another thickness: there the images tell.
    """
    held = []
    told = len({view.reference.thickness_scale.get(start.base.name, 1.0) for view in views}) > 1
    for layer in start.layers if told else (*start.layers, start.base):
        for kept, other, sign, why in getattr(layer, "gauges", ()):
            first, second = f"{layer.name}.{kept}", f"{layer.name}.{other}"
            if free is not None and first in free and second in free:
                free = [name for name in free if name != second]
                held.append(Held({first: 1.0, second: sign}, f"{why}; {second} was held at its start"))
    return free, held


def _chosen(view: AnyView, views: int, seed: int) -> np.ndarray:
    """Pixels of a reference that the fit uses: all, or as many as it can afford, at random."""
    most = max(128, (PIXELS if view.exact else EVALUATIONS // DIRECTIONS) // views)
    total = len(view.index)
    if total <= most:
        return np.arange(total)
    return np.sort(np.random.default_rng(seed).choice(total, most, replace=False))


def _sectors(samples: Samples, count: int) -> np.ndarray:
    """Sector of each pixel, of equal numbers of pixels, however the highlight lies."""
    rank = np.argsort(np.argsort(samples.turn))
    return (rank * count // len(rank)).astype(np.float32)


def _scales(views: Sequence[AnyView], start: Stack) -> np.ndarray | None:
    names = [layer.name for layer in start.layers] + ([start.base.name] if depths(start.base) else [])
    for view in views:
        for name in view.reference.thickness_scale:
            if name not in names:
                raise InputError(
                    f"{view.reference.path}: thickness_scale names {name!r}; layers with a thickness are {', '.join(names) or 'none'}"
                )
    scales = [view.scales(start) for view in views]
    if all(scale is None for scale in scales):
        return None
    return np.array([np.ones(len(start.layers) + 1) if scale is None else scale for scale in scales])


def _space_filling(free: Parametrisation, origin: np.ndarray, count: int, seed: int) -> list[np.ndarray]:
    """Starts spread evenly over the middle of the bounds (R sequence, Roberts 2018); channels of a colour move together."""
    d = len(free.free)
    g = 2.0
    for _ in range(64):
        g = (1.0 + g) ** (1.0 / (d + 1))
    lower, upper = free.bounds()
    points = []
    for k in range(count):
        x = (0.5 + (k + 1 + seed) * g ** -np.arange(1, d + 1)) % 1.0
        u = origin.copy()
        for place, f in zip(x, free.free, strict=True):
            for slot in f.slots:
                low, high = _plausible(f.spec.scale, lower[slot], upper[slot])
                u[slot] = low + place * (high - low)
        points.append(u)
    return points


def _plausible(scale: str, lower: float, upper: float) -> tuple[float, float]:
    """The middle of a range, where materials are: the rest is reached from there."""
    width = upper - lower
    return (lower + 0.4 * width, upper - 0.05 * width) if scale == "log" else (lower + 0.1 * width, lower + 0.6 * width)
