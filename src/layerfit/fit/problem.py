"""What a fit is of: references as weighted blocks of pixels, the free parameters, and the ways down from a point."""

import dataclasses
import time
from collections.abc import Iterator, Sequence

import jax
import numpy as np

from .. import render
from .._place import narrowed
from ..capture.load import AnyView
from ..capture.samples import Samples
from ..capture.scene import AMBIENT, WHOLE, Lit
from ..stack import Stack
from . import discrepancy
from .blocks import arrange, channels_first, held, weighted
from .difference import compared, curve, slope
from .parameters import Parametrisation
from .pixels import chosen, directions, scales, sectors
from .residuals import NEAR, Residuals, initial, scaled
from .result import Row
from .solve import LONGEST
from .starts import FINE_STEPS, Minimum
from .uncertainty import GROUPS
from .weights import Lost, brightness, inverse_sigma, lost, noise_law, robust

AT_ONCE = 2_000_000
"""Evaluations of a BRDF that are not interrupted: a second of them."""

SIDE_BY_SIDE = 4
"""Evaluations that are begun before the first is waited for."""


class Problem:
    """Residuals of a material against references, with weights that follow a model; vectors are in the coordinates of the fit."""

    def __init__(self, views: Sequence[AnyView], start: Stack, free: Parametrisation, metric: str, loss: str, seed: int):
        self.views, self.metric, self.loss = views, metric, loss
        self.trace: list[Row] = []
        self.began = time.perf_counter()
        sampled = [view.relit({AMBIENT: np.ones(3)}) for view in views] if AMBIENT in lights_of(free) else views
        self.samples = [view.samples(chosen(view, len(views), seed), directions(view), seed) for view in sampled]
        self.blocks, self.layout = arrange(self.samples, seed, start.needs, told_apart(free, self.samples))
        self.scale = scales(views, start)
        self.curves = [curve(metric, brightness(s.target)) for s in self.samples]
        if self.curves[0]:
            by = [self.curves[k] for k in self.layout.reference[:, 0]]
            each = jax.tree.map(lambda *of: held(np.stack(of)[:, :, None]), *by)  # beside the pixels of a channel
            self.blocks = dataclasses.replace(self.blocks, curve=each)
        self.release(start, free)

    @property
    def count(self) -> int:
        """Blocks of pixels."""
        return len(self.layout.pixel)

    @property
    def residuals(self) -> Residuals:
        return Residuals(self.start, self.free, self.scale, self.blocks, self.count)

    def release(self, start: Stack, free: Parametrisation) -> None:
        """Set what is fitted, from where."""
        self.start, self.free = start.astype(np.float32), free
        self.bounds = free.bounds()

    def begin(self, model_error: bool) -> None:
        """Have what steps, pictures and, if asked for, the random walk need compiled, while other work goes on."""
        self.residuals.begin()
        if model_error:
            discrepancy.begin(self.start)
        for view, samples in zip(self.views, self.samples, strict=True):
            stack = scaled(self.start, view.scales(self.start))
            render.begin(stack, samples.wi.shape[1], narrowed(samples.place, stack.needs))

    def weigh(self, u: np.ndarray | None) -> None:
        """Set the residual weights from the model at `u`, or equal ones before there is a model."""
        if u is None:
            values = self._even()
        else:
            models = self.models(u, self.samples)
            values = self.weights(models, self.metric)
            self._give_back(models)
        self.blocks = weighted(self.blocks, self.layout, values)
        # By NumPy: so small a thing is not worth a compiler's time.
        weight, target, by = jax.tree.map(
            lambda a: np.asarray(a)[: self.count], (self.blocks.inverse_sigma, self.blocks.target, self.blocks.curve)
        )
        self.brightness = np.sum(np.square(weight * compared(target, by), dtype=float), (1, 2))

    def _give_back(self, models: Sequence[np.ndarray]) -> None:
        """Set the targets to what the references are without fireflies, but for their light: that is everywhere."""
        self.lost = [self._lost(model, samples) for model, samples in zip(models, self.samples, strict=True)]
        targets = [
            samples.target if off is None else samples.target + off.mean
            for off, samples in zip(self.lost, self.samples, strict=True)
        ]
        self.blocks = dataclasses.replace(self.blocks, target=held(channels_first(self.layout.scatter(targets, 0.0))))

    def _lost(self, model: np.ndarray, samples: Samples) -> Lost | None:
        """Light that the loss takes from fireflies, where a file says that it has any."""
        if samples.noise is None or curve(self.metric, brightness(samples.target)):
            return None
        weight = inverse_sigma(model, samples.target, samples.noise, self.metric)
        residual = (model - samples.target) * weight
        return lost(residual, robust(residual, self.loss), weight, noise_law(np.maximum(model, 0.0), samples.noise))

    @property
    def inverse_sigma(self) -> np.ndarray:
        """Weights of the residuals, (blocks, pixels, channels)."""
        return np.moveaxis(np.asarray(self.blocks.inverse_sigma)[: self.count], 1, -1)

    def alike(self) -> list[np.ndarray]:
        """Errors of the weighted residuals that all pixels of a channel of a reference have together."""
        found = []
        for k, off in enumerate(self.lost):
            if off is not None:
                error = self.layout.scatter(
                    [off.error if j == k else np.zeros_like(s.target) for j, s in enumerate(self.samples)], 0.0
                )
                found += [(error * self.inverse_sigma * one).reshape(-1, 3) for one in np.eye(3) if np.any(error * one)]
        return found

    def _even(self) -> list[np.ndarray]:
        """Weights before there is a model. A measurement has no noise to speak of, and a highlight a thousand times as bright as all else:
        there the law holds from the first."""
        plain = ["law" if s.shape is None else "uniform" for s in self.samples]
        first = plain if self.curves[0] is None else [self.metric] * len(self.samples)
        return [inverse_sigma(s.target, s.target, None, metric) for s, metric in zip(self.samples, first, strict=True)]

    def weights(self, models: Sequence[np.ndarray], metric: str) -> list[np.ndarray]:
        """Weights of the residuals of these models, a reference each."""
        values = []
        for model, samples in zip(models, self.samples, strict=True):
            weight = inverse_sigma(model, samples.target, samples.noise, metric)
            by = curve(metric, brightness(samples.target))
            difference = compared(model, by) - compared(samples.target, by)
            values.append(weight * robust(difference * weight, self.loss))
        return values

    def models(self, u: np.ndarray, samples: Sequence[Samples]) -> list[np.ndarray]:
        relit = [s.relit(lit) for s, lit in zip(samples, self.lights(u), strict=True)]
        return [
            render.predict(stack, s.wi, s.wo, s.weight, narrowed(s.place, stack.needs))
            for stack, s in zip(self.materials(u), relit, strict=True)
        ]

    def material(self, u: np.ndarray) -> Stack:
        """The material that references share; of what they have for themselves, that of the first."""
        stack = self.free.put(self.start, self.free.fields(u), np)
        return jax.tree.map(lambda a: np.asarray(a, np.float32), stack)

    def materials(self, u: np.ndarray) -> list[Stack]:
        """The material as it is in each reference, as thick as it is there."""
        return [self._there(np.asarray(u), k, view) for k, view in enumerate(self.views)]

    def _there(self, u: np.ndarray, reference: int, view: AnyView) -> Stack:
        part = self.free.part
        fields = part.fields(self.free.taken(u, reference, np))
        stack = part.put(self.start, fields, np)
        thick = scaled(stack, part.thickness(fields, view.scales(stack), len(stack.layers) + 1, np))
        return jax.tree.map(lambda a: np.asarray(a, np.float32), thick)

    def lights(self, u: np.ndarray) -> list[Lit]:
        """How bright the lights of each reference are."""
        part = self.free.part
        return [part.light(part.fields(self.free.taken(np.asarray(u), k, np)), np) for k in range(len(self.views))]

    def descend(
        self,
        at: Sequence[Minimum],
        stage: str,
        most: int,
        count: int | None = None,
        trust: float = NEAR,
        gain: float | None = None,
    ) -> Iterator[tuple[Minimum, bool]]:
        """Run the solver from some points, side by side, on some blocks; gives where each comes to, and whether it converged."""
        begun = [_Descent(self, point, stage, most, count or self.count, trust, gain) for point in at]
        return (descent.ended() for descent in begun)

    def shine(self, count: int | None = None) -> float:
        return float(np.sum(self.brightness[:count]))

    def refit(self, u: np.ndarray, slots: int | Sequence[int]) -> Minimum:
        """Where all but some entries of the vector go from there."""
        kept = self.bounds
        still = np.isin(np.arange(len(u)), slots)
        self.bounds = np.where(still, u, kept[0]), np.where(still, u, kept[1])
        steps = len(self.trace)
        reached, _ = next(self.descend([Minimum((0,), u, np.inf, np.eye(len(u)))], "profile", FINE_STEPS))
        self.bounds = kept
        del self.trace[steps:]  # the fit had ended
        return reached

    def look(self, points: Sequence[np.ndarray], count: int, most: int) -> list[tuple[np.ndarray, float, np.ndarray | None]]:
        """Where some points lead in a few steps on the first `count` blocks, the cost there, and how much those change with each parameter;
        infinite, and None, where the images are not finite. One step leads nowhere: it evaluates the point."""
        found = []
        for first in range(0, len(points), SIDE_BY_SIDE):
            some = points[first : first + SIDE_BY_SIDE]
            for u, state, _ in [self.residuals.steps(u, initial(u), self.bounds, count, most) for u in some]:
                loss, effect = float(state.loss), np.sqrt(np.diag(np.asarray(state.gram)))
                found.append((np.asarray(u), loss, effect) if np.isfinite(loss) else (np.asarray(u), np.inf, None))
        return found

    def discrepancy(
        self, u: np.ndarray, models: Sequence[np.ndarray], jacobian: np.ndarray, gram: np.ndarray, seed: int
    ) -> discrepancy.Discrepancy:
        """What the form gets wrong at a point, and what that makes of the parameters."""
        place = self.layout.reference.ravel(), self.layout.pixel.ravel()
        slopes = self.layout.scatter([slope(m, by) for m, by in zip(models, self.curves, strict=True)], 0.0).reshape(-1, 3)
        weights = self.inverse_sigma.reshape(-1, 3)
        lit = self.lights(u)
        views = [view.relit(by) for view, by in zip(self.views, lit, strict=True)]
        samples = [s.relit(by) for s, by in zip(self.samples, lit, strict=True)]
        return discrepancy.measure(self.materials(u), views, samples, place, jacobian, slopes * weights, gram, seed)

    def sectors(self) -> np.ndarray:
        """Sector of the image that each pixel of the blocks is in, around the highlight: each has its share of every half angle."""
        return self.layout.scatter([sectors(samples, GROUPS) for samples in self.samples], -1.0).ravel()


def lights_of(free: Parametrisation) -> set[str]:
    """What is fitted of the lights: `WHOLE`, `AMBIENT`, or their names."""
    return {f.field for f in free.free if f.layer is None}


def told_apart(free: Parametrisation, samples: Sequence[Samples]) -> tuple[str, ...]:
    """Names of the lights whose samples have to be known: all of them, where one is fitted by its name."""
    return tuple(sorted({name for s in samples for name in s.lights})) if lights_of(free) - {WHOLE} else ()


class _Descent:
    """The solver on its way from a point: a few steps at a time, so that it can be told of and interrupted."""

    def __init__(self, problem: Problem, at: Minimum, stage: str, most: int, count: int, trust: float, gain: float | None):
        self.problem, self.at, self.stage, self.left, self.count = problem, at, stage, most, count
        self.residuals = problem.residuals
        self.u = np.asarray(at.vector, float)
        self.state = initial(self.u, trust, gain)
        self.taken = 0
        _, pixels, lights, _ = problem.blocks.wi.shape
        self.at_once = int(np.clip(AT_ONCE // (count * pixels * lights), 1, LONGEST))
        self._begin()

    def _begin(self) -> None:
        self.began = time.perf_counter()
        most = min(self.left, self.at_once)
        self.u, self.state, self.losses = self.residuals.steps(self.u, self.state, self.problem.bounds, self.count, most)

    def ended(self) -> tuple[Minimum, bool]:
        while not self._done():
            self._begin()
        finite = bool(np.isfinite(float(self.state.loss)))
        cost = float(self.state.loss) if finite else np.inf
        reached = dataclasses.replace(self.at, vector=np.asarray(self.u), cost=cost, gram=np.asarray(self.state.gram))
        return reached, bool(self.state.done) and finite

    def _done(self) -> bool:
        """Wait for the steps that were begun, and put them on record; their times are spread evenly over them."""
        losses = np.asarray(self.losses)
        losses = losses[~np.isnan(losses)]
        seconds = np.linspace(self.began, time.perf_counter(), len(losses) + 1)[1:] - self.problem.began
        errors = np.sqrt(2.0 * losses / max(self.problem.shine(self.count), 1e-30))
        for second, error in zip(seconds.tolist(), errors.tolist(), strict=True):
            self.problem.trace.append(Row(second, self.stage, self.at.starts[0], self.taken, error))
            self.taken += 1
        self.left -= len(losses)
        return bool(self.state.done) or self.left <= 0
